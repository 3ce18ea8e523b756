"""Figures of information from a slanted edge: noise equivalent quanta, an ideal observer's ratio, and capacity.

Koren (Electronic Imaging 2024) defines them for an edge with levels b and d, a transfer M(f) and white noise of
variance n per pixel, with f in cycles per pixel:

    noise equivalent quanta   q(f) = ((b + d) / 2)^2 M(f)^2 / n
    ideal observer's ratio    s^2 = (b - d)^2 integral |G|^2 M^2 / n    over both axes up to Nyquist,
    capacity                  c = integral from 0 to 1/2 of 2 pi f log2(1 + (b - d)^2 M(f)^2 / (12 n)).

G is the Fourier transform of a square object. The 12 comes from signals that are uniformly distributed between d and b,
whose variance is (b - d)^2 / 12.
"""

from math import log10

import numpy as np

from rodcone.types import Floats
from studies.score.figure import Merit

OBJECT_PX = 3.0  # side of the square object that the ideal observer looks for
KOREN = "Koren 2024, image information metrics from slanted edges"
STEPS = 400  # steps of each integral from 0 to Nyquist


def information(frequency: Floats, mtf: Floats, bright_e: float, dark_e: float, noise_e2: float) -> list[float]:
    """Return the quanta at half Nyquist, the ideal observer's ratio [dB] and the capacity [bits per pixel]."""
    middles = (np.arange(STEPS) + 0.5) / (2 * STEPS)
    power = np.interp(middles, frequency, mtf) ** 2 / noise_e2
    quanta = ((bright_e + dark_e) / 2 * float(np.interp(0.25, frequency, mtf))) ** 2 / noise_e2
    shape = np.sinc(OBJECT_PX * middles) ** 2
    around = np.interp(np.hypot(middles[:, None], middles), frequency, mtf) ** 2 / noise_e2
    seen = OBJECT_PX**4 * float(shape @ around @ shape) / STEPS**2  # the integral over four quadrants of (1/2)^2 each
    bits = np.log2(1 + (bright_e - dark_e) ** 2 * power / 12)
    return [
        quanta,
        10 * log10((bright_e - dark_e) ** 2 * seen),
        float(np.sum(2 * np.pi * middles * bits) / (2 * STEPS)),
    ]


def information_merits(words: str, figures: list[float]) -> tuple[Merit, ...]:
    """Return the three figures as merits, under the conditions `words`."""
    return (
        Merit(
            "information.neq_half_nyquist",
            "noise equivalent quanta at half the Nyquist frequency",
            "quanta/px",
            KOREN,
            words,
            figures[0],
        ),
        Merit(
            "information.snri",
            f"ideal observer's ratio for a square of {OBJECT_PX:g} pixels",
            "dB",
            KOREN,
            f"{words}, the square has the edge's contrast",
            figures[1],
        ),
        Merit(
            "information.capacity",
            "information capacity",
            "bits/px",
            KOREN,
            f"{words}, levels evenly between the edge's",
            figures[2],
        ),
    )
