"""Invariants of expected electrons: monotone and linear in light, reciprocal in light and time, shifted along."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from sensor.optics import spreads
from studies.stress_case import Margin, Situation, worst_of
from studies.stress_chain import expected

Image = NDArray[np.float64]

TOLERANCE = 1e-6  # of the expected electrons of each pixel
NOTHING_E = 1e-12  # a photo-electron in 10^12 exposures: what subnormal numbers lose is less
# Of the frame's sum, where a lens spreads light: an FFT errs by 7 u log2(n) of its norm at most (Higham, "Accuracy and
# Stability of Numerical Algorithms", theorem 24.2); there and back, n = 64 x 64, and two results compared.
TRANSFORM = 2 * 2 * 12 * 7 * 2.0**-53
STEP = 3.0  # factors between radiances; no power of two, which would be exact whatever the code does


def monotone(situation: Situation) -> Margin:
    """More light never gives fewer electrons: every value of the radiance raised by a share of its own, 0 to 1e-3."""
    seen = situation.radiance
    raised = seen.values.astype(np.float64) * (1 + 1e-3 * _shares(seen.values.shape))
    most = np.finfo(seen.values.dtype).max
    more = _with(seen, np.maximum(np.minimum(raised, most).astype(seen.values.dtype), seen.values))
    before, after = _electrons(situation, seen), _electrons(situation, more)
    return worst_of(np.maximum(before - after, 0.0), _allowed(before, situation), "e⁻")


def linear(situation: Situation) -> Margin:
    """Two lights together give the sum of what each gives alone: the scene upside down is added to a part of it."""
    seen = situation.radiance
    part = seen.values / seen.values.dtype.type(STEP)
    other = np.ascontiguousarray(part[::-1])
    together = _electrons(situation, _with(seen, part + other))
    alone = _electrons(situation, _with(seen, part)) + _electrons(situation, _with(seen, other))
    return worst_of(together - alone, _allowed(alone, situation), "e⁻")


def reciprocal(situation: Situation) -> Margin:
    """Three times the light in a third of the exposure gives the same electrons (without dark current)."""
    brighter = _with(situation.radiance, situation.radiance.values * situation.radiance.values.dtype.type(STEP))
    same = expected(replace(situation, radiance=brighter, exposure_s=situation.exposure_s / STEP))
    once = _electrons(situation, situation.radiance)
    return worst_of(same - once, _allowed(once, situation), "e⁻")


def shifted(situation: Situation) -> Margin | None:
    """A scene shifted by a tile gives electrons shifted by a tile, between the frame's quarters; not with cos^4."""
    tile, samples = (len(situation.sensor.cfa), len(situation.sensor.cfa[0])), situation.samples_per_pixel
    height, width = situation.shape
    inside = slice(height // 4, height - height // 4), slice(width // 4, width - width // 4)
    kept = tuple(slice(part.start * samples, part.stop * samples) for part in inside)
    if situation.sensor.lens.horizontal_view_deg or height < 4 * tile[0] or width < 4 * tile[1]:
        return None
    values = np.zeros_like(situation.radiance.values)  # dark outside, so that the border's mirror image stays as it is
    values[kept] = situation.radiance.values[kept]
    moved = _with(situation.radiance, np.roll(values, [samples * size for size in tile], (0, 1)))
    before = np.roll(_electrons(situation, _with(situation.radiance, values)), tile, (0, 1))[inside]
    return worst_of(_electrons(situation, moved)[inside] - before, _allowed(before, situation), "e⁻")


def _electrons(situation: Situation, radiance: SpectralRadiance) -> Image:
    return expected(replace(situation, radiance=radiance))


def _allowed(electrons: Image, situation: Situation) -> Image:
    """A millionth of each pixel's electrons; besides what double precision loses where light of bright ones spreads."""
    transform = TRANSFORM * electrons.sum() if spreads(situation.sensor.lens) else 0.0
    return np.asarray(TOLERANCE * electrons + transform + NOTHING_E)


def _with(radiance: SpectralRadiance, values: NDArray[np.floating]) -> SpectralRadiance:
    return SpectralRadiance(values, radiance.wavelength_nm, 0.0, radiance.width_nm)


def _shares(shape: tuple[int, ...]) -> Image:
    return np.random.default_rng(8).uniform(0.0, 1.0, shape)
