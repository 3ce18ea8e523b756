"""Signal-to-noise ratio, accuracy of contrast and visual noise over light, by formula and on simulated frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log10, nan, pi

import numpy as np

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.config import SensorConfig
from studies.metrics.truth import GREY, named_light
from studies.photograph.snr import snr
from studies.score.contrast import accuracy, accuracy_on_frames
from studies.score.even_field import EvenField, even_field
from studies.score.visual_noise import colour_fields, expected_noise, measured_noise

LEAST_RATIO = 3.0  # the formula for visual noise holds if the noisiest channel's SNR is at least this
LUX: tuple[float, ...] = tuple(float(f"{10 ** (step / 3):.3g}") for step in range(-6, 13))  # 0.01 to 10 000


@dataclass(frozen=True)
class AtLight:
    """Figures at one illuminance.

    Attributes
    ----------
    lux : float
        Illuminance of an 18 % grey card.
    snr_db, measured_snr_db : float
        Signal-to-noise ratio of a pixel that sees the card, by formula and on one simulated frame; nan if the well is
        full.
    accuracy, measured_accuracy : float
        Contrast transfer accuracy (`studies.score.contrast`).
    visual_noise, measured_visual_noise : float
        Visual noise of the card beside a perfect white (`studies.score.visual_noise`); nan if a well is full or the
        camera can't distinguish colours. `visual_noise` is also nan if the grey's ratio is below `LEAST_RATIO`.
    """

    lux: float
    snr_db: float
    measured_snr_db: float
    accuracy: float
    measured_accuracy: float
    visual_noise: float = nan
    measured_visual_noise: float = nan


def over_light(
    sensor: SensorConfig, light: str, exposure_s: float, seed: int, lux: Sequence[float] = LUX
) -> list[AtLight]:
    """Compute and measure a camera's unit channel over light."""
    field = even_field(sensor, named_light(light, sensor.window_nm), exposure_s, sensor.unit_channel)
    colours = _colours(sensor, light, exposure_s)
    rows = []
    for number, each in enumerate(lux):
        luminance = each * GREY / pi
        rng = np.random.default_rng((seed, number))
        samples = field.samples_e(field.shoot(luminance, field.draw_chip(rng), rng))
        electrons = luminance * field.electrons_per_cd_m2
        expected = snr(np.array([electrons]), field.sensor, exposure_s, field.channel)
        ratios = [float(expected[0]), float(samples.mean() / max(samples.std(ddof=1), 1e-9))]
        snr_db, measured_db = (_db(ratio) if electrons < field.headroom_e else nan for ratio in ratios)
        told = accuracy(field, luminance), accuracy_on_frames(field, luminance, rng)
        seen = _visual_noise(*colours, each / pi, rng) if colours else (nan, nan)
        rows.append(AtLight(each, snr_db, measured_db, *told, *seen))
    return rows


def _colours(sensor: SensorConfig, light: str, exposure_s: float) -> tuple[list[EvenField], Floats] | None:
    """Return the fields and the matrix for visual noise; None if the camera can't distinguish three colours."""
    try:
        return colour_fields(sensor, light, exposure_s) if len(sensor.channels) >= 3 else None
    except InputError:
        return None


def _visual_noise(
    fields: Sequence[EvenField], matrix: Floats, white_cd_m2: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Return visual noise by formula and on frames; NaN in the dark, and if a channel is full."""
    electrons = [GREY * white_cd_m2 * field.electrons_per_cd_m2 for field in fields]
    if white_cd_m2 <= 0 or any(e >= field.headroom_e for e, field in zip(electrons, fields, strict=True)):
        return nan, nan
    ratio = min(
        float(snr(np.array([e]), field.sensor, field.exposure_s, field.channel)[0])
        for e, field in zip(electrons, fields, strict=True)
    )
    expected = expected_noise(fields, matrix, white_cd_m2) if ratio >= LEAST_RATIO else nan
    return expected, measured_noise(fields, matrix, white_cd_m2, rng)


def _db(ratio: float) -> float:
    return 20 * log10(ratio) if ratio > 0 else float("-inf")
