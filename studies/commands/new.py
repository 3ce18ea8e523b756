"""`rodcone new`: files to start from."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from cyclopts import App

from rodcone.curve_file import is_curve_file
from rodcone.errors import InputError, require_absent, require_keys, require_range
from rodcone.files import check_place, require_ending, write_files
from rodcone.toml_file import read_toml
from sensor.cameras.emva_report import numbers_at_gains, numbers_of, read_report
from sensor.cameras.library import measured_camera
from sensor.cameras.noise_files import dng_numbers
from sensor.cameras.numbers import (
    PixelNumbers,
    borrowed_curves,
    completed,
    curves_csv,
    measured_curves,
    missing,
    preset_text,
)
from sensor.presets import preset as read_preset
from sensor.presets import preset_file
from studies.commands.console import require_new, say

app = App(help_format="markdown", name="new", help="Write files to start from.")
_STUDIES = Path(__file__).parent.parent / "configs"
_EYE = _STUDIES / "sensors" / "eye.toml"  # its receptors make no colour matrix, so it is no preset of `sensor.presets`
_CLUSTER = Path(__file__).parent.parent / "data" / "dask.yaml"


@app.command
def preset(
    name: str | None = None,
    /,
    *,
    out: Path,
    camera: str | None = None,
    noise: Path | None = None,
    more_gain: Path | None = None,
    anchor: str | None = None,
) -> None:
    """Write a sensor as a TOML file to change: pixel, lens, mosaic, responses, every number with its source.

    Without --camera and --noise the file is a copy of a preset. With them it is a camera that exists: numbers that no
    source states come from the preset, where one is named; the others are left out. A comment in the file says which.

    Parameters
    ----------
    name
        Preset by name: low_noise, table1_pixel, table1_output, or table1_output_6um, _3um and _2um for the paper's
        Figures 1 and 5; or eye, a retina's rods and L, M, S cones, whose curves come with it as receptors.csv.
    out
        File to write, ending in .toml; one that exists is left alone. Its path can replace any preset name. Responses
        go into NAME_curves.csv beside it.
    camera
        Measured response of a camera by name, such as "Nikon D850": see rodcone list sensors.
    noise
        Source of its noise: an EMVA 1288 report as .toml, or a .dng with a NoiseProfile. For raw frames of your own
        use rodcone characterise --from.
    more_gain
        EMVA 1288 report of the same camera at a higher gain, beside --noise at the lowest: the file then states the
        noise before and after the amplifier, and how far an automatic exposure may raise the gain.
    anchor
        Published quantum efficiency at a wavelength, such as 0.5@530, which turns a relative response, or the curves of
        the preset that is named, into electrons.
    """
    if camera is None and noise is None:
        if name is None:
            raise InputError("name: none is given; allowed: a preset's name, --camera or --noise; give one")
        require_absent(f"for {name!r}; allowed: with --camera or --noise", anchor=anchor, more_gain=more_gain)
        if name == _EYE.stem:
            _copy(_EYE, out, ".toml", _beside({out.parent / "receptors.csv": _EYE.with_name("receptors.csv")}))
        else:
            _copy(preset_file(name), out, ".toml")
        return
    require_new(out, ".toml")
    curves_file = out.parent / f"{out.stem}_curves.csv"
    require_new(curves_file, ".csv")
    lender = None if name is None else read_preset(name)
    # what the sources tell
    measured = None if camera is None else measured_camera(camera)
    numbers = _numbers(noise, more_gain)
    if anchor is not None:
        numbers = replace(numbers, efficiency=_anchor(anchor), source=f"{numbers.source}; anchor {anchor} as given")
    # what a preset lends
    shape = None if measured is None else measured_curves(measured)
    if lender is not None:
        numbers = completed(numbers, lender, str(name))
        if shape is None and numbers.efficiency is not None:
            shape = borrowed_curves(lender, str(name), numbers)
    if shape is None and anchor and noise and noise.suffix.lower() != ".toml":  # a report is of a chip without filters
        raise InputError(
            f"anchor: {anchor} scales a response, and {noise.name!r} has none; allowed with "
            "--camera, or with a preset that lends its curves; add low_noise, or leave --anchor out"
        )
    # the files
    curves = curves_csv(numbers, shape)
    title = f"{measured.maker} {measured.model}" if measured else numbers.source.split(":")[0]
    text = preset_text(f"{title}, as its sources tell it.", numbers, shape, curves_file.name if curves else "")
    check_place(out)
    files = {curves_file: curves, out: text} if curves else {out: text}
    write_files(files)
    if "K" in numbers.left_out:
        say(f"{out}: K = {numbers.left_out['K']}")
    if missing(numbers):
        say(f"{out}: no source gives {', '.join(missing(numbers))}; add them, or name a preset, which lends them")
    print(out)


@app.command
def study(name: str = "light_levels", /, *, out: Path | None = None) -> None:
    """Copy an example of a study to a TOML file to change, for `rodcone sweep`; sensors that it names come with it.

    Parameters
    ----------
    name
        light_levels (moonlight to daylight), spectra (one scene under several lights at equal lux), metamers (pairs
        that look alike under D65), infrared_cut (a filter in or out), responses (broad filters or narrow ones),
        exposures (exposure times and fixed patterns on Table 1's pixel), isos (speeds of a phone's pixel), flicker
        (exposure times under lamps of 100 Hz), motion (exposure times of a walker by night), glare (a street's lamps
        through a lens that scatters), opponents (every processor), white_pixel (one method with and without W),
        white_pixel_lights (the same under four lights), real_cameras (five cameras that exist beside the paper's
        pixel), eye (rods and cones, interleaved and in blocks), benchmark (the frozen list of rodcone judge), demo
        (what rodcone demo makes), or paper_1b and paper_6 (of the paper's figures).
    out
        File to write, ending in .toml; one that exists is left alone. Sensors and their curves go into the folder
        sensors beside it, where files of the same content are kept.
    """
    if out is None:
        file = name if name.endswith(".toml") else "mine.toml"
        example = "" if name.endswith(".toml") else f" {name}"
        raise InputError(f"out: none is given; allowed: a new .toml file; write rodcone new study{example} -o {file}")
    examples = {path.stem: path for path in sorted(_STUDIES.glob("*.toml"))}
    require_keys("study", [name], examples)
    beside = {out.parent / file_name: _STUDIES / file_name for file_name in _named(examples[name])}
    _copy(examples[name], out, ".toml", _beside(beside))


@app.command
def cluster(*, out: Path) -> None:
    """Copy settings of dask.distributed that suit sweeps, with the commands that start a cluster.

    Parameters
    ----------
    out
        File to write, ending in .yaml; one that exists is left alone.
    """
    _copy(_CLUSTER, out, ".yaml")


def _named(study_file: Path) -> list[str]:
    """Files that an example names, and those that its sensors name, relative to its folder."""
    files = []
    for name in read_toml(study_file).get("sensors", ()):
        if name.endswith(".toml"):
            responses = read_toml(study_file.parent / name).get("responses", {}).values()
            curves = [value for value in responses if isinstance(value, str) and is_curve_file(value)]
            files += [name, *(str(Path(name).parent / curve) for curve in curves)]
    return list(dict.fromkeys(files))


def _beside(files: Mapping[Path, Path]) -> Mapping[Path, Path]:
    """Files to copy by their new paths, or `InputError` where another file has one of these."""
    for target, source in files.items():
        if target.exists() and target.read_bytes() != source.read_bytes():
            raise InputError(
                f"out: {str(target)!r} exists and differs from the example's; allowed: no such file, or the same; "
                "choose another folder"
            )
    return files


def _numbers(noise: Path | None, more_gain: Path | None) -> PixelNumbers:
    if more_gain is not None:
        if noise is None or noise.suffix.lower() != ".toml":
            raise InputError(
                f"more_gain: {more_gain.name!r} without a report of the lowest gain; allowed: with --noise; give both "
                "as .toml"
            )
        return numbers_at_gains(read_report(noise), read_report(more_gain))
    if noise is None:
        return PixelNumbers("no source of noise is given")
    require_ending(noise, ".toml", ".dng", what="noise")
    return numbers_of(read_report(noise)) if noise.suffix.lower() == ".toml" else dng_numbers(noise)


def _anchor(text: str) -> tuple[float, float]:
    """Quantum efficiency and its wavelength [nm] from a text such as 0.5@530."""
    parts = text.split("@")
    try:
        value, at_nm = (float(part) for part in parts)
    except ValueError:
        raise InputError(f"anchor: {text!r} is not allowed; give electrons a photon @ nm, such as 0.5@530") from None
    require_range("anchor", value, 1e-6, 1.0, "give electrons per photon, such as 0.5@530")
    require_range("anchor", at_nm, 300.0, 1100.0, "give the wavelength in nm, such as 0.5@530")
    return value, at_nm


def _copy(source: Path, out: Path, ending: str, beside: Mapping[Path, Path] = MappingProxyType({})) -> None:
    """Copy a file to a new one, after the files that belong beside it, and print its path."""
    require_new(out, ending)
    for target, other in {**beside, out: source}.items():
        if target != out:
            target.parent.mkdir(exist_ok=True)
        write_files({target: other.read_bytes()})
    print(out)
