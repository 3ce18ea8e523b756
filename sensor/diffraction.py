"""Transfer functions of diffraction and defocus."""

from collections.abc import Callable
from math import inf

import numpy as np
import scipy
from numpy.typing import NDArray

from render.spectrum import Floats
from sensor.config import LensConfig


def limit_per_um(wavelength_nm: float, lens: LensConfig) -> float:
    """Cut-off frequency of diffraction: 1 / (wavelength x working f-number); inf where the lens has none."""
    spot_um = wavelength_nm * 1e-3 * lens.f_number * (1 + lens.magnification) * lens.diffraction
    return 1 / spot_um if spot_um else inf


def diffraction_otf(frequency_per_um: Floats, wavelength_nm: float, lens: LensConfig) -> Floats:
    """Transfer of an incoherent image by a circular aperture: 2/pi (arccos s - s sqrt(1 - s^2)), 0 from s = 1 on.

    s is the frequency over its limit; Goodman, "Introduction to Fourier Optics", section 6.3.
    """
    s = np.minimum(frequency_per_um / limit_per_um(wavelength_nm, lens), 1.0)
    return np.asarray(2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)))


def defocus_otf(frequency_per_um: Floats, diameter_um: float) -> Floats:
    """Transfer of an even disc, 2 J1(x) / x with x = pi x diameter x frequency; negative in places.

    The geometric limit of Hopkins, "The frequency response of a defocused optical system" (Proc. R. Soc. A 231, 1955):
    good where the disc is wider than the Airy disc, from two wavelengths of path or more at the aperture's rim.
    """
    x = np.pi * diameter_um * frequency_per_um
    return np.asarray(np.divide(2 * scipy.special.j1(x), x, out=np.ones_like(x), where=x > 1e-9))


def sampled_otf(
    shape: tuple[int, int], step_um: float, lens: LensConfig, folded: bool
) -> Callable[[float], NDArray[np.float64]]:
    """Transfer at the cosines' frequencies of a picture with samples `step_um` apart, as a function of the wavelength.

    The function gives an array of shape `shape`, 1 at the first. What all bands share is computed once.

    Parameters
    ----------
    folded : bool
        False: the function itself, cut at the samples' Nyquist frequency. True: with its copies one sampling frequency
        away added, which is the transform of the point image taken at the samples (Poisson's sum). That is nowhere
        negative, and below the pixels' Nyquist frequency the same wherever the lens's limit lies under the sampling
        frequency less that.
    """
    rows, columns = (np.arange(size) / (2 * size * step_um) for size in shape)
    copies = [(0, 0), (-1, 0), (0, -1), (-1, -1)] if folded and lens.diffraction else [(0, 0)]

    def frequency_per_um(down: int, across: int) -> Floats:
        return np.asarray(np.hypot(rows[:, None] + down / step_um, columns + across / step_um))

    discs = [defocus_otf(frequency_per_um(*copy), lens.defocus_um) for copy in copies if lens.defocus_um]

    def of_band(wavelength_nm: float) -> Floats:
        if not lens.diffraction:
            return discs[0] if discs else np.ones(shape)
        limit, total = limit_per_um(wavelength_nm, lens), np.zeros(shape)
        for number, (down, across) in enumerate(copies):
            nearest = np.hypot(rows[-1] * bool(down), columns[-1] * bool(across))  # where a copy comes closest to 0
            if nearest < limit:
                transfer = diffraction_otf(frequency_per_um(down, across), wavelength_nm, lens)
                total += transfer * discs[number] if discs else transfer
        return total

    return of_band
