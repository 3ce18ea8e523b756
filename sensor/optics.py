"""From scene radiance to irradiance on the sensor."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from render.errors import InputError
from render.photometry import luminance, photons_per_joule
from render.radiance import SpectralRadiance, check_values
from render.spectrum import Floats, band_widths
from sensor.config import LensConfig, SensorConfig

LEFT_OUT = ("diffraction", "cos^4 falloff", "veiling glare")  # what `form_image` doesn't model


@dataclass(frozen=True)
class SpectralIrradiance:
    """Irradiance on the sensor plane.

    Attributes
    ----------
    values : (h, w, band) floating
        Band means [W m^-2 nm^-1], one pixel a sensor pixel.
    wavelength_nm : (band,) float64
    pitch_um : float
    width_nm : (band,) float64, optional
    """

    values: NDArray[np.floating]
    wavelength_nm: Floats
    pitch_um: float
    width_nm: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", np.array(self.wavelength_nm, dtype=np.float64))
        object.__setattr__(self, "width_nm", band_widths(self.wavelength_nm, self.width_nm))
        if self.values.ndim != 3 or self.values.shape[2] != self.wavelength_nm.size:
            raise InputError(
                f"irradiance: shape {self.values.shape} is not (h, w, {self.wavelength_nm.size}); give one value a band"
            )
        check_values("irradiance", self.values)

    @property
    def widths_nm(self) -> Floats:
        """Width of each band, shape (band,)."""
        return band_widths(self.wavelength_nm, self.width_nm)

    def illuminance(self) -> NDArray[np.float64]:
        """Illuminance of each pixel [lux], shape (h, w)."""
        return luminance(self.values, self.wavelength_nm, self.widths_nm)

    def photons(self) -> NDArray[np.float64]:
        """Photons of all bands together [um^-2 s^-1], shape (h, w)."""
        weights = photons_per_joule(self.wavelength_nm) * self.widths_nm * 1e-12
        return np.asarray(self.values @ weights, dtype=np.float64)


def camera_equation(lens: LensConfig) -> float:
    """Irradiance over radiance on the axis [sr]: pi T / (1 + 4 N^2 (1 + |m|)^2)."""
    return pi * lens.transmittance / (1 + 4 * lens.f_number**2 * (1 + lens.magnification) ** 2)


def form_image(radiance: SpectralRadiance, sensor: SensorConfig) -> SpectralIrradiance:
    """Image a scene onto the sensor: the camera equation alone (`LEFT_OUT` lists the rest).

    A box-filtered render pixel already holds the pixel's aperture, and becomes one sensor pixel.
    """
    factor = radiance.values.dtype.type(camera_equation(sensor.lens))
    return SpectralIrradiance(
        radiance.values * factor, radiance.wavelength_nm, sensor.pixel.pitch_um, radiance.widths_nm
    )
