"""Cameras by name: TOML files in `sensor/data`, which `rodcone new preset` copies for users to change."""

from collections.abc import Sequence
from pathlib import Path

from rodcone.errors import InputError, unknown
from sensor.cameras.library import measured_cameras
from sensor.config import SensorConfig
from sensor.config_file import read_sensor

_FOLDER = Path(__file__).parent / "data"
_NAMES = (
    *("table1_pixel", "table1_output", "low_noise", "table1_output_6um", "table1_output_3um", "table1_output_2um"),
    *("dual_gain", "split_pixel", "staggered", "white_apart"),
)


def names() -> tuple[str, ...]:
    """Names that `preset` knows."""
    return _NAMES


def preset_file(name: str) -> Path:
    """File of a preset.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if name not in _NAMES:
        if " " in name and name.lower() in {camera.lower() for camera in measured_cameras()}:
            raise InputError(
                f"sensor preset: {name!r} is a measured response without a pixel; allowed: a preset or a .toml file; "
                f"make one: rodcone new preset low_noise --camera {name!r} -o camera.toml"
            )
        raise unknown("sensor preset", name, _NAMES)
    return _FOLDER / f"{name}.toml"


def preset(name: str | Path, cfa: str | Sequence[str] | None = None) -> SensorConfig:
    """Camera by name, or from a TOML file of the user's own.

    Parameters
    ----------
    name : str or Path
        One of `names`, or a path that ends in ``.toml``.
    cfa : str or sequence of str, optional
        Mosaic: a name of `sensor.cfa.MOSAICS`, or rows of channels. None takes the file's own, RGBW in every preset.

    Raises
    ------
    InputError
        For an unknown name or mosaic, or a file that doesn't describe a camera.
    """
    is_path = isinstance(name, Path) or name.endswith(".toml")
    return read_sensor(name if is_path else preset_file(str(name)), cfa)


def table1_pixel(cfa: str = "rgbw") -> SensorConfig:
    """Table 1, its noise voltages taken at the photodiode, as ISET computes: read 152.7 e-, DSNU 200 e-."""
    return preset("table1_pixel", cfa)


def table1_output(cfa: str = "rgbw") -> SensorConfig:
    """Table 1, its noise voltages taken behind the analog gain of 7.98: read 19.1 e-, DSNU 25.1 e-."""
    return preset("table1_output", cfa)


def low_noise(cfa: str = "rgbw") -> SensorConfig:
    """Present-day pixel, Table 1's geometry: read 1.5 e-, DSNU 1 e-, PRNU 1 % (typical of backside-lit CMOS)."""
    return preset("low_noise", cfa)
