"""Figures of test targets: the places, colours and noise of a chart's patches, colour differences between pairs of them
and from daylight, and the sharpness of the slanted edge.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
import skimage
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.scene import Scene
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths, tristimulus
from rodcone.colour_spaces import SRGB_TO_XYZ, WHITE_AT, adapt_to_d65, luminance_of_srgb, xyz_to_srgb
from rodcone.errors import InputError
from scenes.catalogue import load
from scenes.metamers import pairs
from scenes.reflectances import color_checker_reflectances
from studies.metrics.mtf import edge_response

Masks = NDArray[np.bool_]
INNER = 0.6  # share of a patch's side within which pixels count; its border has light of neighbours by blur and mosaic


def patch_masks(scene: Scene, shape: tuple[int, int]) -> Masks:
    """Return which pixels belong to each patch of a scene's chart, shape (patch, h, w), in the chart's order.

    The chart's own placement is projected through the scene's own camera; nothing is searched for in a picture.

    Parameters
    ----------
    scene : Scene
        A scene with rectangles ``patch00``, ``patch01``, ...: `scenes.color_checker`, or a scene that holds its chart.
    shape : (int, int)
        Height and width of the picture.

    Raises
    ------
    InputError
        For a scene without patches, or a picture so small that a patch has less than four pixels.
    """
    nodes = [scene.geometry[name] for name in sorted(scene.geometry) if name.startswith("patch")]
    if not nodes:
        raise InputError(f"scene: {scene.name!r} has no patches; give one with a chart, such as 'color_checker'")
    camera = scene.geometry["sensor"]
    to_camera = np.linalg.inv(np.array(camera["to_world"]))
    focal_px = min(shape) / 2 / np.tan(np.radians(camera["fov"] / 2))
    masks = np.stack([_inside(to_camera @ np.array(node["to_world"]), focal_px, shape) for node in nodes])
    least = int(masks.sum(axis=(1, 2)).min())
    if least < 4:
        raise InputError(f"shape: {shape} leaves {least} pixels to a patch; allowed: 4 or more; give a larger picture")
    return masks


def _inside(place: NDArray[np.float64], focal_px: float, shape: tuple[int, int]) -> Masks:
    """Return which pixels (h, w) look with their centre at the inner part of a rectangle.

    `place` transforms a square of side 2 into the camera's space. The camera looks along +z, +x to its left and +y up:
    pixel (row, column) looks at ((w / 2 - column - 0.5), (h / 2 - row - 0.5), focal_px).
    """
    rows, columns = np.indices(shape) + 0.5
    rays = np.stack([shape[1] / 2 - columns, shape[0] / 2 - rows, np.full(shape, focal_px)], axis=-1)
    # A ray t (x, y, z) meets the rectangle's plane where t ray = centre + u right + v up: solve for (u, v, t).
    right, up, centre = place[:3, 0], place[:3, 1], place[:3, 3]
    matrices = np.stack([np.broadcast_to(right, rays.shape), np.broadcast_to(up, rays.shape), -rays], axis=-1)
    u, v, distance = np.moveaxis(np.linalg.solve(matrices, np.broadcast_to(-centre, rays.shape)[..., None]), -2, 0)
    return np.asarray(((np.abs(u) <= INNER) & (np.abs(v) <= INNER) & (distance > 0))[..., 0])


def patch_means(picture: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return the mean of each patch, shape (patch, channel), of a picture (h, w, channel)."""
    return np.stack([picture[mask].mean(axis=0) for mask in masks])


