"""A scene before the paper's cameras: exposed, developed, and how noisy the picture is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.capture import expose
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.response import expected_electrons
from studies.metrics.quality import psnr_db
from studies.metrics.truth import Light, light_in_bands, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit, develop_to_scale
from studies.study.study import Condition
from studies.sweep.cells import device_stream, exposure_stream

Image = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """What the cameras look at.

    Attributes
    ----------
    radiance : SpectralRadiance
    light : Light
        That the cameras' colours are set to.
    white_cd_m2 : float
        Luminance shown as white.
    """

    radiance: SpectralRadiance
    light: Light
    white_cd_m2: float

    @property
    def truth(self) -> Image:
        """Linear sRGB of the noise-free scene, white 1, shape (h, w, 3)."""
        return true_srgb(self.radiance, self.light, self.white_cd_m2)


def view_of(transport: Transport, light: Spectrum, luminance_cd_m2: float | None) -> View:
    """Relight a render to a mean luminance; None: its lights' own powers."""
    radiance = transport.relight(luminance_cd_m2=luminance_cd_m2)
    white = shown_white_cd_m2(transport, luminance_cd_m2)
    return View(radiance, light_in_bands(light, transport.wavelength_nm, transport.width_nm), white)


def exposures(
    view: View, sensor: SensorConfig, exposure_s: float, at: Condition, seeds: int, mosaic: str = "rgbw"
) -> list[RawImage]:
    """Exposures by as many chips, drawn as a sweep draws the cells of this condition."""
    expected_e = expected_electrons(form_image(view.radiance, sensor), sensor, exposure_s)
    made = []
    for seed in range(seeds):
        device = draw_device(sensor, expected_e.shape, device_stream(at.sensor, mosaic, seed))
        made.append(expose(expected_e, sensor, exposure_s, device, exposure_stream(at, mosaic, seed), exact=True))
    return made


def develop(
    raw: RawImage, view: View, sensor: SensorConfig, processor: str = "interleaved", **options: Any
) -> tuple[Image, Picture]:
    """Develop an exposure as `develop_to_scale` does, with the colours fitted under the view's light.

    A ``matrix`` among the processor's `options` stands in place of the fit.
    """
    used = PROCESSORS[processor]
    matrix = options.pop("matrix", None)
    colours = colour_fit(sensor, used, view.light) if matrix is None else matrix
    return develop_to_scale(raw, used, colours, sensor, view.light, view.white_cd_m2, **options)


def noise(pictures: Sequence[Image]) -> float:
    """Noise of a picture: standard deviation over exposures of its linear luminance, root mean square over pixels.

    Blur and wrong colours have no part in it.

    Parameters
    ----------
    pictures : sequence of (h, w, 3) float64
        Linear sRGB, two or more exposures by different chips.
    """
    shown = np.stack([luminance_of_srgb(picture) for picture in pictures])
    return float(np.sqrt(shown.var(axis=0, ddof=1).mean()))


def quality_db(pictures: Sequence[Image], truth: Image) -> float:
    """Mean PSNR of pictures against the truth [dB], both linear and encoded for it."""
    return float(np.mean([psnr_db(encode_srgb(picture), encode_srgb(truth)) for picture in pictures]))
