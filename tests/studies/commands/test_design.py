"""The command `rodcone design`: what it writes other commands take, and each wrong option is refused in one line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call, check_refusals

from rodcone import read_study
from rodcone.digests import digest_file
from rodcone.errors import InputError
from sensor.config import SensorConfig
from sensor.presets import low_noise, preset, preset_file
from studies.commands import design as design_module
from studies.design import expect as expect_module
from studies.design.expect import ExpectedError, expect
from studies.design.search import Goal
from studies.sweep import provenance

FEW = ["design", "low_noise", "--tile", "2x2", "--letters", "RGB", "--over", "classroom:classroom"]
FIGURES = [ExpectedError(25.0, 0.01, 30.0, 29.0, 31.0, 2.0, 3.0)]


@pytest.mark.thorough
def test_the_camera_found_is_a_preset_and_its_study_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = [*FEW, "-o", tmp_path / "found", "--behind", "9", "--behind-in-luminance", "9"]
    code, out, _ = call(asked)
    assert code == 0
    assert call(asked)[:2] == (0, out)  # from the tiles that were tried
    tile = tuple(out.splitlines()[0].split("/"))
    camera = preset(tmp_path / "found" / "sensor.toml")
    assert camera.cfa == tile
    assert camera.pixel == preset("low_noise").pixel
    tried = json.loads((tmp_path / "found" / "tried.json").read_text("utf-8"))
    held = tried["gains_db"]
    one, other = (expect(preset("low_noise", rows), [25.0])[0].psnr_db for rows in (tile, ("BG", "GR")))
    assert abs(held["/".join(tile)][0][0] - (one - other)) < 0.05  # a tile's place in the patch
    assert max(gains[0][0] for gains in held.values()) == held["/".join(tile)][0][0]
    assert read_study(tmp_path / "found" / "study.toml").processors[0] == "ple"
    page = (tmp_path / "found" / "design.html").read_text("utf-8")
    assert "/".join(tile) in page
    assert "rgbw_4x4" in page
    # What another version of the forecast tried doesn't count.
    (tmp_path / "found" / "tried.json").write_text(json.dumps(tried | {"gains_db": {"BB/BB": [[99.0]] * 3}}))
    mine = {Path(expect_module.__file__): "changed"}
    monkeypatch.setattr(provenance, "digest_file", lambda path: mine.get(path) or digest_file(path))
    assert call(asked)[:2] == (0, out)


@pytest.mark.thorough
def test_a_camera_with_curves_of_its_own_takes_them_along(tmp_path: Path) -> None:
    """Into another folder, with a mosaic over several lines and no W; a damaged file of tiles is refused."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "c.csv").write_text("wavelength_nm,R,G,B\n380,0,0,.3\n580,.1,.4,.1\n780,.4,0,0\n")
    table = '[responses]\ncsv = "c.csv"\nrange_nm = [380, 780]\nquantum_efficiency = "included"\n'
    text = preset_file("white_apart").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = [\n  "RG",\n  "GB"]')
    text = text.replace('channel = "W"', 'channel = "G"') + '\n[[channels]]\nchannel = "B"\nlight_share = 0.5\n'
    (tmp_path / "mine" / "s.toml").write_text(text.replace("\n[lens]", f"\n{table}\n[lens]"), "utf-8")
    few = ["design", tmp_path / "mine" / "s.toml", "--tile", "BR/RB", *FEW[4:], "-o", tmp_path / "found"]
    assert call(few)[0] == 0
    given, taken = (preset(path) for path in (tmp_path / "mine" / "s.toml", tmp_path / "found" / "sensor.toml"))
    assert taken.responses.curves["G"].values.tolist() == given.responses.curves["G"].values.tolist() == [0, 0.4, 0]
    assert (taken.lens, taken.pixel) == (given.lens, given.pixel)
    assert [x.channel for x in taken.chip.channels] == ["B"]  # G is read apart where there is one
    assert call(["sweep", tmp_path / "found" / "study.toml", "--as-stated", "--dry-run"])[0] == 0
    check_refusals(
        f"design {tmp_path / 'mine' / 's.toml'} --letters RGB", [(f"--filters -o {tmp_path}/no", "no W")], tmp_path
    )
    assert not (tmp_path / "no").exists()
    (tmp_path / "found" / "tried.json").write_text("[1, 2]")
    code, _, err = call(few)
    assert code == 2
    assert "isn't what rodcone design wrote" in err


