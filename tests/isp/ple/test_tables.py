"""One component's estimate: closed forms, and what drawn signals show of them."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from isp.ple.pick import pick
from isp.ple.prior import LETTERS, PATCH, Mixture, mixture, own_prior
from isp.ple.tables import PILOT_VARIANCE, Sampling, Table, one_frame, window
from isp.ple.units import readings
from sensor.cfa import BAYER, MOSAICS, RGBW

GAINS = (0.5, 1.0, 0.45, 4.9)
SIGMAS = 4.5  # of a normal deviate: 1 in 150 000


def mosaic_rows(tile):
    sides = len(tile), len(tile[0])
    return tuple(
        4 * (PATCH * y + x) + LETTERS.index(tile[y % sides[0]][x % sides[1]])
        for y in range(PATCH)
        for x in range(PATCH)
    )


def sampling(tile=RGBW, prnu=0.01):
    return Sampling(PATCH, mosaic_rows(tile), GAINS, (1.8,) * 4, prnu)


def drawn(table: Table, k: int, light_e: float, count: int, rng):
    """Values of a component in units of noise, and their samples with noise."""
    mix, at = table.mix, table.rows
    factor = np.linalg.cholesky(mix.covariances[k].astype(np.float64) + 1e-9 * np.eye(len(table.values[k])))
    values = table.values[k] + rng.standard_normal((count, len(factor))) @ factor.T * table.slopes[k]
    values += rng.standard_normal((count, 1)) * table.drift[k]
    electrons = np.tile(GAINS, 64)[at] * light_e * (mix.means[k] ** 2 + np.diag(mix.covariances[k]))[at]
    noise = np.sqrt(variance(electrons))
    return values, (values[:, at] + noise * rng.standard_normal((count, len(at)))).astype(np.float32)


def variance(electrons, prnu=0.01):
    """Of a reading at a dark noise of 1.8 e-; `test_units` holds the curves."""
    curves = readings(1.8)
    return curves.variance(electrons) + (prnu * electrons * curves.slope(electrons)) ** 2


def _with_1(y):
    return np.concatenate([y, np.ones((len(y), 1))], axis=1)


@pytest.mark.sample(4)
@pytest.mark.parametrize("tile", [RGBW, BAYER, *(MOSAICS[name] for name in ("rgbw_4x4", "quad_bayer", "quad_rgbw"))])
@pytest.mark.parametrize("light_e", [0.5, 20.0, 2000.0])
def test_over_signals_drawn_from_the_prior_the_error_is_0_in_the_mean_and_varies_as_the_closed_form(tile, light_e):
    rng, count = np.random.default_rng(1), 3000
    table = Table(mixture(own_prior()), sampling(tile), light_e)
    for k in (0, 17, 40):
        values, y = drawn(table, k, light_e, count, rng)
        by = table.estimator(k)
        over = (_with_1(y) @ by.linear[: len(table.rows) + 1]) / np.repeat(window(PATCH).ravel(), 4)
        error = over + np.tile(table.sampling.black, PATCH**2) - values
        deviation = error.std(axis=0)
        assert np.abs(error.mean(axis=0) / deviation).max() < SIGMAS / np.sqrt(count) + 0.01
        for channel in range(4):
            # of the variances' means over pixels, which go together: a chi-square of `count` draws at the least
            assert (deviation**2)[channel::4].mean() == pytest.approx(
                by.variance[channel], rel=SIGMAS * (2 / count) ** 0.5
            )


def test_with_a_pilot_the_error_varies_as_the_closed_form():
    rng, count, k, told, light_e = np.random.default_rng(2), 3000, 17, 0.05, 2.0
    table = Table(mixture(own_prior()), sampling(), light_e)
    values, y = drawn(table, k, light_e, count, rng)
    by = table.estimator(k)
    pilot = np.linalg.inv(
        table.whitening(k).turn.T @ table.whitening(k).turn
    )  # its error's covariance, at a noise of 1
    means = values @ table.average.T + rng.multivariate_normal(np.zeros(4), pilot * told, count)
    told_all = np.concatenate([_with_1(y), means], axis=1)
    news = (told_all @ table.whitening(k).reads)[:, len(table.rows) :]
    spread = told + table.whitening(k).spread
    assert (news**2).mean(axis=0) == pytest.approx(spread, rel=SIGMAS * (2 / count) ** 0.5)
    error = np.concatenate([_with_1(y), news / spread], axis=1) @ by.linear
    error = error / np.repeat(window(PATCH).ravel(), 4) + np.tile(table.sampling.black, PATCH**2) - values
    expected = by.variance - (1 / spread) @ by.pilot_variance
    for channel in range(4):
        assert (error**2)[:, channel::4].mean() == pytest.approx(expected[channel], rel=SIGMAS * (2 / count) ** 0.5)
    # What channels share, brightness, is most of it: colour is known better.
    colour, brightness = np.linalg.eigvalsh(pilot)[[2, 3]]
    assert brightness > PILOT_VARIANCE > 10 * colour


def test_one_component_is_the_textbooks_linear_estimate():
    rng = np.random.default_rng(3)
    root = rng.normal(0, 0.05, (256, 30))
    covariance = root @ root.T + 1e-4 * np.eye(256)
    mix = Mixture(PATCH, np.zeros(1), rng.uniform(0.5, 1.5, (1, 256)), covariance[None].astype(np.float32))
    given, light = sampling(prnu=0.0), 30.0
    at, gains = np.array(given.rows), np.tile(given.gains, 64)
    # by hand, in units of noise: t, slope 2 g m u dt/de, noise r
    electrons = gains * light * (mix.means[0] ** 2 + np.diag(covariance))
    noise, reading = variance(electrons, prnu=0.0), readings(1.8).mean(electrons)
    slope = 2 * gains * light * mix.means[0] * readings(1.8).slope(electrons)
    table = Table(mix, given, light)
    whole = slope[:, None] * covariance * slope + np.outer(table.drift[0], table.drift[0])
    y = reading[at] + rng.normal(0, 2, 64)
    gain = np.linalg.solve(whole[np.ix_(at, at)] + np.diag(noise[at]), whole[at]).T
    expected = reading + gain @ (y - reading[at])
    by = table.estimator(0)
    found = _with_1(y[None])[0] @ by.linear[:65] / np.repeat(window(PATCH).ravel(), 4)
    assert found + np.tile(given.black, PATCH**2) == pytest.approx(expected, rel=2e-4)
    left = np.diag(whole) - np.einsum("ij,ji->i", gain, whole[at])
    assert by.variance == pytest.approx([left[channel::4].mean() for channel in range(4)], rel=1e-4)


def test_of_cells_with_one_channel_each_the_likeliest_component_is_picked():
    """By the normal density of samples and, where there is a pilot, of its four means together."""
    for pilot_noise in [None, 0.05, 2.0]:
        # 16 samples, fewer than the directions of other patches: all but one direction is held against each component
        rng, light_e = np.random.default_rng(4), 50.0
        rows = tuple(4 * (4 * y + x) + LETTERS.index(BAYER[y % 2][x % 2]) for y in range(4) for x in range(4))
        mix, at = mixture(own_prior(), 4), np.array(rows)
        table = Table(mix, Sampling(4, rows, GAINS, (1.8,) * 4, 0.01), light_e)
        seen = np.eye(64)[at]
        electrons = (np.tile(GAINS, 16) * light_e * (mix.means**2 + np.diagonal(mix.covariances, axis1=1, axis2=2)))[
            :, at
        ]
        noise = variance(electrons)[:, :, None] * np.eye(16)
        if pilot_noise is not None:
            seen = np.concatenate([seen, table.average])
            pilot = pilot_noise * np.linalg.inv(table.whitening(0).turn.T @ table.whitening(0).turn)
            noise = np.stack([block_diag(one, pilot) for one in noise])
        means = table.values @ seen.T
        whole = mix.covariances * table.slopes[:, :, None] * table.slopes[:, None]
        whole += table.drift[:, :, None] * table.drift[:, None]
        covariances = seen @ whole @ seen.T + noise
        draws = [rng.multivariate_normal(*component, 20) for component in zip(means, covariances, strict=True)]
        samples = np.concatenate(draws)
        off = samples[:, None] - means
        squares = np.einsum("nki,kij,nkj->nk", off, np.linalg.inv(covariances), off, optimize=True)
        likelihood = mix.log_weights - 0.5 * (np.linalg.slogdet(covariances)[1] + squares)
        known = np.concatenate([_with_1(samples[:, :16]), samples[:, 16:]], axis=1).astype(np.float32)
        variances = None if pilot_noise is None else np.full(len(known), pilot_noise, np.float32)
        chosen, misfit = pick(table, known, variances)
        missed = likelihood.max(axis=1) - likelihood[np.arange(len(known)), chosen]
        assert (missed > 0.01).mean() < 0.01, pilot_noise
        assert misfit.mean() == pytest.approx(1.0, abs=0.1), pilot_noise


def test_within_one_frame_a_table_lets_its_components_go():
    table = Table(mixture(own_prior()), sampling(), 20.0)
    first = table.estimator(3)
    table.end_frame()
    assert table.estimator(3) is first
    with one_frame():
        table.end_frame()
    assert table.estimator(3) is not first
    assert np.array_equal(table.estimator(3).linear, first.linear)
