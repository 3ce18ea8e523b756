"""Figure A, the paper's main claim: the camera changes gracefully between light levels, and W's part falls smoothly.

The same scene is photographed at 40 levels from starlight to day, exposed for green. The figure shows W's part in the
picture, the gain over the same frame without W, and the largest steps of quality between neighbouring levels.
"""

from dataclasses import dataclass, replace
from math import log2

import numpy as np

from isp.interleaved.saturation import saturated_fraction
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from sensor.cfa import mask
from sensor.config import LONGEST_S
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.raw import RawImage
from studies.metrics.appearance import picture_quality, psnr_db
from studies.metrics.confidence import half_width
from studies.metrics.flip import flip
from studies.pages.plots import light_charts
from studies.paper.claims import Claim, PaperFigure, at_least, at_most, claim, paper_figure, with_default, within
from studies.paper.setup import (
    CAMERAS,
    DEFAULT,
    PAPER,
    Camera,
    Setup,
    View,
    at_level,
    close_up,
    develop_view,
    exposures,
    view,
)

LEVELS_CD_M2 = np.geomspace(1e-4, 1e4, 40)  # mean luminance: from a moonless sky to more than full sun
READING = "table1_output"
SMOOTH = 0.5  # W's part is smooth if it steps by at most this between levels, which are 0.68 octaves apart
LEVEL_DB, GAIN_DB = 0.1, 1.0  # a PSNR that counts as no difference, and one that is easily seen
SEEN_DELTA_E, SEEN_FLIP = 1.0, 0.05  # differences that can just be seen; that for FLIP is an assumption


@dataclass(frozen=True)
class LevelCurves:
    """Quality of a camera's pictures over light, and W's part in them, each (level, seed).

    Attributes
    ----------
    weight, similarity, white_full
        Weight of luminance substitution, W's weight (1 - alpha) in the similarity of pixels, share of W's pixels that
        are full.
    psnr_db, delta_e, flip
        Quality: PSNR, median CIEDE2000, mean FLIP.
    gain_db
        PSNR less that of the same frame without W, in which W is full and nothing is substituted.
    """

    weight: Image
    similarity: Image
    white_full: Image
    psnr_db: Image
    delta_e: Image
    flip: Image
    gain_db: Image


def without_white(raw: RawImage) -> RawImage:
    """Return the frame with every sample of W full, so that W says nothing about the scene."""
    return replace(raw, dn=np.where(mask(raw.cfa, "W", raw.shape), raw.dn.dtype.type(raw.white_dn), raw.dn))


def curves(setup: Setup, subject: View, camera: Camera) -> LevelCurves:
    """Photograph a view, which is given at 1 cd/m^2, at every level; return the curves."""
    unit_s = auto_exposure_s(form_image(subject.radiance, camera.sensor), camera.sensor, LONGEST_S * 1e6)
    rows: list[list[tuple[float, ...]]] = []
    for level in LEVELS_CD_M2:
        # Once the exposure time is below the longest, it falls as light rises: brighter levels give the same electrons.
        if len(rows) > 1 and unit_s / LEVELS_CD_M2[len(rows) - 1] < LONGEST_S:
            rows.append(rows[-1])
            continue
        lit = at_level(subject, level)
        time = f"{min(unit_s / level, LONGEST_S) * 1e3:.6g}ms"
        rows.append([_row(camera, raw, lit) for raw in exposures(camera, lit, time, setup.seeds)])
    return LevelCurves(*np.moveaxis(np.array(rows), -1, 0))


def _row(camera: Camera, raw: RawImage, subject: View) -> tuple[float, ...]:
    """Return the fields of `LevelCurves` for one exposure."""
    truth = encode_srgb(subject.truth)
    linear, picture = develop_view(camera, raw, subject)
    encoded, bare = (encode_srgb(x) for x in (linear, develop_view(camera, without_white(raw), subject, 0.0)[0]))
    quality = picture_quality(encoded, truth)
    return (
        picture.substitution or 0.0,
        1 - float(saturated_fraction(raw).mean()),
        float(raw.saturated[mask(raw.cfa, "W", raw.shape)].mean()),
        quality.psnr_db,
        quality.delta_e_median,
        float(flip(encoded, truth).mean()),
        quality.psnr_db - psnr_db(bare, truth),
    )


