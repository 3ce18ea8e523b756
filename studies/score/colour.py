"""Figures of colour on the ColorChecker's 24 patches: how near a matrix can bring the camera to the standard observer.

Noise in a patch's mean enlarges its colour difference; `without_noise_bias` removes this.
"""

from dataclasses import replace
from math import nan

import numpy as np
from skimage.color import deltaE_cie76, deltaE_ciede2000, xyz2lab

from render.radiance import SpectralRadiance
from render.spectrum import tristimulus
from rodcone.colour_spaces import SRGB_TO_XYZ, adapt_to_d65
from rodcone.errors import InputError, one_line
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances, held
from sensor.capture import expose
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.lens.illumination import EVEN_LIGHT
from sensor.optics import form_image
from sensor.response import electrons_per_irradiance, expected_electrons, mixing_of
from studies.metrics.truth import Light, named_light
from studies.photograph.camera import calibrate
from studies.score.even_field import without_blur
from studies.score.figure import Definition, Merit, not_measured, without_noise_bias

GREYS = 6  # number of greys in the chart's last row
SIDE_PX, CHIPS = 64, 8  # side of a patch [pixels], and number of chips that see it in one measurement
# If a camera's read noise exceeds this share of the converter's top value, each chip takes several frames, as many as
# bring the noise of their mean down to this share, but at most `MOST_FRAMES`.
FRAMES_SHARE = 0.003
MOST_FRAMES = 16
ACROSS, BORDER = 5, 2  # patches in a row, and the border of a patch that crosstalk reaches [pixels]
WHITE_SHARE = 0.7  # share of the converter's top value that the most sensitive channel reads from a perfect white
INDEX_FACTOR = 5.5  # ISO 17321-1
COLOURS = 3  # number of channels that a camera needs to distinguish colours
INDEX = Merit(
    "iso_17321.index",
    "sensitivity metamerism index",
    "1",
    "like ISO 17321-1: 100 - 5.5 x mean CIELAB difference",
    "",
    nan,
)
DIFFERENCE = Merit(
    "color_checker.delta_e",
    "mean CIEDE2000 of the 24 patches",
    "1",
    "CIE 142; ISO 17321's patches and balance",
    "",
    nan,
)


