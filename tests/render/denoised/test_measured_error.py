"""The squared error of a picture, measured against two independent pictures: known errors are recovered."""

import numpy as np
import pytest
from loop import loop

from render.denoised.relight import measured_error

# Student's 95 % quantile with 15 degrees of freedom (Fisher and Yates, table III).
STUDENT_15 = 1.753


def test_closed_form_of_blocks() -> None:
    block_error = np.arange(16.0).reshape(4, 4)
    picture = np.sqrt(np.kron(block_error, np.ones((16, 16))))
    found = measured_error(picture, picture, np.ones((64, 64)))
    assert found.mean == pytest.approx(7.5)
    error = np.std(np.arange(16.0), ddof=1) / 4  # of a mean of 16 blocks
    assert found.standard_error == pytest.approx(error)
    assert found.upper == pytest.approx(7.5 + STUDENT_15 * error, rel=1e-3)


def test_weights_and_channels() -> None:
    picture = np.stack([np.full((32, 32), 2.0), np.full((32, 32), 3.0)])
    weight = np.stack([np.full((32, 32), 0.5), np.zeros((32, 32))])
    found = measured_error(picture, picture, weight)
    assert found.mean == pytest.approx(0.5 * 2**2 / 2)  # of two channels one counts, by half
    assert found.standard_error == pytest.approx(0.0, abs=1e-12)


def test_blocks_at_the_edge_count_by_their_pixels() -> None:
    even = np.full((70, 45), 3.0)
    found = measured_error(even, even, np.ones_like(even))
    assert (found.mean, found.standard_error) == pytest.approx((9.0, 0.0), abs=1e-9)


def test_a_negative_estimate_charges_no_negative_limit() -> None:
    one = np.ones((64, 64))
    found = measured_error(one, -one, one)
    assert found.mean == pytest.approx(-1.0)
    assert found.upper == 0.0


@loop("bias", [0.0, 0.3])
def test_known_bias_and_noise_are_recovered(bias: float) -> None:
    """A picture with a smooth bias and its own noise, folds of four times its variance; 400 frames.

    The mean of the estimates lies within 4 of its standard errors of the truth (false alarms: 6e-5). The limit is under
    the truth in 5 % of the frames: in 400 of a binomial at most 36, and 6 or more, but for 1e-3 on each side. The
    bias is the frame's own and doesn't vary from draw to draw, so that blocks take it for noise: with it fewer.
    """
    rng, frames, noise = np.random.default_rng(5), 400, 0.1
    shape = 0.2 + np.abs(np.sin(np.linspace(0, 3, 96))[:, None] * np.cos(np.linspace(0, 5, 80)))
    means, under = [], 0
    for _ in range(frames):
        truth = bias * shape
        picture, one, other = (rng.normal(0, scale * noise, shape.shape) for scale in (1, 2, 2))
        found = measured_error(picture + truth - one, picture + truth - other, np.ones(shape.shape))
        means.append(found.mean)
        # The error of this frame's picture is what is asked for, its own noise included.
        under += found.upper < np.mean((picture + truth) ** 2)
    expected = np.mean(truth**2) + noise**2
    assert abs(np.mean(means) - expected) < 4 * np.std(means, ddof=1) / frames**0.5
    assert under <= 36
    if bias == 0:
        assert under >= 6
