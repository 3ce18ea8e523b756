"""Figure B, camera shake: the best exposure time of a hand-held camera at each level, and how W's light shortens it.

A longer time brings more light but also blur; W brings light without blur. The best time is where the two balance.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import log2

import numpy as np
from numpy.typing import NDArray

from rodcone.types import Image
from sensor.config import SensorConfig
from sensor.shake import blur_variance
from studies.metrics.truth import named_light
from studies.pages.plots import light_charts
from studies.paper.claims import Claim, PaperFigure, judge_claim, paper_figure, with_default
from studies.paper.setup import (
    DEFAULT,
    PAPER,
    Camera,
    Setup,
    View,
    at_level,
    close_up,
    develop_view,
    exposures,
    quality_db,
    view,
)
from studies.photograph.snr import channel_e

LEVELS_CD_M2 = (1.0, 4.0, 16.0, 64.0)
TIMES_S = 0.005 * 2.0 ** np.arange(8)
READING, BAYER = "table1_output", "bayer"


@dataclass(frozen=True)
class Best:
    """Best exposure of a camera at one level; each seed has its own.

    Attributes
    ----------
    time_s, psnr_db : (seed,) float64
    blur_px : float
        Standard deviation of the image's position during the mean time, along each axis [pixels].
    """

    time_s: Image
    psnr_db: Image
    blur_px: float


def best_time_s(times_s: NDArray[np.floating], quality: NDArray[np.floating]) -> tuple[float, float]:
    """Return the exposure time [s] of the highest quality, and that quality; `quality` has the shape (time,).

    The result is the top of a parabola over log time through the best of the given times and its two neighbours. If the
    best is the first or the last one, it is returned as it is.
    """
    index = int(quality.argmax())
    if index in (0, len(times_s) - 1):
        return float(times_s[index]), float(quality[index])
    near = slice(index - 1, index + 2)
    curve = np.polynomial.Polynomial.fit(np.log(times_s[near]), quality[near], 2, domain=[])
    top = float(curve.deriv().roots()[0])
    return float(np.exp(top)), float(curve(top))


def blur_px(sensor: SensorConfig, exposure_s: float) -> float:
    """Return the standard deviation of the image's position during an exposure, along each axis [pixels]."""
    return float(sensor.lens.shake_um / sensor.site_pitch_um * blur_variance(exposure_s) ** 0.5)


def measure_best(setup: Setup, subject: View, camera: Camera) -> Mapping[float, Best]:
    """Find the best exposure of a camera at each level; `subject` is the view at 1 cd/m^2."""
    best = {}
    for level in LEVELS_CD_M2:
        lit = at_level(subject, level)
        quality = np.stack(
            [
                quality_db(
                    [
                        develop_view(camera, raw, lit)[0]
                        for raw in exposures(camera, lit, f"{time * 1e3:g}ms", setup.seeds)
                    ],
                    lit.truth,
                )
                for time in TIMES_S
            ]
        )
        time_s, psnr_db = np.array([best_time_s(TIMES_S, of_seed) for of_seed in quality.T]).T
        best[level] = Best(time_s, psnr_db, blur_px(camera.sensor, float(time_s.mean())))
    return best


def claims_held(bayer: Mapping[float, Best], interleaved: Mapping[float, Best], more_light: float) -> tuple[Claim, ...]:
    """Judge the claims that W makes hand-held times shorter and pictures better, with each camera at its best time.

    Parameters
    ----------
    bayer, interleaved : mapping
        Best exposures by level [cd/m^2].
    more_light : float
        Electrons of the RGBW tile over those of Bayer's.
    """
    pairs = {f"{level:g} cd/m²": (bayer[level], interleaved[level]) for level in bayer}
    octaves = {name: np.log2(theirs.time_s / ours.time_s) for name, (theirs, ours) in pairs.items()}
    mean_octaves = np.mean([values.mean() for values in octaves.values()])
    times = "; ".join(
        f"{name} {theirs.time_s.mean() * 1e3:.3g} and {ours.time_s.mean() * 1e3:.3g} ms, blur {theirs.blur_px:.2f} and "
        f"{ours.blur_px:.2f} pixels"
        for name, (theirs, ours) in pairs.items()
    )
    shorter = {f"{name}, best time shorter by": x for name, x in octaves.items()}
    gained_db = {f"{name}, PSNR gained": ours.psnr_db - theirs.psnr_db for name, (theirs, ours) in pairs.items()}
    return (
        judge_claim(
            27,
            shorter,
            reading=READING,
            count=len(TIMES_S),
            times=times,
            more_light=more_light,
            octaves=log2(more_light),
            share=mean_octaves / log2(more_light),
        ),
        judge_claim(28, gained_db),
    )


def figure_b(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the best hand-held exposures of Bayer, the paper's camera and the default; judge the claims about them."""
    subject = close_up(view(setup, "still_life", 1.0))
    best = {name: measure_best(setup, subject, Camera(READING, name, shake="hand")) for name in (BAYER, PAPER, DEFAULT)}
    light = named_light("D65")
    rgbw, bayer = (channel_e(Camera(READING, name).sensor, light, 1.0, 1.0) for name in (PAPER, BAYER))
    more_light = float(rgbw.sum() / (bayer @ [1.0, 2.0, 1.0]))  # a tile of Bayer's has two pixels of green
    claims = with_default(lambda of: claims_held(best[BAYER], of, more_light), best)
    names = {"Bayer": best[BAYER], "interleaved": best[PAPER], "the default": best[DEFAULT]}
    charts = {
        "Best time by hand, ms": {
            name: [1e3 * one.time_s.mean() for one in of_level.values()] for name, of_level in names.items()
        },
        "PSNR at the best time, dB": {
            name: [one.psnr_db.mean() for one in of_level.values()] for name, of_level in names.items()
        },
    }
    return paper_figure("B", light_charts(LEVELS_CD_M2, charts), reading=READING), claims
