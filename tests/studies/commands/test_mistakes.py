"""51 mistakes as people type them: one line each, exit status 2, and the line names the remedy."""

import json
import re
import shlex
import shutil
import socket
import urllib.request
import warnings
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from command_line import call, check_refusals

from rodcone.colour_spaces import encode_srgb
from sensor.presets import preset_file
from studies.commands import explore as explore_command
from studies.dataset.shards import read_shard

PIXEL = "[pixel]\npitch_um=2\nfill_factor=1\nfull_well_e=5000\nread_noise_e=2\ndsnu_e=0\nprnu=0.01\n"
LENS = "[lens]\nf_number=2\n"
FILES = {
    "thz.csv": "frequency_thz,R\n400,1\n500,2\n",
    "two.csv": "nm,R\n400,1\n500,2\nlamp 2\n400,1\n500,2\n",
    "broken.csv": "nm,R\n400,1\n500,x\n600,1\n",
    "dbm.csv": "nm,dBm\n400,1\n500,1\n",
    "bgr.csv": "nm,blue,green,red\n400,.1,.2,.3\n700,.1,.2,.3\n",
    "bgr.toml": 'cfa="bayer"\n'
    + PIXEL
    + LENS
    + '[responses]\ncsv="bgr.csv"\nrange_nm=[400,700]\nquantum_efficiency="included"\n',
    "b.toml": 'holds="reflectance"\nwavelength_nm=[400,700]\n',
    "c.toml": 'holds="reflectance"\nwavelength_nm=[400,700]\n',
    "e.hdr": "ENVI\nsamples=2\nlines=2\nbands=2\ndata type=4\ninterleave=bsq\n"
    "wavelength units=Wavenumber\nwavelength={4,5}\n",
    "e.img": 32 * " ",
    "e.toml": 'holds="radiance"\n',
    "r.toml": 'camera="x"\n',
}
MISTAKES = {
    "capture": (
        ("flat_field --light thz.csv", "has header ['frequency_thz', 'R'] ... allowed: wavelength_nm"),
        ("flat_field --light two.csv", "begin in lines 2 and 5; allowed: one ... put # before"),
        ("flat_field --light broken.csv", "line 3 ('500,x') ... mend it"),
        ("flat_field --light dbm.csv", "is in dBm; allowed: power per wavelength ... convert it"),
        ("flat_field --light none.spd", "No such file ... give a table"),
        ("color_checker --chart broken.csv", "chart: 'broken.csv': line 3 ... mend it"),
        ("flat_field --sensor bgr.toml", "has the columns blue, green, red ... R, G, B; rename them"),
        ("a.npy", 'nothing says what it holds ... write there holds = "reflectance"'),
        ("b.npy", "100% of its reflectances exceed 1 ... such as 0.01 for per cent"),
        ("c.npy", "side: 6 is outside 16 to 4096 ... crop or scale it"),
        ("m.mat", "-v7.3 ... pip install mat73 scipy; python -c"),
        ("e.hdr", "wavelength units: 'wavenumber' is not allowed; give Nanometers or Micrometers"),
        ("flat_field --level 5 foo", "'foo' has another ending; allowed: .dng, .tif, .tiff"),
        ("flat_field --level 5kd", "level: unit: 'kd' is unknown; allowed: cd/m2, lux"),
        ("flat_field --levl 5lux", "Did you mean --level?"),
        ("flat_field --exposure 20", "exposure: '20' is not a time ... write 20ms or 20s"),
        ("flat_field --size 96.5", "--size ... is not a whole number"),
        ("flat_field --frames 0", "frames: 0"),
        ("", "--source requires an argument"),
    ),
    "capturee": (("flat_field", 'Did you mean "capture"?'),),
    "render": (
        ("flat_field -o a.png", "allowed: .exr"),
        ("flat_field -o a.exr --bands 400-700", "give FIRST_EDGE:LAST_EDGE:WIDTH ... such as 380:780:10"),
        ("flat_field -o a.exr --height 0", "height: 0 ... give pixels"),
        ("flat_field -o a.exr --noise -1", "noise: -1.0 ... such as 0.02"),
        ("flat_field -o a.exr --spp x", 'unable to convert "x" into int'),
    ),
    "develop": (
        ("none.dng", "there is no such file; give the path of a raw file"),
        ("none.dng --bits 12", "bits: 12 is not allowed; give 8 or 16"),
        ("none.dng -o a.jpg", "allowed: .png, .tif, .tiff"),
    ),
    "snr": (
        ("low_nois", "did you mean 'low_noise'?"),
        ("low_noise --at 0", "give signal over noise, such as 10"),
        ("low_noise --light D66", "illuminant: 'D66' is unknown ... temperature such as 3000K"),
        ("low_noise --exposure 0s", "give a time such as 33ms"),
    ),
    "sweep": (
        ("none.toml", "start from one of: rodcone new study -o FILE"),
        ("r.toml", "key: 'camera' is unknown; allowed: budget"),
    ),
    "report": (("none", "run rodcone sweep first"),),
    "export": (("none -o a.csv", "run rodcone sweep first"),),
    "demo": (
        ("--level 5", "'5' has no unit ... write 5lux"),
        ("--processor bayr", "did you mean 'bayer'?"),
        ("--scene still_lif", "did you mean 'still_life'?"),
    ),
    "list": (("scene", 'Did you mean "scenes"?'),),
    "new": (("preset r --noise r.toml", "--out requires an argument"), ("preset low_noise -o a.txt", "allowed: .toml")),
    "characterise": (
        ("", "allowed: PRESET, or raw files by --from and --dark"),
        ("low_nois", "did you mean 'low_noise'?"),
    ),
    "expect": (("low_noise --over street", "write moonlight:sunlit day"),),
    "explore": (("flat_fild", "did you mean 'flat_field'?"),),
    "plan": (("none.toml", "start from one of: rodcone new study -o FILE"),),
    "dataset": (("none.toml", "start from one of: rodcone new study -o FILE"),),
    "judge": (("none", "--of requires an argument"),),
    "paper": (("-o", "--out requires an argument"),),
    "reference": (("flat_fild", "did you mean 'flat_field'?"),),
}


