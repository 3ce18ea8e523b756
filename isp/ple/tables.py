"""The prior at one light in a frame's own units of noise: likelihoods of its components, and the estimate by each.

In units of noise (`isp.ple.units`) a sample of e expected electrons has the mean reading t(e) and noise of variance r.
In a patch of light m and roots of signal u, a sample of channel c with gain g_c has e = m g_c u^2. Near a component's
mean, t is treated as linear in u, so that each component is a Gaussian over t as well. Its estimate from the mosaic's
samples y is the linear one with the least squared error, t + C_xy (C_yy + N)^-1 (y - t_y), where N holds the noise r.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from isp.ple.fine_lines import LEAST_ALIASED, aliased, with_fine_lines
from isp.ple.prior import PATCH, Mixture, Prior, mixture
from isp.ple.units import readings
from rodcone.types import Floats, Singles

STEP = 1.25  # ratio of light from one table to the next brighter one
LIGHT_ERROR = 0.12  # relative standard deviation of the error of a patch's light, including that by `STEP`
PILOT_ERROR = 0.03  # further error of a coarser scale's means, beside their variance [share of the light]
PILOT_VARIANCE = 0.02  # typical variance of a coarser scale's means [units of noise^2]
BRIGHTNESS = 0.98  # share of that variance that lies in brightness; a coarser scale knows colour much better
TAPER = 1.0  # power of the half sine by which a patch's pixels are weighted
DIRECTIONS = 20  # number of directions for the approximate likelihood, which selects candidates
# A component is a candidate for a patch if its approximate log likelihood is less than this below the largest. The
# first number holds if the directions beyond `DIRECTIONS` hold only noise, the second if they hold only signal.
MARGINS = (5.0, 15.0)
# Number of tables that are kept, which suffices for a 4x4 tile over six decades of light. A table has 0.6 MB, and for
# 8x8 pixels 90 kB more per component that a patch has needed.
_TABLES = 512
_ONE_FRAME = ContextVar("one_frame", default=False)


@contextmanager
def one_frame() -> Iterator[None]:
    """Keep no whitenings and estimators for further frames within a ``with`` block.

    This saves 100 MB for a frame of 0.3 Mpx. A further frame would take a second of a processor more to compute them
    again.
    """
    token = _ONE_FRAME.set(True)
    try:
        yield
    finally:
        _ONE_FRAME.reset(token)


@dataclass(frozen=True)
class Sampling:
    """How a patch is sampled, the same all over a scale.

    Attributes
    ----------
    size : int
        Side of a patch [pixels].
    rows : tuple of int
        Places of the samples in the patch's vector, 4 * pixel + channel.
    gains : (4,) tuple of float
        Electrons that white gives in a sample of each channel at unit light.
    dark_e : (4,) tuple of float
        Dark noise of a sample [e-].
    prnu : float
    """

    size: int
    rows: tuple[int, ...]
    gains: tuple[float, ...]
    dark_e: tuple[float, ...]
    prnu: float

    @cached_property
    def black(self) -> Singles:
        """Return the mean reading of a sample without light, by channel [units of noise]."""
        return np.array([readings(dark_e).mean(np.zeros(1))[0] for dark_e in self.dark_e], np.float32)


@dataclass(frozen=True, eq=False)
class Estimator:
    """One component's estimate at one light, for samples y and a coarser scale's means p.

    Attributes
    ----------
    linear : (sample + 5, value) float32
        Matrix that is applied to the samples, the number 1, and the pilot's innovation over its variance in each of
        four directions. It gives mean readings minus `Sampling.black`, times the window.
    variance, noise : (4,) float64
        Posterior variance of a pixel given the samples alone, the mean per channel; and this over the variance of a
        sample's noise.
    inner : (4,) float64
        Posterior variance of the mean over the patch's middle half, per channel.
    pilot_variance, pilot_inner : (4, 4) float64
        How much the pilot reduces `variance` and `inner` in each direction (row), times the innovation's variance.
    """

    linear: Singles
    variance: Floats
    noise: Floats
    inner: Floats
    pilot_variance: Floats
    pilot_inner: Floats


def taper(size: int) -> Singles:
    """Return the weights of a patch's rows where patches overlap; they fall towards the edges, which are uncertain."""
    return np.asarray(np.sin(np.pi * (np.arange(size) + 0.5) / size) ** TAPER, dtype=np.float32)


