"""What a chart's patches tell of colour: pairs told apart, and colours as they are in daylight."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, xyz2lab

from render.illuminants import illuminant
from render.photometry import tristimulus
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.colour_spaces import SRGB_TO_XYZ, adapt_to_d65, luminance_of_srgb, xyz_to_srgb
from scenes.metamers import pairs
from scenes.reflectances import color_checker
from studies.metrics.patches import Masks, patch_means
from studies.metrics.truth import WHITE_AT

WHITE_PATCH = 18  # of the ColorChecker's 24: its 99th percentile of luminance, which pictures show at `WHITE_AT`


def pair_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """CIEDE2000 between the mean colours of patches 0 and 1, 2 and 3, ..., shape (pair,).

    Parameters
    ----------
    linear : (h, w, 3) float64
        Linear sRGB, in which white is 1.
    masks : (patch, h, w) bool
        Of `studies.metrics.patches.patch_masks`.
    """
    lab = _lab(patch_means(linear, masks))
    return np.asarray(deltaE_ciede2000(lab[0::2], lab[1::2]))


def true_pair_delta_e(light: str) -> NDArray[np.float64]:
    """CIEDE2000 that the CIE observer sees within the pairs of scene metamers under a light, shape (pair,).

    In closed form, in the renderer's bands of 10 nm, adapted to D65 as pictures are.
    """
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(nm)
    watts = illuminant(light).band_average(nm, width)
    white = tristimulus(watts, nm, width)
    surfaces = np.array([curve.band_average(nm, width) for pair in pairs() for curve in pair])
    lab = xyz2lab(adapt_to_d65(tristimulus(surfaces * watts, nm, width) / white[1], white))
    return np.asarray(deltaE_ciede2000(lab[0::2], lab[1::2]))


def daylight_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """CIEDE2000 between each patch of a ColorChecker and its colour under D65, shape (patch,); parameters as above.

    Both show the white patch's luminance, under its own light, at `truth.WHITE_AT`: nothing is fitted to the
    picture.
    """
    return np.asarray(deltaE_ciede2000(_lab(patch_means(linear, masks)), _lab(daylight_srgb())))


@cache
def daylight_srgb() -> NDArray[np.float64]:
    """Linear sRGB of the ColorChecker's patches under D65, shape (patch, 3)."""
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(nm)
    light = illuminant("D65").band_average(nm, width)
    surfaces = np.array([curve.band_average(nm, width) for _, curve in color_checker()])
    xyz = tristimulus(surfaces * light, nm, width)
    linear = xyz_to_srgb(xyz)
    return np.asarray(linear * (WHITE_AT / luminance_of_srgb(linear)[WHITE_PATCH]))


def _lab(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(xyz2lab(linear @ SRGB_TO_XYZ.T))
