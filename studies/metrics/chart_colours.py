"""Colour figures of a chart's patches: how far pairs differ, and how far colours are from those in daylight."""

from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, xyz2lab

from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths, tristimulus
from rodcone.colour_spaces import SRGB_TO_XYZ, WHITE_AT, adapt_to_d65, luminance_of_srgb, xyz_to_srgb
from scenes.metamers import pairs
from scenes.reflectances import color_checker
from studies.metrics.target_figures import Masks, patch_labs

WHITE_PATCH = 18  # of the ColorChecker's 24: its 99th percentile of luminance, which pictures show at `WHITE_AT`


def pair_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """CIEDE2000 between the mean colours of patches 0 and 1, 2 and 3, ..., shape (pair,).

    Parameters
    ----------
    linear : (h, w, 3) float64
        Linear sRGB, in which white is 1.
    masks : (patch, h, w) bool
        Of `studies.metrics.target_figures.patch_masks`.
    """
    lab = patch_labs(linear, masks)
    return np.asarray(deltaE_ciede2000(lab[0::2], lab[1::2]))


def true_pair_delta_e(light: str) -> NDArray[np.float64]:
    """CIEDE2000 that the CIE observer sees within the pairs of scene metamers under a light, shape (pair,).

    In closed form, in the renderer's bands of 10 nm, adapted to D65 as pictures are.
    """
    surfaces, white = _xyz(light, [curve for pair in pairs() for curve in pair])
    lab = xyz2lab(adapt_to_d65(surfaces / white[1], white))
    return np.asarray(deltaE_ciede2000(lab[0::2], lab[1::2]))


def daylight_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """CIEDE2000 between each patch of a ColorChecker and its colour under D65, shape (patch,); parameters as above.

    Both show the white patch's luminance, under its own light, at `WHITE_AT`: nothing is fitted to the
    picture.
    """
    return np.asarray(deltaE_ciede2000(patch_labs(linear, masks), xyz2lab(daylight_srgb() @ SRGB_TO_XYZ.T)))


@cache
def daylight_srgb() -> NDArray[np.float64]:
    """Linear sRGB of the ColorChecker's patches under D65, shape (patch, 3)."""
    xyz, _ = _xyz("D65", [curve for _, curve in color_checker()])
    linear = xyz_to_srgb(xyz)
    return np.asarray(linear * (WHITE_AT / luminance_of_srgb(linear)[WHITE_PATCH]))


def _xyz(light: str, surfaces: Iterable[Spectrum]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """XYZ of reflectances under a light, shape (surface, 3), and that of white, shape (3,)."""
    nm, width = DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM)
    watts = illuminant(light).band_average(nm, width)
    reflectances = np.array([surface.band_average(nm, width) for surface in surfaces])
    return tristimulus(reflectances * watts, nm, width), tristimulus(watts, nm, width)