def window(size: int) -> Singles:
    """Return the weight of each pixel of a patch where patches overlap, shape (size, size)."""
    return np.outer(taper(size), taper(size))


@dataclass(frozen=True, eq=False)
class Whitening:
    """Linear map from a patch's evidence to numbers that are independent if the patch comes from one component.

    Attributes
    ----------
    reads : (sample + 5, sample + 4) float32
        Matrix that is applied to the samples, the number 1 and the pilot's means. It gives whitened samples, which have
        variance 1, and the pilot's innovations (the part of the pilot that the samples don't predict) in four
        directions that are independent given the samples.
    log_scale : float
        Log likelihood of samples that equal the component's mean, plus the log of the component's weight.
    spread : (4,) float64
        Variance of the innovations without the pilot's own noise.
    turn : (4, 4) float64
        Matrix from the pilot's means to the four directions.
    """

    reads: Singles
    log_scale: float
    spread: Floats
    turn: Floats


@dataclass(frozen=True, eq=False)
class Among:
    """Moments of a mixture that don't depend on the light, from which the tables of a sampling are made.

    Attributes
    ----------
    squares : (component, value) float64
        Mean squares of the roots of signal.
    samples : (component, sample, sample) float64
        Covariances of the roots of signal at the samples.
    by_channel : (component, channel, pixel, value) float32
        Covariances of the roots of signal, each channel's at every pixel with all values.
    """

    squares: Floats
    samples: Floats
    by_channel: Singles


