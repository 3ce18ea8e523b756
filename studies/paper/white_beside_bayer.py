"""Figure 6: Bayer and interleaved with Table 1's sensor at 25 cd/m^2 and 5, 10 and 20 ms.

In the paper W replaces the luminance only at 5 ms.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from skimage.color import deltaE_ciede2000, rgb2lab

from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, claim, judge_claim, paper_figure, with_default, within_margin
from studies.paper.setup import (
    CAMERAS,
    DEFAULT,
    PAPER,
    READINGS,
    Camera,
    Setup,
    View,
    develop_view,
    exposures,
    noise,
    quality_db,
    view,
)

LUMINANCE_CD_M2 = 25.0
SUBSTITUTED = {"5ms": True, "10ms": False, "20ms": False}  # whether W replaces the luminance, as the paper shows it
DARKEST = "5ms"


@dataclass(frozen=True)
class Outcome:
    """Noise and quality of a camera under one reading at one exposure.

    Attributes
    ----------
    noise : float
        Noise as a share of white.
    psnr_db : (seed,) float64
    substituted : float or None
        Share of the exposures in which W replaced the luminance; None for Bayer.
    """

    noise: float
    psnr_db: Image
    substituted: float | None


@dataclass(frozen=True)
class Swap:
    """Effect of luminance substitution: by what factor it lowers noise, and the median colour shift that it causes."""

    noise_ratio: float
    delta_e: float


def claims_6(
    bayer: Mapping[str, Outcome], interleaved: Mapping[str, Outcome], swaps: Mapping[str, Swap]
) -> tuple[Claim, ...]:
    """Judge the claims of less noise than Bayer's, of substitution only at 5 ms, and of the cost of substitution.

    Parameters
    ----------
    bayer, interleaved : mapping
        Outcomes by reading and exposure, such as ``table1_pixel, 5ms``.
    swaps : mapping
        Effects of substitution by reading.
    """
    noises = {name: camera.noise / bayer[name].noise for name, camera in interleaved.items()}
    gains_db = {name: camera.psnr_db - bayer[name].psnr_db for name, camera in interleaved.items()}
    switches = [
        within_margin({f"{name}, {'on' if on else 'off'}": camera.substituted or 0.0}, float(on), 0.0)
        for name, camera in interleaved.items()
        for on in [SUBSTITUTED[name.rsplit(", ", 1)[1]]]
    ]
    return (
        judge_claim(19, noises),
        judge_claim(20, gains_db),
        claim(21, chain.from_iterable(switches)),
        judge_claim(22, {name: x.noise_ratio for name, x in swaps.items()}, exposure=DARKEST),
        judge_claim(23, {name: x.delta_e for name, x in swaps.items()}),
    )


def figure_6(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the pictures of the study `paper_6.toml`, and judge the claims about them.

    Each reading has its own threshold of substitution. The changes by substitution are judged too.
    """
    subject = view(setup, "still_life", LUMINANCE_CD_M2)
    outcomes: dict[str, dict[str, Outcome]] = {name: {} for name in ("bayer", *CAMERAS)}
    table = []
    for reading, processor in product(READINGS, outcomes):
        pictures: list[tuple[str, Image]] = []
        for exposure in SUBSTITUTED:
            outcome, encoded = _photograph(setup, subject, Camera(reading, processor), exposure)
            outcomes[processor][f"{reading}, {exposure}"] = outcome
            words = {"bayer": "Bayer", PAPER: "interleaved", DEFAULT: "the default"}[processor]
            words += ", W's luminance" if outcome.substituted else ""
            pictures.append((f"{words}, {exposure}" if pictures else f"{reading}: {words}, {exposure}", encoded))
        table.append(pictures)
    swaps = {name: {reading: swap(setup, subject, Camera(reading, name)) for reading in READINGS} for name in CAMERAS}
    judged = {name: (outcomes[name], swaps[name]) for name in CAMERAS}
    return paper_figure("6", picture_rows(table)), with_default(lambda of: claims_6(outcomes["bayer"], *of), judged)


def swap(setup: Setup, subject: View, camera: Camera) -> Swap:
    """Compare pictures at `DARKEST` whose luminance is always replaced by W with pictures where it never is."""
    raws = exposures(camera, subject, DARKEST, setup.seeds)
    without, with_white = (
        [develop_view(camera, raw, subject, threshold)[0] for raw in raws] for threshold in (0.0, np.inf)
    )
    means = (rgb2lab(encode_srgb(np.mean(pictures, axis=0))) for pictures in (without, with_white))
    return Swap(noise(without) / noise(with_white), float(np.median(deltaE_ciede2000(*means))))


def _photograph(setup: Setup, subject: View, camera: Camera, exposure: str) -> tuple[Outcome, Image]:
    """Return the outcome of one condition, and its first picture, encoded."""
    developed = [develop_view(camera, raw, subject) for raw in exposures(camera, subject, exposure, setup.seeds)]
    pictures = [np.clip(linear, 0.0, 1.0) for linear, _ in developed]  # clipped, as a screen shows them
    decisions = [picture.substituted for _, picture in developed if picture.substituted is not None]
    share = float(np.mean(decisions)) if decisions else None
    return Outcome(noise(pictures), quality_db(pictures, subject.truth), share), encode_srgb(pictures[0])
