"""The signal-to-noise ratio and the accuracy of contrast over light, in closed form beside simulated frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log10, nan, pi

import numpy as np

from sensor.config import SensorConfig
from studies.metrics.truth import GREY, named_light
from studies.photograph.snr import snr
from studies.score.contrast import accuracy, accuracy_on_frames
from studies.score.even_field import even_field

LUX: tuple[float, ...] = tuple(float(f"{10 ** (step / 3):.3g}") for step in range(-6, 13))  # 0.01 to 10 000


@dataclass(frozen=True)
class AtLight:
    """Figures in one light.

    Attributes
    ----------
    lux : float
        On an 18 % grey card.
    snr_db, measured_snr_db : float
        Ratio of a pixel's samples of the card, in closed form and on one simulated frame; nan where the well is full.
    accuracy, measured_accuracy : float
        Contrast transfer accuracy (`studies.score.contrast`).
    """

    lux: float
    snr_db: float
    measured_snr_db: float
    accuracy: float
    measured_accuracy: float


def over_light(
    sensor: SensorConfig, light: str, exposure_s: float, seed: int, lux: Sequence[float] = LUX
) -> list[AtLight]:
    """Compute and measure a camera's unit channel over light."""
    field = even_field(sensor, named_light(light, sensor.window_nm), exposure_s, sensor.unit_channel)
    rows = []
    for number, each in enumerate(lux):
        luminance, rng = each * GREY / pi, np.random.default_rng((seed, number))
        samples = field.samples_e(field.shoot(luminance, field.draw_chip(rng), rng))
        electrons = luminance * field.electrons_per_cd_m2
        expected = snr(np.array([electrons]), field.sensor, exposure_s, field.channel)
        ratios = [float(expected[0]), float(samples.mean() / max(samples.std(ddof=1), 1e-9))]
        snr_db, measured_db = (_db(ratio) if electrons < field.headroom_e else nan for ratio in ratios)
        told = accuracy(field, luminance), accuracy_on_frames(field, luminance, rng)
        rows.append(AtLight(each, snr_db, measured_db, *told))
    return rows


def _db(ratio: float) -> float:
    return 20 * log10(ratio) if ratio > 0 else float("-inf")