class Table:
    """All components at one light, and the quick, approximate likelihood that selects candidates among them.

    A component's whitening and estimator are made when a patch first needs them, because most tables need only one in
    four of their components.
    """

    def __init__(self, mix: Mixture, sampling: Sampling, light: float) -> None:
        self.mix, self.sampling, self.rows = mix, sampling, np.array(sampling.rows)
        pixels = mix.size**2
        self.trained = len(mix.means) - mix.lines
        at = self.rows
        among = _among(mix, sampling.rows)
        gains, dark = (np.tile(values, pixels) for values in (sampling.gains, sampling.dark_e))
        self.unit_e = gains * light  # electrons of a signal of 1
        # Each component's mean readings t, their slopes over electrons, and the variance by noise.
        electrons = self.unit_e * among.squares
        self.values, steep, noise = (np.empty_like(electrons) for _ in range(3))
        for channel, dark_e in enumerate(sampling.dark_e):
            places = (slice(None), slice(channel, None, 4))
            self.values[places], steep[places], noise[places] = readings(dark_e).moments(electrons[places])
        self.black, self.taper = np.tile(sampling.black, pixels), np.repeat(window(mix.size), 4)
        # `average` turns a patch's values into the pilot, which is the patch's mean per channel.
        self.average = np.tile(np.eye(4), pixels) / pixels
        self.unit = (1.0 / (steep**2 * (electrons + dark**2))) @ self.average.T
        signal = electrons * steep
        noise += (sampling.prnu * signal) ** 2
        self.noise = noise[:, at]
        self.slopes = 2.0 * self.unit_e * mix.means * steep
        information = gains[at] ** 2 / (self.unit_e[at] + dark[at] ** 2)
        self.drift = signal * np.hypot(LIGHT_ERROR, 1 / (light * np.sqrt(information.sum())))
        brightness = (self.average @ signal[: self.trained].T).mean(axis=1)
        self.pilot_floor = float(((PILOT_ERROR * brightness) ** 2).mean())
        along = brightness / np.linalg.norm(brightness)
        error = PILOT_VARIANCE * (4 * BRIGHTNESS * np.outer(along, along) + (1 - BRIGHTNESS) * np.eye(4))
        white = np.linalg.inv(np.linalg.cholesky(error + np.diag((PILOT_ERROR * brightness) ** 2)))
        self.white = white.astype(np.float32)  # scales the pilot's errors to variance 1, if `noise` of `pick` is 1
        # The pilot's covariances with the samples, and with itself.
        slopes = self.slopes.reshape(len(electrons), pixels, 4).swapaxes(1, 2) / pixels
        lean = (slopes.astype(np.float32)[:, :, None] @ among.by_channel)[:, :, 0] * self.slopes[:, None]
        drift = (self.average @ self.drift.T).T
        self.pilot_samples = lean[:, :, at] + drift[:, :, None] * self.drift[:, None, at]
        self.pilot_pilot = lean @ self.average.T + drift[:, :, None] * drift[:, None]
        # Coarser scales see fine lines as a colour. An error as large as the light makes the pilot count for nothing.
        self.pilot_pilot[self.trained :] += np.diag(brightness**2)
        # What fine lines of contrast 1 would add to the pilot's means, and the least such part for which lines are
        # tried; both are relative to typical means.
        sampled = np.isin(np.arange(4), at % 4) / (self.average @ (self.values[: self.trained] - self.black).T).mean(
            axis=1
        )
        self.aliased = (aliased(at, mix.size) * sampled).astype(np.float32)
        self.least_aliased = (LEAST_ALIASED * sampled).astype(np.float32)
        self.centre, self.directions, self.quick, outside = self._quick_likelihood()
        # The more signal lies in the directions that the quick likelihood leaves out, the more wrong it may be.
        share = 1.0 - np.mean(self.noise[: self.trained]) / (np.exp(mix.log_weights[: self.trained]) @ outside)
        self.margin = float(np.interp(share, (0.0, 1.0), MARGINS))
        self._whitenings: dict[int, Whitening] = {}
        self._estimators: dict[int, Estimator] = {}
        self._making = RLock()

    def _quick_likelihood(self) -> tuple[Singles, Singles, Singles, Floats]:
        """Compute a matrix for the log likelihood of samples and pilot by coordinates in `DIRECTIONS` directions.

        Let z be a patch's coordinates, and let m and C be their mean and covariance in a component of weight w. Let q
        be the sum of squares in the n other directions, which all count with their mean variance o. Twice the log
        likelihood is

            2 log w - (z - m)^T C^-1 (z - m) - log |C| - q / o - n log o.

        The log likelihoods of all trained components are the matrix times the column of the products z_i z_j, z, q
        and 1. Each of its rows holds C^-1, C^-1 m, 1 / o and the constant of a component, with their factors.

        Returns
        -------
        centre of the coordinates, directions, that matrix, o of each component
        """
        at = self.rows
        own = len(self.rows)
        white = self.white
        trained = slice(self.trained)
        values = self.values[trained]
        means = np.concatenate([values[:, at], values @ self.average.T @ white.T], axis=1)
        covariances = np.empty((*means.shape, means.shape[1]))
        samples = covariances[:, :own, :own]
        slopes, drift = self.slopes[trained, at], self.drift[trained, at]
        np.multiply(_among(self.mix, self.sampling.rows).samples[trained], slopes[:, :, None], out=samples)
        samples *= slopes[:, None]
        samples += drift[:, :, None] * drift[:, None]
        samples[:, np.arange(own), np.arange(own)] += self.noise[trained]
        covariances[:, own:, :own] = white @ self.pilot_samples[trained]
        covariances[:, :own, own:] = covariances[:, own:, :own].swapaxes(1, 2)
        covariances[:, own:, own:] = white @ self.pilot_pilot[trained] @ white.T + np.eye(4)

        weights = np.exp(self.mix.log_weights[trained])
        centre = weights @ means
        off = means - centre
        pooled = np.tensordot(weights, covariances, 1) + (off.T * weights) @ off
        count = min(DIRECTIONS, covariances.shape[1] - 1)
        directions = np.linalg.eigh(pooled)[1][:, ::-1][:, :count]
        mean = off @ directions
        within = directions.T @ covariances @ directions
        inverse = np.linalg.inv(within)
        others = covariances.shape[1] - count
        total = np.trace(covariances, axis1=1, axis2=2) + (off**2).sum(axis=1)
        outside = (total - np.trace(within, axis1=1, axis2=2) - (mean**2).sum(axis=1)) / others
        pairs = np.triu_indices(count)
        square = -0.5 * inverse[:, pairs[0], pairs[1]] * np.where(pairs[0] == pairs[1], 1.0, 2.0)
        straight = np.einsum("kij,kj->ki", inverse, mean)
        constant = self.mix.log_weights[trained] - 0.5 * (
            np.linalg.slogdet(within)[1] + (straight * mean).sum(axis=1) + others * np.log(outside)
        )
        quick = np.concatenate([square, straight, -0.5 / outside[:, None], constant[:, None]], axis=1)
        return centre.astype(np.float32), directions.astype(np.float32), quick.astype(np.float32), outside

    def end_frame(self) -> None:
        """Release the whitenings and estimators if this is within `one_frame`."""
        if _ONE_FRAME.get():
            with self._making:
                self._whitenings, self._estimators = {}, {}

    def whitening(self, k: int) -> Whitening:
        """Return the whitening of component k."""
        found = self._whitenings.get(k)
        if found is None:
            with self._making:
                self.make_whitenings([k])
                found = self._whitenings[k]
        return found

    def make_whitenings(self, components: Sequence[int]) -> None:
        """Make the whitenings that don't exist yet; made together they take a third of the time."""
        with self._making:
            ks = [k for k in components if k not in self._whitenings]
            if ks:
                self._whitenings |= self._made_whitenings(ks)

    def _made_whitenings(self, ks: list[int]) -> dict[int, Whitening]:
        # C_yy = S A S + d d^T + N, with the covariance A of the roots, their slopes S, the change d of readings by the
        # light's standard error, and the noise N.
        at = self.rows
        own = len(self.rows)
        slopes, drift = self.slopes[ks][:, at], self.drift[ks][:, at]
        values = self.values[ks]
        scatter = _among(self.mix, self.sampling.rows).samples[ks] * slopes[:, :, None]
        scatter *= slopes[:, None]
        scatter += drift[:, :, None] * drift[:, None]
        scatter[:, np.arange(own), np.arange(own)] += self.noise[ks]
        # F satisfies F C_yy F^T = 1, so that F (y - t_y) are independent numbers of variance 1.
        factors = _triangular_inverses(np.asarray(np.linalg.cholesky(scatter), np.float64))
        # H is C_py F^T. The pilot's innovation p - t_p - H F (y - t_y), in units of its errors, is turned so that its
        # four directions are independent given the samples: by the eigenvectors of its covariance C_pp - H H^T.
        half = self.pilot_samples[ks] @ factors.swapaxes(1, 2)
        left = self.white @ (self.pilot_pilot[ks] - half @ half.swapaxes(1, 2)) @ self.white.T
        spread, turns = np.linalg.eigh(left)
        turn = turns.swapaxes(1, 2) @ self.white
        reads = np.zeros((len(ks), own + 5, own + 4))
        reads[:, :own, :own], reads[:, -4:, own:] = factors.swapaxes(1, 2), turn.swapaxes(1, 2)
        reads[:, :own, own:] = -(turn @ (half @ factors)).swapaxes(1, 2)
        reads[:, own] = -(values[:, None, at] @ reads[:, :own])[:, 0]
        reads[:, own, own:] -= (turn @ (values @ self.average.T)[:, :, None])[:, :, 0]
        log_scale = self.mix.log_weights[ks] + np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        parts = zip(ks, reads.astype(np.float32), log_scale.tolist(), np.maximum(spread, 0.0), turn, strict=True)
        return {k: Whitening(*made) for k, *made in parts}

    @cached_property
    def roots(self) -> tuple[Singles, Singles]:
        """Return slope and offset of the line from `Estimator.linear`'s result to twice the root of expected electrons.

        Both have the shape (component, value).
        """
        root = 2.0 * np.sqrt(self.unit_e)
        start = root * (self.mix.means - (self.values - self.black) / self.slopes)
        return (root / (self.slopes * self.taper)).astype(np.float32), start.astype(np.float32)

    def estimator(self, k: int) -> Estimator:
        """Return the estimator of component k."""
        found = self._estimators.get(k)
        if found is None:
            with self._making:
                found = self._estimators.get(k) or self._make_estimator(k)
                self._estimators[k] = found
        return found

    def _make_estimator(self, k: int) -> Estimator:
        # With F of `make_whitenings`: C_yy^-1 = F^T F, and the estimate's matrix is C_xy C_yy^-1. Both have samples in
        # rows here, as `Estimator.linear` has.
        at, size = self.rows, self.mix.size
        own = len(at)
        whitening = self.whitening(k)
        factor = whitening.reads[:own, :own].T.astype(np.float64)
        covariance, slopes, drift = self.mix.covariances[k], self.slopes[k], self.drift[k]
        crossed = covariance[at] * slopes[at, None]
        crossed *= slopes
        crossed += np.outer(drift[at], drift)
        estimate = (factor.T @ factor) @ crossed
        # C_xx - C_xy C_yy^-1 C_yx, the posterior covariance given the samples: its diagonal for every pixel, its rows
        # for the pilot's means, and for each channel's mean over the patch's middle.
        explained = np.einsum("ij,ij->j", estimate, crossed)
        variance = self.average @ (np.diagonal(covariance) * slopes**2 + drift**2 - explained)
        weights = slopes.reshape(-1, 1, 4).T / size**2  # (channel, 1, pixel)
        means = (weights @ covariance.reshape(size**2, 4, -1).swapaxes(0, 1))[:, 0] * slopes
        means += np.outer(self.average @ drift, drift) - (self.average @ crossed.T) @ estimate
        pilot = whitening.turn @ means  # covariance of the pilot's four innovations with every value
        middle, of_middle = _middle(size)
        among = covariance[middle[:, :, None], middle[:, None]]  # the covariances of the middle's pixels, per channel
        inner = np.einsum("ci,cij,cj->c", slopes[middle], among, slopes[middle]) / middle.shape[1] ** 2
        inner += (of_middle @ drift) ** 2 - ((of_middle @ crossed.T) * (of_middle @ estimate.T)).sum(axis=1)
        linear = np.empty((own + 5, len(slopes)), np.float32)
        offset = self.values[k] - self.black - self.values[k, at] @ estimate
        for rows, part in ((slice(own), estimate), (own, offset), (slice(own + 1, None), pilot)):
            np.multiply(part, self.taper, out=linear[rows], casting="same_kind")
        return Estimator(
            linear=linear,
            variance=variance,
            noise=variance * self.unit[k],
            inner=inner,
            pilot_variance=pilot**2 @ self.average.T,
            pilot_inner=(pilot @ of_middle.T) ** 2,
        )