@pytest.mark.thorough
def test_51_mistakes_are_refused_in_one_line_that_names_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, "utf-8")
    for name, cube in (
        ("a", np.full((4, 4, 3), 0.5)),
        ("b", np.full((20, 20, 3), 50.0)),
        ("c", np.full((6, 20, 3), 0.5)),
    ):
        np.save(tmp_path / f"{name}.npy", cube)
    (tmp_path / "m.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + bytes(384) + b"\x89HDF\r\n\x1a\n")
    assert sum(map(len, MISTAKES.values())) == 51
    for command, rows in MISTAKES.items():
        check_refusals(command, rows, tmp_path)


# What the line of a mistake says to do, typed: by command, the command that was meant, files mended as its line says.
MENDED = {
    "thz.csv": "wavelength_nm,R\n380,1\n780,2\n",
    "two.csv": "nm,R\n380,1\n780,2\n# lamp 2\n#400,1\n#500,2\n",
    "broken.csv": "nm,R\n380,1\n500,2\n780,1\n",
    "w.csv": "nm,watt\n380,1\n780,1\n",
    "chart.csv": "wavelength_nm," + ",".join(str(n) for n in range(1, 25)) + "\n"
    + "\n".join(f"{nm}," + ",".join(f"{0.03 * n:.2f}" for n in range(1, 25)) for nm in (380, 580, 780)) + "\n",
    "bgr.csv": "nm,B,G,R\n400,.5,.1,.1\n550,.1,.5,.1\n700,.1,.1,.5\n",
    "bgr.toml": FILES["bgr.toml"],
    "a.toml": 'holds="reflectance"\nwavelength_nm=[400,550,700]\n',
    "b.toml": 'holds="reflectance"\nwavelength_nm=[400,550,700]\nscale=0.01\n',
    "e.hdr": "ENVI\nsamples=20\nlines=20\nbands=2\ndata type=4\ninterleave=bsq\n"
    "wavelength units=Nanometers\nwavelength={450,650}\n",
    "e.toml": 'holds="reflectance"\n',
    "r.toml": 'scenes=["flat_field"]\nlevels=["5lux"]\nprocessors=["bayer"]\n[render]\nsize=16\nspp=1\n'
    '[budget]\nmodel="default"\n',
}  # fmt: skip
QUICK = " --size 16 --spp 1"
REMEDIES = {
    "capture": (
        f"flat_field --light thz.csv{QUICK}", f"flat_field --light two.csv{QUICK}",
        f"flat_field --light broken.csv{QUICK}", f"flat_field --light w.csv{QUICK}", f"flat_field --light A{QUICK}",
        "color_checker --chart chart.csv --size 32 --spp 1", f"flat_field --sensor bgr.toml{QUICK}", "a.npy", "b.npy",
        "c.npy", "e.hdr", f"flat_field --level 5lux foo.dng{QUICK}", f"flat_field --level 5cd/m2{QUICK}",
        f"flat_field --exposure 20ms{QUICK}", f"flat_field --exposure 20s{QUICK}", "flat_field --size 96 --spp 1",
        f"flat_field --frames 1{QUICK}", f"--source flat_field{QUICK}",
    ),
    "render": (
        "flat_field -o a.exr --height 8 --spp 1", "flat_field -o a.exr --bands 380:780:100 --height 8 --spp 1",
        "flat_field -o a.exr --height 8 --noise 0.5", "flat_field -o a.exr --height 8 --spp 2",
    ),
    "develop": ("foo.dng", "foo.dng --bits 16 -o a.tif", "foo.dng --bits 8 -o b.png"),
    "snr": ("low_noise", "low_noise --at 10", "low_noise --light 3000K", "low_noise --exposure 33ms"),
    "new": ("study -o mine.toml", "preset low_noise -o mine_sensor.toml"),
    "sweep": ("r.toml --out out",),
    "report": ("out",),
    "export": ("out -o a.csv",),
    "demo": (
        "--level 5lux --dry-run", "--processor bayer --dry-run", "--scene still_life --dry-run",
    ),
    "list": ("scenes",),
    "characterise": ("low_noise --height 16 --width 16",),
    "expect": ("low_noise --over 'moonlight:sunlit day' --dry-run",),
    "plan": ("r.toml",),
    "dataset": ("r.toml --out set --shards 1",),
    "reference": ("flat_field -o refs --size 16 --max-seconds 1",),
}  # fmt: skip


@pytest.mark.thorough
def test_the_remedy_of_each_mistake_is_typed_and_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in MENDED.items():
        (tmp_path / name).write_text(text, "utf-8")
    for name, cube in (
        ("a", np.full((20, 20, 3), 0.5)),
        ("b", np.full((20, 20, 3), 50.0)),
        ("c", np.full((20, 20, 3), 0.5)),
    ):
        np.save(tmp_path / f"{name}.npy", cube)
    (tmp_path / "c.toml").write_text(MENDED["a.toml"], "utf-8")
    np.full((2, 20, 20), 0.5, np.float32).tofile(tmp_path / "e.img")
    failed = []
    for command, rows in REMEDIES.items():
        for row in rows:
            with warnings.catch_warnings():
                warnings.simplefilter("default")  # a coarse table is told of, and taken
                code, _, err = call([*command.split(), *shlex.split(row)])
            if code != 0:
                failed.append(f"{command} {row}: {err.splitlines()[-1:]}")
    assert not failed


def _works(*words: object) -> str:
    """What a command prints that ends well."""
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # wide bands are told of, and taken
        code, out, err = call(words)
    assert code == 0, f"{words}: {err}"
    return out


def _refused(*words: object) -> str:
    """Line of a command that is refused."""
    code, out, err = call(words)
    assert (code, out, err.count("\n")) == (2, "", 1), f"{words}: {err}"
    return err


@pytest.mark.thorough
def test_what_judge_says_to_do_is_done_and_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # rows of light, so that an upside-down picture is another one
    np.save("a.npy", np.linspace(0.1, 0.9, 20)[:, None, None] * np.linspace(0.5, 1, 20)[:, None] * [0.3, 0.6, 0.9])
    Path("a.toml").write_text(MENDED["a.toml"], "utf-8")
    study = MENDED["r.toml"].replace("flat_field", "a.npy").replace("5lux", "5cd/m2")
    Path("r.toml").write_text('sensors=["own.toml"]\n' + study, "utf-8")
    (mine := tmp_path / "mine").mkdir()
    shutil.copy(preset_file("low_noise"), "own.toml")  # for whose like no closed form is computed: a second each
    judged = ("judge", "mine", "--of", "whole", "--workers", 1)
    _works("dataset", "r.toml", "--out", "set", "--shards", 1, "--truth", "depth")
    (remedy,) = re.findall("make one with (--truth rgb)", _refused(*judged[:3], "set"))
    _works("dataset", "r.toml", "--out", "whole", "--shards", 1, *remedy.split())
    (path,) = Path("whole/set").glob("*.tar")
    ((truth, facts),) = ((arrays["rgb"].astype(float), facts) for arrays, facts in read_shard(path))
    # named as the line says, encoded as it says, turned as it says
    (key,) = re.findall(r"named such as '([^']+)'", _refused(*judged))
    assert key == facts["key"]
    linear = np.clip(truth, 0, 1)
    for name, picture, words in (
        ("holiday", encode_srgb(linear), f"such as '{key}'; rename it"),
        (key, linear, "linear values; encode them as sRGB"),
        (key, encode_srgb(encode_srgb(linear)), "encoded twice; encode them once"),
        (key, encode_srgb(linear)[::-1], "upside down"),
        (key, encode_srgb(linear)[..., ::-1], "write R, G, B"),
        (key, 255 * encode_srgb(linear), "allowed: 0 to 1, 1 is white"),
    ):
        np.save(mine / f"{name}.npy", picture)
        assert words in _refused(*judged)
        (mine / f"{name}.npy").unlink()
    np.save(mine / f"{key}.npy", encode_srgb(linear))
    assert "allowed: .html, .csv" in _refused(*judged, "--out", "a.txt")
    _works(*judged, "--out", "a.csv")
    told = json.loads(_works(*judged, "--out", "a.html", "--json"))
    assert [score["developer"] for score in told["scores"]] == ["mine"]


@pytest.mark.thorough
def test_what_paper_says_to_do_is_done_and_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "allowed: 1a, 1b, 2, 3" in _refused("paper", "--figure", "7")
    for words, option, allowed in (
        ("16 to 1024; give the side", "--size", 16),
        ("1 to 65536; give samples per pixel", "--spp", 1),
        ("2 to 1000; give 2 exposures or more", "--seeds", 2),
    ):
        assert words in _refused("paper", "--figure", "2", option, allowed - 1), option
    # figure 2 is computed from spectra alone
    least = ("--size", 16, "--spp", 1, "--seeds", 2)
    assert _works("paper", "--figure", "2", *least, "--out", "paper").strip().endswith("paper.html")


@pytest.mark.thorough
def test_what_explore_says_to_do_is_done_and_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page answers at the address that is printed; the server then ends, as by Ctrl-C."""
    monkeypatch.chdir(tmp_path)
    answers: list[int] = []
    make = explore_command.make_server

    def make_and_ask(session: Any, listener: Any) -> tuple[Any, str]:
        server, address = make(session, listener)

        def ask() -> None:
            with urllib.request.urlopen(address, timeout=300) as page:
                answers.append(page.status)
            server.should_exit = True

        Thread(target=ask).start()
        return server, address

    monkeypatch.setattr(explore_command, "make_server", make_and_ask)
    (name,) = re.findall("did you mean '([a-z_]+)'", _refused("explore", "flat_fild", "--no-browser"))
    small = ("--size", 16, "--spp", 1, "--no-browser")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        line = _refused("explore", name, *small, "--port", taken.getsockname()[1])
        assert "leave it out for a free one" in line
        assert _works("explore", name, *small).startswith("http://127.0.0.1:")
    assert answers == [200]
