"""Figure 3: one exposure in low light gives a noisy colour image and a cleaner W image; both together give a result."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from isp.planes import bilinear
from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Image
from sensor.raw import RawImage
from studies.metrics.truth import neutral_electrons
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, judge_claim, paper_figure, with_default
from studies.paper.setup import (
    CAMERAS,
    DEFAULT,
    READINGS,
    RESULT,
    Camera,
    Setup,
    View,
    develop_view,
    exposures,
    grey_picture,
    noise,
    quality_db,
    view,
)
from studies.photograph.camera import colour_fit

LOW_CD_M2, LOW_S = 2.5, 0.020  # low light: a tenth of Table 1's, at Figure 6's longest time


@dataclass(frozen=True)
class Stages:
    """Quality of Figure 3's images: noise as a share of white; PSNR that the result gains over the colours [dB]."""

    colour_noise: float
    white_noise: float
    gain_db: Image


def colour_and_white(raw: RawImage, subject: View, camera: Camera) -> tuple[Image, Image]:
    """Return Figure 3's colour image from R, G and B alone, in linear sRGB, and its W image.

    The colours are balanced by calibration, and converted by the colour matrix for no noise.
    """
    planes = bilinear(raw)
    neutral = neutral_electrons(camera.sensor, subject.light, raw.exposure_s)
    matrix = colour_fit(camera.sensor, PROCESSORS[DEFAULT], subject.light).matrix()
    colour = planes[..., :3] / (neutral[:3] * subject.white_cd_m2) @ matrix.T
    index = raw.channels.index("W")
    return np.asarray(colour), grey_picture(planes[..., index], neutral[index] * subject.white_cd_m2)


def claims_3(stages: Mapping[str, Stages]) -> tuple[Claim, ...]:
    """Judge the claims that in low light colour is noisy, W cleaner, and the result better than the colour image."""
    light = {"cd_m2": LOW_CD_M2, "ms": LOW_S * 1e3}
    noises = {f"{name}, W's noise over the colours'": x.white_noise / x.colour_noise for name, x in stages.items()}
    gains_db = {f"{name}, PSNR gained": step.gain_db for name, step in stages.items()}
    return judge_claim(14, noises, **light), judge_claim(15, gains_db, **light)


def figure_3(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Draw the colour image, the W image and the result under both readings, and judge the claims about them."""
    subject = view(setup, "still_life", LOW_CD_M2)
    stages = {name: dict[str, Stages]() for name in CAMERAS}
    rows = []
    for reading in READINGS:
        raws = exposures(Camera(reading), subject, "20ms", setup.seeds)
        colour, white = zip(*(colour_and_white(raw, subject, Camera(reading)) for raw in raws), strict=True)
        pictures = {f"{reading}: colour": colour[0], "W": white[0]}
        for name in CAMERAS:
            result = [develop_view(Camera(reading, name), raw, subject)[0] for raw in raws]
            stages[name][reading] = Stages(
                noise(colour), noise(white), quality_db(result, subject.truth) - quality_db(colour, subject.truth)
            )
            pictures[RESULT[name]] = result[0]
        rows.append([(words, encode_srgb(picture)) for words, picture in pictures.items()])
    return paper_figure("3", picture_rows(rows), level=LOW_CD_M2, ms=LOW_S * 1e3), with_default(claims_3, stages)
