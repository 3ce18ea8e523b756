"""Figures of sharpness from a slanted edge: lens, pixel aperture and crosstalk by formula, and measured edges."""

from dataclasses import replace

import numpy as np
from scipy.signal import fftconvolve

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from rodcone.types import Floats
from sensor.capture import expose
from sensor.config import SensorConfig, with_tile
from sensor.device import draw_device
from sensor.diffraction import defocus_otf, diffraction_otf, half_frequency
from sensor.lens.illumination import EVEN_LIGHT
from sensor.optics import form_image, least_samples
from sensor.readings.best_estimate import collected_share
from sensor.readings.resolve import at_channel, chip_readings, several
from sensor.response import electrons_per_irradiance, expected_electrons
from studies.metrics.mtf import EdgeResponse, edge_response
from studies.metrics.s_cielab import PIXELS_PER_DEGREE
from studies.metrics.truth import Light, light_in_bands, lit_range
from studies.photograph.snr import snr
from studies.score.figure import Definition, Merit, without_noise_bias
from studies.score.information import information, information_merits

SIDE_PX = 192
QUARTER_PX = SIDE_PX // 4  # columns at the left and right border in which the noise is measured
ANGLE_DEG, CONTRAST = 5.0, 4.0  # angle and contrast of ISO 12233's edge
FRAMES = 8  # number of frames, each by a chip of its own, that are averaged, because noise lowers the measured MTF50
BRIGHT_SHARE = 0.6  # share of the full well on the edge's bright side
BAND_NM = 20.0
GRID: Floats = np.arange(-6000, 6001) / 2000.0  # frequencies at which the transfer is computed [cycles per pixel]
# Relative contrast sensitivity of IEEE 1858 (CPIQ): v^0.8 exp(-0.2 v), v in cycles per degree.
CSF_POWER, CSF_DECAY = 0.8, 0.2


