"""A situation through the whole chain: expected electrons, raw image, both pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from isp.colour.camera_colour import fit_matrix, neutral_response
from isp.colour.colour_fit import ColourFit
from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from isp.substitution import matrix_with_white
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.jit import backend
from scenes.reflectances import color_checker
from sensor.capture import capture
from sensor.cfa import Tile, channels
from sensor.curves import rgbw
from sensor.device import draw_device
from sensor.kernel.kernel import expected_electrons_single
from sensor.optics import camera_equation, falloff, form_image, spreads
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.response import electrons_per_irradiance, expected_electrons
from studies.metrics.truth import light_in_bands
from studies.photograph.camera import colour_fit
from studies.stress_case import Situation

Image = NDArray[np.float64]
CAMERAS = ("interleaved", "bayer")
MOST_E = 1e30  # where the readout holds a mean (sensor.kernel.kernel): over any well
# The fixed settings take W into every picture: what it did wrong would show. Automatic ones decide by the frame.
FIXED: Mapping[str, float] = MappingProxyType({"substitution_snr": np.inf})


@dataclass(frozen=True)
class Developed:
    """One camera's raw image, its picture at a fixed colour balance, and the one that the camera makes by itself."""

    raw: RawImage
    fixed: Image
    automatic: Picture


def behind(situation: Situation, name: str) -> Situation:
    """The situation with the mosaic of one of `CAMERAS`."""
    if name == "interleaved":
        return situation
    return replace(situation, sensor=replace(situation.sensor, cfa=situation.bayer))


def expected(situation: Situation) -> Image:
    """Expected photo-electrons as `sensor.capture.capture` forms them, (h, w) [e-]; held at `MOST_E`, as it does."""
    radiance, sensor, samples = situation.radiance, situation.sensor, situation.samples_per_pixel
    if backend() == "numpy":
        return np.minimum(
            expected_electrons(form_image(radiance, sensor, samples), sensor, situation.exposure_s), MOST_E
        )
    weights = electrons_per_irradiance(sensor, radiance.wavelength_nm, radiance.widths_nm, situation.exposure_s)
    if samples > 1 or spreads(sensor.lens):
        electrons = expected_electrons_single(form_image(radiance, sensor, samples).values, weights, sensor)
    else:
        electrons = expected_electrons_single(radiance.values, weights * camera_equation(sensor.lens), sensor)
        if sensor.lens.horizontal_view_deg:
            electrons *= falloff(sensor.lens, radiance.shape).astype(electrons.dtype)
    return np.minimum(np.asarray(electrons, dtype=np.float64), MOST_E)


def shoot(situation: Situation, name: str, seed: int = 0) -> RawImage:
    """One exposure of one chip, both drawn by `seed`."""
    of = behind(situation, name)
    device, rng = draw_device(of.sensor, of.shape, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
    return capture(of.radiance, of.sensor, of.exposure_s, device, rng, samples_per_pixel=of.samples_per_pixel)


def develop_fixed(raw: RawImage, situation: Situation) -> Image:
    """Picture at the balance of a neutral under D65, linear in the reconstructed channels, (h, w, 3) [e-]."""
    name = "interleaved" if "W" in channels(raw.cfa) else "bayer"
    options = {**FIXED, **situation.develop} if name == "interleaved" else {}
    balance = options.pop("balance", neutral_response(channels(raw.cfa)))
    return PROCESSORS[name].develop(raw, plain_matrix(), balance=balance, **options).rgb


def develop(raw: RawImage, situation: Situation) -> Developed:
    """Both ways to develop one raw image."""
    name = "interleaved" if "W" in channels(raw.cfa) else "bayer"
    options = dict(situation.develop) if name == "interleaved" else {}
    automatic = PROCESSORS[name].develop(raw, colours(name), **options)
    return Developed(raw, develop_fixed(raw, situation), automatic)


def to_picture(cfa: Tile, develop: Mapping[str, float]) -> Image:
    """Matrix (3, channel) from a camera's channels [e-] to its fixed picture, away from saturation."""
    letters = channels(cfa)
    balance = np.asarray(
        develop.get("balance", neutral_response(letters)) if "W" in letters else neutral_response("RGB")
    )
    matrix = matrix_with_white(plain_matrix(), 0.0, 1.0) if "W" in letters else plain_matrix()
    return np.asarray(matrix * (balance[letters.index("G")] / balance))


@cache
def plain_matrix() -> Image:
    """Matrix from balanced R, G, B to linear sRGB of the project's curves under D65, fitted on the ColorChecker."""
    nm, width = DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM)
    surfaces = np.array([reflectance.band_average(nm, width) for _, reflectance in color_checker()])
    light = illuminant("D65").band_average(nm, width)
    return fit_matrix(rgbw().band_average(("R", "G", "B"), nm, width), nm, light, surfaces, width)


@cache
def colours(name: str) -> ColourFit:
    """Fit with which a camera decides its colours by itself."""
    nm = DEFAULT_WAVELENGTH_NM
    sensor = low_noise(PROCESSORS[name].mosaic)
    return colour_fit(sensor, PROCESSORS[name], light_in_bands(illuminant("D65"), nm, band_widths(nm)))
