"""RGBW prior art that uses W's samples as luminance: Sato 1983, Yamagami 1994, Kijima 2007.

Sato: I. Sato et al., "Color image pick-up apparatus", US patent 4 390 895, 1983. It has elements for luminance at every
other place in both directions. Their signal, with its high frequencies, is the picture's luminance; colour comes from
the other elements.

Yamagami: T. Yamagami et al., 1994, as Parmar & Wandell 2009 cite it (to our knowledge US patent 5 323 233, whose text
could not be consulted). By their account it combines luminance with colour differences, and matches the sensitivities
by a neutral density in front of W or by complementary filters (`sensor.curves`), so that W doesn't saturate first.

Kijima: T. Kijima et al., "Image sensor with improved light sensitivity", US patent application 11/341 210, 2006
(published 2007). It makes a picture of W in full resolution and a picture of the colours in lower resolution, and fuses
them. Samples of one colour are combined until they gather about as much light as W does.

In all three, white balance before, interpolation by normalised convolution, the conversion to linear sRGB and the
treatment of highlights are this project's. None of the three handles a saturated W: luminance ends at W's full well.
"""

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.colour.colour_fit import ColourFit
from isp.colour.highlights import saturated_nearby
from isp.colour.white_balance import WhiteBalance, neutral_response
from isp.picture import Picture, require_letters
from isp.planes import fill, fill_channels, tent
from isp.processors.mosaic import balance_mosaic, to_rgb
from rodcone.colour_spaces import luminance_of_srgb
from rodcone.errors import InputError
from rodcone.types import Image, Plane
from sensor.cfa import Tile, channels, mask
from sensor.curves import complementary, matched_transmittance, rgbw
from sensor.raw import RawImage, renamed

# Radius of the tent that averages colours. Its 7 x 7 pixels hold samples 2 pixels apart, whose weighted mean has the
# noise of a plain mean of 7.1 samples, (8^2 / 24)^2. W gathers 6 to 10 times the light of a colour.
MATCHED_RADIUS = 3
CHANNELS = ("R", "G", "B", "W")
# Names under which the complementary channels are processed: yellow, the brightest, as green, the picture's unit.
_STANDS_FOR = {"C": "R", "Y": "G", "M": "B", "W": "W"}


def picture_sato(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop an RGBW raw image with W as the luminance of bilinear colours."""
    require_letters(raw, CHANNELS)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons, balance)
    rgb = to_rgb(raw, fill_channels(mosaic, raw.cfa, "RGB"), gains, colours, 1)
    return Picture(_fused(raw, rgb, fill(mosaic, raw.cfa, "W")), sources)


def picture_yamagami(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop an RGBW raw image with a neutral density over W, by W's luminance and low-passed colour differences.

    The default neutral includes the density of `sensor.curves`.
    """
    require_letters(raw, CHANNELS)
    if balance.neutral is None:
        behind_density = np.array([1.0, 1.0, 1.0, matched_transmittance(rgbw())])
        balance = replace(balance, neutral=neutral_response(CHANNELS) * behind_density)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons, balance)
    planes = np.stack([tent_means(mosaic, raw.cfa, channel) for channel in "RGB"], axis=-1)
    rgb = to_rgb(raw, planes, gains, colours, MATCHED_RADIUS)
    return Picture(_fused(raw, rgb, fill(mosaic, raw.cfa, "W")), sources)


def picture_complementary(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a CMYW raw image like `picture_yamagami`, by W's luminance and differences of complementary colours.

    `colours` converts balanced C, Y and M, in this order, to linear sRGB. White balance scales every channel so that a
    neutral surface has the electrons of a yellow pixel.
    """
    names = raw.channels
    if set(names) != set(_STANDS_FOR):
        raise InputError(f"raw: mosaic {raw.cfa} is not C, M, Y and W; allowed here: these four; use another processor")
    named = renamed(raw, _STANDS_FOR)
    true = {stand_in: channel for channel, stand_in in _STANDS_FOR.items()}
    order = [names.index(true[stand_in]) for stand_in in channels(named.cfa)]
    neutral = balance.neutral
    if neutral is None:
        neutral = neutral_response(names, complementary(rgbw()))
    reordered = WhiteBalance(neutral[order], None if balance.given is None else balance.given[order])
    picture = picture_yamagami(named, colours, balance=reordered)
    return replace(picture, balance={true[stand_in]: source for stand_in, source in picture.balance.items()})


def picture_kijima(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop an RGBW raw image by early fusion: averaged differences of each colour from W are added to W."""
    require_letters(raw, CHANNELS)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons, balance)
    white = fill(mosaic, raw.cfa, "W")
    differences = mosaic - white
    planes = np.stack([white + tent_means(differences, raw.cfa, channel) for channel in "RGB"], axis=-1)
    return Picture(to_rgb(raw, planes, gains, colours, MATCHED_RADIUS), sources)


def tent_means(values: Plane, cfa: Tile, channel: str) -> Plane:
    """Average one channel's samples by a tent at every pixel, its own sites included, shape (h, w).

    The tent reaches `MATCHED_RADIUS` pixels, so that at least one sample is in reach everywhere.
    """
    sampled = mask(cfa, channel, (values.shape[0], values.shape[1]))
    total: NDArray[np.float64] = np.where(sampled, values, 0.0)
    weight = sampled.astype(np.float64)
    for axis in (0, 1):
        total = scipy.ndimage.convolve1d(total, tent(MATCHED_RADIUS), axis, mode="constant")
        weight = scipy.ndimage.convolve1d(weight, tent(MATCHED_RADIUS), axis, mode="constant")
    return np.asarray(total / weight)


def _fused(raw: RawImage, rgb: Image, luminance: Plane) -> Image:
    """Combine W's luminance with the colours' differences, or with their ratios where W is full.

    A full W is only a lower bound of luminance. The differences may then belong to a much larger luminance and would
    amplify noise in the colours, which ratios don't.
    """
    of_colours = luminance_of_srgb(rgb)
    scale = np.where(of_colours > luminance, luminance / np.maximum(of_colours, 1e-12), 1.0)
    full = saturated_nearby(raw, "W", 1)[..., None]
    return np.where(full, rgb * scale[..., None], with_luminance(rgb, luminance))


def with_luminance(rgb: Image, luminance: Plane) -> Image:
    """Give linear sRGB another luminance and keep its colour differences."""
    return np.asarray(rgb + (luminance - luminance_of_srgb(rgb))[..., None])
