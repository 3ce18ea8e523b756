"""Colour calibration of a camera on the ColorChecker, as a laboratory fills in a digital negative's tags."""

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import fit_through_neutral, grey_of, training
from render.illuminants import illuminant
from render.photometry import photons_per_joule, tristimulus
from render.spectrum import DEFAULT_WAVELENGTH_NM, Floats, Spectrum, band_widths
from rodcone.colour_spaces import D50_XYZ, adapt_to_d65, xyz_to_srgb
from rodcone.errors import InputError
from scenes.reflectances import color_checker
from sensor.calibration import ColourCalibration
from sensor.cfa import channels, unit_channel
from sensor.config import SensorConfig
from sensor.optics import camera_equation
from sensor.response import electrons_per_irradiance
from studies.metrics.truth import Light, green_scale, light_in_bands

ISO_SATURATION_LUX_S = 78.0  # ISO 12232:2019: saturation-based speed is 78 / exposure that saturates [lux s]


def calibrate(sensor: SensorConfig, light: Spectrum) -> ColourCalibration:
    """Fit a camera's colours under the light of an exposure, illuminant A and D65.

    Parameters
    ----------
    sensor : SensorConfig
        The first three channels of its mosaic, R, G and B where it has them, tell colours. Channels beyond these get a
        fitted column from XYZ, and carry no colour back. One or two channels give grey.
    light : Spectrum
        What the camera's white balance is set to.

    Raises
    ------
    InputError
        Where a channel collects nothing, or the three can't tell colours apart.
    """
    neutral, to_srgb, _, _ = _under(sensor, light)
    _, _, to_camera_a, to_xyz_a = _under(sensor, illuminant("A"))
    _, _, to_camera_d65, to_xyz_d65 = _under(sensor, illuminant("D65"))
    return ColourCalibration(
        neutral=neutral,
        to_srgb=to_srgb,
        xyz_to_camera_a=to_camera_a,
        xyz_to_camera_d65=to_camera_d65,
        camera_to_xyz_a=to_xyz_a,
        camera_to_xyz_d65=to_xyz_d65,
    )


def iso_speed(sensor: SensorConfig) -> float | None:
    """Saturation-based speed of green under D65; None where the mosaic has no G or it collects nothing.

    The exposure that fills the well with green's mean; no half stop of headroom is taken off.
    """
    if "G" not in channels(sensor.cfa):
        return None
    light = _in_bands(illuminant("D65"))
    electrons_per_cd_m2 = green_scale(sensor, light, 1.0)
    if electrons_per_cd_m2 <= 0:
        return None
    per_lux_s = electrons_per_cd_m2 / camera_equation(sensor.lens)
    return ISO_SATURATION_LUX_S * per_lux_s / sensor.metered_well_e


def _in_bands(spectrum: Spectrum) -> Light:
    return light_in_bands(spectrum, DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM))


def _under(sensor: SensorConfig, spectrum: Spectrum) -> tuple[Floats, Floats, Floats, Floats]:
    """Neutral, matrix to sRGB, matrix from XYZ and matrix to XYZ (D50) under one light."""
    light = _in_bands(spectrum)
    nm, width = light.wavelength_nm, light.width_nm
    electrons = electrons_per_irradiance(sensor, nm, width, 1.0)
    response = electrons / (photons_per_joule(nm) * width)  # inside the camera's window
    names = channels(sensor.cfa)
    three = list(range(min(len(names), 3)))
    collected = electrons @ light.spectrum
    if not np.all(collected > 0):
        raise InputError(
            f"responses: {names[int(np.argmin(collected))]} collects nothing under the light, 380-780 nm; "
            "allowed: a channel that sees light; give another curve"
        )
    surfaces = np.array([reflectance.band_average(nm, width) for _, reflectance in color_checker()])
    signals, colours = training(response[three], nm, light.spectrum, surfaces)
    to_srgb = fit_through_neutral(signals, colours if len(three) == 3 else grey_of(colours))
    if len(three) == 3 and np.linalg.cond(to_srgb) > 1e6:
        raise InputError(
            f"responses: {', '.join(names[:3])} can't tell colours apart; allowed: three different curves; correct one"
        )
    white = tristimulus(light.spectrum, nm, width)  # Y = 1
    from_xyz = _srgb_of_xyz(white)
    target = xyz_to_srgb(adapt_to_d65(tristimulus(surfaces * light.spectrum, nm, width), white))
    balanced = (surfaces * light.spectrum) @ electrons.T / collected
    from_srgb = fit_through_neutral(target, balanced)
    if len(three) == 3:
        from_srgb[three] = np.linalg.inv(to_srgb)
    neutral = collected / collected[names.index(unit_channel(sensor.cfa))]
    to_xyz = np.zeros((3, len(names)))
    to_xyz[:, three] = (
        np.linalg.inv(_srgb_of_xyz(D50_XYZ)) @ to_srgb
    )  # D50: the connection space of DNG's ForwardMatrix
    return neutral, to_srgb, neutral[:, None] * from_srgb @ from_xyz, to_xyz


def _srgb_of_xyz(white: Floats) -> NDArray[np.float64]:
    """Matrix from XYZ under a light to linear sRGB, adapted to D65."""
    return np.asarray(xyz_to_srgb(adapt_to_d65(np.eye(3), white)).T)
