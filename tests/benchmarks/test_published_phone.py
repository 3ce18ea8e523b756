"""The published telephone's noise: the preset's windows have the variance that its numbers say in closed form."""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from published_phone import DN_PER_E, FRAMES, MEAN_DN, VARIANCE_DN2, WINDOW, green_dn, phone  # noqa: E402

CHIPS = 40


def test_windows_have_the_variance_of_the_published_numbers_and_the_camera_s_lies_among_them() -> None:
    windows = [green_dn(phone(), MEAN_DN, 2 * WINDOW, FRAMES, chip) for chip in range(CHIPS)]
    assert windows[0].shape == (FRAMES, WINDOW**2)
    read_dn, dsnu_dn = 0.226 / 0.44875, 0.038 / 0.44875
    temporal = DN_PER_E * MEAN_DN + read_dn**2 + 1 / 12
    fixed = dsnu_dn**2 + (0.005444 * MEAN_DN) ** 2
    variances = np.array([window.var() for window in windows])
    expected = temporal + fixed * (1 - 1 / WINDOW**2)
    scatter = np.hypot(temporal * (2 / windows[0].size) ** 0.5, fixed * (2 / WINDOW**2) ** 0.5)  # of one window
    assert abs(variances.mean() - expected) < 5 * scatter / CHIPS**0.5
    assert abs(VARIANCE_DN2 - expected) < 2 * scatter  # published: 57.8 for 58.1 ± 2.0
