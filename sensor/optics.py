"""From scene radiance to irradiance on the sensor."""

from dataclasses import dataclass
from math import pi, radians, tan

import numpy as np
from numpy.typing import NDArray

from render.photometry import luminance, photons_per_joule
from render.radiance import SpectralRadiance, check_values
from render.spectrum import Floats, band_widths
from rodcone.errors import InputError, require_whole
from sensor.config import LensConfig, SensorConfig
from sensor.diffraction import spread_light


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
    signed : bool
        As of `SpectralRadiance`.
    """

    values: NDArray[np.floating]
    wavelength_nm: Floats
    pitch_um: float
    width_nm: Floats | None = None
    signed: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength_nm", np.array(self.wavelength_nm, dtype=np.float64))
        object.__setattr__(self, "width_nm", band_widths(self.wavelength_nm, self.width_nm))
        if self.values.ndim != 3 or self.values.shape[2] != self.wavelength_nm.size:
            raise InputError(
                f"irradiance: shape {self.values.shape} is not (h, w, {self.wavelength_nm.size}); give one value a band"
            )
        check_values("irradiance", self.values, self.signed)

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


def falloff(lens: LensConfig, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Irradiance of each pixel over that on the axis: cos^4 of its angle, shape `shape`."""
    tangent = tan(radians(lens.horizontal_view_deg / 2)) / (shape[1] / 2)
    rows, columns = ((np.arange(size) - (size - 1) / 2) * tangent for size in shape)
    return np.asarray((1.0 + rows[:, None] ** 2 + columns**2) ** -2)


def spreads(lens: LensConfig) -> bool:
    """Whether light of one point reaches other pixels, so that a picture can't be imaged in parts."""
    return lens.diffraction > 0 or lens.defocus_um > 0 or lens.veiling_glare > 0


def form_image(radiance: SpectralRadiance, sensor: SensorConfig, samples_per_pixel: int = 1) -> SpectralIrradiance:
    """Image a scene onto the sensor: camera equation, cos^4, diffraction and defocus, veiling glare, in this order.

    Parameters
    ----------
    radiance : SpectralRadiance
        Box-filtered samples. One a pixel already holds the pixel's aperture, and the optical transfer function is all
        that it lacks; detail finer than a pixel has aliased by then.
    sensor : SensorConfig
        A term of its lens that is 0 costs nothing; `sensor.left_out` says what that leaves out.
    samples_per_pixel : int
        Samples of `radiance` along each side of a pixel, 1 to 64; more than one are averaged behind the lens. 4 image
        detail finer than a pixel as the lens does, at 16 times the cost.

    Returns
    -------
    SpectralIrradiance
        One value a sensor pixel and band, in the radiance's precision. Light is neither gained nor lost at the border,
        where the picture goes on as its mirror image.

    Raises
    ------
    InputError
        Where the samples don't make whole pixels.
    """
    require_whole("samples_per_pixel", samples_per_pixel, 1, 64, "give samples a side")
    lens, samples = sensor.lens, int(samples_per_pixel)
    if any(size % samples for size in radiance.shape):
        raise InputError(f"samples_per_pixel: {samples} don't divide the picture's {radiance.shape}; give whole pixels")
    factor = radiance.values.dtype.type(camera_equation(lens))
    if samples == 1 and not spreads(lens):
        values = radiance.values * factor
        if lens.horizontal_view_deg:
            values *= falloff(lens, radiance.shape)[..., None].astype(values.dtype)
    else:
        plane = camera_equation(lens) * falloff(lens, radiance.shape)
        values = spread_light(radiance, plane, lens, sensor.pixel.pitch_um, samples)
    return SpectralIrradiance(
        values, radiance.wavelength_nm, sensor.pixel.pitch_um, radiance.widths_nm, radiance.signed
    )
