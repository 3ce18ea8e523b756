"""Photons, luminance and colour of spectral quantities; exact SI constants, defined once."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.published_spectra import published_spectra
from render.spectrum import Spectrum
from rodcone.types import Floats

PLANCK_J_S = 6.62607015e-34  # exact, SI 2019
LIGHT_M_S = 299792458.0  # exact
LUMINOUS_EFFICACY_LM_W = 683.0  # SI: K_cd at 540 THz


@cache
def colour_matching_functions() -> tuple[Spectrum, Spectrum, Spectrum]:
    """CIE 1931 2-degree x, y, z at 1 nm from 360 to 830 nm (CIE 018:2019)."""
    x, y, z = (Spectrum(nm, np.maximum(values, 0.0)) for nm, values in published_spectra("observer").values())
    return x, y, z


def luminous_efficiency(wavelength_nm: ArrayLike, width_nm: ArrayLike) -> Floats:
    """Mean of V(lambda) in each band; V is the y of the CIE 1931 observer."""
    return colour_matching_functions()[1].band_average(wavelength_nm, width_nm)


def luminance(spectral: NDArray[np.floating], wavelength_nm: ArrayLike, width_nm: ArrayLike) -> NDArray[np.float64]:
    """Photometric value of a spectral radiometric one over its last axis (band): K_m sum L V d_lambda.

    Radiance [W m^-2 sr^-1 nm^-1] gives luminance [cd m^-2]; irradiance [W m^-2 nm^-1] gives illuminance [lux].
    """
    weights = luminous_efficiency(wavelength_nm, width_nm) * np.asarray(width_nm)
    return np.asarray(LUMINOUS_EFFICACY_LM_W * (spectral @ weights), dtype=np.float64)


def tristimulus(spectral: NDArray[np.floating], wavelength_nm: ArrayLike, width_nm: ArrayLike) -> NDArray[np.float64]:
    """XYZ [cd m^-2] of spectral radiance over its last axis (band): shape (..., 3), Y is luminance."""
    curves = [curve.band_average(wavelength_nm, width_nm) for curve in colour_matching_functions()]
    weights = np.stack(curves, axis=-1) * np.asarray(width_nm)[:, None]
    return np.asarray(LUMINOUS_EFFICACY_LM_W * (spectral @ weights), dtype=np.float64)


def photons_per_joule(wavelength_nm: ArrayLike) -> Floats:
    """Photons in a joule of light: lambda / (h c)."""
    return np.asarray(wavelength_nm, dtype=np.float64) * 1e-9 / (PLANCK_J_S * LIGHT_M_S)