def patch_labs(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return CIELAB of each patch's mean colour, shape (patch, 3), of linear sRGB (h, w, 3)."""
    return np.asarray(skimage.color.xyz2lab(patch_means(linear, masks) @ SRGB_TO_XYZ.T))


def patch_snr_db(picture: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return the SNR of each patch and channel, 20 log10(mean / standard deviation) [dB], shape (patch, channel).

    The picture (h, w, channel) is linear, as in ISO 15739, and each patch is assumed to be evenly lit. A mean that
    isn't above 0 gives -inf, even without noise; a patch above 0 without noise gives inf.
    """
    mean = patch_means(picture, masks)
    # Values are taken relative to each patch's first pixel, so that an even patch has exactly no deviation, in whatever
    # order a processor adds.
    deviation = np.stack([(picture[mask] - picture[mask][0]).std(axis=0, ddof=1) for mask in masks])
    lit = mean > 0
    with np.errstate(divide="ignore"):  # a patch may have no noise
        return np.where(lit, 20 * (np.log10(np.where(lit, mean, 1.0)) - np.log10(deviation)), -np.inf)


def patch_colour_errors(picture: NDArray[np.float64], truth: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return CIEDE2000 between the mean colours of each patch in two pictures, shape (patch,).

    Parameters
    ----------
    picture, truth : (h, w, 3) float64
        Linear sRGB, not clipped, in which white is 1. In linear light noise averages out, and only colour is left.
        Clipping or encoding first would turn noise into a shift of colour.
    masks : (patch, h, w) bool
    """
    return np.asarray(skimage.color.deltaE_ciede2000(patch_labs(picture, masks), patch_labs(truth, masks)))


EDGE, CHART = "slanted_edge", "color_checker"  # names in `scenes.catalogue`


@dataclass(frozen=True)
class TargetFigures:
    """Figures of a picture of a target; None for other scenes, and where they can't be measured.

    Attributes
    ----------
    mtf50_cy_per_px : float or None
        MTF50 of the slanted edge's luminance (ISO 12233); None also if noise hides the edge.
    chart_delta_e_mean : float or None
        Mean over the ColorChecker's patches of CIEDE2000 between mean colours; None if patches have under four pixels.
    patch_snr_db : float or None
        Median over the patches of luminance's mean over its standard deviation [dB], which includes the render's noise.
        None also if it isn't finite.
    """

    mtf50_cy_per_px: float | None = None
    chart_delta_e_mean: float | None = None
    patch_snr_db: float | None = None


def target_figures(scene: str, linear: NDArray[np.float64], truth: NDArray[np.float64]) -> TargetFigures:
    """Measure the figures that a picture's scene allows.

    Parameters
    ----------
    scene : str
        Name of the scene in a study.
    linear, truth : (h, w, 3) float64
        sRGB, not clipped; white is 1.
    """
    if scene == EDGE:
        try:
            return TargetFigures(mtf50_cy_per_px=edge_response(luminance_of_srgb(linear)).mtf50_cycles_per_px)
        except InputError:  # noise hides the edge, or blur leaves none
            return TargetFigures()
    masks = _chart(truth.shape[0], truth.shape[1]) if scene == CHART else None
    if masks is None:
        return TargetFigures()
    snr_db = float(np.median(patch_snr_db(luminance_of_srgb(linear)[..., None], masks)))
    return TargetFigures(
        chart_delta_e_mean=float(patch_colour_errors(linear, truth, masks).mean()),
        patch_snr_db=snr_db if np.isfinite(snr_db) else None,
    )


@cache
def _chart(height: int, width: int) -> Masks | None:
    """Return which pixels belong to the patches of `CHART`; None for a picture too small for them."""
    try:
        return patch_masks(load(CHART), (height, width))
    except InputError:
        return None


WHITE_PATCH = 18  # number of the ColorChecker's white among its 24 patches, which pictures show at `WHITE_AT`


def pair_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return CIEDE2000 between the mean colours of patches 0 and 1, 2 and 3, ..., shape (pair,).

    Parameters
    ----------
    linear : (h, w, 3) float64
        Linear sRGB, in which white is 1.
    masks : (patch, h, w) bool
        As from `studies.metrics.target_figures.patch_masks`.
    """
    lab = patch_labs(linear, masks)
    return np.asarray(skimage.color.deltaE_ciede2000(lab[0::2], lab[1::2]))


def true_pair_delta_e(light: str) -> NDArray[np.float64]:
    """Return CIEDE2000 that the CIE observer sees within each pair of the scene metamers under a light, shape (pair,).

    It is computed by formula in the renderer's bands of 10 nm, and adapted to D65 as pictures are.
    """
    surfaces, white = _xyz(light, [curve for pair in pairs() for curve in pair])
    lab = skimage.color.xyz2lab(adapt_to_d65(surfaces / white[1], white))
    return np.asarray(skimage.color.deltaE_ciede2000(lab[0::2], lab[1::2]))


def daylight_delta_e(linear: NDArray[np.float64], masks: Masks) -> NDArray[np.float64]:
    """Return CIEDE2000 between each patch of a ColorChecker and its colour under D65, shape (patch,).

    The parameters are those of `pair_delta_e`. In the picture and under D65 the white patch has the luminance
    `WHITE_AT`; nothing is fitted to the picture.
    """
    return np.asarray(
        skimage.color.deltaE_ciede2000(
            patch_labs(linear, masks), skimage.color.xyz2lab(daylight_srgb() @ SRGB_TO_XYZ.T)
        )
    )


@cache
def daylight_srgb() -> NDArray[np.float64]:
    """Return linear sRGB of the ColorChecker's patches under D65, shape (patch, 3)."""
    xyz, _ = _xyz("D65", [curve for _, curve in color_checker_reflectances()])
    linear = xyz_to_srgb(xyz)
    return np.asarray(linear * (WHITE_AT / luminance_of_srgb(linear)[WHITE_PATCH]))


def _xyz(light: str, surfaces: Iterable[Spectrum]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return XYZ of reflectances under a light, shape (surface, 3), and of a white surface, shape (3,)."""
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(DEFAULT_WAVELENGTH_NM)
    watts = illuminant(light).band_average(nm, width)
    reflectances = np.array([surface.band_average(nm, width) for surface in surfaces])
    return tristimulus(reflectances * watts, nm, width), tristimulus(watts, nm, width)
