"""The command `rodcone snr`: the light that a chip's pixels need."""

from dataclasses import asdict, replace
from math import isinf
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from rodcone.errors import require_range
from rodcone.files import write_files
from sensor.config import SensorConfig
from sensor.presets import preset as sensor_preset
from studies.commands.console import Time, print_json, print_table, require_place
from studies.metrics.truth import GREY
from studies.pages.plots import snr_svg
from studies.pages.report_text import MISSING
from studies.photograph.snr import light_for_snr

RELATIVE = "*"  # mark behind the name of a sensor whose responses are relative
HEAD = ("sensor", "channel", "electrons", "cd/m2", f"lux on {GREY:.0%} grey")


def snr(
    sensors: Annotated[list[str], Parameter(negative_iterable=())],
    /,
    *,
    at: float = 10.0,
    light: str = "D65",
    exposure: Time = 0.033,
    f_number: float | None = None,
    out: Path | None = None,
    json: bool = False,
) -> None:
    """Print the light in which a sensor's pixels reach a signal-to-noise ratio, by channel.

    In closed form, with shot noise, dark current, read noise, fixed patterns of one chip and quantisation; of an even
    neutral field in the middle of the picture.

    Parameters
    ----------
    sensors
        One or more sensor presets by name, or preset files.
    at
        Signal over noise of a pixel; 10 is 20 dB.
    light
        Illuminant.
    exposure
        Exposure time, such as 33ms, the default, or 1/30.
    f_number
        F-number of the lens; the preset's own by default.
    out
        Plot of the SNR over light (.svg).
    json
        Print one JSON object: a list for each sensor.
    """
    require_range("at", at, 1e-3, 1e4, "give signal over noise, such as 10")
    require_range("exposure", exposure, 1e-9, 1e6, "give a time such as 33ms")
    require_place(out, ".svg")
    opened = {name: _opened(name, f_number) for name in sensors}
    light_by_sensor = {name: light_for_snr(at, sensor, light, exposure) for name, sensor in opened.items()}
    if out is not None:
        named = {f"{name}{RELATIVE * sensor.responses.relative}": sensor for name, sensor in opened.items()}
        write_files({out: snr_svg(named, light, exposure, at)})
    if json:
        relative = {name: {"relative": sensor.responses.relative} for name, sensor in opened.items()}
        print_json({name: [asdict(x) | relative[name] for x in of] for name, of in light_by_sensor.items()})
        return
    print_table(
        HEAD,
        [
            (
                f"{name}{RELATIVE * opened[name].responses.relative}",
                x.channel,
                *(MISSING if isinf(value) else f"{value:.4g}" for value in figures),
            )
            for name, of in light_by_sensor.items()
            for x in of
            for figures in [(x.electrons, x.luminance_cd_m2, x.illuminance_lux)]
        ],
        words=2,
    )
    if any(sensor.responses.relative for sensor in opened.values()):
        print(f"{RELATIVE} its responses are relative: the light of its rows holds up to one factor")
    if any(isinf(x.electrons) for of in light_by_sensor.values() for x in of):
        print(f"{MISSING}: no light is enough: the well is full before, or fixed patterns alone are 1/{at:g} of it")


def _opened(name: str, f_number: float | None) -> SensorConfig:
    sensor = sensor_preset(name)
    return sensor if f_number is None else replace(sensor, lens=replace(sensor.lens, f_number=f_number))
