"""Cameras by name; and cameras with another mosaic and, if that needs them, other filters in front of their pixels.

Presets are TOML files in `sensor/data`, which `rodcone new preset` copies for users to change.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from rodcone.errors import InputError, unknown
from sensor.cameras.library import measured_cameras
from sensor.cfa import MOSAICS, OWN, RGBW, Tile, channels, plain, tile_of
from sensor.config import SensorConfig, with_tile
from sensor.config_file import read_sensor
from sensor.curves import Responses, complementary, neutral_density, with_channels

_FOLDER = Path(__file__).parent / "data"
_NAMES = (
    *("table1_pixel", "table1_output", "low_noise", "table1_output_6um", "table1_output_3um", "table1_output_2um"),
    *("dual_gain", "split_pixel", "staggered", "white_apart"),
)


def preset_names() -> tuple[str, ...]:
    """Return the names that `preset` knows.

    Examples
    --------
    >>> import rodcone
    >>> "low_noise" in rodcone.sensors()
    True
    """
    return _NAMES


def preset_file(name: str) -> Path:
    """Return the file of a preset.

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
    """Return a camera by name, or from a TOML file of the user's own.

    Parameters
    ----------
    name : str or Path
        One of `preset_names`, or a path that ends in ``.toml``.
    cfa : str or sequence of str, optional
        Mosaic: a name of `sensor.cfa.MOSAICS`, or rows of channels. None takes the file's own, RGBW in every preset.

    Raises
    ------
    InputError
        For an unknown name or mosaic, or a file that doesn't describe a camera.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.preset("low_noise", "bayer").pixel.pitch_um
    2.2
    """
    is_path = isinstance(name, Path) or name.endswith(".toml")
    return read_sensor(name if is_path else preset_file(str(name)), cfa)


def table1_pixel(cfa: str = "rgbw") -> SensorConfig:
    """Return Table 1's camera with noise voltages taken at the photodiode, as ISET does: read 152.7 e-, DSNU 200 e-."""
    return preset("table1_pixel", cfa)


def table1_output(cfa: str = "rgbw") -> SensorConfig:
    """Return Table 1's camera with noise voltages taken behind the analog gain of 7.98: read 19.1 e-, DSNU 25.1 e-."""
    return preset("table1_output", cfa)


def low_noise(cfa: str = "rgbw") -> SensorConfig:
    """Return a camera with a present-day pixel of Table 1's geometry: read 1.5 e-, DSNU 1 e-, PRNU 1 %.

    These are typical of backside-lit CMOS.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.low_noise().pixel.read_noise_e
    1.5
    """
    return preset("low_noise", cfa)


CMYW: Tile = ("CM", "YW")  # RGBW with each primary's complement in its place
CYYM: Tile = ("CY", "YM")  # Bayer with complements, yellow in green's place: Kodak's DCS 620x
CYGM: Tile = ("CY", "GM")  # cameras for video, and compact cameras about 1998

# Mosaics with filters of their own: their tile, and what makes their responses from the camera's.
VARIATIONS: Mapping[str, tuple[Tile, Callable[[Responses], Responses]]] = MappingProxyType(
    {
        "rgbw_nd": (RGBW, neutral_density),
        "cmyw": (CMYW, complementary),
        "cyym": (CYYM, complementary),
        "cygm": (CYGM, complementary),
    }
)


def tile_named(mosaic: str) -> Tile:
    """Return the tile of a mosaic by a name of `sensor.cfa.MOSAICS` or `VARIATIONS`."""
    return VARIATIONS[mosaic][0] if mosaic in VARIATIONS else tile_of(mosaic)


def vary(sensor: SensorConfig, mosaic: str) -> SensorConfig:
    """Give a camera another mosaic: the same pixel, well, lens and converter.

    The mosaic is the one that the raw image shows. For a camera that bins it can't be a quad, because the photodiodes
    would need a quad of the quad, which no camera has.

    Parameters
    ----------
    sensor : SensorConfig
        With curves of R, G, B and W.
    mosaic : str
        A name of `sensor.cfa.MOSAICS`, or rows such as ``RG/BW``; ``own``, the camera's own with its own curves; or
        ``rgbw_nd`` (W behind a neutral density that gives it G's sensitivity), ``cmyw`` (cyan, magenta, yellow and W),
        ``cyym`` or ``cygm``; `sensor.curves` states what is assumed of these filters.

    Raises
    ------
    InputError
        For an unknown name, rows that differ in length, curves that are missing, or a quad for a camera that bins.
    """
    if mosaic == OWN:
        return sensor
    if "/" not in mosaic and mosaic not in (*VARIATIONS, *MOSAICS):
        raise unknown("cfa", mosaic, (*MOSAICS, *VARIATIONS, OWN))
    if mosaic in VARIATIONS:
        tile, change = VARIATIONS[mosaic]
        responses = change(sensor.responses)
    else:
        tile = tile_of(mosaic)
        if sensor.sites > 1 and plain(tile) != tile:
            raise InputError(
                f"cfa: {mosaic!r} for a sensor that bins, whose raw images hold no quad; allowed: what they hold, such "
                f"as {mosaic.removeprefix('quad_')}; give that, or a sensor that doesn't bin"
            )
        responses = with_channels(sensor.responses, channels(tile))
    return with_tile(sensor, tile, responses)
