"""From irradiance to the expected number of photo-electrons."""

import numpy as np
from numpy.typing import NDArray

from render.photometry import photons_per_joule
from render.spectrum import Floats
from rodcone.errors import require_range
from sensor.cfa import channels, check_covers, mask
from sensor.config import SensorConfig
from sensor.optics import SpectralIrradiance
from sensor.window import check_covered, check_window, inside_nm


def electrons_per_irradiance(
    sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats, exposure_s: float
) -> Floats:
    """Electrons of each channel per unit irradiance in each band, shape (channel, band).

    Response x photons per joule x band width (its part inside the camera's window) x collecting area x time.

    Raises
    ------
    InputError
        For a negative exposure, a window beyond 380-780 nm that the bands don't reach, or bands that leave out more
        than half of a channel's response.

    Warns
    -----
    UserWarning
        Where the bands don't fill the camera's window: what each channel loses.
    """
    require_range("exposure_s", exposure_s, 0.0, 1e7, "give seconds, 0 or more")
    check_window(sensor.window_nm, wavelength_nm, width_nm)
    check_covered(sensor, wavelength_nm, width_nm)
    seen_nm = inside_nm(sensor.window_nm, wavelength_nm, width_nm)
    response = sensor.responses.band_average(channels(sensor.cfa), wavelength_nm, width_nm)
    area_m2 = (sensor.pixel.pitch_um * 1e-6) ** 2 * sensor.pixel.fill_factor
    return np.asarray(response * photons_per_joule(wavelength_nm) * seen_nm * area_m2 * exposure_s)


def channel_electrons(irradiance: SpectralIrradiance, sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Expected photo-electrons that each pixel would collect behind every filter, shape (h, w, channel)."""
    weights = electrons_per_irradiance(sensor, irradiance.wavelength_nm, irradiance.widths_nm, exposure_s)
    planes = np.moveaxis(irradiance.values, -1, 0)
    flat = planes.reshape(planes.shape[0], -1)  # a view where the memory is band-planar
    electrons = weights.astype(flat.dtype) @ flat
    return np.asarray(np.moveaxis(electrons.reshape(-1, *planes.shape[1:]), 0, -1), dtype=np.float64)


def expected_electrons(irradiance: SpectralIrradiance, sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Expected photo-electrons behind each pixel's own filter, shape (h, w); dark current comes with `read_out`.

    Parameters
    ----------
    irradiance : SpectralIrradiance
        Bands that it lacks count as dark, which is told, and refused where a channel loses more than half.
    sensor : SensorConfig
    exposure_s : float
        0 or more [s].

    Raises
    ------
    InputError
        For a negative exposure, a frame smaller than the mosaic's tile, and as `electrons_per_irradiance`.
    """
    electrons = channel_electrons(irradiance, sensor, exposure_s)
    shape = (electrons.shape[0], electrons.shape[1])
    check_covers(sensor.cfa, shape)
    result = np.empty(shape)
    for index, letter in enumerate(channels(sensor.cfa)):
        here = mask(sensor.cfa, letter, shape)
        result[here] = electrons[here, index]
    return result
