"""Flicker figures of IEEE 2020: how much a lamp's flicker shows in frames that start at random times of its period."""

from dataclasses import replace
from math import nan

import numpy as np

from rodcone.errors import InputError
from sensor.flicker.figures import TOLERANCE, flicker_figures
from sensor.flicker.rows import check_flicker, row_weights
from sensor.flicker.waveform import waveform
from studies.score.even_field import EvenField, even_field
from studies.score.figure import Definition, Merit, not_measured

LAMP, EXPOSURE_S = "metal_halide@100Hz", 0.002  # a lamp on the mains, and an exposure of a fifth of its period
FRAMES = 40  # frames per measurement, which start at random moments
WHITE_SHARE = 0.4  # in the lamp's mean light the field fills this share of the largest reading


def flicker(plain: EvenField, light: str) -> Definition:
    """Define the modulation index and the mitigation probability of a camera that looks at an even field.

    The formulas depend on the exposure time and the lamp alone; the measurement on frames includes the camera.
    """
    lamp = waveform(LAMP)
    known = flicker_figures(lamp, EXPOSURE_S)
    words = (
        f"{plain.channel}, raw means of {FRAMES} frames that start at random, {light} from a lamp that "
        f"swings by {100 * lamp.depth:.0f} % at {lamp.frequency_hz:g} Hz ({LAMP}), {EXPOSURE_S * 1e3:g} ms"
    )
    merits = (
        Merit(
            "flicker.modulation_index",
            "flicker modulation index",
            "1",
            "IEEE 2020-2024: (most - least) / (most + least) of a frame's light",
            f"{words}; of the cosine that fits the frames",
            known.modulation_index,
        ),
        Merit(
            "flicker.mitigation_probability",
            "modulation mitigation probability",
            "1",
            f"IEEE 2020-2024: share of frames within {100 * TOLERANCE:.0f} % of the mean",
            words,
            known.mitigation_probability,
        ),
    )
    try:
        check_flicker(plain.sensor)
    except InputError:
        reason = "readings of a part of the exposure see other parts of the lamp's period"
        return Definition(tuple(replace(x, computed=nan, missing=reason) for x in merits), not_measured)
    field = even_field(plain.sensor, plain.light, EXPOSURE_S, plain.channel)
    mean_cd_m2 = WHITE_SHARE * field.headroom_e / field.electrons_per_cd_m2

    def measure(rng: np.random.Generator) -> list[float]:
        chip = field.draw_chip(rng)
        dark = field.samples_e(field.shoot(0.0, chip, rng)).mean()
        phases = rng.random(FRAMES)
        rows = field.sensor.sites  # rows of photodiodes that are exposed together
        light_of = [row_weights(lamp, field.sensor, rows, EXPOSURE_S, x * lamp.period_s)[0] for x in phases.tolist()]
        frames = (field.shoot(mean_cd_m2 * float(x), chip, rng) for x in light_of)
        seen = np.array([field.samples_e(raw).mean() - dark for raw in frames])
        turns = 2 * np.pi * phases
        waves = np.stack([np.ones(FRAMES), np.cos(turns), np.sin(turns)], axis=1)
        mean, *swing = np.linalg.lstsq(waves, seen)[0].tolist()
        return [float(np.hypot(*swing)) / mean, float(np.mean(np.abs(seen / mean - 1) <= TOLERANCE))]

    return Definition(merits, measure)
