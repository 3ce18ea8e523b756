"""Dead leaves: a chart of overlapping disks whose spectrum is known, and what a camera transfers of it.

Disks of radii with a density in proportion to r^-3, between two limits, fall on one another, each of a grey of its own.
Two points at a distance d see the same disk with the probability

    g(d) / (2 g(0) - g(d)),    g(d) the mean area in which a disk and itself moved by d overlap

(Matheron 1968), which times the variance of the greys is the chart's autocovariance.
"""

from dataclasses import dataclass

import numpy as np

from rodcone.types import Floats, Plane

LEAST_PX, MOST_PX = 1.0, 24.0  # radii, in pixels of the picture
DARKEST, BRIGHTEST = 0.05, 0.95  # reflectances, evenly spread
LAYERS = 5.0  # of disks: exp(-5) of the chart shows the ground, which has the mean grey
ANNULUS = 0.02  # width of a step of frequency [cycles per pixel]


@dataclass(frozen=True)
class TextureResponse:
    """What a picture holds of a chart, by frequency: (n,) each, from 0 cycles per pixel, where it is 1."""

    frequency_cycles_per_px: Floats
    mtf: Floats


def draw_leaves(side_px: int, samples: int, rng: np.random.Generator) -> Plane:
    """Draw the reflectances of a chart of side_px x side_px pixels, `samples` squares along a side of each pixel."""
    side, least, most = (value * samples for value in (side_px, LEAST_PX, MOST_PX))
    around = side + 2 * most
    mean_area = 2 * np.pi * np.log(most / least) / (least**-2 - most**-2)
    count = int(rng.poisson(LAYERS * around**2 / mean_area))
    radii = (least**-2 - rng.random(count) * (least**-2 - most**-2)) ** -0.5
    rows, columns = rng.uniform(-most, side + most, (2, count))
    greys = rng.uniform(DARKEST, BRIGHTEST, count)
    chart: Plane = np.full((int(side), int(side)), (DARKEST + BRIGHTEST) / 2)
    middles = np.arange(int(side)) + 0.5
    for radius, row, column, grey in zip(radii.tolist(), rows.tolist(), columns.tolist(), greys.tolist(), strict=True):
        down = slice(max(int(row - radius), 0), max(int(row + radius) + 1, 0))
        across = slice(max(int(column - radius), 0), max(int(column + radius) + 1, 0))
        inside = (middles[down, None] - row) ** 2 + (middles[across] - column) ** 2 <= radius**2
        chart[down, across][inside] = grey
    return chart


def autocovariance(distance_px: Floats) -> Floats:
    """Return the chart's autocovariance at distances in pixels."""
    radii = np.geomspace(LEAST_PX, MOST_PX, 4001)
    half = np.minimum(np.asarray(distance_px)[..., None] / (2 * radii), 1.0)
    overlap = 2 * radii**2 * (np.arccos(half) - half * np.sqrt(1 - half**2))
    shared = np.trapezoid(overlap * radii**-3, radii)
    whole = np.trapezoid(np.pi / radii, radii)
    variance = (BRIGHTEST - DARKEST) ** 2 / 12
    return np.asarray(variance * shared / (2 * whole - shared))


def texture_response(picture: Plane, chart: Plane) -> TextureResponse:
    """Compare a picture with the chart that it shows, both in reflectances: sum of conj(T) P over sum of |T|^2.

    Noise has no part in it on average, nor has light of frequencies beyond Nyquist, for neither knows the chart T. The
    chart is known at the middles of its squares: a sum over a pixel's squares, over the transfer of one square, is
    that of the pixel's aperture.
    """
    side = picture.shape[0]
    samples = chart.shape[0] // side
    mean = float(chart.mean())
    seen = _spectrum(picture - mean, side)
    known = _spectrum(chart - mean, side) / samples**2
    frequency = np.fft.fftfreq(side)
    square = np.sinc(frequency / samples)[:, None] * np.sinc(frequency / samples)
    return _by_annulus((known.conj() * seen).real * square, np.abs(known) ** 2, side)


def expected_response(transfer: Floats) -> TextureResponse:
    """Return the response to a transfer at the frequencies of a picture's Fourier transform, shape (side, side)."""
    frequency = np.fft.fftfreq(transfer.shape[0])
    steep = (
        np.maximum(np.hypot(frequency[:, None], frequency), 1 / transfer.shape[0]) ** -3.0
    )  # as the chart's spectrum
    return _by_annulus(transfer * steep, steep, transfer.shape[0])


def _spectrum(values: Plane, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Transform under a Hann window, at the lowest `side` frequencies of either axis, from the picture's corner on."""
    count = values.shape[0]
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    orders = np.rint(np.fft.fftfreq(side) * side).astype(int)
    found = np.fft.fft2(values * window[:, None] * window)[np.ix_(orders % count, orders % count)]
    shift = np.exp(-1j * np.pi * orders / count)
    return np.asarray(found * shift[:, None] * shift)


def _by_annulus(products: Floats, squares: Floats, side: int) -> TextureResponse:
    frequency = np.fft.fftfreq(side)
    radius = np.hypot(frequency[:, None], frequency)
    step = np.rint(radius / ANNULUS).astype(int).ravel()
    counted = slice(1, round(0.5 / ANNULUS) + 1)
    sums = [np.bincount(step, of.ravel())[counted] for of in (products, squares, radius * squares)]
    return TextureResponse(np.append(0.0, sums[2] / sums[1]), np.append(1.0, sums[0] / sums[1]))
