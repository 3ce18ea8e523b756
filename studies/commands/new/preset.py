"""The command `rodcone new preset`: a sensor as a TOML file."""

from dataclasses import replace
from pathlib import Path

from rodcone.errors import InputError, require_absent, require_range
from rodcone.files import check_place, require_ending, write_files
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
from studies.commands.new.example_files import copy_example
from studies.study.study_file import EXAMPLES

_EYE = EXAMPLES / "sensors" / "eye.toml"  # not in `sensor.presets`, because an eye's receptors have no colour matrix


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
            copy_example(_EYE, out, ".toml", {out.parent / "receptors.csv": _EYE.with_name("receptors.csv")})
        else:
            copy_example(preset_file(name), out, ".toml")
        return
    require_new(out, ".toml")
    curves_file = out.parent / f"{out.stem}_curves.csv"
    require_new(curves_file, ".csv")
    lender = None if name is None else read_preset(name)
    # Numbers that the sources state.
    measured = None if camera is None else measured_camera(camera)
    numbers = _numbers(noise, more_gain)
    if anchor is not None:
        numbers = replace(numbers, efficiency=_anchor(anchor), source=f"{numbers.source}; anchor {anchor} as given")
    # Curves, lent by a preset if the sources have none.
    shape = None if measured is None else measured_curves(measured)
    if lender is not None:
        numbers = completed(numbers, lender, str(name))
        if shape is None and numbers.efficiency is not None:
            shape = borrowed_curves(lender, str(name), numbers)
    if shape is None and anchor and noise and noise.suffix.lower() != ".toml":  # a .toml report is of a chip alone
        raise InputError(
            f"anchor: {anchor} scales a response, and {noise.name!r} has none; allowed with "
            "--camera, or with a preset that lends its curves; add low_noise, or leave --anchor out"
        )
    # The files that are written.
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
    """Parse a quantum efficiency and its wavelength [nm] from a text such as 0.5@530."""
    parts = text.split("@")
    try:
        value, at_nm = (float(part) for part in parts)
    except ValueError:
        raise InputError(f"anchor: {text!r} is not allowed; give electrons a photon @ nm, such as 0.5@530") from None
    require_range("anchor", value, 1e-6, 1.0, "give electrons per photon, such as 0.5@530")
    require_range("anchor", at_nm, 300.0, 1100.0, "give the wavelength in nm, such as 0.5@530")
    return value, at_nm
