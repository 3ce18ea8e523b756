"""Figures 3, 5 and 6: W in low light, in bright light where it is partly full, and beside Bayer at three times.

Figure 3: one exposure gives a noisy colour image and a cleaner W image, and from both a result. Figure 5: at
200 cd/m^2, 66 ms and 3 um W is partly full, and the result is whole. Figure 6: Bayer and interleaved at 5, 10 and
20 ms, Table 1 at 25 cd/m^2; W replaces the luminance at 5 ms alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab

from isp.colour.white_balance import saturated_nearby
from isp.planes import bilinear
from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.cfa import mask
from sensor.raw import RawImage
from studies.metrics.truth import neutral_electrons
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, at_least, at_most, beside, claim, near, paper_figure, within
from studies.paper.setup import (
    CAMERAS,
    DEFAULT,
    PAPER,
    READINGS,
    Camera,
    Image,
    Setup,
    View,
    develop,
    exposures,
    noise,
    quality_db,
    view,
)
from studies.photograph.camera import colour_fit

LOW_CD_M2, LOW_S = 2.5, 0.020  # low light: a tenth of Table 1's, at Figure 6's longest time
BRIGHT_CD_M2, PITCH_UM = 200.0, 3
PARTLY = (0.02, 0.98)  # share of W's pixels that may be full for "partly"
WHOLE = 0.95  # correlation with the truth where W is full, for "whole": nine tenths of the variance
GAIN_DB = 1.0  # a decibel is easily seen
RESULT = {PAPER: "result", DEFAULT: "by the default"}  # above the pictures


def grey(plane: NDArray[np.floating], white: float) -> Image:
    """Plane (h, w) as linear grey (h, w, 3), in which `white` is 1."""
    return np.repeat(np.asarray(plane, dtype=np.float64)[..., None] / white, 3, axis=-1)


@dataclass(frozen=True)
class Stages:
    """How good the three images of Figure 3 are: noise (share of white), PSNR the result gains [dB], (seed,)."""

    colour_noise: float
    white_noise: float
    gain_db: Image


def colour_and_white(raw: RawImage, subject: View, camera: Camera) -> tuple[Image, Image]:
    """Figure 3's linear sRGB from R, G and B alone, balanced by calibration, through the plain matrix, and its W."""
    planes, neutral = bilinear(raw), neutral_electrons(camera.sensor, subject.light, raw.exposure_s)
    matrix = colour_fit(camera.sensor, PROCESSORS[DEFAULT], subject.light).matrix()
    colour = planes[..., :3] / (neutral[:3] * subject.white_cd_m2) @ matrix.T
    index = raw.channels.index("W")
    return np.asarray(colour), grey(planes[..., index], neutral[index] * subject.white_cd_m2)


def claims_3(stages: Mapping[str, Stages]) -> tuple[Claim, ...]:
    """In low light colour is noisy, W is cleaner, and the result better than the colour image."""
    light = {"cd_m2": LOW_CD_M2, "ms": LOW_S * 1e3}
    noises = {f"{name}, W's noise over the colours'": x.white_noise / x.colour_noise for name, x in stages.items()}
    gains_db = {f"{name}, PSNR gained": step.gain_db for name, step in stages.items()}
    return claim(14, at_most(noises, 0.5, "×"), **light), claim(15, at_least(gains_db, GAIN_DB, "dB"), **light)


