"""The command `rodcone expect`."""

from dataclasses import asdict, dataclass, fields, replace
from math import pi
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from rodcone.csv_file import csv_text
from rodcone.errors import InputError
from rodcone.files import write_files
from rodcone.memory import GB
from rodcone.progress import duration
from scenes.levels import AVERAGE_REFLECTANCE, DEMO_LEVELS
from sensor.cfa import OWN
from sensor.exposure import AUTO_INFORMATION
from sensor.presets import preset, vary
from studies.commands.console import announce_cost, print_json, print_table, require_place
from studies.design.expect import ExpectedError
from studies.design.expect import expect as expect_errors
from studies.pages.gain_plot import gain_svg
from studies.study.cost import START_S, cores, pace
from studies.study.levels import UNITS, levels_between, parse_exposure, parse_level

_TABLES_S, _ERROR_S = 12.0, 0.05  # processor seconds for the prior's tables, and for a camera at one level
_BYTES = 0.6e9


@dataclass(frozen=True)
class _Cost:
    """Cost of a table with a number of cameras and levels."""

    cameras: int
    levels: int

    @property
    def seconds(self) -> float:
        """Return the time on this machine's cores if they are idle [s]."""
        return pace() * (START_S + (_TABLES_S + _ERROR_S * self.cameras * self.levels) / cores())

    def words(self) -> str:
        """Return one line for a reader: time and memory, and the time for half the levels."""
        half = replace(self, levels=max(1, self.levels // 2))
        several = "s" * (self.cameras > 1)
        return (
            f"about {duration(self.seconds)}, {_BYTES / GB:.1f} GB: {self.cameras} camera{several} at {self.levels} "
            f"levels, no samples; with half the levels {duration(half.seconds)}"
        )

    def facts(self) -> dict[str, Any]:
        """Return the same cost as values by name."""
        return {**vars(self), "seconds": self.seconds, "bytes": _BYTES}


def expect(
    sensors: Annotated[list[str], Parameter(negative_iterable=())],
    /,
    *,
    mosaic: list[str] | None = None,
    level: list[str] | None = None,
    over: str = f"{DEMO_LEVELS[0].name}:{DEMO_LEVELS[-1].name}",
    light: str = "D65",
    exposure: str = AUTO_INFORMATION,
    prior: str = "drawn",
    blur: bool = False,
    out: Path | None = None,
    dry_run: bool = False,
    json: bool = False,
) -> None:
    """Print the error to expect of a sensor's pictures by level of light, in closed form, without rendering.

    The error is that of the best estimate under a prior over patches of 8x8 pixels, with every noise source of the
    sensor. A number of decibels is an expectation over the prior, no limit: compare mosaics by their differences.
    Beside simulated scenes differences are off by 0.2 dB RMS, of Table 1's pixel by 0.3, in luminance by 0.4
    (docs/design.md).

    Parameters
    ----------
    sensors
        Sensor presets by name, or preset files.
    mosaic
        Mosaics by name, or rows such as RG/BW; the sensor's own by default.
    level
        Levels of light, such as 25cd/m2, 500lux or moonlight.
    over
        Named levels from one to another, where no level is given.
    light
        Illuminant; the camera knows it.
    exposure
        Rule of exposure, or a time such as 20ms.
    prior
        Prior over patches: drawn (shapes and photographs) or photographs (alone).
    blur
        Count the lens's diffraction and defocus, at 550 nm, as a blur that the picture keeps.
    out
        Table with every figure (.csv), or plot of the gain over the first camera (.svg).
    dry_run
        Print what it would cost in time and memory; compute nothing.
    json
        Print one JSON object: a list of errors by level for each camera.
    """
    require_place(out, ".csv", ".svg")
    if out is not None and out.suffix.lower() == ".svg" and len(sensors) * len(mosaic or [""]) == 1:
        raise InputError(f"out: {out} plots gains over the first camera, and there is one; add a sensor or a --mosaic")
    levels = {text: _luminance(text) for text in level} if level else levels_between(over)
    time_s = parse_exposure(exposure, "exposure")
    cameras = [(name, tile) for name in sensors for tile in mosaic or [""]]
    if not announce_cost(_Cost(len(cameras), len(levels)), dry_run=dry_run, json=json):
        return
    choices = (list(levels.values()), light, exposure if time_s is None else time_s, prior, blur)
    by_camera = {
        f"{name} {tile}".strip(): expect_errors(vary(preset(name), tile or OWN), *choices) for name, tile in cameras
    }
    if out is not None:
        write_files({out: _csv(by_camera) if out.suffix.lower() == ".csv" else gain_svg(by_camera)})
    if json:
        print_json({name: [asdict(row) for row in rows] for name, rows in by_camera.items()})
        return
    reference, *others = by_camera.items()
    print_table(
        ("PSNR in dB, then gains over it", *levels),
        [(reference[0], *(f"{row.psnr_db:.2f}" for row in reference[1]))]
        + [
            (name, *(f"{row.psnr_db - beside.psnr_db:+.2f}" for row, beside in zip(errors, reference[1], strict=True)))
            for name, errors in others
        ],
    )
    print_table(
        ("error of a*, b*", *levels),
        [(name, *(f"{row.colour:.2f}" for row in errors)) for name, errors in by_camera.items()],
    )


def _luminance(text: str) -> float:
    value, unit = parse_level(text)
    return value if unit == UNITS[0] else value * AVERAGE_REFLECTANCE / pi


def _csv(by_camera: dict[str, list[ExpectedError]]) -> str:
    head = ("camera", *(key.name for key in fields(ExpectedError)))
    return csv_text(head, ((name, *vars(row).values()) for name, rows in by_camera.items() for row in rows))