def largest_step(values: Image, sign: float) -> tuple[float, Image]:
    """Return the largest step from one level to the next: its upper level [cd/m^2], and the step of each seed (seed,).

    `values` have the shape (level, seed). With `sign` 1 steps upwards count, with -1 steps downwards, with 0 both. The
    largest step is the one whose confidence interval has the highest lower end, because in the dark, means of few
    exposures rise and fall by chance.
    """
    steps = np.diff(values, axis=0)
    sizes = steps * sign if sign else np.abs(steps)
    moved = (sizes != 0).any(axis=1)  # levels with the same electrons don't count
    index = int(np.where(moved, sizes.mean(axis=1) - half_width(sizes), -np.inf).argmax())
    return float(LEVELS_CD_M2[index + 1]), sizes[index]


def where_white_fills(curves: LevelCurves) -> float:
    """Return the first level [cd/m^2] at which at least half as many of W's pixels are full as at any level.

    If no pixel is full at any level, return the brightest level.
    """
    full = curves.white_full.mean(axis=1)
    return float(LEVELS_CD_M2[int((full >= full.max() / 2).argmax()) if full.any() else -1])


def claims_levels(curves: LevelCurves) -> tuple[Claim, ...]:
    """Judge the claims about the steps of quality, the steps of W's part, and the gain by W."""
    how = (
        f"still_life, {READING}, {len(LEVELS_CD_M2)} levels from {LEVELS_CD_M2[0]:g} to {LEVELS_CD_M2[-1]:g} cd/m², "
        "exposed for green up to 66 ms."
    )
    # Quality from level to level, and over the octave in which W fills.
    (psnr_at, psnr), (delta_at, delta), (flip_at, flip_rise) = (
        largest_step(*pair) for pair in ((curves.psnr_db, -1.0), (curves.delta_e, 1.0), (curves.flip, 1.0))
    )
    fills_at = where_white_fills(curves)
    log_levels = np.log2(LEVELS_CD_M2)
    before, after = (
        np.array([np.interp(log2(fills_at) + side, log_levels, of_seed) for of_seed in curves.psnr_db.T])
        for side in (-0.5, 0.5)
    )
    qualities = (
        *at_most({"PSNR, largest fall from level to level": psnr}, GAIN_DB, "dB"),
        *at_most({"CIEDE2000, largest rise": delta}, SEEN_DELTA_E),
        *at_most({"FLIP, largest rise": flip_rise}, SEEN_FLIP),
        *at_most({"PSNR, fall over the octave in which W fills": before - after}, GAIN_DB, "dB"),
    )
    places = {"psnr_at": psnr_at, "delta_at": delta_at, "flip_at": flip_at, "fills_at": fills_at}
    # W's part.
    parts = (
        *at_most({"share of similarity by W, largest step": _step(curves.similarity)}, SMOOTH),
        *at_most({"substitution's weight, largest step": _step(curves.weight)}, SMOOTH),
        *within({"share of similarity by W, in starlight": curves.similarity[0].mean()}, 0.95, 1.0),
        *at_most({"share of similarity by W, in full sun": curves.similarity[-1].mean()}, 0.5),
    )
    # What W gains.
    means = curves.gain_db.mean(axis=1)
    margins = half_width(curves.gain_db)
    best = curves.gain_db[(means - margins).argmax()]
    least = curves.gain_db[(means + margins).argmin()]
    gains = (
        *at_least({"gain over the frame without W, largest": best}, GAIN_DB, "dB"),
        *at_least({"gain over the frame without W, least": least}, -LEVEL_DB, "dB"),
    )
    return (
        claim(24, qualities, how=how, gain_db=_step(curves.psnr_db), **places),
        claim(25, parts, how=how),
        claim(26, gains, how=how),
    )


def _step(values: Image) -> float:
    return float(largest_step(values, 0.0)[1].mean())


def figure_a(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the curves of the paper's method and of the default, and judge the claims about them."""
    subject = close_up(view(setup, "still_life", 1.0))
    by_camera = {name: curves(setup, subject, Camera(READING, name)) for name in CAMERAS}
    paper, default = by_camera[PAPER], by_camera[DEFAULT]
    charts = {
        "W's part, share": {"similarity": paper.similarity, "luminance": paper.weight, "W full": paper.white_full},
        "PSNR, dB": {
            "interleaved": paper.psnr_db,
            "without W": paper.psnr_db - paper.gain_db,
            "the default": default.psnr_db,
        },
        "FLIP": {"interleaved": paper.flip, "the default": default.flip},
    }
    means = {title: {name: x.mean(axis=1) for name, x in lines.items()} for title, lines in charts.items()}
    claims = with_default(claims_levels, by_camera)
    return paper_figure("A", light_charts(LEVELS_CD_M2, means), count=len(LEVELS_CD_M2), reading=READING), claims
