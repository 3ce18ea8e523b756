"""Light of a scene that moves while it is exposed: the mean of its light at several times."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from render.error_estimates import Halves, SharedPaths
from render.level import Irradiance, SceneMeans
from render.transport import Transport
from rodcone.errors import InputError, require_whole
from rodcone.types import Floats, Planes


def moments_s(exposure_s: float, count: int) -> Floats:
    """Give the middles of `count` equal parts of an exposure that begins at 0, shape (count,) [s].

    Parameters
    ----------
    exposure_s : float
    count : int

    Raises
    ------
    InputError
        For a count that isn't a whole number, 1 or more.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.moments_s(0.1, 2).tolist()
    [0.025, 0.07500000000000001]
    """
    require_whole("count", count, 1, 1 << 16, "give times within the exposure")
    return np.asarray((np.arange(count) + 0.5) * (exposure_s / count))


def time_average(transports: Iterable[Transport]) -> Transport:
    """Average the light of a scene at times that are spread evenly over an exposure.

    A sensor sums light, so that the mean over k times is what it collects of a scene that stays for 1 / k of the time
    at each. What moves by s pixels in the whole exposure is blurred into k edges s / k pixels apart: with k of at least
    s the steps are smaller than a pixel. The renders' errors must be independent, which other seeds make them; the
    variance of the mean is theirs over k.

    Parameters
    ----------
    transports : iterable of Transport
        Of one size, bands and light groups. Of a generator one at a time is held in memory.

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
    # Running means, so that the light of one time is held beside them.
    first: Transport | None = None
    means: list[Any] = []
    told: list[_Told] = []
    for number, each in enumerate(transports):
        if first is None:
            first, means = each, [np.array(planes) for planes in _planes(each)]
        _require_alike(f"transports[{number}]", first, each)
        for index, planes in enumerate(_planes(each)):
            means[index] += (planes - means[index]) / means[index].dtype.type(number + 1)
        told.append(_Told(each.scene_means, each.relative_mc_error, each.seconds, each.compile_s, each.meter))
    if first is None:
        raise InputError("transports: none given; allowed: one or more; give those of the times of an exposure")
    # What the mean over k times is, from the means of what each is.
    count = len(told)
    light, difference, variance, counts, coverage, coverage_difference, *rest = means
    variance /= variance.dtype.type(count)
    covariance = rest.pop() / np.float32(count) if first.shared else None
    return replace(
        first,
        light=Halves(light, difference),
        variance=variance,
        counts=np.rint(counts * count).astype(np.uint32),
        coverage=Halves(coverage, coverage_difference),
        seen=tuple(Halves(mean, half) for mean, half in zip(rest[::2], rest[1::2], strict=True)),
        shared=None if covariance is None or first.shared is None else _shared(first.shared, covariance, variance),
        scene_means=SceneMeans(
            np.mean([x.scene_means.radiance for x in told], axis=0),
            float(np.mean([x.scene_means.uncovered for x in told])),
            np.mean([x.scene_means.covariance for x in told], axis=0) / count,
        ),
        seconds=sum(x.seconds for x in told),
        compile_s=sum(x.compile_s for x in told),
        relative_mc_error=float(np.sqrt(np.mean([x.relative_mc_error**2 for x in told]) / count)),
        meter=None if first.meter is None else _meter([x.meter for x in told if x.meter is not None]),
    )


@dataclass(frozen=True)
class _Told:
    """What a transport tells beside its planes."""

    scene_means: SceneMeans
    relative_mc_error: float
    seconds: float
    compile_s: float
    meter: Callable[[], Irradiance] | None


def _planes(transport: Transport) -> list[Any]:
    """All planes of a transport: light, variance, counts, coverage, what is seen, and the covariance of two groups."""
    halves = (transport.coverage, *transport.seen)
    light, counts = transport.light, transport.counts.astype(np.float64)
    planes: list[Any] = [light.mean, light.difference, transport.variance, counts]
    planes += [part for half in halves for part in (half.mean, half.difference)]
    if transport.shared is not None:
        a, b = transport.shared.groups
        planes += [transport.shared.correlation * np.sqrt(transport.variance[a] * transport.variance[b])]
    return planes


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


def _shared(first: SharedPaths, covariance: Planes, variance: Planes) -> SharedPaths:
    """Correlation of two groups' errors, from their covariance and variance."""
    a, b = first.groups
    deviations = np.sqrt(variance[a] * variance[b])
    return SharedPaths(
        first.groups, np.divide(covariance, deviations, out=np.zeros_like(covariance), where=deviations > 0)
    )


def _meter(meters: Sequence[Callable[[], Irradiance]]) -> Callable[[], Irradiance]:
    """Meter of the mean, which asks each time's once."""

    @cache
    def measured() -> Irradiance:
        each = [meter() for meter in meters]
        covariance = np.mean([x.covariance for x in each], axis=0) / len(each)
        return Irradiance(np.mean([x.mean for x in each], axis=0), covariance)

    return measured
