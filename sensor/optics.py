"""Compute the irradiance on the sensor from scene radiance, and list the effects of a lens that this leaves out.

Where a lens spreads light the picture is transformed by cosines (DCT-II), which continue it as its own mirror image: no
border darkens, and the sum of the light is kept to rounding. `form_image` transforms each band there and back in double
precision. A camera collects sums over bands, one for each filter. A lens is linear, so that `image_sums` adds the
transformed bands and transforms the few sums back, in single precision where no lamp in view asks for more.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import ceil, inf, isnan, pi, radians, tan
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from render.radiance import BandRadiance, SpectralRadiance, band_extents, band_plane, check_values
from render.spectrum import Spectrum, band_widths, luminance, photons_per_joule
from rodcone.display import brief
from rodcone.errors import InputError, require_whole
from rodcone.types import Floats
from sensor.config import LONGEST_S, LensConfig, SensorConfig
from sensor.diffraction import defocus_otf, diffraction_otf, half_frequency, limit_per_um, sampled_otf
from sensor.lens.illumination import darkens, falloff
from sensor.lens.patches import mover, spreader
from sensor.lens.scatter import scatterer, scatters
from sensor.lens.table import Kernels, lens_table
from sensor.shake import SHAKES, blur_variance

# For the costs that `left_out` states.
WAVELENGTH_NM = 550.0
VIEW_DEG = 40.0  # angle of view for the falloff
DIAGONAL = 1.25  # diagonal of a 4:3 picture over its width
APERTURE_AT_NYQUIST = 2 / pi  # transfer of a square pixel at the Nyquist frequency, sin(pi / 2) / (pi / 2)
AIRY_DIAMETER = 2.44  # diameter of the first dark ring over wavelength x f-number
# Single precision is used if the brightest light is at most this many times the mean; its error grows with the
# brightest light.
MOST_OVER_MEAN = 10.0
_AT_ONCE = 2**17  # frequencies that a thread computes at once: few enough for its cache
_LEAST_LOSS = 5e-4  # smaller losses of MTF aren't stated


@dataclass(frozen=True)
class SpectralIrradiance:
    """Irradiance on the sensor plane.

    Attributes
    ----------
    values : (h, w, band) floating
        Band means [W m^-2 nm^-1] at each sensor pixel.
    wavelength_nm : (band,) float64
    pitch_um : float
    width_nm : (band,) float64, optional
    signed : bool
    light : Spectrum, optional
        As in `SpectralRadiance`.
    """

    values: NDArray[np.floating]
    wavelength_nm: Floats
    pitch_um: float
    width_nm: Floats | None = None
    signed: bool = False
    light: Spectrum | None = None

    __repr__ = brief

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
        """Return the width of each band [nm], shape (band,)."""
        return band_widths(self.wavelength_nm, self.width_nm)

    def illuminance(self) -> NDArray[np.float64]:
        """Return the illuminance of each pixel [lux], shape (h, w)."""
        return luminance(self.values, self.wavelength_nm, self.widths_nm, self.light)

    def photons(self) -> NDArray[np.float64]:
        """Return the photons of all bands together [um^-2 s^-1], shape (h, w)."""
        weights = photons_per_joule(self.wavelength_nm) * self.widths_nm * 1e-12
        return np.asarray(self.values @ weights, dtype=np.float64)


def camera_equation(lens: LensConfig) -> float:
    """Return the ratio of irradiance to radiance on the axis [sr]: pi T / (1 + 4 N^2 (1 + |m|)^2)."""
    return pi * lens.transmittance / (1 + 4 * lens.f_number**2 * (1 + lens.magnification) ** 2)


def spreads(lens: LensConfig) -> bool:
    """Return whether the lens spreads a point's light over other pixels: a picture then can't be imaged in parts."""
    blurs = lens.diffraction > 0 or lens.defocus_um > 0 or bool(lens.table)
    return blurs or lens.veiling_glare > 0 or scatters(lens)


def form_image(radiance: SpectralRadiance, sensor: SensorConfig, samples_per_pixel: int = 1) -> SpectralIrradiance:
    """Image a scene onto the sensor: camera equation, falloff, diffraction and defocus, scatter, veiling glare.

    Parameters
    ----------
    radiance : SpectralRadiance
        Box-filtered samples. One sample per pixel already includes the pixel's aperture, but doesn't say where in the
        pixel its light lies (`sensor.diffraction.sampled_otf`).
    sensor : SensorConfig
        A term of its lens that is 0 costs nothing; `left_out` says what that leaves out.
    samples_per_pixel : int
        Samples of `radiance` along each side of a pixel, 1 to 64; more than one are averaged behind the lens. 4 image
        detail finer than a pixel as the lens does, at 16 times the cost.

    Returns
    -------
    SpectralIrradiance
        One value per sensor pixel and band, in the radiance's precision. Light is neither gained nor lost at the
        border, where the picture goes on as its mirror image; what a lens scatters beyond the border is lost.

    Raises
    ------
    InputError
        Where the samples don't make whole pixels; for a lens that scatters, or falls off by a power, and an angle of
        view that isn't known.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.ones((8, 8, 4)), np.arange(430.0, 780.0, 100.0))
    >>> image = rodcone.form_image(light, rodcone.low_noise())
    >>> image.values.shape
    (8, 8, 4)
    """
    shape = pixel_shape(radiance, samples_per_pixel)
    samples = int(samples_per_pixel)
    lens = sensor.lens
    values_type = radiance.values.dtype.type
    if samples == 1 and not spreads(lens):
        values = radiance.values * values_type(camera_equation(lens))
        if darkens(lens):
            values *= falloff(lens, radiance.shape, radiance.horizontal_view_deg)[..., None].astype(values.dtype)
    else:
        imaged = _imager(radiance, sensor, samples, np.float64)
        planes = np.empty((radiance.wavelength_nm.size, *shape), values_type)
        for plane, of_one_band in zip(planes, np.eye(len(planes)), strict=True):
            plane[:] = imaged(of_one_band[None])[0]
        values = np.moveaxis(planes, 0, -1)
    return SpectralIrradiance(
        values=values,
        wavelength_nm=radiance.wavelength_nm,
        pitch_um=sensor.site_pitch_um,
        width_nm=radiance.widths_nm,
        signed=radiance.signed,
        light=radiance.light,
    )


def image_sums(
    radiance: SpectralRadiance | BandRadiance, weights: Floats, sensor: SensorConfig, samples_per_pixel: int = 1
) -> NDArray[np.float64]:
    """Return weighted sums over bands of what `form_image` gives, shape (h, w, sum), at one inverse transform per sum.

    Where the brightest light is at most `MOST_OVER_MEAN` times the mean in each band, they are computed in single
    precision. Their error is then up to 1e-6 of the pixel's own light and the mean together, which would be much for
    the dark parts beside a lamp in view: there they are computed in double precision. Undershoot becomes 0 in each sum;
    `form_image` sets it to 0 in each band.

    Parameters
    ----------
    radiance, sensor, samples_per_pixel
        As in `form_image`.
    weights : (sum, band) float64
        Weights of irradiance, such as `sensor.response.electrons_per_irradiance`.

    Raises
    ------
    InputError
        As in `form_image`.
    """
    imaged = _imager(radiance, sensor, samples_per_pixel, _enough(radiance))
    largest = float(np.abs(weights).max(initial=0.0)) or 1.0
    # Weights in electrons per watt would be beyond the range of single precision.
    sums = imaged(weights / largest)
    sums *= largest
    return np.moveaxis(sums, 0, -1)


def pixel_shape(radiance: SpectralRadiance | BandRadiance, samples_per_pixel: int) -> tuple[int, int]:
    """Return the rows and columns of pixels that the samples make.

    Raises
    ------
    InputError
        Where the samples don't make whole pixels.
    """
    require_whole("samples_per_pixel", samples_per_pixel, 1, 64, "give samples a side")
    samples = int(samples_per_pixel)
    if any(size % samples for size in radiance.shape):
        raise InputError(f"samples_per_pixel: {samples} don't divide the picture's {radiance.shape}; give whole pixels")
    return radiance.shape[0] // samples, radiance.shape[1] // samples


def _enough(radiance: SpectralRadiance | BandRadiance) -> type[np.floating]:
    """Return the floating-point type that a picture's range of light needs."""
    if isinstance(radiance, SpectralRadiance) and radiance.values.dtype != np.float32:
        return np.float64
    most, mean = band_extents(radiance)
    even = bool(np.all(most <= MOST_OVER_MEAN * mean))
    return np.float32 if even else np.float64


