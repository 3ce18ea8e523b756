"""Pictures encoded for a display: sRGB, or Display P3, whose primaries hold more of the colours that cameras see."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from isp.colour.camera_colour import SRGB_PRIMARIES_XY, encode_srgb, rgb_to_xyz
from render.spectrum import Floats
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
    primaries_xy: Floats


# Display P3: primaries of SMPTE EG 432-1 (DCI-P3) with D65 and the curve of sRGB, as CSS Color 4, section 10.4, has it.
ENCODINGS: Mapping[str, Encoding] = MappingProxyType(
    {
        "srgb": Encoding("sRGB", SRGB_PRIMARIES_XY),
        "display-p3": Encoding("Display P3", np.array([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]])),
    }
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
    to_xyz = rgb_to_xyz(SRGB_PRIMARIES_XY)
    return encode_srgb(linear_srgb @ (np.linalg.inv(rgb_to_xyz(ENCODINGS[encoding].primaries_xy)) @ to_xyz).T)
