"""Encoding of pictures for a display: sRGB, or Display P3, whose primaries cover more of the colours of cameras."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.strips import strips
from rodcone.colour_spaces import DISPLAY_P3_PRIMARIES_XY, SRGB_PRIMARIES_XY, SRGB_TO_XYZ, encode_srgb, rgb_to_xyz
from rodcone.errors import InputError, require_name

STRIP_ROWS = 128  # rows that are encoded together


@dataclass(frozen=True)
class Encoding:
    """A display's colour space; all in `ENCODINGS` have D65 as white and the curve of IEC 61966-2-1.

    Attributes
    ----------
    title : str
        Name of the space, as in colour profiles.
    primaries_xy : (3, 2) float64
        Chromaticities of red, green and blue.
    """

    title: str
    primaries_xy: NDArray[np.float64]


ENCODINGS: Mapping[str, Encoding] = MappingProxyType(
    {"srgb": Encoding("sRGB", SRGB_PRIMARIES_XY), "display-p3": Encoding("Display P3", DISPLAY_P3_PRIMARIES_XY)}
)


def encode(
    linear_srgb: NDArray[np.floating], encoding: str, *, white: float = 1.0, gain: float = 1.0
) -> NDArray[np.float64]:
    """Encode ``linear_srgb / white * gain`` (..., 3) for a display, clipped to [0, 1] in the display's primaries.

    Raises
    ------
    InputError
        For an encoding that is not in `ENCODINGS`.
    """
    require_name("encoding", encoding, ENCODINGS)
    from_srgb = np.linalg.inv(rgb_to_xyz(ENCODINGS[encoding].primaries_xy)) @ SRGB_TO_XYZ
    linear_srgb = np.asarray(linear_srgb)
    if not linear_srgb.ndim:
        return encode_srgb(linear_srgb / white * gain)
    encoded = np.empty(linear_srgb.shape)
    for rows in strips(len(encoded), STRIP_ROWS):
        linear = linear_srgb[rows] / white * gain
        encoded[rows] = encode_srgb(linear if encoding == "srgb" else linear @ from_srgb.T)
    return encoded


def quantise(encoded: ArrayLike, bits: int = 8) -> NDArray[np.unsignedinteger]:
    """Round an encoded picture in [0, 1], (h, w, 3) or grey (h, w), to samples of 8 or 16 bits, (h, w, 3).

    Raises
    ------
    InputError
        For another shape, values of another type than floats, NaN and infinity.

    Warns
    -----
    UserWarning
        If values are clipped; the message says how many.
    """
    given = np.asarray(encoded)
    if given.dtype.kind != "f":
        raise InputError(f"picture: values of {given.dtype} are not allowed; give fractions, such as values / 255")
    if given.ndim not in (2, 3) or given.size == 0 or given.shape[2:] not in ((), (3,)):
        raise InputError(f"picture: shape {given.shape} is not allowed; give (h, w, 3), or (h, w) for grey")
    if wrong := given.size - int(np.isfinite(given).sum()):
        raise InputError(f"picture: {wrong} of {given.size} values are NaN or infinite; allowed: 0 to 1; mend them")
    most = 2**bits - 1
    outside, samples = 0, np.empty(given.shape, f"u{bits // 8}")
    for rows in strips(len(given), STRIP_ROWS):
        levels = np.rint(np.multiply(given[rows], most, dtype=np.float64))
        outside += int(((levels < 0) | (levels > most)).sum())
        samples[rows] = np.clip(levels, 0, most)
    if outside:
        warnings.warn(
            f"picture: {outside} of {given.size} values lie outside 0 to 1 and are clipped; linear light is encoded "
            "first: give the Picture itself, or encode_srgb(linear / white)",
            stacklevel=3,
        )
    return samples if given.ndim == 3 else np.repeat(samples[..., None], 3, axis=2)
