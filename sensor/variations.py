"""A camera with another mosaic, and where that needs it, other filters in front of its pixels."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from rodcone.errors import InputError, unknown
from sensor.cfa import MOSAICS, OWN, RGBW, Tile, channels, plain, tile_of
from sensor.config import SensorConfig, with_tile
from sensor.curves import Responses, complementary, neutral_density, with_channels

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


def vary(sensor: SensorConfig, mosaic: str) -> SensorConfig:
    """Give a camera another mosaic: the same pixel, well, lens and converter.

    The mosaic is the one that the raw image shows: for a camera that bins it can't be a quad, of whose pixels no camera
    has four for one.

    Parameters
    ----------
    sensor : SensorConfig
        With curves of R, G, B and W.
    mosaic : str
        A name of `sensor.cfa.MOSAICS`, or rows such as ``RG/BW``; ``own``, the camera's own with its own curves; or
        ``rgbw_nd`` (W behind a
        neutral density that gives it G's sensitivity), ``cmyw`` (cyan, magenta, yellow and W), ``cyym`` or ``cygm``;
        `sensor.curves` states what is assumed of these filters.

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
        if sensor.chip.sites > 1 and plain(tile) != tile:
            raise InputError(
                f"cfa: {mosaic!r} for a sensor that bins, whose raw images hold no quad; allowed: what they hold, such "
                f"as {mosaic.removeprefix('quad_')}; give that, or a sensor that doesn't bin"
            )
        responses = with_channels(sensor.responses, channels(tile))
    return with_tile(sensor, tile, responses)
