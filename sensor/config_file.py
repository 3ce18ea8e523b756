"""Read a camera from a TOML file. Presets are such files, and users copy and change them."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from render.spectrum import Spectrum
from rodcone.errors import InputError, in_place, read_errors, require_name
from rodcone.toml_file import read_toml, strict_converter, structured
from sensor.cfa import Tile, channels, tile_of
from sensor.config import LensConfig, SensorConfig
from sensor.curves import RelativeResponsesWarning, Responses, built_in, read_csv, read_curve, rgbw
from sensor.lens.table import lens_table, terms_of
from sensor.photodiodes import binned
from sensor.pixel import MERGED, ChannelReading, Chip, ChipTemperature, PixelConfig, Reading, pixel_of_readings

_SETTINGS = (
    *("bits", "black_level_dn", "white_level_dn", "window_nm"),
    *("gain", "converter_noise_dn", "gain_limit", "row_time_us"),
)
MOST_PRNU = 0.1  # a larger PRNU is probably in per cent: sensors have 0.003 to 0.02 of the signal
MOST_OUTSIDE = 0.01  # a warning is given if more than this share of a response lies outside the window
OF_TABLES = ("csv", "quantum_efficiency", "ir_cut")  # keys of [responses] that may name a file
_OF_READINGS = ("read_noise_e", "dsnu_e", "full_well_e")  # keys of each of several readings, in place of the pixel's


def read_sensor(path: str | Path, cfa: str | Sequence[str] | None = None) -> SensorConfig:
    """Read a camera.

    Parameters
    ----------
    path : str or Path
        TOML with the tables ``[pixel]`` and ``[lens]`` (fields of `PixelConfig` and `LensConfig`), optionally ``cfa``
        (a name of `sensor.cfa.MOSAICS`, or rows of channels), ``bits``, ``black_level_dn``, ``white_level_dn``,
        ``window_nm``, ``gain``, ``gain_limit``, ``converter_noise_dn``, ``row_time_us``, ``binning`` ("charge" or
        "digital"), ``readout`` ("merged" or "switched") with ``[[readings]]`` (fields of `Reading`), ``[[channels]]``
        (fields of `ChannelReading`), ``[temperature]`` (fields of `ChipTemperature`), and ``[responses]``: ``csv``, its
        ``range_nm``, its ``quantum_efficiency`` ("included", "relative", a number, or a table), its ``unit``
        ("per_photon" by default, or "per_watt") and ``ir_cut`` (nm, or a table). The tables are files of curves
        (`rodcone.curve_file.read_columns`), whose names are relative to the TOML's folder, as is the ``table`` of a
        lens by data.
    cfa : str or sequence of str, optional
        Mosaic to use in place of the file's.

    Raises
    ------
    InputError
        For a file that can't be read, an unknown or missing key, or a value out of range; the file is named.

    Warns
    -----
    RelativeResponsesWarning
        Where the responses are relative.
    UserWarning
        Where a window that the file doesn't state takes over 1 % from one; where PRNU seems to be in per cent.
    """
    tile = None if cfa is None else tile_of(cfa)  # a wrong one isn't the file's fault
    with read_errors(f"sensor file: {str(path)!r} can't be read", "copy a preset: rodcone new preset NAME -o FILE"):
        content = read_toml(Path(path))
    with in_place(f"sensor file {str(path)!r}"):
        sensor = _sensor(content, Path(path).parent, tile)
    if sensor.responses.relative:
        warnings.warn(
            f"sensor file {str(path)!r}: its responses are relative, so its electrons, and the light and SNR that "
            "follow from them, hold up to one factor; give quantum_efficiency a number, of the greatest response",
            RelativeResponsesWarning,
            stacklevel=2,
        )
    if "responses" in content and "window_nm" not in content:
        _warn_of_window(sensor, content["responses"]["range_nm"], path)
    if (prnu := sensor.pixel.prnu) > MOST_PRNU:
        warnings.warn(
            f"sensor file {str(path)!r}: prnu = {prnu:g} is {prnu:.0%} of the signal; if per cent were meant, as EMVA "
            f"1288 states it, give {prnu / 100:g}",
            stacklevel=2,
        )
    return sensor


def _warn_of_window(sensor: SensorConfig, range_nm: Sequence[float], path: str | Path) -> None:
    """Warn where the window that a file doesn't state takes over 1 % from a response."""
    nm = np.arange(*range_nm)
    seen = sensor.responses.band_average(sensor.channels, nm + 0.5, np.ones_like(nm))
    inside = (nm >= sensor.window_nm[0]) & (nm < sensor.window_nm[1])
    if (seen[:, ~inside].sum(axis=1) > MOST_OUTSIDE * seen.sum(axis=1)).any():
        (low, high), (first, last) = sensor.window_nm, range_nm
        cut = f", or range_nm = [{max(low, first):g}, {min(high, last):g}]" if inside.any() else ""
        warnings.warn(
            f"sensor file {str(path)!r}: of its responses' {first:g} to {last:g} nm it lets in {low:g} to {high:g}; "
            f"give window_nm = [{first:g}, {last:g}] too{cut}",
            stacklevel=3,
        )


