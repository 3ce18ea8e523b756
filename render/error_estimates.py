"""How far a render may be off: Monte Carlo noise, and light that varies within a band together with the scene.

Both are estimated from pixels spread evenly over the picture, and cost little beside relighting.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.scene import LightGroup
from render.spectrum import Spectrum, colour_matching_functions
from rodcone.display import brief
from rodcone.types import Floats, Planes

SAMPLE_PIXELS = 1024  # with 40 bands the median of the error is then known to about 1 %
LEAST_UNCOVERED = 1e-6  # of a pixel: less is rounding
MOST_BAND_ERROR = 0.01  # of a band's light: a larger error of wide bands is said
MOST_LUMINANCE_ERROR = 0.04  # of a picture; 80 nm of daylight miss 2.5 %, a line in 10 nm up to 7 %
LEAST_LIGHT = 0.01  # of the picture's light, in a band whose error counts
SUB_BANDS = 64  # of a band, over which a light's moments are summed: 0.16 nm in a band of 10 nm


@dataclass(frozen=True)
class Halves:
    """What two halves of the samples give, whose paths are independent of each other.

    Attributes
    ----------
    mean : (..., h, w) float32
    difference : (..., h, w) float32
        Half the difference between the even and the odd half: one draw of the error of `mean`, all correlations kept.
    """

    mean: Planes
    difference: Planes

    __repr__ = brief

    @classmethod
    def zeros(cls, *shape: int) -> "Halves":
        """Halves before the first sample."""
        return cls(np.zeros(shape, np.float32), np.zeros(shape, np.float32))

    def copy(self) -> "Halves":
        """Halves that can be added to."""
        return Halves(self.mean.copy(), self.difference.copy())

    def __getitem__(self, index: int) -> "Halves":
        """View of one along the first axis."""
        return Halves(self.mean[index], self.difference[index])

    def add(self, even: Planes, odd: Planes, weight: np.float32) -> None:
        """Add a chunk's two means, in place: m += ((a + b) / 2 - m) w, d += ((a - b) / 2 - d) w."""
        for planes, twice in ((self.mean, even + odd), (self.difference, even - odd)):
            step = np.multiply(twice, np.float32(0.5), out=twice)
            np.subtract(step, planes, out=step)
            np.multiply(step, weight, out=step)
            np.add(planes, step, out=planes)


@dataclass(frozen=True)
class SharedPaths:
    """Two light groups that were rendered along the same paths, so that their errors aren't independent.

    Attributes
    ----------
    groups : (int, int)
        Which, by their order.
    correlation : (band, h, w) float32
        Of their errors, -1 to 1.
    """

    groups: tuple[int, int]
    correlation: Planes

    __repr__ = brief

    def term(self, emitted: Floats, variance: Planes) -> Planes:
        """Twice the covariance of the two groups' light: what it adds to the variance of the sum, (band, h, w).

        Parameters
        ----------
        emitted : (group, band) float64
        variance : (group, band, h, w) float32
        """
        first, second = self.groups
        factor = (2 * emitted[first] * emitted[second]).astype(np.float32)[:, None, None]
        return np.asarray(factor * self.correlation * np.sqrt(variance[first]) * np.sqrt(variance[second]))


def pooled(planes: Planes) -> Planes:
    """Means over 3x3 pixels, of the last two axes; at the picture's edge the nearest pixels count again."""
    # Sums of nine: a running sum would leave a rounding of its brightest pixel behind.
    wide = np.pad(planes, [(0, 0)] * (planes.ndim - 2) + [(1, 1), (1, 1)], mode="edge")
    rows = wide[..., :-2, :] + wide[..., 1:-1, :] + wide[..., 2:, :]
    return np.asarray((rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:]) / planes.dtype.type(9))


@dataclass(frozen=True)
class GroupError:
    """One draw of a light group's error, in two parts that are independent of each other.

    Attributes
    ----------
    scattered : (band, h, w) float32
        Noise of scattered light, of one sample.
    rim : (band, h, w) float32
        What comes of a lamp that is seen in more or fewer samples of the pixel than it should be.
    scale : (band, h, w) float32
        Root of scattered light over its mean in 3x3 pixels.
    """

    scattered: Planes
    rim: Planes
    scale: Planes

    def covariance(self, other: "GroupError", rates: NDArray[np.uint32]) -> Planes:
        """Covariance with another group's error, or the variance with itself: (band, h, w).

        Noise of scattered light is pooled over 3x3 pixels in ratio to the light: across an edge of light variance over
        mean differs far less than variance. A lamp's rim counts in its own pixel alone, since a lamp is thousands of
        times brighter than the dark beside it. One difference has one degree of freedom; bands share their paths, and
        add none.
        """
        scattered = pooled(self.scattered * other.scattered) * self.scale * other.scale
        return np.asarray(scattered / rates.astype(np.float32) + self.rim * other.rim)