def test_what_was_tried_with_other_curves_of_the_same_letters_does_not_count(tmp_path, monkeypatch):
    monkeypatch.setattr(design_module, "expected", lambda *_: FIGURES)  # of the cameras beside the tiles
    monkeypatch.setattr(design_module, "design_page", lambda *_, **__: "")
    table = '[responses]\ncsv = "c.csv"\nrange_nm = [380, 780]\nquantum_efficiency = "included"\n'
    text = preset_file("low_noise").read_text("utf-8").replace('cfa = "rgbw"', 'cfa = ["RG", "GB"]')
    (tmp_path / "s.toml").write_text(text.replace("\n[lens]", f"\n{table}\n[lens]"), "utf-8")
    gains = []
    for most in (0.4, 0.2):
        (tmp_path / "c.csv").write_text(f"wavelength_nm,R,G,B\n380,0,0,.3\n580,.1,{most},.1\n780,.4,0,0\n")
        few = ["--tile", "2x2", "--letters", "G", "--over", "classroom:classroom", "-o", tmp_path / "found"]
        assert call(["design", tmp_path / "s.toml", *few])[0] == 0
        gains.append(json.loads((tmp_path / "found" / "tried.json").read_text("utf-8"))["gains_db"]["GG/GG"])
    assert gains[0] != gains[1]


@pytest.mark.slow
def test_filters_are_written_as_curves_that_read_back(tmp_path: Path) -> None:
    assert call([*FEW, "--filters", "-o", tmp_path / "found", "--behind", "9", "--behind-in-luminance", "9"])[0] == 0
    camera = preset(tmp_path / "found" / "sensor.toml")
    given = preset("low_noise").responses.curves
    changes = [
        np.abs(curve.values - np.interp(curve.wavelength_nm, given[name].wavelength_nm, given[name].values)).max()
        for name, curve in camera.responses.curves.items()
    ]
    assert max(changes) > 0.02


def test_a_wrong_option_is_refused_and_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = (
        ("--tile 3x3 -o found", "tile: '3x3' is unknown"),
        ("--tile RG/B -o found", "cfa: rows of ('RG', 'B') differ in length"),
        ("--tile RGB/GBR/BRG -o found", "cfa: ('RGB', 'GBR', 'BRG') isn't 1, 2 or 4 pixels high and wide"),
        ("--exposure 20 -o found", "exposure: '20'"),
        ("--rounds 0 -o found", "rounds: 0"),
        ("--letters RGQ -o found", "letters: 'Q' is unknown"),
        ("--letters '' -o found", "letters: '' names no channel"),
        ("--steps -1 -o found", "steps: -1"),
        ("--seed -1 -o found", "seed: -1"),
        ("--over noon:midnight -o found", "over: 'noon:midnight' is not a range of levels"),
        ("--weights 1 --weights 2 -o found", "for 7 levels"),
        ("--tile RG/BW --over street:street --weights nan -o found", "weights: [nan] for 1 levels"),
        ("--behind -101 -o found", "behind: -101"),
        ("--never-worse-than bayr -o found", "did you mean 'bayer'"),
        ("--never-worse-than cmyw -o found", "never_worse_than: 'C' is unknown; allowed: B, G, R, W"),
        ("--light D66 -o found", "did you mean 'D65'"),
        ("--prior draw -o found", "did you mean 'drawn'"),
    )
    check_refusals("design low_noise", rows, tmp_path)
    assert not (tmp_path / "found").exists()


