"""Light of a scene that moves while it is exposed: the mean of its light at several times."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from math import hypot
from typing import Any

import numpy as np

from render.error_estimates import Halves, SharedPaths
from render.level import Irradiance, SceneMeans
from render.transport import Transport
from rodcone.errors import InputError
from rodcone.types import Floats, Planes
from sensor.config import SensorConfig
from studies.study.motion import moments_s, site_starts_s


def rolling_moments(sensor: SensorConfig, rows: int, exposure_s: float, count: int) -> tuple[Floats, Floats]:
    """Return the times at which to render a scene that moves while rows roll, and each row's shares of these times.

    The times are the middles of equal parts of the time from the first row's start, at 0, to the last row's end.
    Between two times the light is interpolated linearly, so that an edge in a row lies where it is in the middle of
    that row's own exposure; before the first and after the last time it is constant. If all rows start together, each
    time counts the same.

    Parameters
    ----------
    sensor : SensorConfig
        Sensor whose `row_time_us` separates the rows' starts; photodiodes that bin are exposed together.
    rows : int
        Number of rows of photodiodes.
    exposure_s : float
        Exposure time of a row, above 0.
    count : int

    Returns
    -------
    times_s : (time,) float64
    shares : (time, row) float64
        A row's sum is 1.
    """
    starts_s = site_starts_s(sensor, rows)
    whole_s = float(starts_s.max()) + exposure_s
    return moments_s(whole_s, count), _shares(starts_s, exposure_s, whole_s, count)


def centred_shares(sensor: SensorConfig, rows: int, exposure_s: float, whole_s: float, count: int) -> Floats:
    """Return each row's shares of the times of a longer exposure, for a shorter one that lies in its middle.

    Parameters
    ----------
    sensor, rows, exposure_s
        As in `rolling_moments`.
    whole_s : float
        Length of the longer exposure, from the first row's start to the last row's end; it has `count` times.
    count : int

    Returns
    -------
    (time, row) float64
        A row's sum is 1.
    """
    starts_s = site_starts_s(sensor, rows)
    before_s = (whole_s - exposure_s - float(starts_s.max())) / 2
    return _shares(before_s + starts_s, exposure_s, whole_s, count)


def _shares(starts_s: Floats, exposure_s: float, whole_s: float, count: int) -> Floats:
    """Return the weight of each moment in the mean light of each exposure, shape (moment, exposure).

    The exposures start at `starts_s`. The moments are the middles of `count` equal parts of the time from 0 to
    `whole_s`. Between two moments the light is interpolated linearly, and before the first and after the last it is
    constant.
    """
    times_s = moments_s(whole_s, count)
    step_s = whole_s / count

    def until(time_s: Floats) -> Floats:
        # Integral from time 0 of each moment's weight, which is a tent 2 steps wide; outside the first and the last
        # moment the weight of that moment stays at 1.
        away = (time_s - times_s[:, None]) / step_s
        steps = np.clip(away, -1.0, 1.0)
        tent = 0.5 + steps - steps * np.abs(steps) / 2
        tent[0] = np.where(away[0] < 0, 0.5 + away[0], tent[0])
        tent[-1] = np.where(away[-1] > 0, tent[-1] + away[-1] ** 2 / 2, tent[-1])
        return np.asarray(tent * step_s)

    return np.asarray((until(starts_s + exposure_s) - until(starts_s)) / exposure_s)


def rolling_average(transports: Iterable[Transport], shares: Floats) -> Transport:
    """Average the light of a scene over several times, each row by its own shares of them.

    A lens in front of the sensor blurs the average, which mixes the times of rows within the width of the blur.

    Parameters
    ----------
    transports : iterable of Transport
    shares : (time, row) float64
        Shares from `rolling_moments`, for the transports' rows.

    Raises
    ------
    InputError
        As `time_average`.
    """
    return _average(transports, shares)


def time_average(transports: Iterable[Transport]) -> Transport:
    """Average the light of a scene at times that are spread evenly over an exposure.

    A sensor sums light, so that the mean over k times is what it collects from a scene that stays at each for a k-th of
    the exposure. An edge that moves by s pixels in the whole exposure becomes k edges s / k pixels apart: with k of at
    least s the steps are smaller than a pixel. The renders' errors must be independent, which different seeds ensure;
    the variance of the mean is then theirs over k.

    Parameters
    ----------
    transports : iterable of Transport
        Transports of one size, with the same bands and light groups. A generator's are in memory one at a time.

    Raises
    ------
    InputError
        For none, and for transports that differ in more than what is lit.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> nm = np.array([450.0, 550.0, 650.0])
    >>> moving = [
    ...     rodcone.render(rodcone.load("walker", time_s=time_s), (16, 16), wavelength_nm=nm, spp=1, seed=seed)
    ...     for seed, time_s in enumerate(rodcone.moments_s(0.1, 2))
    ... ]  # doctest: +SKIP
    >>> rodcone.time_average(moving).spp  # doctest: +SKIP
    2.0
    """
    return _average(transports, None)


def _average(transports: Iterable[Transport], shares: Floats | None) -> Transport:
    """Return the mean of transports over times. All times count alike if `shares` is None, else by (time, row)."""
    mean: Transport | None = None
    meters: list[Callable[[], Irradiance] | None] = []
    for each in transports:
        _require_alike(f"transports[{len(meters)}]", mean or each, each)
        meters.append(each.meter)
        mean = each if mean is None else _with(mean, each, len(meters), _parts(shares, len(meters)))
        del each  # frees its light before the next is rendered
    if mean is None:
        raise InputError("transports: none given; allowed: one or more; give those of the times of an exposure")
    if len(meters) == 1:
        return mean
    if shares is not None:  # a row that sees few of the times has few of the samples
        fewer = len(meters) * (shares**2).sum(axis=0)
        counts = np.rint(mean.counts / fewer[:, None]).astype(mean.counts.dtype)
        error = mean.relative_mc_error * float(np.sqrt(fewer).mean())
        mean = replace(mean, counts=counts, relative_mc_error=error)
    return replace(mean, meter=None if meters[0] is None else _meter([x for x in meters if x is not None]))


def _parts(shares: Floats | None, count: int) -> float | Floats:
    """Return each row's sum of the first `count` times' shares over its share of the last of these, shape (row, 1).

    The ratio is infinite if the last share is 0. If all times count alike (`shares` is None), it is `count`.
    """
    if shares is None:
        return count
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = shares[:count].sum(axis=0) / shares[count - 1]
    return np.asarray(np.where(shares[count - 1] > 0, parts, np.inf))[:, None]


def _with(mean: Transport, each: Transport, count: int, parts: float | Floats) -> Transport:
    """Update a mean over times by one more time: x is the light at this time, m the mean over all times before it.

    With k = `count`, the number of times including the new one, the mean is m + (x - m) / k. Its variance is
    ((k - 1)^2 v_m + v_x) / k^2, because the errors are independent. Arrays with rows use `parts`, from `_parts`, for k.
    """

    def mixed(first: Any, last: Any, k: float | Floats = count) -> Any:
        return first + (last - first) / np.asarray(k, np.asarray(first).dtype)

    def of_errors(first: Any, last: Any, k: float | Floats = count) -> Any:
        real = np.asarray(first).dtype
        newest = np.asarray(1 / np.asarray(k, np.float64))
        return first * ((1 - newest) ** 2).astype(real) + last * (newest**2).astype(real)

    def halves(first: Halves, last: Halves) -> Halves:
        return Halves(mixed(first.mean, last.mean, parts), mixed(first.difference, last.difference, parts))

    variance = of_errors(mean.variance, each.variance, parts)
    means = mean.scene_means
    last = each.scene_means
    shared = None
    if mean.shared is not None and each.shared is not None:
        covariance = of_errors(_covariance(mean.shared, mean), _covariance(each.shared, each), parts)
        shared = _correlated(mean.shared.groups, covariance, variance)
    return replace(
        mean,
        light=halves(mean.light, each.light),
        variance=variance,
        counts=mean.counts + each.counts,
        coverage=halves(mean.coverage, each.coverage),
        seen=tuple(halves(*pair) for pair in zip(mean.seen, each.seen, strict=True)),
        shared=shared,
        scene_means=SceneMeans(
            mixed(means.radiance, last.radiance),
            means.uncovered + (last.uncovered - means.uncovered) / count,
            of_errors(means.covariance, last.covariance),
        ),
        seconds=mean.seconds + each.seconds,
        compile_s=mean.compile_s + each.compile_s,
        relative_mc_error=hypot((count - 1) * mean.relative_mc_error, each.relative_mc_error) / count,
    )


def _require_alike(name: str, first: Transport, other: Transport) -> None:
    if other.denoised is not None:
        raise InputError(f"{name}: it has denoised light; allowed: unbiased light alone; render it without denoise")
    same = (
        first.radiance.shape == other.radiance.shape
        and list(first.groups) == list(other.groups)
        and np.array_equal(first.wavelength_nm, other.wavelength_nm)
        and np.array_equal(first.width_nm, other.width_nm)
        and (first.shared is None) == (other.shared is None)
        and [x.mean.shape for x in first.seen] == [x.mean.shape for x in other.seen]
    )
    if not same:
        raise InputError(
            f"{name}: light of {other.radiance.shape} in groups {', '.join(other.groups)} beside "
            f"{first.radiance.shape} in {', '.join(first.groups)}; allowed: one size, the same bands and groups; "
            "render all alike"
        )


def _covariance(shared: SharedPaths, transport: Transport) -> Planes:
    """Return the covariance between the errors of two light groups that share their paths."""
    a, b = shared.groups
    return np.asarray(shared.correlation * np.sqrt(transport.variance[a] * transport.variance[b]))


def _correlated(groups: tuple[int, int], covariance: Planes, variance: Planes) -> SharedPaths:
    a, b = groups
    deviations = np.sqrt(variance[a] * variance[b])
    return SharedPaths(groups, np.divide(covariance, deviations, out=np.zeros_like(covariance), where=deviations > 0))


def _meter(meters: Sequence[Callable[[], Irradiance]]) -> Callable[[], Irradiance]:
    """Return a function that measures the mean irradiance over all times; it calls the meter of each time only once."""

    @cache
    def measured() -> Irradiance:
        each = [meter() for meter in meters]
        covariance = np.mean([x.covariance for x in each], axis=0) / len(each)
        return Irradiance(np.mean([x.mean for x in each], axis=0), covariance)

    return measured