def figure_3(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Colour image, W image and result under both readings."""
    subject = view(setup, "still_life", LOW_CD_M2)
    stages, rows = {name: dict[str, Stages]() for name in CAMERAS}, []
    for reading in READINGS:
        raws = exposures(Camera(reading), subject, "20ms", setup.seeds)
        colour, white = zip(*(colour_and_white(raw, subject, Camera(reading)) for raw in raws), strict=True)
        pictures = {f"{reading}: colour": colour[0], "W": white[0]}
        for name in CAMERAS:
            result = [develop(Camera(reading, name), raw, subject)[0] for raw in raws]
            stages[name][reading] = Stages(
                noise(colour), noise(white), quality_db(result, subject.truth) - quality_db(colour, subject.truth)
            )
            pictures[RESULT[name]] = result[0]
        rows.append([(words, encode_srgb(picture)) for words, picture in pictures.items()])
    return paper_figure("3", picture_rows(rows), level=LOW_CD_M2, ms=LOW_S * 1e3), beside(claims_3, stages)


@dataclass(frozen=True)
class Bright:
    """What Figure 5 measures under one reading.

    Attributes
    ----------
    white_full, colours_full : float
        Share of W's pixels that are full, and of the colours'.
    result_likeness, white_likeness : float
        Correlation of luminance with the truth where W is full and no colour is: of the result, and of W itself.
    full_likeness : float
        Of the result where a colour is full as well.
    """

    white_full: float
    colours_full: float
    result_likeness: float
    white_likeness: float
    full_likeness: float


def likeness(plane: Image, truth: Image, where: NDArray[np.bool_]) -> float:
    """Correlation of two planes (h, w) over some pixels; 0 where either is constant or there are none."""
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
        likeness(luminance, truth, white & ~colours),
        likeness(bilinear(raw)[..., raw.channels.index("W")], truth, white & ~colours),
        likeness(luminance, truth, white & colours),
    )


def claims_5(bright: Mapping[str, Bright]) -> tuple[Claim, ...]:
    """W partly full and the result whole, by reading."""
    whole = {f"{name}, colours not full": shot.result_likeness for name, shot in bright.items()}
    whole |= {f"{name}, a colour full too": shot.full_likeness for name, shot in bright.items()}
    return (
        claim(17, within({name: shot.white_full for name, shot in bright.items()}, *PARTLY, "of its pixels")),
        claim(
            18,
            at_least(whole, WHOLE),
            white=" and ".join(f"{shot.white_likeness:.2f} ({name})" for name, shot in bright.items()),
            full=" and ".join(f"{shot.colours_full:.0%}" for shot in bright.values()),
        ),
    )


def figure_5(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """R image, W image and result under both readings."""
    subject = view(setup, "still_life", BRIGHT_CD_M2)
    bright, rows = {name: dict[str, Bright]() for name in CAMERAS}, []
    for reading in READINGS:
        pictures = {}
        for name in CAMERAS:
            camera = Camera(reading, name, PITCH_UM)
            raw = exposures(camera, subject, "66ms")[0]
            result = develop(camera, raw, subject)[0]
            bright[name][reading] = measure_bright(raw, result, subject)
            pictures[RESULT[name]] = encode_srgb(result)
        planes, full_e = bilinear(raw), camera.sensor.pixel.full_well_e
        recorded = {"R": planes[..., 0], "W": planes[..., 3]}
        shown = {f"{name}, white is full": encode_srgb(grey(plane, full_e)) for name, plane in recorded.items()}
        (first, picture), *others = (shown | pictures).items()
        rows.append([(f"{reading}: {first}", picture), *others])
    return paper_figure("5", picture_rows(rows)), beside(claims_5, bright)


LUMINANCE_CD_M2 = 25.0
SUBSTITUTED = {"5ms": True, "10ms": False, "20ms": False}  # what the paper shows
DARKEST = "5ms"
A_LOT = 2.0  # times less noise: what "a lot" is taken for
SLIGHT = 5.0  # CIEDE2000, what "slightly" is taken for: seen side by side, not by itself


@dataclass(frozen=True)
class Outcome:
    """A camera under one reading at one exposure.

    Attributes
    ----------
    noise : float
        Share of white.
    psnr_db : (seed,) float64
    substituted : float or None
        Share of the exposures in which W replaced the luminance; None for Bayer.
    """

    noise: float
    psnr_db: Image
    substituted: float | None


@dataclass(frozen=True)
class Swap:
    """What luminance substitution does: noise without it over that with it, and the median colour shift."""

    noise_ratio: float
    delta_e: float


def claims_6(
    bayer: Mapping[str, Outcome], interleaved: Mapping[str, Outcome], swaps: Mapping[str, Swap]
) -> tuple[Claim, ...]:
    """Less noise than Bayer, substitution at 5 ms alone, and what that costs.

    Parameters
    ----------
    bayer, interleaved : mapping
        By reading and exposure, such as ``table1_pixel, 5ms``.
    swaps : mapping
        By reading.
    """
    noises = {name: camera.noise / bayer[name].noise for name, camera in interleaved.items()}
    gains_db = {name: camera.psnr_db - bayer[name].psnr_db for name, camera in interleaved.items()}
    switches = [
        near({f"{name}, {'on' if on else 'off'}": camera.substituted or 0.0}, float(on), 0.0)
        for name, camera in interleaved.items()
        for on in [SUBSTITUTED[name.rsplit(", ", 1)[1]]]
    ]
    return (
        claim(19, at_most(noises, 1.0, "×")),
        claim(20, at_least(gains_db, 0.0, "dB")),
        claim(21, chain.from_iterable(switches)),
        claim(22, at_least({name: x.noise_ratio for name, x in swaps.items()}, A_LOT, "×"), exposure=DARKEST),
        claim(23, at_most({name: x.delta_e for name, x in swaps.items()}, SLIGHT, "ΔE2000")),
    )


def figure_6(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Pictures of the study `paper_6.toml`, each reading with its own threshold of substitution, and what that does."""
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
    return paper_figure("6", picture_rows(table)), beside(lambda of: claims_6(outcomes["bayer"], *of), judged)


def swap(setup: Setup, subject: View, camera: Camera) -> Swap:
    """Substitution at `DARKEST`, always against never."""
    raws = exposures(camera, subject, DARKEST, setup.seeds)
    without, with_white = ([develop(camera, raw, subject, threshold)[0] for raw in raws] for threshold in (0.0, np.inf))
    means = (rgb2lab(encode_srgb(np.mean(pictures, axis=0))) for pictures in (without, with_white))
    return Swap(noise(without) / noise(with_white), float(np.median(deltaE_ciede2000(*means))))


def _photograph(setup: Setup, subject: View, camera: Camera, exposure: str) -> tuple[Outcome, Image]:
    """Outcome of one condition, and its first picture, encoded."""
    developed = [develop(camera, raw, subject) for raw in exposures(camera, subject, exposure, setup.seeds)]
    pictures = [np.clip(linear, 0.0, 1.0) for linear, _ in developed]  # as a screen shows them
    decisions = [picture.substituted for _, picture in developed if picture.substituted is not None]
    share = float(np.mean(decisions)) if decisions else None
    return Outcome(noise(pictures), quality_db(pictures, subject.truth), share), encode_srgb(pictures[0])
