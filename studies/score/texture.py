"""Texture: contrast that lens, pixel aperture and crosstalk leave in dead leaves, computed and on simulated frames."""

from dataclasses import replace
from math import isfinite

import numpy as np

from rodcone.types import Floats
from scenes.dead_leaves import draw_leaves
from sensor.capture import expose
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.diffraction import half_frequency
from sensor.optics import form_image, least_samples
from sensor.response import expected_electrons
from studies.metrics.s_cielab import PIXELS_PER_DEGREE
from studies.score.figure import Definition, Merit
from studies.score.sharpness import acutance, bands_of, every_pixel, grey_radiance, transfer_at
from studies.score.texture_response import TextureResponse, expected_response, texture_response

SIDE_PX = 96
LEAST_SAMPLES = 4  # least samples of the chart along a side of a pixel
WHITE_SHARE = 0.6  # share of the full well that a perfect white fills


def texture(sensor: SensorConfig, light: str, exposure_s: float, channel: str) -> Definition:
    """Define the figures of dead leaves that one channel sees, if every pixel has its filter."""
    seen = every_pixel(sensor, channel)
    bands = bands_of(light, sensor.window_nm)
    samples = max(least_samples(seen), LEAST_SAMPLES)
    frequency: Floats = np.asarray(np.fft.fftfreq(SIDE_PX), np.float64)
    expected = expected_response(transfer_at(seen, bands, exposure_s, frequency[:, None], frequency))
    white_e = WHITE_SHARE * seen.top_e / seen.sites**2
    white = np.ones((2 * seen.sites * samples,) * 2)
    per_reflectance = expected_electrons(form_image(grey_radiance(white, bands), seen, samples), seen, exposure_s).max()
    words = (
        f"{channel} at every pixel, raw, disks of 1 to 24 pixels with radii by r^-3, {light}, "
        f"f/{seen.lens.f_number:g}, each frame of a chart of its own, which is known"
    )

    def measure(rng: np.random.Generator) -> list[float]:
        chart = draw_leaves(SIDE_PX, seen.sites * samples, rng)
        image = form_image(grey_radiance(chart, bands), seen, samples)
        leaves_e = expected_electrons(image, seen, exposure_s) * white_e / per_reflectance
        raw = expose(leaves_e, seen, exposure_s, draw_device(seen, leaves_e.shape, rng), rng)
        return figures_of(texture_response(raw.electrons / (WHITE_SHARE * seen.top_e), chart))

    merits = texture_merits("iso_19567", "texture ", words, figures_of(expected))
    above = "the response stays above half up to the Nyquist frequency"
    return Definition(tuple(x if isfinite(x.computed) else replace(x, missing=above) for x in merits), measure)


def texture_merits(group: str, title: str, words: str, figures: list[float]) -> tuple[Merit, ...]:
    """Return the three figures of a texture's response as merits, under the conditions `words`."""
    like = "like ISO/TS 19567-2: dead leaves, by the spectrum that picture and chart share"
    seen = f"{words}; seen at {PIXELS_PER_DEGREE:.0f} pixels per degree"
    return (
        Merit(f"{group}.texture_mtf50", f"{title}MTF50", "cycles/px", like, words, figures[0]),
        Merit(
            f"{group}.texture_half_nyquist", f"{title}MTF at half the Nyquist frequency", "1", like, words, figures[1]
        ),
        Merit(
            f"{group}.texture_acutance",
            f"{title}acutance",
            "1",
            "like IEEE 1858 (CPIQ), of dead leaves",
            seen,
            figures[2],
        ),
    )


def figures_of(response: TextureResponse) -> list[float]:
    """Return MTF50, the response at half Nyquist, and the acutance."""
    shown = response.frequency_cycles_per_px, response.mtf
    return [half_frequency(*shown), float(np.interp(0.25, *shown)), acutance(*shown)]
