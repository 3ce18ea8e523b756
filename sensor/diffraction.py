"""Transfer functions of diffraction and defocus."""

from collections.abc import Callable
from itertools import product
from math import inf, nan

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from rodcone.types import Floats
from sensor.config import LensConfig


def limit_per_um(wavelength_nm: float, lens: LensConfig) -> float:
    """Return the cut-off frequency of diffraction, 1 / (wavelength x working f-number) [1/um]; inf without it."""
    spot_um = wavelength_nm * 1e-3 * lens.f_number * (1 + lens.magnification) * lens.diffraction
    return 1 / spot_um if spot_um else inf


def diffraction_otf(frequency_per_um: Floats, wavelength_nm: float, lens: LensConfig) -> Floats:
    """Return a circular aperture's incoherent transfer: 2/pi (arccos s - s sqrt(1 - s^2)), 0 from s = 1 on.

    Here s is the frequency over the cut-off (Goodman, "Introduction to Fourier Optics", section 6.3).
    """
    s = np.minimum(frequency_per_um / limit_per_um(wavelength_nm, lens), 1.0)
    return np.asarray(2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)))


def _fit() -> list[float]:
    """Fit the polynomial in s by which (1 - s)^1.5 has to be multiplied to give `diffraction_otf`, within 4e-8."""
    s = (1 - np.cos(np.pi * (np.arange(400) + 0.5) / 400)) / 2
    exact = diffraction_otf(s, 1e3, LensConfig(1.0, diffraction=1.0))
    falling = (1 - s) ** 1.5
    fitted = Polynomial.fit(s, exact / falling, 5, domain=[0, 1], window=[0, 1], w=falling + 1e-3)
    return [float(factor) for factor in fitted.coef[::-1]]  # Python's floats, so that s keeps its precision


_FIT = _fit()


def fast_otf(s: NDArray[np.floating], under: NDArray[np.floating], value: NDArray[np.floating]) -> None:
    """Write `diffraction_otf`, within 4e-8, at the frequencies s (in units of the cut-off) into `value`.

    The three arrays have one shape and one precision; the content of `under` is overwritten. Nothing is allocated.
    """
    np.subtract(1, s, out=under)
    if s[-1, -1] > 1 or s[0, 0] > 1 or s[0, -1] > 1 or s[-1, 0] > 1:  # frequencies of a rectangle: a corner is the last
        np.maximum(under, 0, out=under)
    np.multiply(s, _FIT[0], out=value)
    value += _FIT[1]
    for factor in _FIT[2:]:
        value *= s
        value += factor
    value *= under
    np.sqrt(under, out=under)
    value *= under


def defocus_otf(frequency_per_um: Floats, diameter_um: float) -> Floats:
    """Return the transfer function of an even disc, 2 J1(x) / x with x = pi x diameter x frequency; negative in places.

    This is the geometric limit of Hopkins, "The frequency response of a defocused optical system" (Proc. R. Soc. A 231,
    1955). It is good where the disc is wider than the Airy disc, from two wavelengths of path or more at the aperture's
    rim.
    """
    x = np.pi * diameter_um * frequency_per_um
    return np.asarray(np.divide(2 * scipy.special.j1(x), x, out=np.ones_like(x), where=x > 1e-9))


def half_frequency(frequency: Floats, transfer: Floats) -> float:
    """Return the first frequency at which a transfer is 0.5, by a straight line; nan where it stays above."""
    under = np.flatnonzero(transfer < 0.5)
    if not under.size:
        return nan
    last = slice(int(under[0]) - 1, int(under[0]) + 1)
    return float(np.interp(-0.5, -transfer[last], frequency[last]))


def sampled_otf(
    shape: tuple[int, int], step_um: float, lens: LensConfig, folded: bool, real: type[np.floating] = np.float64
) -> Callable[..., NDArray[np.floating]]:
    """Return the lens's transfer function on the frequency grid of a cosine transform, as a function of the wavelength.

    The function takes the wavelength [nm] and, optionally, a slice of rows. It returns an array of shape `shape`, or of
    these rows, which is 1 at the first frequency. Samples `step_um` apart can't distinguish a frequency from its
    aliases, which lie one sampling frequency away: each value combines the transfer of both. In focus no point image
    gets negative.

    Parameters
    ----------
    folded : bool
        False, for a picture's pixels: the mean of the aliases' transfers, weighted by the energy that a square pixel
        passes of each, sinc^2. A pixel's light is somewhere in its square, and of the four nearest aliases this gives
        the best linear estimate of what the next pixels get of it. True, for samples finer than the pixels: the sum of
        the aliases, which is the transform of the point image taken at the samples (Poisson's sum). Below the pixels'
        Nyquist frequency that is the lens's own transfer, provided that its limit lies under the sampling frequency
        less that.
    real : type
        Floating-point type of the result.
    """
    rows, columns = (np.arange(size) / (2 * size) for size in shape)
    # Along an axis sinc^2 of f and of f - 1, over their sum.
    energies = [((1 - f) ** 2 / ((1 - f) ** 2 + f**2), f**2 / ((1 - f) ** 2 + f**2)) for f in (rows, columns)]
    copies = list(product((0, 1), (0, 1))) if lens.diffraction or not folded else [(0, 0)]
    blurred: dict[tuple[int, int], NDArray[np.floating]] = {}  # the same for all wavelengths, and slow
    for down, across in copies if lens.defocus_um else []:
        frequency_per_um = np.hypot(rows[:, None] - down, columns - across) / step_um
        blurred[down, across] = defocus_otf(frequency_per_um, lens.defocus_um).astype(real)

    def sum_of_copies(limit_per_sample: float, at: slice, beside: slice) -> NDArray[np.floating]:
        total = np.zeros((rows[at].size, columns[beside].size), real)
        s, under, part = np.empty((3, *total.shape), real)
        for down, across in copies:
            down2, across2 = ((f / limit_per_sample) ** 2 for f in (rows[at] - down, columns[beside] - across))
            if lens.diffraction and down2.min() + across2.min() >= 1:
                continue
            if lens.diffraction:
                np.add(down2.astype(real)[:, None], across2.astype(real), out=s)
                fast_otf(np.sqrt(s, out=s), under, part)
            else:
                part.fill(1)
            if not folded:
                part *= energies[0][down][at].astype(real)[:, None]
                part *= energies[1][across][beside].astype(real)
            if lens.defocus_um:
                part *= blurred[down, across][at, beside]
            total += part
        return total

    def of_band(wavelength_nm: float, at: slice = slice(None)) -> NDArray[np.floating]:
        limit = step_um * limit_per_um(wavelength_nm, lens)
        first = slice(0, 1)
        total = sum_of_copies(limit, at, slice(None))
        total /= sum_of_copies(limit, first, first)[0, 0]
        return total

    return of_band