def group_errors(
    light: Halves, seen: Sequence[Halves], coverage: Planes, rates: NDArray[np.uint32]
) -> list[GroupError]:
    """Error of each group of light (group, band, h, w), from half the difference of the halves.

    Parameters
    ----------
    coverage : (h, w) float32
        Share of the samples in which a lamp is seen: what more of the lamp is seen, less is seen of what lies behind.
    rates : (h, w) uint32
        In the ratio of the pixels' samples.
    """
    root_rates = np.sqrt(rates.astype(np.float32))
    uncovered = np.where(coverage < 1 - LEAST_UNCOVERED, 1 - coverage, 0)
    errors = []
    for group, lamp in enumerate(seen):
        scattered = np.maximum(light[group].mean - lamp.mean, np.float32(0))
        lamp_light = np.broadcast_to(lamp.mean, scattered.shape) * uncovered
        behind = np.divide(scattered * coverage, lamp_light, out=np.zeros_like(scattered), where=lamp_light > 0)
        rim = lamp.difference * (1 - behind)
        means = pooled(scattered)
        scale = np.sqrt(np.divide(scattered, means, out=np.zeros_like(means), where=means > 0))
        errors.append(GroupError((light[group].difference - rim) * root_rates, rim, scale))
    return errors


def shared_paths(
    groups: tuple[int, int], errors: Sequence[GroupError], variance: Planes, rates: NDArray[np.uint32]
) -> SharedPaths:
    """Correlation of the errors of two groups, whose variance is known."""
    first, second = groups
    deviations = np.sqrt(variance[first]) * np.sqrt(variance[second])
    products = errors[first].covariance(errors[second], rates)
    correlation = np.divide(products, deviations, out=np.zeros_like(deviations), where=deviations > 0)
    return SharedPaths(groups, np.clip(correlation, -1, 1, out=correlation))


def relative_error(emitted: Floats, radiance: Planes, variance: Planes, shared: SharedPaths | None = None) -> float:
    """Median over pixels and bands of standard error over mean; dark values out.

    Parameters
    ----------
    emitted : (group, band) float64
    radiance, variance : (group, band, h, w) float32
    shared : SharedPaths, optional
        Groups whose errors are correlated.
    """
    chosen = _spread(radiance.shape[2:])
    total = (emitted[:, :, None, None] ** 2 * variance[chosen]).sum(axis=0)
    if shared:
        total += replace(shared, correlation=shared.correlation[chosen]).term(emitted, variance[chosen])
    values = (emitted[:, :, None, None] * radiance[chosen]).sum(axis=0)
    lit = values > 0
    return float(np.median(np.sqrt(np.maximum(total[lit], 0.0)) / values[lit])) if lit.any() else 0.0


def within_band_error(
    lights: Mapping[str, LightGroup], radiance: Planes, wavelength_nm: Floats, width_nm: Floats
) -> Floats:
    """Error of the product of band averages over each pixel's radiance, RMS over lit pixels; shape (band,).

    The mean of transport T times emission S over a band is not the product of their means. With T expanded about the
    band's centre, T + s x + q/2 (x^2 - w^2/12), what is missed is s <S x> + q/2 <S (x^2 - w^2/12)>, x from the centre.
    Slope s and curvature q come from the neighbouring bands. The two terms are added without their signs; what T does
    within a band beyond a parabola stays unseen. A coloured emitter is averaged as it is rendered, so a flat
    factor on it misses nothing.

    Parameters
    ----------
    radiance : (group, band, h, w) float32
        At unit spectral emission.
    """
    chosen = _spread(radiance.shape[2:])
    missed, total = np.zeros((2, *radiance[0][chosen].shape))
    for light, planes in zip(lights.values(), radiance, strict=True):
        transport = planes[chosen].astype(np.float64)
        slope, curvature = _derivatives(transport, wavelength_nm)
        moments = _moments(light.spectrum, wavelength_nm, width_nm)
        mean, first, second = (moment[:, None, None] * light.power for moment in moments)
        missed += np.abs(slope * first) + np.abs(curvature * second) / 2
        total += transport * mean
    # a lamp in view doesn't hide the rest
    relative = np.divide(missed, total, out=np.zeros_like(total), where=total > 0)
    lit = np.maximum((total > 0).sum(axis=(1, 2)), 1)
    return np.asarray(np.sqrt(np.square(relative).sum(axis=(1, 2)) / lit))


