"""The noise-free picture against which others are measured, and the known scale of a camera's electrons."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, Spectrum, luminance, tristimulus
from render.transport import Transport
from rodcone.colour_spaces import WHITE_AT, WHITE_PERCENTILE, adapt_to_d65, xyz_to_srgb
from rodcone.display import brief
from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.optics import camera_equation
from sensor.response import electrons_per_irradiance, mixing_of

GREY = 0.18  # reflectance of a grey card


@dataclass(frozen=True)
class Light:
    """The light of a study: its spectrum of 1 cd/m^2, in bands.

    Attributes
    ----------
    wavelength_nm, width_nm, spectrum : (band,) float64
    lamp : Spectrum
        The spectrum from which the bands were averaged, up to a factor.
    """

    wavelength_nm: Floats
    width_nm: Floats
    spectrum: Floats
    lamp: Spectrum

    __repr__ = brief


def light_in_bands(spectrum: Spectrum, wavelength_nm: Floats, width_nm: Floats) -> Light:
    """Average a spectrum over bands and scale it to 1 cd/m^2."""
    values = spectrum.band_average(wavelength_nm, width_nm)
    return Light(
        wavelength_nm, width_nm, values / float(luminance(values, wavelength_nm, width_nm, spectrum)), spectrum
    )


def named_light(name: str, window_nm: tuple[float, float] = VISIBLE_NM) -> Light:
    """Return an illuminant of 1 cd/m^2 in bands of 1 nm that cover 380-780 nm and a camera's window.

    Bands outside the illuminant's table are dark.
    """
    first_nm, last_nm = lit_range(window_nm, 1.0)
    nm: Floats = np.arange(first_nm + 0.5, last_nm)
    return light_in_bands(illuminant(name), nm, np.ones_like(nm))


def lit_range(window_nm: tuple[float, float], step_nm: float) -> tuple[float, float]:
    """Return the range 380-780 nm, extended by whole steps until it contains a camera's window."""
    low, high = VISIBLE_NM
    below, above = (max(ceil(beyond / step_nm), 0) * step_nm for beyond in (low - window_nm[0], window_nm[1] - high))
    return low - below, high + above


def shown_white_cd_m2(transport: Transport, luminance_cd_m2: float | None) -> float:
    """Return the luminance that is shown as white [cd/m^2], for a level of the transport's lights.

    If `luminance_cd_m2` is None, the lights have their own powers. Lamps that are seen directly don't count, nor do the
    parts of pixels that they cover.
    """
    return white_of_pixels(transport.scattered_luminance(luminance_cd_m2=luminance_cd_m2), transport.coverage.mean)


def white_of_pixels(luminance: NDArray[np.float64], coverage: NDArray[np.floating]) -> float:
    """Return the luminance that is shown as white [cd/m^2], from the luminances of all pixels.

    Parameters
    ----------
    luminance, coverage : (h, w) array
        Luminance without lamps that are seen directly, and the share of each pixel that such lamps cover, as in
        `render.transport.Transport`.
    """
    # Without weights NumPy finds the same value by partition instead of sorting, in a tenth of the time.
    weights = 1.0 - coverage.astype(np.float64) if coverage.any() else None
    return float(np.percentile(luminance, WHITE_PERCENTILE, weights=weights, method="inverted_cdf")) / WHITE_AT


def true_srgb(radiance: SpectralRadiance, light: Light, white_cd_m2: float) -> NDArray[np.float64]:
    """Return linear sRGB of the scene, Bradford-adapted from its light to D65, shape (h, w, 3).

    A luminance of `white_cd_m2` has the value 1.
    """
    white = tristimulus(light.spectrum, light.wavelength_nm, light.width_nm, light.lamp)
    xyz = tristimulus(radiance.values, radiance.wavelength_nm, radiance.widths_nm, radiance.light)
    return xyz_to_srgb(adapt_to_d65(xyz, white) / white_cd_m2)


def neutral_electrons(sensor: SensorConfig, light: Light, exposure_s: float) -> Floats:
    """Return the expected electrons in each channel's raw pixel from a neutral surface of 1 cd/m^2, shape (channel,).

    Crosstalk is included: these are the mean samples of an even neutral field.

    Green's electrons are the known scale: a developed picture, divided by them, is in cd/m^2. The scale doesn't depend
    on the noisy picture.
    """
    whole = sensor.undivided
    weights = electrons_per_irradiance(whole, light.wavelength_nm, light.width_nm, exposure_s, light.lamp)
    return np.asarray(mixing_of(sensor) @ weights @ light.spectrum * camera_equation(sensor.lens))
