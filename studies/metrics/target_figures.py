"""What a target tells beyond quality: sharpness of the slanted edge, colour and noise of the ColorChecker."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import luminance_of_srgb
from rodcone.errors import InputError
from scenes.catalog import load
from studies.metrics.mtf import edge_response
from studies.metrics.patches import Masks, patch_colour_errors, patch_masks, patch_snr_db

EDGE, CHART = "slanted_edge", "color_checker"  # names in `scenes.catalog`


@dataclass(frozen=True)
class TargetFigures:
    """Figures of a picture of a target; None on other scenes, and where the picture doesn't let them be measured.

    Attributes
    ----------
    mtf50_cy_per_px : float or None
        Of the slanted edge's luminance (ISO 12233); None where noise hides the edge, too.
    chart_delta_e_mean : float or None
        CIEDE2000 between mean colours, mean over the ColorChecker's patches; None where these have under four pixels.
    patch_snr_db : float or None
        Mean over deviation of luminance, median over the patches; the render's own noise counts. None where it isn't
        finite, too.
    """

    mtf50_cy_per_px: float | None = None
    chart_delta_e_mean: float | None = None
    patch_snr_db: float | None = None


def target_figures(scene: str, linear: NDArray[np.float64], truth: NDArray[np.float64]) -> TargetFigures:
    """Measure a picture by what its scene is known to be.

    Parameters
    ----------
    scene : str
        Name, as a study gives it.
    linear, truth : (h, w, 3) float64
        sRGB, not clipped; white is 1.
    """
    luminance = luminance_of_srgb(linear)
    if scene == EDGE:
        try:
            return TargetFigures(mtf50_cy_per_px=edge_response(luminance).mtf50_cycles_per_px)
        except InputError:  # the edge can't be followed through the noise, or blur leaves none
            return TargetFigures()
    masks = _chart(truth.shape[0], truth.shape[1]) if scene == CHART else None
    if masks is None:
        return TargetFigures()
    snr_db = float(np.median(patch_snr_db(luminance[..., None], masks)))
    return TargetFigures(
        chart_delta_e_mean=float(patch_colour_errors(linear, truth, masks).mean()),
        patch_snr_db=snr_db if np.isfinite(snr_db) else None,
    )


@cache
def _chart(height: int, width: int) -> Masks | None:
    """Pixels of the chart's patches; None in a picture too small for them."""
    try:
        return patch_masks(load(CHART), (height, width))
    except InputError:
        return None