def luminance_error(
    lights: Mapping[str, LightGroup], radiance: Planes, wavelength_nm: Floats, width_nm: Floats
) -> float:
    """Relative error of a picture's luminance whose lights are known by their band averages alone, RMS over pixels.

    A sensor's channels, as steep as the eye's sensitivity, see an error of this order or some times it. As
    `within_band_error`, with the eye's sensitivity in place of the transport, and signs.
    """
    eye = colour_matching_functions()[1].band_average(wavelength_nm, width_nm)
    slope, curvature = (values[:, 0, 0] for values in _derivatives(eye[:, None, None], wavelength_nm))
    transport = radiance[_spread(radiance.shape[2:])].astype(np.float64)
    moments = [light.power * np.array(_moments(light.spectrum, wavelength_nm, width_nm)) for light in lights.values()]
    mean, first, second = np.swapaxes(moments, 0, 1)  # (group, band)
    weights = slope * first + curvature * second / 2, eye * mean
    missed, total = (np.tensordot(weight * width_nm, transport, 2) for weight in weights)
    relative = np.divide(missed, total, out=np.zeros_like(total), where=total > 0)
    return float(np.sqrt(np.square(relative).sum() / max(1, np.count_nonzero(total > 0))))


class WideBandsWarning(UserWarning):
    """Bands within which light and surfaces, or light and eye, vary together by more than band averages tell."""


def warn_of_wide_bands(
    error: Floats, photometric: float, values: Planes, wavelength_nm: Floats, width_nm: Floats
) -> None:
    """Warn (`WideBandsWarning`) where `within_band_error` is large in a band of a picture, with what would do.

    For smooth light the error falls with the square of the width. `values` has the shape (band, h, w), `photometric` is
    the `luminance_error`.
    """
    light = values.mean(axis=(1, 2), dtype=np.float64) * width_nm
    error = np.where(light >= LEAST_LIGHT * light.sum(), error, 0.0)
    worst = int(error.argmax())
    if error[worst] > MOST_BAND_ERROR:
        enough_nm = width_nm[worst] * (MOST_BAND_ERROR / error[worst]) ** 0.5
        warnings.warn(
            f"bands: the one at {wavelength_nm[worst]:g} nm is off by about {error[worst]:.1%}, for light and surfaces "
            f"vary together within its {width_nm[worst]:g} nm; bands of {int(enough_nm) or enough_nm:.3g} nm would do, "
            "or for a lamp's lines rodcone.line_bands",
            WideBandsWarning,
            stacklevel=3,
        )
    if photometric > MOST_LUMINANCE_ERROR and light.any():
        warnings.warn(
            f"bands: luminance is off by about {photometric:.1%} and a sensor's channels by more, for a light varies "
            f"within bands of up to {width_nm.max():g} nm; give narrower ones, as --bands of rodcone render, or for a "
            "lamp's lines rodcone.line_bands",
            WideBandsWarning,
            stacklevel=3,
        )


def _spread(shape: tuple[int, ...]) -> tuple[Any, ...]:
    """Index (..., row, column) of at most about `SAMPLE_PIXELS` pixels, evenly spread over a picture."""
    step = max(1, round(np.sqrt(shape[0] * shape[1] / SAMPLE_PIXELS)))
    rows, columns = (np.arange(min(step // 2, length - 1), length, step) for length in shape)
    return ..., rows[:, None], columns


def _derivatives(values: Floats, wavelength_nm: Floats) -> tuple[Floats, Floats]:
    """Slope and curvature over wavelength (axis 0), from the parabola through each band and its two neighbours."""
    if wavelength_nm.size < 2:
        return np.zeros_like(values), np.zeros_like(values)
    slope = np.gradient(values, wavelength_nm, axis=0, edge_order=1 if wavelength_nm.size == 2 else 2)
    if wavelength_nm.size == 2:
        return slope, np.zeros_like(values)
    steps = np.diff(wavelength_nm)[:, None, None]
    curvature = 2 * np.diff(np.diff(values, axis=0) / steps, axis=0) / (steps[1:] + steps[:-1])
    return slope, np.pad(curvature, ((1, 1), (0, 0), (0, 0)), mode="edge")


def _moments(spectrum: Spectrum, wavelength_nm: Floats, width_nm: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean of S, S x and S (x^2 - w^2/12) over each band, x from its centre; shape (band,) each."""
    places = (np.arange(SUB_BANDS) + 0.5) / SUB_BANDS - 0.5
    x = places * width_nm[:, None]
    sub_width = np.repeat(width_nm / SUB_BANDS, SUB_BANDS)
    values = spectrum.band_average((wavelength_nm[:, None] + x).ravel(), sub_width).reshape(x.shape)
    even = x**2 - np.mean(x**2, axis=1, keepdims=True)
    return values.mean(axis=1), (values * x).mean(axis=1), (values * even).mean(axis=1)