@dataclass(frozen=True)
class ResponsesTable:
    """Keys of ``[responses]``; what the file doesn't say about them is refused, not guessed."""

    csv: str
    range_nm: tuple[float, float]
    quantum_efficiency: str | float
    unit: str = "per_photon"
    ir_cut: str | float | None = None


@dataclass(frozen=True)
class SensorTable:
    """Keys of a sensor file; `SensorConfig` and `tile_of` check the values of those that are Any."""

    pixel: PixelConfig
    lens: LensConfig
    temperature: ChipTemperature | None = None
    cfa: Any = "rgbw"
    bits: Any = None
    black_level_dn: Any = None
    white_level_dn: Any = None
    window_nm: Any = None
    gain: Any = None
    converter_noise_dn: Any = None
    gain_limit: Any = None
    row_time_us: Any = None
    binning: str = ""
    readout: str = MERGED
    readings: tuple[Reading, ...] = ()
    channels: tuple[ChannelReading, ...] = ()
    responses: ResponsesTable | None = None


_CONVERTER = strict_converter()
_FIX = (
    'see rodcone new preset; [responses] has csv, range_nm = [shortest, longest] and quantum_efficiency = "included", '
    '"relative", a number or a CSV'
)


def _sensor(content: dict[str, Any], folder: Path, cfa: Tile | None) -> SensorConfig:
    table = structured(_with_its_lens(_with_a_whole_pixel(content), folder), SensorTable, _CONVERTER, _FIX)
    tile = tile_of(table.cfa) if cfa is None else cfa
    if table.responses is not None:
        responses = _responses(table.responses, folder)
        _check_channels(tile, responses, table.responses.csv)
    else:
        responses = rgbw() if set(channels(tile)) <= set("RGBW") else built_in()
    # With another mosaic than the file's own, entries for channels that only the file's mosaic has are dropped.
    fallen = set(channels(tile_of(table.cfa))) - set(channels(tile)) if table.channels else set()
    apart = tuple(x for x in table.channels if x.channel not in fallen)
    if table.lens.table:
        lens_table(table.lens)
    pixel = table.pixel if table.temperature is None else table.temperature.pixel_of(table.pixel)
    sensor = SensorConfig(
        pixel_of_readings(pixel, table.readings) if table.readings else pixel,
        table.lens,
        cfa=tile,
        responses=responses,
        chip=Chip(readings=table.readings, readout=table.readout, channels=apart),
        **{name: value for name in _SETTINGS if (value := getattr(table, name)) is not None},
    )
    return binned(sensor, table.binning) if table.binning else sensor


def _with_its_lens(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Find a tabulated lens from the file's own folder, and take its f-number where the file states none."""
    lens = content.get("lens")
    if not isinstance(lens, dict) or not isinstance(lens.get("table"), str) or not lens["table"]:
        return content
    name = str(folder / lens["table"]) if lens["table"].endswith(".toml") else lens["table"]
    own = terms_of(name)
    return content | {"lens": {"f_number": own.pop("f_number")} | lens | own}


def _with_a_whole_pixel(content: dict[str, Any]) -> dict[str, Any]:
    """Fill in the pixel's terms that each of several readings states for itself, from the first reading."""
    pixel, readings = content.get("pixel"), content.get("readings")
    if "readings" not in content or not isinstance(pixel, dict):
        return content
    if not isinstance(readings, list) or not readings or not isinstance(readings[0], dict):
        raise InputError(f"readings: {readings!r} is no list of tables; allowed: [[readings]], two or more; write so")
    if twice := [name for name in _OF_READINGS if name in pixel]:
        raise InputError(f"pixel: {twice[0]} beside [[readings]]; allowed: in each of them; take it out of [pixel]")
    return content | {"pixel": pixel | {name: readings[0].get(name, 1.0) for name in _OF_READINGS}}


def _responses(table: ResponsesTable, folder: Path) -> Responses:
    scale = table.quantum_efficiency
    efficiency = None if scale in ("included", "relative") else scale
    require_name("responses: unit", table.unit, ("per_photon", "per_watt"))
    return read_csv(
        folder / table.csv,
        range_nm=table.range_nm,
        ir_cut=_number_or_curve(table.ir_cut, folder),
        quantum_efficiency=_number_or_curve(efficiency, folder),
        unit=table.unit,
        relative=scale == "relative",
    )


def _check_channels(tile: Tile, responses: Responses, name: str) -> None:
    """Raise `InputError` where a channel of the mosaic has no column in the file of responses."""
    needed = channels(tile)
    columns = list(responses.curves)
    if set(needed) - set(columns):
        raise InputError(
            f"responses: {name!r} has the columns {', '.join(columns)}; allowed: one for each channel of the mosaic, "
            f"{', '.join(needed)}; rename them in its header"
        )


def _number_or_curve(value: str | float | None, folder: Path) -> float | Spectrum | None:
    return read_curve(folder / value) if isinstance(value, str) else value
