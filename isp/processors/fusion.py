"""RGBW prior art that takes W's samples for the luminance: Sato 1983, Yamagami 1994, Kijima 2007.

Sato: I. Sato et al., "Color image pick-up apparatus", US patent 4 390 895, 1983. Taken: elements for luminance at every
other place of both directions, whose signal, with its high frequencies, is the picture's luminance; colour comes from
the other elements.

Yamagami: T. Yamagami et al., 1994, as Parmar & Wandell 2009 cite it (US patent 5 323 233 to our knowledge; its text
could not be consulted). Taken from their account: luminance and colour differences, with the sensitivities matched by a
neutral density in front of W or by complementary filters (`sensor.curves`), so that W doesn't saturate first.

Kijima: T. Kijima et al., "Image sensor with improved light sensitivity", US patent application 11/341 210, 2006
(published 2007). Taken: a picture of W in full resolution and one of the colours in less, colour samples of one kind
being combined until they gather about as much light as W does, then one from both.

Ours in all of them: white balance before, interpolation by normalised convolution, the way back to linear sRGB, and
what happens to highlights. None of the three has an answer to a saturated W: luminance ends where W's well does.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import convolve1d

from isp.colour.camera_colour import luminance_of_srgb, neutral_response
from isp.colour.white_balance import saturated_nearby
from isp.picture import Picture, require_letters
from isp.planes import Plane, fill, tent
from isp.processors.mosaic import Image, as_picture, balance_mosaic, to_rgb
from sensor.cfa import Tile, mask
from sensor.curves import matched_transmittance, rgbw
from sensor.raw import RawImage

# A tent of 7 over samples 2 apart averages like (8^2 / 24)^2 = 7.1 of them: W gathers 6 to 10 times a colour's light.
MATCHED_RADIUS = 3
LETTERS = ("R", "G", "B", "W")


def picture_sato(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop an RGBW raw image with W as the luminance of bilinear colours; parameters as `develop_interleaved`."""
    require_letters(raw, LETTERS)
    mosaic = balance_mosaic(raw, raw.electrons, neutral, balance)
    colours = np.stack([fill(mosaic.values, raw.cfa, letter) for letter in "RGB"], axis=-1)
    rgb = _fused(raw, to_rgb(raw, colours, matrix, 1), fill(mosaic.values, raw.cfa, "W"))
    return as_picture(raw, rgb, mosaic.balance)


def picture_yamagami(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop an RGBW raw image whose W is behind a neutral density: W's luminance, low-passed colour differences.

    Parameters as `isp.pipeline.develop_interleaved`; the default `neutral` knows the density of `sensor.curves`.
    """
    require_letters(raw, LETTERS)
    if neutral is None:
        neutral = neutral_response(LETTERS) * np.array([1.0, 1.0, 1.0, matched_transmittance(rgbw())])
    mosaic = balance_mosaic(raw, raw.electrons, neutral, balance)
    colours = np.stack([combine(mosaic.values, raw.cfa, letter) for letter in "RGB"], axis=-1)
    rgb = _fused(raw, to_rgb(raw, colours, matrix, MATCHED_RADIUS), fill(mosaic.values, raw.cfa, "W"))
    return as_picture(raw, rgb, mosaic.balance)


def picture_kijima(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop an RGBW raw image by early fusion: combined differences of each colour from W, added to W."""
    require_letters(raw, LETTERS)
    mosaic = balance_mosaic(raw, raw.electrons, neutral, balance)
    white = fill(mosaic.values, raw.cfa, "W")
    differences = mosaic.values - white
    colours = [white + combine(differences, raw.cfa, letter) for letter in "RGB"]
    rgb = to_rgb(raw, np.stack(colours, axis=-1), matrix, MATCHED_RADIUS)
    return as_picture(raw, rgb, mosaic.balance)


def combine(values: Plane, cfa: Tile, letter: str, radius: int = MATCHED_RADIUS) -> Plane:
    """Plane of tent-weighted means of one letter's samples, at its own sites too, shape (h, w).

    Parameters
    ----------
    values : (h, w) float64
        Mosaic.
    radius : int
        The tent reaches this many pixels; at least one sample has to be in reach everywhere.
    """
    total: NDArray[np.float64] = np.where(mask(cfa, letter, (values.shape[0], values.shape[1])), values, 0.0)
    weight = mask(cfa, letter, (values.shape[0], values.shape[1])).astype(np.float64)
    for axis in (0, 1):
        total = convolve1d(total, tent(radius), axis, mode="constant")
        weight = convolve1d(weight, tent(radius), axis, mode="constant")
    return np.asarray(total / weight)


def _fused(raw: RawImage, rgb: Image, luminance: Plane) -> Image:
    """W's luminance with the colours' differences; where W is full, with their ratios.

    Differences that belong to a much larger luminance than a full W can tell would turn noise into colour.
    """
    own = luminance_of_srgb(rgb)
    scale = np.where(own > luminance, luminance / np.maximum(own, 1e-12), 1.0)
    full = saturated_nearby(raw, "W", 1)[..., None]
    return np.where(full, rgb * scale[..., None], with_luminance(rgb, luminance))


def with_luminance(rgb: Image, luminance: Plane) -> Image:
    """Linear sRGB with another luminance and the same colour differences."""
    return np.asarray(rgb + (luminance - luminance_of_srgb(rgb))[..., None])
