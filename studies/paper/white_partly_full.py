"""Figure 5: at 200 cd/m^2 and 66 ms, with pixels of 3 um, some W pixels are full, and the result has no gaps there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.colour.highlights import saturated_nearby
from isp.planes import bilinear
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from rodcone.types import Image
from sensor.cfa import mask
from sensor.raw import RawImage
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, judge_claim, paper_figure, with_default
from studies.paper.setup import (
    CAMERAS,
    READINGS,
    RESULT,
    Camera,
    Setup,
    View,
    develop_view,
    exposures,
    grey_picture,
    view,
)

BRIGHT_CD_M2 = 200.0
PITCH_UM = 3


@dataclass(frozen=True)
class Bright:
    """Measurements of Figure 5 under one reading.

    Attributes
    ----------
    white_full, colours_full : float
        Share of W's pixels that are full, and share of the colours' pixels that are.
    result_correlation, white_correlation : float
        Correlation with the truth's luminance where W is full and no colour is: of the result's luminance, and of W.
    full_correlation : float
        Correlation of the result where a colour is full as well.
    """

    white_full: float
    colours_full: float
    result_correlation: float
    white_correlation: float
    full_correlation: float


def correlation(plane: Image, truth: Image, where: NDArray[np.bool_]) -> float:
    """Return the correlation of two planes (h, w) over some pixels; 0 where either is constant or there are none."""
    if where.sum() < 2 or np.ptp(plane[where]) == 0 or np.ptp(truth[where]) == 0:
        return 0.0
    return float(np.corrcoef(plane[where], truth[where])[0, 1])


def measure_bright(raw: RawImage, result: Image, subject: View) -> Bright:
    """Measure one exposure and its result (h, w, 3), linear sRGB."""
    truth, luminance = luminance_of_srgb(subject.truth), luminance_of_srgb(result)
    white, colours = saturated_nearby(raw, "W"), saturated_nearby(raw, "RGB")
    is_white = mask(raw.cfa, "W", raw.shape)
    return Bright(
        float(raw.saturated[is_white].mean()),
        float(raw.saturated[~is_white].mean()),
        correlation(luminance, truth, white & ~colours),
        correlation(bilinear(raw)[..., raw.channels.index("W")], truth, white & ~colours),
        correlation(luminance, truth, white & colours),
    )


def claims_5(bright: Mapping[str, Bright]) -> tuple[Claim, ...]:
    """Judge the claims that some W pixels are full and the result has no gaps, under each reading."""
    whole = {f"{name}, colours not full": shot.result_correlation for name, shot in bright.items()}
    whole |= {f"{name}, a colour full too": shot.full_correlation for name, shot in bright.items()}
    return (
        judge_claim(17, {name: shot.white_full for name, shot in bright.items()}),
        judge_claim(
            18,
            whole,
            white=" and ".join(f"{shot.white_correlation:.2f} ({name})" for name, shot in bright.items()),
            full=" and ".join(f"{shot.colours_full:.0%}" for shot in bright.values()),
        ),
    )


def figure_5(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the R image, the W image and the result under both readings, and judge the claims about them."""
    subject = view(setup, "still_life", BRIGHT_CD_M2)
    bright = {name: dict[str, Bright]() for name in CAMERAS}
    rows = []
    for reading in READINGS:
        pictures = {}
        for name in CAMERAS:
            camera = Camera(reading, name, PITCH_UM)
            raw = exposures(camera, subject, "66ms")[0]
            result = develop_view(camera, raw, subject)[0]
            bright[name][reading] = measure_bright(raw, result, subject)
            pictures[RESULT[name]] = encode_srgb(result)
        planes = bilinear(raw)
        full_e = camera.sensor.pixel.full_well_e
        recorded = {"R": planes[..., 0], "W": planes[..., 3]}
        shown = {f"{name}, white is full": encode_srgb(grey_picture(plane, full_e)) for name, plane in recorded.items()}
        (first, picture), *others = (shown | pictures).items()
        rows.append([(f"{reading}: {first}", picture), *others])
    return paper_figure("5", picture_rows(rows)), with_default(claims_5, bright)