def sharpness(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Definition:
    """Define the figures of an edge that one channel sees, if every pixel has its filter."""
    # The camera, and the edge by formula.
    seen = every_pixel(sensor, channel)
    bands = bands_of(light, sensor.window_nm)
    edge_e = _edge_electrons(seen, bands, exposure_s)
    angle = np.radians(ANGLE_DEG)
    along, down = GRID * np.cos(angle), GRID * np.sin(angle)
    frequency, mtf = _windowed(transfer_at(seen, bands, exposure_s, along, down))
    lens = seen.lens
    blur = f"diffraction {lens.diffraction:g}, defocus {lens.defocus_um:g} um"
    words = (
        f"{channel} at every pixel, raw, edge of {CONTRAST:g}:1 at {ANGLE_DEG:g} degrees, {light}, "
        f"f/{lens.f_number:g}, {blur}, crosstalk {seen.pixel.crosstalk:g}"
    )

    readings = at_channel(chip_readings(seen, exposure_s), channel)
    levels_e = BRIGHT_SHARE * seen.top_e * np.array([1.0, 1 / CONTRAST])
    bright_e, dark_e = levels_e.tolist()
    noise_e2 = float(np.mean((levels_e / snr(levels_e, seen, exposure_s, channel)) ** 2))

    def figures(edge: EdgeResponse, seen_noise_e2: float) -> list[float]:
        shown = edge.frequency_cycles_per_px, edge.mtf
        told = information(*shown, bright_e, dark_e, seen_noise_e2)
        return [edge.mtf50_cycles_per_px, float(np.interp(0.25, *shown)), acutance(*shown), *told]

    def measure(rng: np.random.Generator) -> list[float]:
        chips = [draw_device(seen, edge_e.shape, rng) for _ in range(FRAMES)]
        frames = np.array([expose(edge_e, seen, exposure_s, chip, rng).electrons for chip in chips], np.float64)
        frames /= collected_share(readings) if several(readings) else 1.0
        variances = frames.var(axis=0, ddof=1)
        noise = float(variances[:, :QUARTER_PX].mean() + variances[:, -QUARTER_PX:].mean()) / 2
        halves = frames[: FRAMES // 2].mean(axis=0), frames[FRAMES // 2 :].mean(axis=0)
        return without_noise_bias(*(figures(edge_response(x), noise) for x in (frames.mean(axis=0), *halves)))

    # The figures.
    e_sfr = "ISO 12233:2017, annex D (e-SFR)"
    merits = (
        Merit("iso_12233.mtf50", "MTF50", "cycles/px", e_sfr, words, half_frequency(frequency, mtf)),
        Merit(
            "iso_12233.mtf_half_nyquist",
            "MTF at half the Nyquist frequency",
            "1",
            e_sfr,
            words,
            float(np.interp(0.25, frequency, mtf)),
        ),
        Merit(
            "ieee_1858.acutance",
            "acutance",
            "1",
            "IEEE 1858 (CPIQ): MTF weighted by the contrast sensitivity, up to Nyquist",
            f"{words}; seen at {PIXELS_PER_DEGREE:.0f} pixels per degree, the display taken as perfect",
            acutance(frequency, mtf),
        ),
        *information_merits(
            f"{words}, bright side at {100 * BRIGHT_SHARE:.0f} % of the well, fixed patterns included",
            information(frequency, mtf, bright_e, dark_e, noise_e2),
        ),
    )
    return Definition(merits, measure)


def every_pixel(sensor: SensorConfig, channel: str) -> SensorConfig:
    """Return the camera with the channel's filter at every pixel, and a lens without falloff, glare and shake."""
    plain = with_tile(sensor, (channel,), sensor.responses)
    return replace(
        plain, lens=replace(plain.lens, **EVEN_LIGHT, shake_um=0.0, veiling_glare=0.0, scatter=0.0, eye_age_years=0.0)
    )


def bands_of(light: str, window_nm: tuple[float, float]) -> Light:
    """Return a named illuminant of 1 cd/m^2 in bands of `BAND_NM` that cover a camera's window."""
    first_nm, last_nm = lit_range(window_nm, BAND_NM)
    centres = np.arange(first_nm + BAND_NM / 2, last_nm, BAND_NM)
    return light_in_bands(illuminant(light), centres, np.full(centres.size, BAND_NM))


def _edge_electrons(sensor: SensorConfig, bands: Light, exposure_s: float) -> Floats:
    """Return an edge's expected photo-electrons by photodiode; the brightest has `BRIGHT_SHARE` of its well."""
    samples = least_samples(sensor)
    radiance = grey_radiance(edge_reflectance(SIDE_PX * sensor.sites * samples), bands)
    electrons = expected_electrons(form_image(radiance, sensor, samples), sensor, exposure_s)
    return np.asarray(electrons * BRIGHT_SHARE * sensor.top_e / sensor.sites**2 / electrons.max())


def edge_reflectance(side: int) -> Floats:
    """Return the reflectances of side x side squares with an edge through their middle; 1 on its bright side."""
    return np.asarray((1 + (CONTRAST - 1) * edge_coverage(side)) / CONTRAST)


def grey_radiance(reflectance: Floats, bands: Light) -> SpectralRadiance:
    """Return the radiance of a chart of reflectances, (h, w) of grey or (h, w, band), in a light."""
    lit = reflectance if reflectance.ndim == 3 else reflectance[..., None]
    values = (lit * bands.spectrum).astype(np.float32)
    return SpectralRadiance(values, bands.wavelength_nm, width_nm=bands.width_nm, light=bands.lamp)


def edge_coverage(side: int) -> Floats:
    """Return the share of each of side x side squares that lies right of an edge through the middle.

    The distances of a square's points from the edge are sums of two uniform variables, a = |cos| and b = |sin| wide.
    With d the distance of its middle, the share is therefore the integral of a trapezoid:

        F(d) = sum of +-max(d +- (a +- b) / 2, 0)^2 / (2 a b).
    """
    cosine, sine = np.cos(np.radians(ANGLE_DEG)), np.sin(np.radians(ANGLE_DEG))
    place = np.arange(side) - (side - 1) / 2
    distance = place[None, :] * cosine + place[:, None] * sine

    def ramp(at: float) -> Floats:
        return np.asarray(np.maximum(distance + at, 0.0) ** 2)

    wide, narrow = (cosine + sine) / 2, (cosine - sine) / 2
    return np.asarray((ramp(wide) - ramp(narrow) - ramp(-narrow) + ramp(-wide)) / (2 * cosine * sine))


def transfer_at(sensor: SensorConfig, bands: Light, exposure_s: float, along: Floats, down: Floats) -> Floats:
    """Return the transfer of lens, pixel aperture and crosstalk at frequencies along and down [cycles/px]."""
    weights = electrons_per_irradiance(sensor, bands.wavelength_nm, bands.width_nm, exposure_s, bands.lamp)[0]
    weights = weights * bands.spectrum
    share = sensor.pixel.crosstalk
    spread = 1 - 4 * share + 2 * share * (np.cos(2 * np.pi * along) + np.cos(2 * np.pi * down))
    per_um = np.hypot(along, down) / sensor.pixel.pitch_um
    lens = defocus_otf(per_um, sensor.lens.defocus_um)
    if sensor.lens.diffraction:
        by_band = [diffraction_otf(per_um, nm, sensor.lens) for nm in bands.wavelength_nm]
        lens = lens * np.tensordot(weights / weights.sum(), np.array(by_band), axes=1)
    return np.asarray(lens * np.sinc(along) * np.sinc(down) * spread)


def _windowed(transfer: Floats) -> tuple[Floats, Floats]:
    """Return frequencies up to 1 cycle per pixel, and the transfer as measured under the standard's Hamming window.

    Multiplying the line spread by the window, 2 R wide, convolves its transfer with

        1.08 sinc(2 R f) + 0.46 (sinc(2 R f - 1) + sinc(2 R f + 1)).
    """
    reach = SIDE_PX / 2 * (1 - np.tan(np.radians(ANGLE_DEG))) * np.cos(np.radians(ANGLE_DEG))
    turns = 2 * reach * GRID
    window = 1.08 * np.sinc(turns) + 0.46 * (np.sinc(turns - 1) + np.sinc(turns + 1))
    shown = fftconvolve(transfer, window, mode="same")
    middle = GRID.size // 2
    last = GRID.size // 2 + round(1 / (GRID[1] - GRID[0]))
    return GRID[middle : last + 1], np.abs(shown[middle : last + 1] / shown[middle])


def acutance(frequency: Floats, mtf: Floats) -> float:
    """Return the integral of the eye's sensitivity x transfer over that of the sensitivity, both up to Nyquist."""
    grid = np.linspace(0.0, 0.5, 501)
    per_degree = grid * PIXELS_PER_DEGREE
    sensitivity = per_degree**CSF_POWER * np.exp(-CSF_DECAY * per_degree)
    transfer = np.interp(grid, frequency, mtf)
    return float(np.trapezoid(sensitivity * transfer, grid) / np.trapezoid(sensitivity, grid))
