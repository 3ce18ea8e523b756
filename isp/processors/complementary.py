"""Yamagami's camera with cyan, magenta and yellow filters around W (see `fusion` and `sensor.curves`)."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.camera_colour import neutral_response
from isp.picture import Picture
from isp.processors.fusion import picture_yamagami
from rodcone.errors import InputError
from sensor.cfa import channels
from sensor.curves import complementary, rgbw
from sensor.raw import RawImage

# Places in which the shared steps see the three: yellow, the brightest, where green stands, as the unit of the picture.
_SEEN_AS = {"C": "R", "Y": "G", "M": "B", "W": "W"}
_TRUE = {seen: letter for letter, seen in _SEEN_AS.items()}


def picture_complementary(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop a CMYW raw image: W's luminance, colour differences from the complementary colours.

    Parameters
    ----------
    raw : RawImage
        Mosaic with C, M, Y and W.
    matrix : (3, 3) array_like
        From balanced C, Y, M, in this order, to linear sRGB.
    neutral, balance : (channel,) array_like, optional
        As `isp.pipeline.develop_interleaved`, in the order of `sensor.cfa.channels`.

    Returns
    -------
    Picture
        A neutral reads the electrons of a yellow pixel.
    """
    letters = channels(raw.cfa)
    if set(letters) != set(_SEEN_AS):
        raise InputError(f"raw: mosaic {raw.cfa} is not C, M, Y and W; allowed here: these four; use another isp")
    tile = tuple("".join(_SEEN_AS[letter] for letter in row) for row in raw.cfa)
    order = [letters.index(_TRUE[letter]) for letter in channels(tile)]
    neutral = neutral_response(letters, complementary(rgbw())) if neutral is None else neutral
    seen = replace(raw, cfa=tile, colour=None)
    picture = picture_yamagami(seen, matrix, neutral=_part(neutral, order), balance=_part(balance, order))
    return replace(picture, balance={_TRUE[letter]: source for letter, source in picture.balance.items()})


def _part(values: ArrayLike | None, order: list[int]) -> NDArray[np.float64] | None:
    """Values in another order; `isp.colour.white_balance` tells of a wrong number of them."""
    if values is None:
        return None
    array = np.asarray(values, dtype=np.float64)
    return array[order] if array.shape == (len(order),) else array
