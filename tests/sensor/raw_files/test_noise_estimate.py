"""Gain and dark noise from one frame: closed forms, what texture does, and frames that tell nothing."""

import numpy as np
import pytest
from loop import loop

from sensor.raw_files.noise_estimate import estimate_noise


def frame(gain_e_per_dn: float, dark_e: float, texture: float, seed: int = 0) -> np.ndarray:
    """Bayer mosaic above black [DN]: a ramp over two decades in each half, the left one with texture."""
    rng = np.random.default_rng(seed)
    ramp = np.tile(np.geomspace(20.0, 4000.0, 384), (512, 2))
    ramp[:, :384] *= 1 + texture * rng.standard_normal((512, 384))
    electrons = rng.poisson(np.maximum(ramp, 0.0)) + dark_e * rng.standard_normal(ramp.shape)
    return np.rint(electrons / gain_e_per_dn)


@loop(("gain", "dark"), [(0.25, 3.0), (1.0, 12.0), (0.5, 20.0)])
def test_gain_and_dark_noise_come_back(gain: float, dark: float) -> None:
    # 24 bins of some 400 used blocks each: a variance to 12 %, so the slope to about 4 % (one sigma), and the dark
    # variance, which the darkest bins alone tell, to about 15 %; five sigma
    found = estimate_noise(frame(gain, dark, 0.0), 16_000.0)
    assert found is not None
    assert found.gain_e_per_dn == pytest.approx(gain, rel=0.2)
    assert found.dark_noise_e == pytest.approx(np.hypot(dark, gain / np.sqrt(12)), rel=0.4)


def test_texture_in_half_the_frame_changes_little() -> None:
    found = estimate_noise(frame(0.5, 3.0, 0.3), 16_000.0)
    assert found is not None
    assert found.gain_e_per_dn == pytest.approx(0.5, rel=0.2)


def test_clipped_highlights_do_not_pass_for_quiet_ones() -> None:
    # most of the frame lies at the white level, where clipping takes half of the noise away
    rng = np.random.default_rng(5)
    below = np.tile(np.linspace(400.0, 3600.0, 384), (512, 1))
    levels = np.hstack([below, np.full((512, 768), 3990.0)])
    dn = np.minimum(np.rint(rng.poisson(levels) / 0.5), 8000.0)
    found = estimate_noise(dn, 8000.0)
    assert found is not None
    assert found.gain_e_per_dn == pytest.approx(0.5, rel=0.1)


@loop(
    "above_black_dn",
    [
        np.full((400, 400), 100.0),
        np.random.default_rng(0).normal(100.0, 3.0, (400, 400)),
        np.random.default_rng(1).normal(100.0, 3.0, (30, 30)),
        np.full((400, 400), 990.0) + np.random.default_rng(2).normal(0.0, 3.0, (400, 400)),
        np.full((2, 2), 3.0),
    ],
)
def test_a_frame_that_tells_nothing_gives_nothing(above_black_dn: np.ndarray) -> None:
    assert estimate_noise(above_black_dn, 1000.0) is None
