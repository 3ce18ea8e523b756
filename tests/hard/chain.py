"""A situation through the whole chain: expected electrons, raw image, both pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from hard.case import Situation

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import neutral_response
from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from isp.settings import DEFAULTS
from isp.substitution import matrix_with_white
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
from rodcone.jit import backend
from rodcone.types import Image
from sensor.capture import photograph_radiance
from sensor.cfa import Tile, channels
from sensor.device import draw_device
from sensor.kernel.kernel import expected_electrons_single
from sensor.lens.illumination import darkens, falloff
from sensor.optics import camera_equation, form_image, spreads
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.response import electrons_per_irradiance, expected_electrons
from studies.metrics.truth import light_in_bands
from studies.photograph.camera import colour_fit

CAMERAS = ("interleaved", "bayer")
MOST_E = 1e30  # the readout's largest mean (sensor.kernel.kernel), over any well
# With W in every picture its errors would show; the automatic settings decide by the frame.
FIXED: Mapping[str, float] = MappingProxyType({"substitution_snr": np.inf})


@dataclass(frozen=True)
class Developed:
    """A camera's raw image, its picture at a fixed white balance, and the one with automatic settings."""

    raw: RawImage
    fixed: Image
    automatic: Picture


def behind(situation: Situation, name: str) -> Situation:
    """The situation with the mosaic of one of `CAMERAS`."""
    if name == "interleaved":
        return situation
    return replace(situation, sensor=replace(situation.sensor, cfa=situation.bayer))


def expected(situation: Situation) -> Image:
    """Expected photo-electrons, (h, w) [e-], as `photograph_radiance` forms them; at most `MOST_E`, as there."""
    radiance, sensor, samples = situation.radiance, situation.sensor, situation.samples_per_pixel
    if backend() == "numpy":
        return np.minimum(
            expected_electrons(form_image(radiance, sensor, samples), sensor, situation.exposure_s), MOST_E
        )
    weights = electrons_per_irradiance(
        sensor, radiance.wavelength_nm, radiance.widths_nm, situation.exposure_s, radiance.light
    )
    if samples > 1 or spreads(sensor.lens):
        electrons = expected_electrons_single(form_image(radiance, sensor, samples).values, weights, sensor)
    else:
        electrons = expected_electrons_single(radiance.values, weights * camera_equation(sensor.lens), sensor)
        if darkens(sensor.lens):
            electrons *= falloff(sensor.lens, radiance.shape, radiance.horizontal_view_deg).astype(electrons.dtype)
    return np.minimum(np.asarray(electrons, dtype=np.float64), MOST_E)


def shoot(situation: Situation, name: str, seed: int = 0) -> RawImage:
    """One exposure by one chip, both drawn by `seed`."""
    of = behind(situation, name)
    device, rng = draw_device(of.sensor, of.shape, np.random.default_rng([seed, 0])), np.random.default_rng([seed, 1])
    return photograph_radiance(
        of.radiance, of.sensor, of.exposure_s, device, rng, samples_per_pixel=of.samples_per_pixel
    )


def keywords(develop: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords of `picture_interleaved`: the fields of `Settings` among them as one value."""
    of_settings = {name: value for name, value in develop.items() if hasattr(DEFAULTS, name)}
    return {name: value for name, value in develop.items() if name not in of_settings} | {
        "settings": replace(DEFAULTS, **of_settings)
    }


def develop_fixed(raw: RawImage, situation: Situation) -> Image:
    """Picture at the white balance of D65, linear in the reconstructed channels, (h, w, 3) [e-]."""
    name = camera_of(raw)
    options = keywords({**FIXED, **situation.develop}) if name == "interleaved" else {}
    balance = options.pop("balance", neutral_response(raw.channels))
    return PROCESSORS[name].develop(raw, plain_matrix(), balance=balance, **options).rgb


def develop(raw: RawImage, situation: Situation) -> Developed:
    """Both ways to develop one raw image."""
    name = camera_of(raw)
    options = keywords(situation.develop) if name == "interleaved" else {}
    automatic = PROCESSORS[name].develop(raw, colours(name), **options)
    return Developed(raw, develop_fixed(raw, situation), automatic)


def camera_of(raw: RawImage) -> str:
    """Which of `CAMERAS` took it."""
    return "interleaved" if "W" in raw.channels else "bayer"


def to_picture(cfa: Tile, develop: Mapping[str, float]) -> Image:
    """Matrix (3, channel) from a camera's channels [e-] to its fixed picture, away from saturation."""
    names = channels(cfa)
    with_white = "W" in names
    balance = np.asarray(develop.get("balance", neutral_response(names)) if with_white else neutral_response("RGB"))
    matrix = matrix_with_white(ColourFit.of(plain_matrix()), np.zeros(4), 1.0) if with_white else plain_matrix()
    return np.asarray(matrix * (balance[names.index("G")] / balance))


@cache
def colours(name: str) -> ColourFit:
    """Fit of one of `CAMERAS` on the ColorChecker under D65, with the project's own curves."""
    nm = DEFAULT_WAVELENGTH_NM
    sensor = low_noise(PROCESSORS[name].mosaic)
    return colour_fit(sensor, PROCESSORS[name], light_in_bands(illuminant("D65"), nm, band_widths(nm)))


@cache
def plain_matrix() -> Image:
    """Matrix (3, 3) from balanced R, G, B to linear sRGB, without noise and without W."""
    return colours("bayer").matrix()
