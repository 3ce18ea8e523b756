"""What `form_image` leaves out for a camera, and what that costs."""

from math import pi, radians, tan

import numpy as np
from scipy.fft import dctn, idctn

from sensor.config import LensConfig, SensorConfig
from sensor.diffraction import defocus_otf, diffraction_otf, limit_per_um, sampled_otf

WAVELENGTH_NM = 550.0  # at which costs are stated
VIEW_DEG = 40.0  # angle of view that the falloff is stated for
DIAGONAL = 1.25  # over the width of a picture of 4:3
APERTURE_AT_NYQUIST = 2 / pi  # transfer of a square pixel there, sin(pi / 2) / (pi / 2)
_WORTH_TELLING = 5e-4  # of a point's light
AIRY_DIAMETER = 2.44  # of the first dark ring, in wavelengths x f-number


def left_out(sensor: SensorConfig, samples_per_pixel: int = 1) -> tuple[str, ...]:
    """One line for each effect of a lens that `form_image` leaves out or takes simply, with what that costs.

    MTFs are those of lens and pixel aperture together, at 550 nm, for the camera's own pixel and f-number.
    """
    lens, nyquist = sensor.lens, np.array(0.5 / sensor.pixel.pitch_um)
    lines = []
    if not lens.diffraction:
        ideal = LensConfig(lens.f_number, magnification=lens.magnification, diffraction=1.0)
        lines.append(f"diffraction: {_at_nyquist(float(diffraction_otf(nyquist, WAVELENGTH_NM, ideal)))}")
    if samples_per_pixel == 1 and under_zero(sensor) >= _WORTH_TELLING:
        lines.append(
            f"detail finer than a pixel: {under_zero(sensor):.1%} of a point's light is taken from around it, to 0 at "
            "most, and given to its own pixel; 4 samples a pixel are free of that"
        )
    if samples_per_pixel > 1 and lens.diffraction and _folded_excess(sensor, samples_per_pixel) > 0:
        excess = APERTURE_AT_NYQUIST * _folded_excess(sensor, samples_per_pixel)
        lines.append(
            f"detail finer than a sample: it lifts the MTF at Nyquist by {excess:.3f}; more samples a pixel don't"
        )
    if not lens.horizontal_view_deg:
        corner = (1 + (tan(radians(VIEW_DEG / 2)) * DIAGONAL) ** 2) ** -2
        lines.append(
            f"cos^4 falloff: a picture of 4:3, {VIEW_DEG:g} degrees wide, would lose {1 - corner:.0%} in its corners"
        )
    if not lens.veiling_glare:
        lines.append("veiling glare: each per cent would add 1 % of the picture's mean irradiance to every pixel")
    if not lens.defocus_um:
        disc = float(defocus_otf(nyquist, sensor.pixel.pitch_um))
        lines.append(f"defocus: a disc as wide as a pixel: {_at_nyquist(disc)}")
    elif lens.diffraction and lens.defocus_um < AIRY_DIAMETER / limit_per_um(WAVELENGTH_NM, lens):
        lines.append("defocus: its disc is within the Airy disc, where the product of both transfers is a rough guess")
    return (*lines, "aberrations, distortion, flare, polarisation: not modelled, their cost isn't estimated")


def under_zero(sensor: SensorConfig) -> float:
    """Share of a point's light in the negative lobes of its image, 32 pixels around, where one sample is a pixel."""
    side = 32
    shape = (2 * side, 2 * side)
    point = np.zeros(shape)
    point[side, side] = 1.0
    transfer = sampled_otf(shape, sensor.pixel.pitch_um, WAVELENGTH_NM, sensor.lens, folded=False)
    image = idctn(dctn(point) * transfer)
    return float(-image[image < 0].sum())


def _folded_excess(sensor: SensorConfig, samples_per_pixel: int) -> float:
    """Transfer that the nearest copy adds at the pixels' Nyquist frequency (`sensor.diffraction.sampled_otf`)."""
    frequency = np.array((samples_per_pixel - 0.5) / sensor.pixel.pitch_um)
    return float(diffraction_otf(frequency, WAVELENGTH_NM, sensor.lens))


def _at_nyquist(transfer: float) -> str:
    return (
        f"it would take the MTF at Nyquist from {APERTURE_AT_NYQUIST:.2f} to {APERTURE_AT_NYQUIST * abs(transfer):.2f}"
    )
