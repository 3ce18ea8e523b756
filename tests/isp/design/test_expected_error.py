"""The closed form against textbook LMMSE, against signals drawn from the prior, and in its limits."""

import numpy as np
import pytest
from design_slope import error_slopes
from numpy.testing import assert_allclose
from scipy.special import ndtr

from isp.design.expected_error import Gaussians, Noise, expected_error, sample_variance, sampled, single_gaussian
from sensor.noise_law import NoiseLaw

PIXELS, COEFFICIENTS, DIRECTIONS = 6, 3, 5
MIDDLE = np.array([2, 3])


def mixture(components: int, seed: int = 1) -> Gaussians:
    rng = np.random.default_rng(seed)
    return Gaussians(
        weights=rng.dirichlet(np.ones(components)),
        means=rng.uniform(1.0, 2.0, (components, PIXELS, COEFFICIENTS)),
        factors=0.2 * rng.standard_normal((components, PIXELS, COEFFICIENTS, DIRECTIONS)),
        rest=rng.uniform(0.001, 0.01, components),
        brightness=0.3,
    )


def mosaic(seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.eye(PIXELS)[:, :, None] * rng.uniform(0.5, 1.0, (PIXELS, 1, COEFFICIENTS))


def unit_forms(components: int) -> np.ndarray:
    return np.broadcast_to(np.eye(COEFFICIENTS), (1, components, len(MIDDLE), COEFFICIENTS, COEFFICIENTS))


def covariance(prior: Gaussians, k: int) -> np.ndarray:
    factor, mean = prior.factors[k].reshape(PIXELS * COEFFICIENTS, -1), prior.brightness * prior.means[k].ravel()
    return factor @ factor.T + prior.rest[k] * np.eye(len(factor)) + np.outer(mean, mean)


def error(prior: Gaussians, scale: float, noise: Noise) -> float:
    samples = sampled(prior, mosaic(), MIDDLE, np.eye(PIXELS))
    return float(expected_error(samples, scale, noise, unit_forms(len(prior.weights)))[0])


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_one_component_gives_textbook_lmmse_and_the_blur_that_a_picture_keeps(spread: float) -> None:
    prior, noise, scale = mixture(1), Noise(NoiseLaw(shot=1.0, dark_e=2.0, prnu=0.01), full_e=np.inf), 50.0
    c, mean = covariance(prior, 0), prior.means[0].ravel()
    lens = np.eye(PIXELS) + spread * np.random.default_rng(9).random((PIXELS, PIXELS))
    sampling, blur = np.einsum("spc,pq->sqc", mosaic(), lens), np.kron(lens, np.eye(COEFFICIENTS))
    h = scale * sampling.reshape(PIXELS, -1)
    mean_e = h @ mean
    n = np.diag(mean_e + 2.0**2 + (0.01 * mean_e) ** 2)
    gain = blur @ c @ h.T @ np.linalg.inv(h @ c @ h.T + n)
    # The picture less the patch, in the patch's spread, the noise and the mean (Joseph's form).
    signal, off = gain @ h - np.eye(len(c)), (blur - np.eye(len(c))) @ mean
    left = np.diag(signal @ c @ signal.T + gain @ n @ gain.T) + off**2
    samples = sampled(prior, sampling, MIDDLE, lens)
    expected = expected_error(samples, scale, noise, unit_forms(1))
    assert_allclose(expected, left.reshape(PIXELS, -1).sum(axis=1)[MIDDLE].mean(), rtol=1e-9)


def test_draws_have_the_error_of_a_known_component_and_no_estimator_a_smaller_one() -> None:
    prior, noise, scale, draws = mixture(4), Noise(NoiseLaw(shot=1.0, dark_e=3.0), full_e=np.inf), 5.0, 4000
    rng = np.random.default_rng(4)
    h = scale * mosaic().reshape(PIXELS, -1)
    covariances = [covariance(prior, j) for j in range(4)]
    means = prior.means.reshape(4, -1)
    variance = means @ h.T + 9.0
    k = rng.choice(4, draws, p=prior.weights)
    roots = np.linalg.cholesky(covariances)
    x = means[k] + np.einsum("nij,nj->ni", roots[k], rng.standard_normal((draws, means.shape[1])))
    y = x @ h.T + np.sqrt(variance[k]) * rng.standard_normal((draws, PIXELS))
    # The posterior mean, which has the least squared error of all estimators.
    logs, estimates = [], []
    for j in range(4):
        total = h @ covariances[j] @ h.T + np.diag(variance[j])
        off = y - means[j] @ h.T
        solved = np.linalg.solve(total, off.T).T
        logs.append(np.log(prior.weights[j]) - 0.5 * ((off * solved).sum(axis=1) + np.linalg.slogdet(total)[1]))
        estimates.append(means[j] + solved @ h @ covariances[j])
    known, by_component = error(prior, scale, noise), np.array(estimates)[k, np.arange(draws)]
    squares = ((by_component - x) ** 2).reshape(draws, PIXELS, -1).sum(axis=2)[:, MIDDLE].mean(axis=1)
    assert_allclose(squares.mean(), known, atol=4.0 * squares.std() / np.sqrt(draws))  # a false alarm in 16 000 runs
    parts = np.exp(np.array(logs) - np.max(logs, axis=0))
    parts /= parts.sum(axis=0)
    squares = ((np.einsum("jn,jni->ni", parts, estimates) - x) ** 2).reshape(draws, PIXELS, -1).sum(axis=2)[:, MIDDLE]
    one_sided = 4.0 * squares.mean(axis=1).std() / np.sqrt(draws)  # a false alarm in 30 000 runs
    linear = error(single_gaussian(prior), scale, noise)
    assert squares.mean() > known - one_sided
    assert squares.mean() < linear + one_sided


def test_pooling_keeps_mean_and_covariance() -> None:
    prior, means = mixture(3), mixture(3).means.reshape(3, -1)
    mean = prior.weights @ means
    second = sum(
        w * (covariance(prior, k) + np.outer(m, m)) for k, (w, m) in enumerate(zip(prior.weights, means, strict=True))
    )
    assert_allclose(single_gaussian(prior).means.ravel(), mean, rtol=1e-12)
    assert_allclose(covariance(single_gaussian(prior), 0), second - np.outer(mean, mean), atol=1e-12)


def test_an_endless_well_has_a_smaller_error() -> None:
    ended, endless = (Noise(NoiseLaw(shot=1.0, dark_e=2.0, prnu=0.01), full_e=full_e) for full_e in (100.0, np.inf))
    assert error(mixture(3), 10.0, endless) < error(mixture(3), 10.0, ended)


def test_without_samples_the_error_is_that_of_the_prior() -> None:
    prior = mixture(2)
    blind = Noise(NoiseLaw(shot=1.0, dark_e=1e9), full_e=np.inf)
    alone = prior.weights @ [np.diag(covariance(prior, k)).reshape(PIXELS, -1)[MIDDLE].sum() for k in range(2)] / 2
    assert_allclose(error(prior, 1.0, blind), alone, rtol=1e-9)


def test_a_known_signal_has_the_information_of_a_censored_gaussian() -> None:
    """Fisher information of a sample of known noise: the variance of the score, by quadrature."""
    for mean_e in (80.0, 100.0, 115.0):
        noise = Noise(NoiseLaw(shot=0.0, dark_e=10.0), full_e=100.0)
        y = np.linspace(mean_e - 80.0, 100.0, 20001)
        density = np.exp(-(((y - mean_e) / 10.0) ** 2) / 2) / (10.0 * np.sqrt(2 * np.pi))
        step = 1e-4
        log_full = [np.log(ndtr((m - 100.0) / 10.0)) for m in (mean_e - step, mean_e + step)]
        full = np.diff(log_full)[0] ** 2 / (2 * step) ** 2 * ndtr((mean_e - 100.0) / 10.0)
        information = np.trapezoid(((y - mean_e) / 100.0) ** 2 * density, y) + full
        assert_allclose(sample_variance(np.array([mean_e]), np.zeros(1), noise)[0], 1 / information, rtol=1e-5)


def test_a_lone_sample_that_may_be_full_leaves_what_draws_leave() -> None:
    """The variance of the signal given a sample, or given that it is full, of a million draws; five deviations."""
    rng, spread, draws = np.random.default_rng(3), 900.0, 1_000_000
    noise = Noise(NoiseLaw(shot=0.0, dark_e=10.0), full_e=100.0)
    for mean_e in (80.0, 100.0, 150.0):
        signal = mean_e + 30.0 * rng.standard_normal(draws)
        total = signal + 10.0 * rng.standard_normal(draws)
        full = total > 100.0
        estimate = np.where(full, signal[full].mean(), mean_e + (total - mean_e) * spread / (spread + 100.0))
        squares = (signal - estimate) ** 2
        variance = sample_variance(np.array([mean_e]), np.array([spread]), noise)[0]
        alarm = 5 * squares.std() / np.sqrt(draws)  # in one of 1.7 million runs
        assert_allclose(squares.mean(), spread * variance / (spread + variance), atol=alarm)


def test_of_three_samples_that_may_be_full_the_error_is_near_that_of_draws() -> None:
    """Exact by draws of what is hidden, for neighbours alike and unlike; the form is a quarter off at most."""
    rng, noise = np.random.default_rng(5), Noise(NoiseLaw(shot=0.0, dark_e=10.0), full_e=100.0)
    for alike, means in [(0.5, (80.0, 100.0, 120.0)), (0.9, (80.0, 95.0, 110.0)), (0.9, (120.0, 120.0, 120.0))]:
        signal, mean_e = 900.0 * (alike + (1 - alike) * np.eye(3)), np.array(means)
        total = signal + 100.0 * np.eye(3)
        gain = np.linalg.solve(total, signal)  # (sample, pixel)
        left = np.trace(signal - signal @ gain)
        exact = []
        for z in mean_e + rng.standard_normal((150, 3)) @ np.linalg.cholesky(total).T:
            full = z > 100.0
            known = np.linalg.solve(total[np.ix_(~full, ~full)], total[np.ix_(~full, full)])
            middle = mean_e[full] + (z - mean_e)[~full] @ known
            root = np.linalg.cholesky(total[np.ix_(full, full)] - total[np.ix_(full, ~full)] @ known)
            draws = middle + rng.standard_normal((20000, full.sum())) @ root.T
            draws = draws[(draws > 100.0).all(axis=1)]
            exact.append(left + ((draws @ gain[full]).var(axis=0).sum() if len(draws) > 50 else 0.0))
        variance = sample_variance(mean_e, np.diag(signal), noise)
        form = np.trace(signal - signal @ np.linalg.solve(signal + np.diag(variance), signal))
        assert_allclose(form, np.mean(exact), rtol=0.25)


def test_the_slope_is_that_of_differences() -> None:
    """Central differences, one entry of H after another; some samples are half full."""
    noise = Noise(NoiseLaw(shot=1.0, dark_e=2.0, prnu=0.01), full_e=60.0)
    prior, rng = mixture(3), np.random.default_rng(7)
    sampling, scales = mosaic(), (40.0, 3.0)
    rows = [[rng.standard_normal((3, len(MIDDLE), d, COEFFICIENTS)) for d in (2, 1)] for _ in scales]

    def errors_of(h: np.ndarray) -> np.ndarray:
        samples = sampled(prior, h, MIDDLE, np.eye(PIXELS))
        by_scene = [
            expected_error(samples, scale, noise, np.stack([row.swapaxes(-1, -2) @ row for row in metrics]))
            for scale, metrics in zip(scales, rows, strict=True)
        ]  # fmt: skip
        return np.mean(by_scene, axis=0)

    unlit = (np.array([0.1, 0.2]), noise)
    errors, slopes = (x[1] for x in error_slopes(prior, sampling, MIDDLE, [unlit, (np.array(scales), noise)], rows))
    assert_allclose(errors, errors_of(sampling), rtol=1e-10)
    for place in np.ndindex(sampling.shape):
        step = np.zeros_like(sampling)
        step[place] = 3e-5
        difference = (errors_of(sampling + step) - errors_of(sampling - step)) / 6e-5
        atol = 1e-9 * np.abs(slopes).max()
        assert_allclose(slopes[:, *place], difference, rtol=1e-6, atol=atol, err_msg=str(place))