@cache
def _middle(size: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the indices of the middle half's pixels in a patch's vector, (channel, pixel), and a matrix of averages.

    The matrix, (channel, value), averages these pixels per channel.
    """
    inside = np.arange(size)[size // 4 : -(size // 4)]
    places = 4 * (size * inside[:, None] + inside).ravel() + np.arange(4)[:, None]
    averages = np.zeros((4, 4 * size**2))
    np.put_along_axis(averages, places, 1.0 / places.shape[1], axis=1)
    return places, averages


def _triangular_inverses(lower: Floats) -> Floats:
    """Invert lower triangular matrices (matrix, row, column) by halves.

    The inverse of [[A, 0], [B, C]] is [[A^-1, 0], [-C^-1 B A^-1, C^-1]].
    """
    if lower.shape[-1] == 1:
        return 1.0 / lower
    half = lower.shape[-1] // 2
    inverses = np.zeros_like(lower)
    inverses[:, :half, :half] = _triangular_inverses(lower[:, :half, :half])
    inverses[:, half:, half:] = _triangular_inverses(lower[:, half:, half:])
    inverses[:, half:, :half] = -inverses[:, half:, half:] @ lower[:, half:, :half] @ inverses[:, :half, :half]
    return inverses


@lru_cache(maxsize=16)
def _among(mix: Mixture, rows: tuple[int, ...]) -> Among:
    at = np.array(rows)
    pixels = mix.size**2
    count = len(mix.means)
    squares = mix.means**2 + np.diagonal(mix.covariances, axis1=1, axis2=2)
    samples = mix.covariances[:, at[:, None], at].astype(np.float64)
    by_channel = mix.covariances.reshape(count, pixels, 4, -1).swapaxes(1, 2)
    return Among(squares, samples, by_channel)


@lru_cache(maxsize=_TABLES)
def table(prior: Prior, sampling: Sampling, step: int) -> Table:
    """Return the table of a prior and a sampling at the light ``STEP ** step``."""
    mix = mixture(prior, sampling.size)
    return Table(with_fine_lines(mix) if sampling.size == PATCH else mix, sampling, STEP**step)
