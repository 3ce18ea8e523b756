"""Figure 3: one exposure in low light gives a noisy colour image and a cleaner W image, and from both a result."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from isp.planes import bilinear
from isp.processors.catalogue import PROCESSORS
from rodcone.colour_spaces import encode_srgb
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.raw import RawImage
from studies.metrics.truth import neutral_electrons
from studies.pages.plots import picture_rows
from studies.paper.claims import Claim, PaperFigure, at_least, at_most, beside
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

LUMINANCE_CD_M2, EXPOSURE_S = 2.5, 0.020  # low light: a tenth of Table 1's, at Figure 6's longest time
GAIN_DB = 1.0  # a decibel is easily seen


@dataclass(frozen=True)
class Stages:
    """How good the three images of Figure 3 are: noise (share of white) and PSNR [dB]."""

    colour_noise: float
    white_noise: float
    colour_db: float
    result_db: float


def colour_image(raw: RawImage, seen: View, sensor: SensorConfig) -> Image:
    """R, G and B of the RGBW mosaic filled in bilinearly, balanced by calibration, through the plain matrix."""
    neutral = neutral_electrons(sensor, seen.light, raw.exposure_s)[:3]
    matrix = colour_fit(sensor, PROCESSORS["interleaved"], seen.light).matrix()
    return np.asarray(bilinear(raw)[..., :3] / (neutral * seen.white_cd_m2) @ matrix.T)


def white_image(raw: RawImage, seen: View, sensor: SensorConfig) -> Image:
    """W of the mosaic filled in bilinearly as a grey picture, white 1, shape (h, w, 3)."""
    index = channels(raw.cfa).index("W")
    unit_e = neutral_electrons(sensor, seen.light, raw.exposure_s)[index]
    return np.repeat(bilinear(raw)[..., index, None] / (unit_e * seen.white_cd_m2), 3, axis=-1)


def claims_3(stages: Mapping[str, Stages]) -> tuple[Claim, ...]:
    """In low light colour is noisy, W is cleaner, and the result better than the colour image."""
    note = (
        f"still_life at {LUMINANCE_CD_M2:g} cd/m² and {EXPOSURE_S * 1e3:g} ms: the paper says low light. Noise is the "
        "scatter of luminance over exposures."
    )
    return (
        Claim(
            "Figure 3",
            "In the dark the colour image is noisy and the monochrome one clean",
            tuple(
                at_most(f"{name}, W's noise over the colours'", one.white_noise / one.colour_noise, 0.5, "×")
                for name, one in stages.items()
            ),
            note,
        ),
        Claim(
            "Figure 3",
            "The result of both is better than the colour image",
            tuple(
                at_least(f"{name}, PSNR gained", one.result_db - one.colour_db, GAIN_DB, "dB")
                for name, one in stages.items()
            ),
            note,
        ),
    )


def figure_3(setup: Setup) -> tuple[PaperFigure, tuple[Claim, ...]]:
    """Colour image, W image and result under both readings."""
    seen = view(setup, "still_life", LUMINANCE_CD_M2)
    stages, rows = {name: dict[str, Stages]() for name in CAMERAS}, []
    for reading in READINGS:
        sensor = Camera(reading).sensor
        raws = exposures(Camera(reading), seen, "20ms", setup.seeds)
        colour = [colour_image(raw, seen, sensor) for raw in raws]
        white = [white_image(raw, seen, sensor) for raw in raws]
        shown = {f"{reading}: colour": colour, "W": white}
        for name in CAMERAS:
            result = [develop(Camera(reading, name), raw, seen)[0] for raw in raws]
            stages[name][reading] = Stages(
                noise(colour), noise(white), quality_db(colour, seen.truth), quality_db(result, seen.truth)
            )
            shown["result" if name == PAPER else "by the default"] = result
        rows.append([(words, encode_srgb(made[0])) for words, made in shown.items()])
    caption = (
        f"One exposure at {LUMINANCE_CD_M2:g} cd/m² and {EXPOSURE_S * 1e3:g} ms: R, G and B filled in bilinearly, W "
        "filled in, and the interleaved reconstruction with luminance substitution, the paper's and the default."
    )
    return PaperFigure("3", caption, picture_rows(rows)), beside(claims_3(stages[PAPER]), claims_3(stages[DEFAULT]))
