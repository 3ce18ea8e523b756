"""Pictures encoded for a display: sRGB, or Display P3, whose primaries hold more of the colours that cameras see."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import DISPLAY_P3_PRIMARIES_XY, SRGB_PRIMARIES_XY, SRGB_TO_XYZ, encode_srgb, rgb_to_xyz
from rodcone.errors import unknown


@dataclass(frozen=True)
class Encoding:
    """A display's colour space; both share D65 as white and the curve of IEC 61966-2-1.

    Attributes
    ----------
    title : str
        Its name as profiles give it.
    primaries_xy : (3, 2) float64
        Chromaticities of red, green and blue.
    """

    title: str
    primaries_xy: NDArray[np.float64]


ENCODINGS: Mapping[str, Encoding] = MappingProxyType(
    {"srgb": Encoding("sRGB", SRGB_PRIMARIES_XY), "display-p3": Encoding("Display P3", DISPLAY_P3_PRIMARIES_XY)}
)


def encode(linear_srgb: NDArray[np.floating], encoding: str) -> NDArray[np.float64]:
    """Encode linear sRGB (..., 3) for a display, clipped to [0, 1] in its own primaries.

    Raises
    ------
    InputError
        For an encoding that is not in `ENCODINGS`.
    """
    if encoding not in ENCODINGS:
        raise unknown("encoding", encoding, ENCODINGS)
    if encoding == "srgb":
        return encode_srgb(linear_srgb)
    from_srgb = np.linalg.inv(rgb_to_xyz(ENCODINGS[encoding].primaries_xy)) @ SRGB_TO_XYZ
    return encode_srgb(linear_srgb @ from_srgb.T)