def _imager(
    radiance: SpectralRadiance | BandRadiance, sensor: SensorConfig, samples: int, real: type[np.floating]
) -> Callable[[Floats], NDArray[np.float64]]:
    """Return a function that takes weights (sum, band) and gives these sums behind the lens, (sum, h, w).

    Bands without weight cost nothing. A sum's value doesn't depend on the number of threads.
    """
    # What the lens does.
    pixels, lens, (height, width) = pixel_shape(radiance, samples), sensor.lens, radiance.shape
    view = radiance.horizontal_view_deg
    step_um = sensor.site_pitch_um / samples
    threads = os.cpu_count() or 1
    moved, spread = None, None
    if lens.table:
        table = lens_table(lens)
        real = np.float64
        lens = replace(lens, diffraction=0.0 if isinstance(table.point_spread, Kernels) else 1.0)
        moved = mover(table, radiance.shape, step_um)
        if table.point_spread is not None:
            spread = spreader(table, radiance.shape, step_um, samples > 1, threads)
    per_radiance: NDArray[Any] = (camera_equation(lens) * falloff(lens, radiance.shape, view)).astype(real)
    otf = None
    if lens.diffraction or lens.defocus_um:
        otf = sampled_otf(radiance.shape, step_um, lens, folded=samples > 1, real=real)
    scattered = scatterer(lens, pixels, view) if scatters(lens) else None
    step = max(_AT_ONCE // width, 1)
    strips = [slice(first, first + step) for first in range(0, height, step)]

    # Its parts, and the whole.
    def add(rows: slice, sums: NDArray[Any], weights: NDArray[Any], light: NDArray[Any], nm: float) -> None:
        part = light[rows] if otf is None else light[rows] * otf(nm, rows)
        for plane, weight in zip(sums, weights, strict=True):
            plane[rows] += weight * part

    def behind_lens(plane: NDArray[Any], beside: NDArray[Any] | float) -> NDArray[np.float64]:
        if otf is not None:
            plane = scipy.fft.idctn(plane, type=2, overwrite_x=True, workers=threads)
        if spread is not None:
            plane += beside
        blurred = otf is not None or spread is not None
        if blurred and plane.min() < 0 and not radiance.signed:  # undershoot becomes 0, the sum of the light stays
            total = plane.sum(dtype=np.float64)
            plane = np.maximum(plane, 0)
            plane *= real(total / plane.sum(dtype=np.float64) if total > 0 else 0.0)
        light = plane.astype(np.float64)
        if samples > 1:
            light = light.reshape(pixels[0], samples, pixels[1], samples).mean(axis=(1, 3))
        if scattered is not None:
            light = scattered(light)
            light = light if radiance.signed else np.maximum(light, 0.0)  # rounding beside a lamp
        mean = light.mean()
        light = (1 - lens.veiling_glare) * light
        light += lens.veiling_glare * mean
        return np.asarray(light)

    def imaged(weights: Floats) -> NDArray[np.float64]:
        sums = np.zeros((len(weights), height, width), real)
        beside = np.zeros(sums.shape if spread is not None else len(weights))
        with ThreadPoolExecutor(threads) as pool:
            for band in np.flatnonzero(weights.any(axis=0)).tolist():
                nm = float(radiance.wavelength_nm[band])
                light = band_plane(radiance, band)
                light = (light if moved is None else moved(light.astype(np.float64), nm)) * per_radiance
                if spread is not None:
                    beside += weights[:, band, None, None] * spread(light, nm)
                if otf is not None:
                    light = scipy.fft.dctn(light, type=2, overwrite_x=True, workers=threads)
                of_band = weights[:, band].astype(real), light, nm
                list(pool.map(lambda rows, of_band=of_band: add(rows, sums, *of_band), strips))
        result = np.empty((len(sums), *pixels))
        for plane, *planes in zip(result, sums, beside, strict=True):
            plane[:] = behind_lens(*planes)
        return result

    return imaged


def left_out(sensor: SensorConfig, samples_per_pixel: int = 1) -> tuple[str, ...]:
    """Return a line per effect of a lens that `form_image` leaves out or approximates, with its estimated cost.

    MTFs are those of lens and pixel aperture together, at 550 nm, for the camera's own pixel and f-number.
    """
    lens = sensor.lens
    nyquist = np.array(0.5 / sensor.site_pitch_um)
    lines = []
    if not lens.diffraction and not lens.table:
        ideal = LensConfig(lens.f_number, magnification=lens.magnification, diffraction=1.0)
        lines.append(f"diffraction: {_at_nyquist(float(diffraction_otf(nyquist, WAVELENGTH_NM, ideal)))}")
    if samples_per_pixel == 1 and (loss := loss_within_pixels(sensor)) >= _LEAST_LOSS:
        lines.append(
            f"detail finer than a pixel: not knowing it lowers the MTF by up to {loss:.3f} below Nyquist"
            f"{_edge_words(sensor)}; {least_samples(sensor)} samples a pixel don't"
        )
    if not lens.horizontal_view_deg and not lens.falloff_power and not lens.table:
        corner = (1 + (tan(radians(VIEW_DEG / 2)) * DIAGONAL) ** 2) ** -2
        lines.append(
            f"cos^4 falloff: a picture of 4:3, {VIEW_DEG:g} degrees wide, would lose {1 - corner:.0%} in its corners"
        )
    if not lens.veiling_glare and not scatters(lens):
        lines.append("veiling glare: each per cent would add 1 % of the picture's mean irradiance to every pixel")
    if not lens.defocus_um and not lens.table:
        disc = float(defocus_otf(nyquist, sensor.site_pitch_um))
        lines.append(f"defocus: a disc as wide as a pixel: {_at_nyquist(disc)}")
    elif lens.diffraction and lens.defocus_um < AIRY_DIAMETER / limit_per_um(WAVELENGTH_NM, lens):
        lines.append("defocus: its disc is within the Airy disc, where the product of both transfers is a rough guess")
    if not lens.shake_um:
        moved_um = SHAKES["hand"] * blur_variance(LONGEST_S) ** 0.5
        lines.append(
            f"camera shake: in the hand the image would move by {moved_um:.1f} um in {LONGEST_S * 1e3:g} ms (standard "
            "deviation along each axis)"
        )
    rest = "flare" if lens.table else "aberrations, distortion, flare"
    return (*lines, f"{rest}, polarisation: not modelled, their cost isn't estimated")


def loss_within_pixels(sensor: SensorConfig) -> float:
    """Return the largest loss of MTF along an axis up to Nyquist, at 550 nm, due to one sample per pixel."""
    _, ideal, imaged = _axis_mtfs(sensor)
    return float(np.max(ideal - imaged))


def least_samples(sensor: SensorConfig) -> int:
    """Return the least samples along a pixel's side that image the lens's own transfer below the pixels' Nyquist.

    Samples alias the frequencies beyond their own limit. So the cut-off of diffraction at 550 nm has to lie under the
    sampling frequency less the pixels' Nyquist frequency. Without diffraction one sample is enough.
    """
    limit_per_px = limit_per_um(WAVELENGTH_NM, sensor.lens) * sensor.site_pitch_um
    return 1 if limit_per_px == inf else max(2, ceil(limit_per_px + 0.5))


def mtf50_error(sensor: SensorConfig) -> float:
    """Return the relative error of MTF50 due to one sample per pixel, at 550 nm; nan if it is beyond Nyquist."""
    frequency, ideal, imaged = _axis_mtfs(sensor)
    true, found = (half_frequency(frequency, mtf) for mtf in (ideal, imaged))
    return found / true - 1


def _edge_words(sensor: SensorConfig) -> str:
    error = mtf50_error(sensor)
    return "" if isnan(error) else f" and an edge's mtf50_cy_per_px by {-error:.1%}"


def _axis_mtfs(sensor: SensorConfig) -> tuple[Floats, Floats, Floats]:
    """Return frequencies along an axis up to Nyquist [1/px], and the true and imaged MTF of lens and pixel."""
    lens = sensor.lens
    steps = np.arange(64) / 128
    ideal = diffraction_otf(steps / sensor.site_pitch_um, WAVELENGTH_NM, lens) if lens.diffraction else 1.0
    ideal = ideal * defocus_otf(steps / sensor.site_pitch_um, lens.defocus_um)
    imaged = sampled_otf((1, 64), sensor.site_pitch_um, lens, folded=False)(WAVELENGTH_NM)[0]
    return steps, ideal * np.sinc(steps), imaged * np.sinc(steps)


def _at_nyquist(transfer: float) -> str:
    return (
        f"it would take the MTF at Nyquist from {APERTURE_AT_NYQUIST:.2f} to {APERTURE_AT_NYQUIST * abs(transfer):.2f}"
    )
