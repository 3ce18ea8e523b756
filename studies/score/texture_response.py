"""Measure by frequency how much contrast a camera transfers from a chart of dead leaves (`scenes.dead_leaves`)."""

from dataclasses import dataclass

import numpy as np

from rodcone.types import Floats, Plane

ANNULUS = 0.02  # width of a step of frequency [cycles per pixel]


@dataclass(frozen=True)
class TextureResponse:
    """Response of a picture to a chart by frequency: arrays (n,) from 0 cycles per pixel, where the response is 1."""

    frequency_cycles_per_px: Floats
    mtf: Floats


def texture_response(picture: Plane, chart: Plane) -> TextureResponse:
    """Compare a picture P with the chart T that it shows, both in reflectances: sum of conj(T) P over sum of |T|^2.

    Noise is independent of the chart, and so is detail beyond Nyquist that folds back; on average neither changes the
    result. The chart consists of small squares and is known at their middles: the sum over a pixel's squares, over the
    transfer of one square, is the transfer of the pixel's aperture.
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
    """Return the response of a camera with this transfer, (side, side), at a Fourier transform's frequencies."""
    frequency = np.fft.fftfreq(transfer.shape[0])
    steep = (
        np.maximum(np.hypot(frequency[:, None], frequency), 1 / transfer.shape[0]) ** -3.0
    )  # weights like the spectrum of the chart
    return _by_annulus(transfer * steep, steep, transfer.shape[0])


def _spectrum(values: Plane, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """Return the Fourier transform under a Hann window at the lowest `side` frequencies of either axis.

    Phases count from the picture's corner, so that transforms of pictures with other pixels can be compared.
    """
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
