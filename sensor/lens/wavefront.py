"""Point images of wavefronts, by Fourier optics.

A wave's path W over the pupil is a sum of Zernike's polynomials, each with a root mean square of 1 and counted as R. J.
Noll did ("Zernike polynomials and atmospheric turbulence", J. Opt. Soc. Am. 66, 1976). Angles in the pupil are counted
from the direction that leads outwards in the picture, and its radius is 1 at the rim. Light that crosses the pupil at a
place p lands at

    -2 N dW/dp

beside the point's place (N: working f-number), by which the sign of W is defined, and the transfer is the pupil
function's correlation with itself, where f / (wavelength x N) is the cut-off (Goodman, "Introduction to Fourier
Optics", chapter 6).
"""

from functools import lru_cache
from itertools import product
from math import ceil, factorial, sqrt
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.lens.table import Kernels, LensTable, Wavefronts

LEAST_ACROSS = 64  # least number of sampling points across the pupil
_HARD = 1e-9  # width of a rim that isn't softened
MOST_KEPT = 1024  # cached images of points: enough for 20 bands and some 50 places; 60 MB at 2 um
_PAD = 4  # a kernel is padded with zeros to this many times its side, so that its transform is smooth


def orders(noll: int) -> tuple[int, int]:
    """Return the radial order n and the signed angular order m of Noll's number; m < 0 has a sine."""
    n = int((sqrt(8 * noll - 7) - 1) / 2)
    rest = noll - n * (n + 1) // 2 - 1
    m = 2 * ((rest + 1) // 2) if n % 2 == 0 else 2 * (rest // 2) + 1
    return n, m if noll % 2 == 0 else -m


def zernike(noll: int, along: Floats, across: Floats) -> Floats:
    """Evaluate a polynomial of root mean square 1 over the unit disc; 1 is its rim."""
    return _path_nm(np.ones(1), (noll,), along, across)


@lru_cache(maxsize=512)
def _radial(noll: int) -> tuple[float, ...]:
    """Return the factors of the powers of the radius, from 0 on, in a Zernike polynomial."""
    n, m = orders(noll)
    factors = [0.0] * (n + 1)
    for s in range((n - abs(m)) // 2 + 1):
        down = factorial(s) * factorial((n + abs(m)) // 2 - s) * factorial((n - abs(m)) // 2 - s)
        factors[n - 2 * s] = (-1) ** s * factorial(n - s) / down * sqrt((n + 1) * (1 + (m != 0)))
    return tuple(factors)


def _path_nm(coefficients: Floats, noll: tuple[int, ...], along: Floats, across: Floats) -> Floats:
    """Sum the Zernike polynomials to the wave's path [nm]; those of one angular order are added up first."""
    by_order: dict[int, Floats] = {}
    for value, j in zip(coefficients, noll, strict=True):
        if value:
            factors = by_order.setdefault(orders(j)[1], np.zeros(12))
            factors[: len(_radial(j))] += value * np.array(_radial(j))
    radius, angle = np.hypot(along, across), np.arctan2(across, along)
    total = np.zeros(radius.shape)
    for m, factors in by_order.items():
        turned = 1.0 if m == 0 else np.cos(m * angle) if m > 0 else np.sin(-m * angle)
        total += np.polynomial.polynomial.polyval(radius, factors) * turned
    return total


def _pupil(
    table: LensTable, height: float, wavelength_nm: float, along: Floats, across: Floats, edge: float
) -> NDArray[np.complex128]:
    """Return the pupil function at places in units of the f-number's radius; `edge` is the width of its soft rim."""
    assert isinstance(table.point_spread, Wavefronts)
    coefficients, (radial, sideways) = table.wavefront_nm(height, wavelength_nm)
    along, across = along / radial, across / sideways
    radius = np.hypot(along, across)
    amplitude = np.clip((1 - radius) / (edge / min(radial, sideways)) + 0.5, 0.0, 1.0)
    within = np.flatnonzero(amplitude.ravel())
    function = np.zeros(radius.size, np.complex128)
    path = _path_nm(coefficients, table.point_spread.noll, along.ravel()[within], across.ravel()[within])
    function[within] = amplitude.ravel()[within] * np.exp(2j * np.pi / wavelength_nm * path)
    return function.reshape(radius.shape)


def transfer(table: LensTable, height: float, wavelength_nm: float, radial: Floats, across: Floats) -> Floats:
    """Return the lens's transfer function at one place of the picture, straight from the table.

    Parameters
    ----------
    table : LensTable
        With a point spread.
    height : float
        Image height, 0 in the middle of the picture and 1 in its corners.
    wavelength_nm : float
    radial, across : array
        Frequencies along the radius and across it [1/um].

    Returns
    -------
    complex128 array
        Transfer in the shape of the frequencies; 1 at frequency 0. Its absolute value is the MTF.
    """
    radial, across = np.broadcast_arrays(np.asarray(radial, np.float64), np.asarray(across, np.float64))
    if isinstance(table.point_spread, Kernels):
        kernel = table.kernel(height, wavelength_nm)
        step_um = table.point_spread.step_um
        places = (np.arange(len(kernel)) - len(kernel) // 2) * step_um
        found = [
            np.exp(-2j * np.pi * f * places) @ kernel @ np.exp(-2j * np.pi * g * places)
            for f, g in zip(radial.ravel(), across.ravel(), strict=True)
        ]
        return np.asarray(np.array(found).reshape(radial.shape))
    assert isinstance(table.point_spread, Wavefronts)
    # Correlation of the pupil with itself, shifted by 2 N wavelengths x frequency.
    spot_um = wavelength_nm * 1e-3 * table.f_number
    grid = ((np.arange(512) + 0.5) / 128 - 2) * max(1.0, float(table.point_spread.pupil.max()))
    x, y = np.meshgrid(grid, grid, indexing="ij")
    values = []
    for f, g in zip(radial.ravel(), across.ravel(), strict=True):
        shift = spot_um * f, spot_um * g
        ahead, behind = (
            _pupil(table, height, wavelength_nm, x + sign * shift[0], y + sign * shift[1], _HARD) for sign in (1, -1)
        )
        values.append((ahead * behind.conj()).sum())
    whole = (np.abs(_pupil(table, height, wavelength_nm, x, y, _HARD)) ** 2).sum()
    return np.asarray(np.array(values).reshape(radial.shape) / whole)


def reach_of(table: LensTable, nm: Floats, step_um: float) -> int:
    """Return the samples on each side of a point within which its image differs from an ideal one's.

    The widest image of the table counts.
    """
    spread = table.point_spread
    if isinstance(spread, Kernels):
        farthest_um = sqrt(2) * float(spread.energy.shape[2] // 2) * spread.step_um
        return ceil(float(farthest_um) / step_um) + 2
    assert isinstance(spread, Wavefronts)
    widest_um = max(float(x) for x in nm) * 1e-3 * table.f_number
    grid = np.linspace(-1, 1, 65)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    inside = np.hypot(x, y) < 1
    farthest_um = 0.0
    for of_field, pupils in zip(spread.path_nm, spread.pupil, strict=True):
        for coefficients, pupil in zip(of_field, pupils, strict=True):
            slopes = np.gradient(_path_nm(coefficients, spread.noll, x, y) * 1e-3, grid, grid)
            away = np.hypot(slopes[0] / pupil[0], slopes[1] / pupil[1])
            farthest_um = max(farthest_um, 2 * table.f_number * float(away[inside].max()))
    # The pupil holds `LEAST_ACROSS` places where the image has as many of its least details.
    least = max(ceil((farthest_um + 12 * widest_um) / step_um), ceil(LEAST_ACROSS / 2 * widest_um / step_um), 16)
    return int(scipy.fft.next_fast_len(least))


@lru_cache(maxsize=MOST_KEPT)  # they take four fifths of a picture's time, and a capture needs them three times
def sampled_kernel(
    table: LensTable, height: float, azimuth: float, wavelength_nm: float, step_um: float, reach: int, folded: bool
) -> Floats:
    """Return a point's image at the samples around it, less that of an ideal lens, shape (2 reach,) * 2.

    The point is at [0, 0], and what lies before it wraps around to the ends; the sum is 0. The ideal lens has no
    aberrations and, for a table of kernels, no diffraction either. `folded` is as `sensor.diffraction.sampled_otf`
    takes it.

    Parameters
    ----------
    table : LensTable
        With a point spread.
    height : float
    azimuth : float
        Angle of the radius from the rows' direction, downwards, towards the columns' [radians].
    wavelength_nm, step_um : float
    reach : int
        Samples on each side of the point, from `reach_of`.
    folded : bool
    """
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    if isinstance(table.point_spread, Kernels):
        kernel = table.kernel(height, wavelength_nm)
        own_um = table.point_spread.step_um
        times = max(2, 2 * ceil(step_um / own_um / 2))
        down, over = np.meshgrid(*[np.fft.fftfreq(2 * reach * times, step_um / times)] * 2, indexing="ij")
        found = _of_kernel(kernel, own_um, down * cosine + over * sine, over * cosine - down * sine)
        image = _inverse(found, times, reach, folded)
        image[0, 0] -= 1
        return image
    assert isinstance(table.point_spread, Wavefronts)
    spot_um = wavelength_nm * 1e-3 * table.f_number
    least = max(2, ceil(2 * step_um / spot_um * max(1.0, float(table.point_spread.pupil.max()))))
    times = scipy.fft.next_fast_len(least)
    # Places in the pupil are frequencies of the amplitude.
    down, over = np.meshgrid(*[np.fft.fftfreq(2 * reach * times, step_um / times) * 2 * spot_um] * 2, indexing="ij")
    along, across = down * cosine + over * sine, over * cosine - down * sine
    edge = spot_um / (reach * step_um)
    function = _pupil(table, height, wavelength_nm, along, across, edge)
    return _inverse(_correlated(function), times, reach, folded) - _ideal(spot_um, step_um, reach, times, folded)


def _correlated(pupil: NDArray[Any]) -> NDArray[np.complex128]:
    """Correlate a pupil function with itself; at 0, a place on the soft rim counts by its covered part."""
    amplitude = scipy.fft.ifft2(pupil.astype(np.complex64), overwrite_x=True)
    found = scipy.fft.fft2(amplitude.real**2 + amplitude.imag**2)
    found[0, 0] = np.abs(pupil).sum() / pupil.size
    return np.asarray(found)


@lru_cache(maxsize=4)
def _ideal(spot_um: float, step_um: float, reach: int, times: int, folded: bool) -> Floats:
    """Return the image of a point by a round pupil without aberrations, computed by the same sums as one with them."""
    places = np.fft.fftfreq(2 * reach * times, step_um / times) * 2 * spot_um
    amplitude = np.clip((1 - np.hypot(places[:, None], places)) / (spot_um / (reach * step_um)) + 0.5, 0.0, 1.0)
    return _inverse(_correlated(amplitude), times, reach, folded)


def _of_kernel(kernel: Floats, step_um: float, radial: Floats, across: Floats) -> NDArray[np.complex128]:
    """Return the Fourier transform of a kernel at frequencies; 0 beyond half the sampling frequency of its points."""
    side = scipy.fft.next_fast_len(_PAD * len(kernel))
    padded = np.zeros((side, side))
    padded[: len(kernel), : len(kernel)] = kernel
    spectrum = np.fft.fftshift(np.fft.fft2(np.roll(padded, (-(len(kernel) // 2),) * 2, (0, 1))))
    at = [f * step_um * side + side // 2 for f in (radial, across)]
    parts = [scipy.ndimage.map_coordinates(x, at, order=3, mode="grid-wrap") for x in (spectrum.real, spectrum.imag)]
    seen = np.maximum(np.abs(radial), np.abs(across)) * step_um <= 0.5
    return np.asarray(np.where(seen, parts[0] + 1j * parts[1], 0.0))


def _inverse(found: NDArray[np.complex128], times: int, reach: int, folded: bool) -> Floats:
    """Return the kernel of sum 1 at the samples, from a transfer known up to `times` their frequencies.

    Frequencies beyond those of the samples are aliased into them.
    """
    if folded:
        kernel = scipy.fft.ifft2(found).real[::times, ::times].astype(np.float64)
        return np.asarray(kernel / kernel.sum())
    side = 2 * reach
    index = np.arange(side) - side * (np.arange(side) >= reach)
    f = np.abs(index) / side
    # Along an axis sinc^2 of f and of f - 1, over their sum.
    energies = (1 - f) ** 2 / ((1 - f) ** 2 + f**2), f**2 / ((1 - f) ** 2 + f**2)
    total = np.zeros((side, side), np.complex128)
    for down, across in product((0, 1), (0, 1)):
        rows, columns = (index - copy * side * np.where(index >= 0, 1, -1) for copy in (down, across))
        total += energies[down][:, None] * energies[across] * found[np.ix_(rows, columns)]
    return np.asarray(np.fft.ifft2(total / total[0, 0]).real)
