"""Invariants of expected electrons: monotone and linear in light, reciprocal in light and time, shifted along."""

from dataclasses import replace

import numpy as np
from hard.case import Margin, Situation, worst_of
from hard.chain import expected
from numpy.typing import NDArray

from rodcone.types import Image
from sensor.optics import spreads

UNIT = 2.0**-24  # roundoff of single precision
NOTHING_E = 1e-12  # one photo-electron in 10^12 exposures: more than subnormal numbers lose
# Of the frame's sum, where a lens spreads light: an FFT errs by 7 u log2(n) of its norm at most (Higham, "Accuracy and
# Stability of Numerical Algorithms", theorem 24.2); there and back, n = 64 x 64, and two results compared.
TRANSFORM = 2 * 2 * 12 * 7 * 2.0**-53
STEP = 3.0  # factors between radiances; no power of two, which would be exact whatever the code does


def monotone(situation: Situation) -> Margin:
    """More light never gives fewer electrons: each value of the radiance is raised by a random share, 0 to 1e-3."""
    values = situation.radiance.values
    raised = values.astype(np.float64) * (1 + 1e-3 * np.random.default_rng(8).uniform(0.0, 1.0, values.shape))
    raised = np.minimum(raised, np.finfo(values.dtype).max).astype(values.dtype)
    before, after = _electrons(situation, values), _electrons(situation, np.maximum(raised, values))
    return worst_of(np.maximum(before - after, 0.0), _allowed(before, situation), "e⁻")


def linear(situation: Situation) -> Margin:
    """Two lights together give the sum of what each gives alone. The second light is the scene upside down."""
    values = situation.radiance.values
    part = values / values.dtype.type(STEP)
    other = np.ascontiguousarray(part[::-1])
    together = _electrons(situation, part + other)
    alone = _electrons(situation, part) + _electrons(situation, other)
    return worst_of(together - alone, _allowed(alone, situation), "e⁻")


def reciprocal(situation: Situation) -> Margin:
    """Three times the light in a third of the exposure gives the same electrons (without dark current)."""
    values = situation.radiance.values
    shorter = replace(situation, exposure_s=situation.exposure_s / STEP)
    same, once = _electrons(shorter, values * values.dtype.type(STEP)), expected(situation)
    return worst_of(same - once, _allowed(once, situation), "e⁻")


def shifted(situation: Situation) -> Margin | None:
    """A scene shifted by a tile gives electrons shifted by a tile, in the frame's inner half; not tried with cos^4."""
    tile, samples = (len(situation.sensor.cfa), len(situation.sensor.cfa[0])), situation.samples_per_pixel
    height, width = situation.shape
    inside = slice(height // 4, height - height // 4), slice(width // 4, width - width // 4)
    kept = tuple(slice(part.start * samples, part.stop * samples) for part in inside)
    if situation.sensor.lens.horizontal_view_deg or height < 4 * tile[0] or width < 4 * tile[1]:
        return None
    values = np.zeros_like(situation.radiance.values)  # dark outside, so that the border's mirror image stays as it is
    values[kept] = situation.radiance.values[kept]
    moved = np.roll(values, [samples * size for size in tile], (0, 1))
    before = np.roll(_electrons(situation, values), tile, (0, 1))[inside]
    return worst_of(_electrons(situation, moved)[inside] - before, _allowed(before, situation), "e⁻")


def _electrons(situation: Situation, values: NDArray[np.floating]) -> Image:
    """Electrons expected from other values of the radiance."""
    return expected(replace(situation, radiance=replace(situation.radiance, values=values)))


def _allowed(electrons: Image, situation: Situation) -> Image:
    """What single precision loses of each pixel's sum over bands, and double precision where a lens spreads light.

    A sum of n products errs by n + 2 roundings at most, the factors' own among them (Higham, section 3.1); two results
    are compared.
    """
    transform = TRANSFORM * electrons.sum() if spreads(situation.sensor.lens) else 0.0
    roundings = 2 * (situation.radiance.wavelength_nm.size + 2)
    return np.asarray(roundings * UNIT * electrons + transform + NOTHING_E)
