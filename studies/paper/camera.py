"""A scene before the paper's cameras: exposed, developed, and how noisy the picture is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.readout import read_out
from sensor.response import expected_electrons
from studies.metrics.quality import psnr_db
from studies.metrics.truth import Light, light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit
from studies.sweep.cells import Coordinates, device_stream, exposure_stream

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


def electrons(view: View, sensor: SensorConfig, exposure_s: float) -> Image:
    """Expected electrons of the mosaic, shape (h, w)."""
    return expected_electrons(form_image(view.radiance, sensor), sensor, exposure_s)


def exposures(view: View, sensor: SensorConfig, exposure_s: float, at: Coordinates, seeds: int) -> list[RawImage]:
    """Exposures by as many chips, drawn as a sweep draws the cells at these coordinates."""
    expected_e, made = electrons(view, sensor, exposure_s), []
    mosaic = PROCESSORS[at.processor].mosaic
    for seed in range(seeds):
        place = replace(at, seed=seed)
        device = draw_device(sensor, expected_e.shape, device_stream(place, mosaic))
        made.append(read_out(expected_e, sensor, device, exposure_s, exposure_stream(place, mosaic)))
    return made


def develop(
    raw: RawImage, view: View, sensor: SensorConfig, processor: str = "interleaved", **options: Any
) -> tuple[Image, Picture]:
    """Develop an exposure with the colours fitted under the view's light.

    Returns
    -------
    (h, w, 3) float64, Picture
        Linear sRGB with the view's white at 1, and the processor's own result. `options` are the processor's; a
        ``matrix`` among them stands in place of the fit.
    """
    used = PROCESSORS[processor]
    neutral = neutral_electrons(sensor, view.light, raw.exposure_s)
    matrix = options.pop("matrix", None)
    colours = colour_fit(sensor, used, view.light) if matrix is None else matrix
    picture = used.develop(raw, colours, neutral=neutral, **options)
    unit_e = neutral[channels(sensor.cfa).index(used.unit)]
    return picture.rgb / (unit_e * view.white_cd_m2), picture


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
