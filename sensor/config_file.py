"""A camera from a TOML file: what a preset is, and what users copy and change."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from render.spectrum import Spectrum
from rodcone.errors import InputError, one_line, require_keys
from rodcone.toml_file import read_toml
from sensor.cfa import Tile, channels, tile_of
from sensor.config import LensConfig, PixelConfig, SensorConfig, pixel_of_readings
from sensor.curves import RelativeResponsesWarning, Responses, built_in, read_csv, read_curve, rgbw
from sensor.readings.reading import Reading

_SETTINGS = ("bits", "black_level_dn", "white_level_dn", "window_nm", "binning", "readout")
_KEYS = ("cfa", *_SETTINGS, "pixel", "lens", "responses", "readings")
_OF_READINGS = ("read_noise_e", "dsnu_e", "full_well_e")  # keys of each of several readings, in place of the pixel's
_RESPONSE_KEYS = ("csv", "range_nm", "quantum_efficiency", "ir_cut")


def read_sensor(path: str | Path, cfa: str | Sequence[str] | None = None) -> SensorConfig:
    """Read a camera.

    Parameters
    ----------
    path : str or Path
        TOML with the tables ``[pixel]`` and ``[lens]`` (fields of `PixelConfig` and `LensConfig`), optionally ``cfa``
        (a name of `sensor.cfa.MOSAICS`, or rows of channels), ``bits``, ``black_level_dn``, ``white_level_dn``,
        ``window_nm``, ``binning`` ("charge" or "digital"), ``readout`` ("merged" or "switched") with ``[[readings]]``
        (fields of `Reading`), and ``[responses]``: ``csv``, its ``range_nm``, its ``quantum_efficiency`` ("included",
        "relative", a number, or a CSV) and ``ir_cut`` (nm, or a CSV). Names of CSV files are relative to the TOML's
        folder.
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
    """
    tile = None if cfa is None else tile_of(cfa)  # a wrong one isn't the file's fault
    try:
        content = read_toml(Path(path))
    except (OSError, ValueError) as error:
        reason = one_line(error)
        raise InputError(
            f"sensor file: {str(path)!r} can't be read ({reason}); copy a preset: rodcone new preset NAME -o FILE"
        ) from error
    try:
        sensor = _sensor(content, Path(path).parent, tile)
    except InputError as error:
        raise InputError(f"sensor file {str(path)!r}: {error}") from error
    if sensor.responses.relative:
        warnings.warn(
            f"sensor file {str(path)!r}: its responses are relative, so its electrons, and the light and SNR that "
            "follow from them, hold up to one factor; give quantum_efficiency a number, of the greatest response",
            RelativeResponsesWarning,
            stacklevel=2,
        )
    return sensor


def _sensor(content: Mapping[str, Any], folder: Path, cfa: Tile | None) -> SensorConfig:
    require_keys("key", content, _KEYS)
    tile = tile_of(content.get("cfa", "rgbw")) if cfa is None else cfa
    if "responses" in content:
        responses = _responses(_table("responses", content), folder)
    else:
        responses = rgbw() if set(channels(tile)) <= set("RGBW") else built_in()
    settings = {name: content[name] for name in _SETTINGS if name in content}
    readings = _readings(content["readings"]) if "readings" in content else ()
    return SensorConfig(
        _pixel(content, readings),
        LensConfig(**_numbers("lens", content, LensConfig)),
        cfa=tile,
        responses=responses,
        readings=readings,
        **settings,
    )


def _pixel(content: Mapping[str, Any], readings: Sequence[Reading]) -> PixelConfig:
    """The table's pixel; what each of several readings has is theirs alone."""
    if not readings:
        return PixelConfig(**_numbers("pixel", content, PixelConfig))
    table = _table("pixel", content)
    if twice := [name for name in _OF_READINGS if name in table]:
        raise InputError(f"pixel: {twice[0]} beside [[readings]]; allowed: in each of them; take it out of [pixel]")
    filled = {**content, "pixel": table | {name: getattr(readings[0], name) for name in _OF_READINGS}}
    return pixel_of_readings(PixelConfig(**_numbers("pixel", filled, PixelConfig)), readings)


def _readings(tables: Any) -> tuple[Reading, ...]:
    if not isinstance(tables, list) or not tables:
        raise InputError(f"readings: {tables!r} is no list of tables; allowed: [[readings]], two or more; write so")
    return tuple(Reading(**_numbers("readings", {"readings": each}, Reading)) for each in tables)


def _table(name: str, content: Mapping[str, Any]) -> dict[str, Any]:
    table = content.get(name)
    if not isinstance(table, dict):
        raise InputError(f"{name}: {table!r} is not a table; allowed: {_header(name)} and its keys; add it")
    return table


def _header(name: str) -> str:
    return "[[readings]]" if name == "readings" else f"[{name}]"


def _numbers(name: str, content: Mapping[str, Any], kind: type) -> dict[str, Any]:
    """Keys of a table, checked against the fields of the dataclass that they go into."""
    table = _table(name, content)
    require_keys(f"{name} key", table, [field.name for field in fields(kind)])
    for field in fields(kind):
        if field.default is MISSING and field.name not in table:
            raise InputError(f"{name}: {field.name} is missing; allowed: a number; add it to {_header(name)}")
    for key, value in table.items():
        if isinstance(value, bool):  # a Real for Python
            raise InputError(f"{key}: {value!r} is not a number; allowed: a number, 0 to switch a term off; write one")
    return table


def _responses(table: Mapping[str, Any], folder: Path) -> Responses:
    """Responses of a CSV; what the file doesn't say about them is refused, not guessed."""
    require_keys("responses key", table, _RESPONSE_KEYS)
    for key in ("csv", "range_nm", "quantum_efficiency"):
        if key not in table:
            raise InputError(
                f"responses: {key} is missing; allowed: csv, range_nm = [shortest, longest], "
                'quantum_efficiency = "included", "relative", a number or a CSV; add it to [responses]'
            )
    if not isinstance(table["csv"], str):
        raise InputError(f"csv: {table['csv']!r} is not a file's name; allowed: a name in quotes; write so")
    pair = table["range_nm"]
    if not (isinstance(pair, list) and len(pair) == 2 and all(isinstance(nm, int | float) for nm in pair)):
        raise InputError(f"range_nm: {pair!r} is not a pair of numbers; allowed: [shortest, longest] in nm; write so")
    said = table["quantum_efficiency"]
    efficiency = None if said in ("included", "relative") else said
    found = read_csv(
        folder / table["csv"],
        range_nm=(float(pair[0]), float(pair[1])),
        ir_cut=_number_or_curve("ir_cut", table.get("ir_cut"), folder),
        quantum_efficiency=_number_or_curve("quantum_efficiency", efficiency, folder),
    )
    return Responses(found.curves, relative=said == "relative")


def _number_or_curve(name: str, value: Any, folder: Path) -> float | Spectrum | None:
    if isinstance(value, str):
        return read_curve(folder / value)
    if isinstance(value, bool) or not isinstance(value, int | float | None):
        raise InputError(f"{name}: {value!r} is not allowed; give a number, or the name of a CSV in quotes")
    return None if value is None else float(value)
