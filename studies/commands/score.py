"""The command `rodcone score`: the figures of merit that data sheets and test houses state."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import metadata
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from rodcone.csv_file import csv_text
from rodcone.errors import InputError, require_range
from rodcone.files import write_files
from rodcone.progress import progress
from sensor.config import SensorConfig
from sensor.presets import preset
from studies.commands.console import Time, print_json, print_table, require_place, say
from studies.pages.score_page import number_text, score_page
from studies.score.figure import Merit
from studies.score.over_light import over_light
from studies.score.score import score as merits_of
from studies.study.gain import at_gain, gain_text

HEAD = ("figure", "unit", "computed", "measured", "95 % from", "to", "defined by")
MOST_SENSORS = 4


def score(
    sensors: Annotated[list[str], Parameter(negative_iterable=())],
    /,
    *,
    only: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    light: str = "D65",
    exposure: Time = 0.033,
    f_number: float | None = None,
    diffraction: float | None = None,
    gain: float | None = None,
    iso: float | None = None,
    processor: str | None = None,
    trust_code: bool = False,
    sweep: bool = False,
    seed: int = 0,
    out: Path | None = None,
    json: bool = False,
) -> None:
    """Print a camera's figures of merit, each in closed form beside the same figure measured on simulated frames.

    Conversion (ISO 14524), speeds (ISO 12232), SNR10 and SNR1s, dynamic range and SNR (ISO 15739), stops, bits and
    low-light speed as test houses print them, flare (ISO 9358), sharpness (ISO 12233, IEEE 1858), texture (ISO/TS
    19567), contrast transfer accuracy (IEEE 2020), colour (ISO 17321), and the figures of EMVA 1288.

    Parameters
    ----------
    sensors
        One or more sensor presets by name, or preset files.
    only
        Groups such as iso_12232, or figures such as iso_12232.noise_speed_10, with commas between them; all by default.
    light
        Illuminant of all figures whose definition doesn't name another one.
    exposure
        Exposure time of the same, such as 33ms, the default, or 1/30.
    f_number
        F-number of the lens; the preset's own by default.
    diffraction
        Width of the lens's point image over an ideal one's, 0 for none; the preset's own by default.
    gain
        Gain over that at which a full well reads the converter's top; the preset's own by default.
    iso
        The same as a saturation-based speed.
    processor
        Measure pictures developed by it as well: of rodcone list processors, or mine.py:develop.
    trust_code
        Run the Python file that --processor names; it may do all that you may.
    sweep
        Print the signal-to-noise ratio, the accuracy of contrast and visual noise over light instead.
    seed
        Seed of the chips and frames.
    out
        File to write as well: a sheet (.html; of one sensor or two it prints on one page), or a table (.csv).
    json
        Print one JSON object: a list of figures for each sensor.
    """
    # What was asked for.
    require_range("exposure", exposure, 1e-9, 1e6, "give a time such as 33ms")
    require_place(out, ".html", ".csv")
    if len(sensors) > MOST_SENSORS:
        raise InputError(f"sensors: {len(sensors)} are too many; allowed: {MOST_SENSORS}; score them in two calls")
    if sweep and processor:
        raise InputError(
            "processor: one beside --sweep, which is of raw samples; allowed: one of the two; leave one out"
        )
    if sweep and only:
        raise InputError("only: figures beside --sweep, which has its own; allowed: one of the two; leave one out")
    names = [name for text in only or () for name in text.split(",")]
    text = gain_text(gain, iso)
    cameras = {name: _with_lens(at_gain(preset(name), text), f_number, diffraction) for name in sensors}
    if sweep:
        _print_sweep(cameras, light, exposure, seed, out, json=json)
        return
    # Figures, and where they are written.
    found = {}
    for name, sensor in cameras.items():
        say(f"{name}: measuring, some 10 s" if not names else f"{name}: measuring")
        with progress(sys.stderr) as step:
            found[name] = merits_of(
                sensor, light, exposure, names, seed, processor=processor, trust_code=trust_code, step=step
            )
    if out is not None and out.suffix.lower() == ".html":
        short = _short(list(cameras))
        curves = {short[name]: over_light(sensor, light, exposure, seed) for name, sensor in cameras.items()}
        lens = "; ".join(
            f"{short[name]} at f/{sensor.lens.f_number:g}" + (f", gain {sensor.gain:g}" if sensor.gain != 1 else "")
            for name, sensor in cameras.items()
        )
        set_up = f"Under {light}, {exposure * 1e3:.4g} ms, unless a row says otherwise: {lens}."
        named = {short[name]: of for name, of in found.items()}
        write_files({out: score_page(named, curves, set_up, metadata.version("rodcone"))})
    elif out is not None:
        rows = [{"sensor": name} | asdict(one) for name, of in found.items() for one in of]
        write_files({out: csv_text(list(rows[0]) if rows else ["sensor"], [list(row.values()) for row in rows])})
    if json:
        print_json({name: [asdict(one) | {"agrees": one.agrees} for one in of] for name, of in found.items()})
        return
    for name, of in found.items():
        _print_merits(name if len(found) > 1 else "", of)
    for name, of in found.items():
        for one in of:
            if one.missing:
                print(f"{name}: {one.title} is left out: {one.missing}.")
    checked = [one.agrees for of in found.values() for one in of if one.agrees is not None]
    print(f"{sum(checked)} of {len(checked)} closed forms lie inside their interval; one in twenty misses by chance.")


def _print_merits(name: str, merits: Sequence[Merit]) -> None:
    if name:
        print(name)
    rows = [
        (one.title, one.unit, *map(number_text, (one.computed, one.measured, one.low, one.high)), one.standard)
        for one in merits
        if not one.missing
    ]
    print_table(HEAD, rows, words=2)


def _short(names: Sequence[str]) -> dict[str, str]:
    """Name each camera by its file without folder and ending, if these names differ from each other."""
    short = [Path(name).stem for name in names]
    return dict(zip(names, short if len(set(short)) == len(names) else names, strict=True))


def _with_lens(sensor: SensorConfig, f_number: float | None, diffraction: float | None) -> SensorConfig:
    lens = sensor.lens
    lens = lens if f_number is None else replace(lens, f_number=f_number)
    lens = lens if diffraction is None else replace(lens, diffraction=diffraction)
    if lens.table:
        say(f"lens {lens.table!r}: its table is left out, because figures are of a part of the picture that is even")
    return replace(sensor, lens=lens)


def _print_sweep(
    cameras: dict[str, SensorConfig], light: str, exposure_s: float, seed: int, out: Path | None, *, json: bool
) -> None:
    if out is not None and out.suffix.lower() != ".csv":
        raise InputError(f"out: {out} beside --sweep; allowed: .csv; the sheet (.html) shows curves without it")
    curves = {name: over_light(sensor, light, exposure_s, seed) for name, sensor in cameras.items()}
    rows = [{"sensor": name} | asdict(row) for name, of in curves.items() for row in of]
    if out is not None:
        write_files({out: csv_text(list(rows[0]), [list(row.values()) for row in rows])})
    if json:
        print_json({name: [asdict(row) for row in of] for name, of in curves.items()})
        return
    head = ("sensor", "lux", "SNR [dB]", "measured", "contrast accuracy", "measured", "visual noise", "measured")
    print_table(head, [[str(row["sensor"]), *(number_text(x) for x in list(row.values())[1:])] for row in rows])