def test_a_given_tile_is_expected_once_and_a_mosaic_that_cannot_be_judged_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged: list[tuple[str, ...]] = []

    def expected(_: Goal, camera: SensorConfig) -> list[ExpectedError]:
        judged.append(camera.cfa)
        if len(judged) > most:
            raise InputError("sensor: it can't be judged; allowed: another; take one")
        return FIGURES

    monkeypatch.setattr(design_module, "expected", expected)
    asked = ["design", "low_noise", "--tile", "BR/RB", *FEW[6:], "-o", tmp_path / "found"]
    most = 99
    assert call(asked)[0] == 0
    assert judged.count(("BR", "RB")) == 1
    assert len(judged) > len(set(judged)) > 8  # complementary filters share a tile
    most = len(judged) + 2
    code, _, err = call(asked)
    assert (code, "can't be judged" in err) == (2, True)


# The command `rodcone expect`: table, CSV, plot, JSON, and each wrong option in one line.


CELLS = ["low_noise", "--mosaic", "bayer", "--mosaic", "RG/BW", "--level", "moonlight", "--level", "25cd/m2"]


def test_the_table_has_the_first_camera_and_gains_over_it() -> None:
    """436 lux on surfaces that give back 18 % are 436 x 0.18 / pi = 25.0 cd/m2."""
    code, out, _ = call(["expect", *CELLS, "--level", "436lux"])
    assert code == 0
    rows = [expect(low_noise(tile), [0.036, 25.0, 436 * 0.18 / np.pi]) for tile in ("bayer", "rgbw")]
    bayer, rgbw = ([row.psnr_db for row in of] for of in rows)
    head, first, second, *colours = out.splitlines()
    assert head.split()[-3:] == ["moonlight", "25cd/m2", "436lux"]
    assert first.split() == ["low_noise", "bayer", *(f"{db:.2f}" for db in bayer)]
    assert second.split() == ["low_noise", "RG/BW", *(f"{a - b:+.2f}" for a, b in zip(rgbw, bayer, strict=True))]
    assert colours[0].startswith("error of a*, b*")
    assert [line.split()[2:] for line in colours[1:]] == [[f"{row.colour:.2f}" for row in of] for of in rows]


@pytest.mark.thorough
def test_csv_json_and_plot_hold_the_same(tmp_path: Path) -> None:
    for ending in (".csv", ".svg"):
        _, out, _ = call(["expect", *CELLS, "--json", "-o", tmp_path / f"gain{ending}"])
    printed = json.loads(out.splitlines()[-1])
    rows = list(csv.DictReader((tmp_path / "gain.csv").read_text("utf-8").splitlines()))
    assert [row["camera"] for row in rows] == ["low_noise bayer"] * 2 + ["low_noise RG/BW"] * 2
    assert [float(row["psnr_db"]) for row in rows] == [x["psnr_db"] for one in printed.values() for x in one]
    assert "low_noise RG/BW" in (tmp_path / "gain.svg").read_text("utf-8")


def test_a_wrong_option_is_refused(tmp_path: Path) -> None:
    rows = (
        ("--mosaic bayr", "did you mean 'bayer'"),
        ("--mosaic RG/B", "differ in length"),
        ("--mosaic RGRGRG/GBGBGB", "isn't 1, 2 or 4 pixels high and wide"),
        ("--over street:moon", "over: 'street:moon' is not a range of levels"),
        ("--over 'sunlit day:moonlight'", "the darker first"),
        ("--level 25", "has no unit"),
        ("--light D66", "did you mean 'D65'"),
        ("--prior draw", "did you mean 'drawn'"),
        ("--exposure autoo", "did you mean 'auto'"),
        ("-o gain.pdf", "has another ending; allowed: .csv, .svg"),
        ("-o gain.svg", "plots gains over the first camera, and there is one"),
    )
    check_refusals("expect low_noise", rows, tmp_path)