def colour_figures(sensor: SensorConfig, light: str, exposure_s: float) -> Definition:
    """Define the figures of colour; for a camera that can't distinguish three colours they are missing."""
    if len(sensor.channels) < COLOURS:
        missing = f"the mosaic has {', '.join(sensor.channels)} alone, which tells no colours"
        return Definition(tuple(replace(x, missing=missing) for x in (INDEX, DIFFERENCE)), not_measured)
    # What the camera and the standard observer see of the patches, without noise.
    known = named_light(light, sensor.window_nm)
    plain = replace(
        sensor, lens=replace(sensor.lens, **EVEN_LIGHT, shake_um=0.0, veiling_glare=0.0, scatter=0.0, eye_age_years=0.0)
    )
    try:
        matrix = calibrate(plain, known.lamp).to_srgb
    except InputError as error:  # a channel gets no light, or three are alike in the window
        return Definition(tuple(replace(x, missing=one_line(error)) for x in (INDEX, DIFFERENCE)), not_measured)
    named = color_checker_reflectances()
    surfaces = np.array([held(x).band_average(known.wavelength_nm, known.width_nm) for _, x in named])
    standard_lab = true_lab(surfaces, known)
    signals = _signals(plain, known, surfaces)
    chart_e = _chart_e(plain, known, surfaces, exposure_s)
    white = f"white at {100 * WHITE_SHARE:.0f} % of the top"
    words = f"raw channels balanced on {light}, the matrix fitted on the 24 patches, {white}, dark frames subtracted"

    def errors(measured: Floats) -> tuple[Floats, Floats]:
        balanced = measured[:, :3] / signals[-1, :3]
        lab = xyz2lab(np.clip(balanced @ matrix.T, 0.0, None) @ SRGB_TO_XYZ.T)
        return np.asarray(deltaE_ciede2000(standard_lab, lab)), np.asarray(deltaE_cie76(standard_lab, lab))

    # The same on frames, from which a dark frame of the chip is subtracted. A noisy camera takes several frames,
    # because colour differences aren't linear, so that noise would bias them.
    frames = int(np.clip((plain.read_noise_e / plain.top_e / FRAMES_SHARE) ** 2, 1, MOST_FRAMES))

    def means_of(chips: int, rng: np.random.Generator) -> Floats:
        """Return the chips' mean samples of each patch and, last, of white: (25, channel)."""
        total = np.zeros_like(signals)
        for _ in range(chips):
            chip = draw_device(plain, chart_e.shape, rng)
            lit_e, dark_e = (
                np.mean([expose(light_e, plain, exposure_s, chip, rng).electrons for _ in range(frames)], axis=0)
                for light_e in (chart_e, np.zeros_like(chart_e))
            )
            seen_e = lit_e - dark_e
            channels = [np.where(mask(plain.cfa, name, seen_e.shape), seen_e, np.nan) for name in plain.channels]
            total += np.transpose([_patch_means(samples) for samples in channels])
        return total / chips

    def figures(means: Floats) -> list[float]:
        return _figures(*errors(means[:-1] * (signals[-1] / means[-1])))

    def measure(rng: np.random.Generator) -> list[float]:
        first, second = (means_of(CHIPS // 2, rng) for _ in range(2))
        return without_noise_bias(*(figures(means) for means in ((first + second) / 2, first, second)))

    # The figures.
    index, difference = _figures(*errors(signals[:-1]))
    merits = (
        replace(INDEX, conditions=f"the chart's 18 coloured patches, {words}", computed=index),
        replace(DIFFERENCE, conditions=words, computed=difference),
    )
    return Definition(merits, measure)


def _figures(ciede2000: Floats, cielab: Floats) -> list[float]:
    """Return the sensitivity metamerism index of the coloured patches, and the mean CIEDE2000 of all patches."""
    return [100 - INDEX_FACTOR * float(cielab[:-GREYS].mean()), float(ciede2000.mean())]


def true_lab(surfaces: Floats, light: Light) -> Floats:
    """Return CIELAB of surfaces under a light that the standard observer is adapted to, (surface, 3)."""
    white = tristimulus(light.spectrum, light.wavelength_nm, light.width_nm, light.lamp)
    xyz = tristimulus(surfaces * light.spectrum, light.wavelength_nm, light.width_nm, light.lamp)
    return np.asarray(xyz2lab(adapt_to_d65(xyz, white) / white[1]))


def _signals(sensor: SensorConfig, light: Light, surfaces: Floats) -> Floats:
    """Return what the channels read of each patch and, last, of a perfect white: (25, channel)."""
    weights = electrons_per_irradiance(sensor, light.wavelength_nm, light.width_nm, 1.0, light.lamp)
    seen = np.vstack([surfaces, np.ones_like(light.spectrum)]) * light.spectrum
    return np.asarray(seen @ (mixing_of(sensor) @ weights).T)


def _chart_e(sensor: SensorConfig, light: Light, surfaces: Floats, exposure_s: float) -> Floats:
    """Return the photo-electrons of a chart of 5 x 5 even patches, of which the last is white."""
    rows, columns = (len(line) * sensor.sites for line in (sensor.cfa, sensor.cfa[0]))
    repeats = (SIDE_PX // rows, SIDE_PX // columns)
    patches = []
    for reflectance in (*surfaces, np.ones_like(light.spectrum)):
        values = np.broadcast_to(reflectance * light.spectrum, (rows, columns, light.spectrum.size)).copy()
        radiance = SpectralRadiance(values, light.wavelength_nm, width_nm=light.width_nm, light=light.lamp)
        image = form_image(radiance, without_blur(sensor))
        patches.append(np.tile(expected_electrons(image, sensor, exposure_s), repeats))
    chart_e = np.block([patches[row * ACROSS : (row + 1) * ACROSS] for row in range(ACROSS)])
    return np.asarray(chart_e * WHITE_SHARE * sensor.top_e / sensor.sites**2 / patches[-1].max())


def _patch_means(samples: Floats) -> Floats:
    """Return the mean of each patch without its border; `samples` are one channel's, nan at other channels' pixels."""
    height, width = (side // ACROSS for side in samples.shape)
    patches = samples.reshape(ACROSS, height, ACROSS, width).swapaxes(1, 2)[:, :, BORDER:-BORDER, BORDER:-BORDER]
    return np.asarray(np.nanmean(patches, axis=(2, 3)).ravel())
