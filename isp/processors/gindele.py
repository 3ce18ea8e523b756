"""RGBW prior art that recovers colours where W is full: Gindele & Gallagher 2002, on Adams' demosaicking.

E. B. Gindele, A. C. Gallagher, "Sparsely sampled image sensing device with color and luminance photosites", US patent
6 476 865, 2002. By its claims there are R, G, B and luminance sites in equal numbers. Missing colours are interpolated
by a first method, which uses the neighbouring luminance values, or where these are clipped by a second, which doesn't.

The first method follows J. E. Adams and J. F. Hamilton (US patent 5 629 734, 1997): it interpolates along the direction
of the smaller gradient, with a Laplacian of the site's own colour, and then differences of each colour from luminance.
This project adds white balance before, filling W from its quarter of the sites in two steps (diagonals first), averages
for ties, and bilinear interpolation by normalised convolution as the second method.

S. H. Park, H. S. Kim, S. Lansel, M. Parmar, B. A. Wandell, "A case for denoising before demosaicking color filter array
data", Asilomar 2009, is about Bayer; `isp.processors.sub_images` allows any 2x2 tile. Here W's sub-image is the fourth,
and Adams' interpolation follows. Where W is full, its sub-image is flat, and the others keep their differences.
"""

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.colour.highlights import saturated_nearby
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture, require_letters
from isp.planes import fill_channels
from isp.processors.fusion import CHANNELS
from isp.processors.mosaic import balance_mosaic, to_rgb
from isp.processors.sub_images import bm3d_mosaic, principal_components
from rodcone.errors import InputError
from rodcone.types import Image, Mosaic, Plane
from sensor.cfa import Tile, is_rgbw, mask
from sensor.raw import RawImage

_PAD = 4  # pixels for two steps of two pixels each, in whole tiles
REACH = 3  # pixels: two for W at a colour's site, and one for the difference
_DIAGONALS = ((1, 1), (1, -1))
_AXES = ((0, 1), (1, 0))


def picture_gindele(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, electrons: Mosaic | None = None
) -> Picture:
    """Develop a 2x2 RGBW raw image from its mosaic, or from a denoised one [e-]."""
    require_letters(raw, CHANNELS)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons if electrons is None else electrons, balance)
    clipped = saturated_nearby(raw, "W", REACH)[..., None]
    planes = np.where(clipped, fill_channels(mosaic, raw.cfa, "RGB"), adams_planes(mosaic, raw.cfa))
    return Picture(to_rgb(raw, planes, gains, colours, REACH), sources)


def adams_planes(mosaic: Mosaic, cfa: Tile) -> Image:
    """Interpolate R, G and B with the help of W, shape (h, w, 3), in the unit of the balanced `mosaic`.

    Raises
    ------
    InputError
        If the tile isn't 2x2 with R, G, B and W once each.
    """
    white = luminance_plane(mosaic, cfa)
    return white[..., None] + fill_channels(mosaic - white, cfa, "RGB")


def luminance_plane(mosaic: Mosaic, cfa: Tile) -> Plane:
    """Interpolate W along the smaller gradient, first at the sites diagonal to W, then at those beside W."""
    require_rgbw(cfa)
    padded = np.pad(mosaic, _PAD, mode="reflect")
    row, column = divmod("".join(cfa).index("W"), 2)
    opposite = mask(cfa, cfa[1 - row][1 - column], (padded.shape[0], padded.shape[1]))
    sampled = mask(cfa, "W", (padded.shape[0], padded.shape[1]))
    white = np.where(opposite, _along_smaller_gradient(padded, padded, _DIAGONALS), padded)
    white = np.where(sampled | opposite, white, _along_smaller_gradient(white, padded, _AXES))
    return white[_PAD:-_PAD, _PAD:-_PAD]


def require_rgbw(cfa: Tile) -> None:
    """Raise `InputError` unless the tile is 2x2 with R, G, B and W once each."""
    if not is_rgbw(cfa):
        raise InputError(f"cfa: {cfa} is not 2x2 RGBW; allowed here: R, G, B and W once each; use another processor")


def _along_smaller_gradient(white: Plane, colour: Plane, directions: tuple[tuple[int, int], ...]) -> Plane:
    """Average the two neighbours in `white` and correct by a quarter of the Laplacian of the site's own colour.

    Adams & Hamilton's classifier of a direction is the neighbours' difference plus the Laplacian, as absolute values.
    """
    estimates, classifiers = [], []
    for down, right in directions:
        before, after = (np.roll(white, (sign * down, sign * right), (0, 1)) for sign in (1, -1))
        laplacian = 2 * colour - sum(np.roll(colour, (2 * sign * down, 2 * sign * right), (0, 1)) for sign in (1, -1))
        estimates.append((before + after) / 2 + laplacian / 4)
        classifiers.append(np.abs(before - after) + np.abs(laplacian))
    first, second = estimates
    smaller = np.where(classifiers[0] < classifiers[1], first, second)
    return np.where(classifiers[0] == classifiers[1], (first + second) / 2, smaller)


def picture_rgbw_park(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a 2x2 RGBW raw image whose mosaic is denoised by principal components (Park et al. 2009)."""
    require_letters(raw, CHANNELS)
    require_rgbw(raw.cfa)
    return picture_gindele(raw, colours, balance=balance, electrons=bm3d_mosaic(raw, principal_components))
