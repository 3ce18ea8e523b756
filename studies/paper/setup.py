"""Parts that the figures share: cameras under both readings of Table 1, renders, exposures, pictures, measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import ColourFit
from isp.picture import Picture
from isp.processors.catalogue import NAMED
from isp.substitution import SUBSTITUTION_SNR, SUBSTITUTION_SNR_TABLE1_PIXEL
from render.radiance import SpectralRadiance
from render.spectrum import photons_per_joule
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from rodcone.errors import require_fields
from rodcone.progress import Step, render_words
from rodcone.types import Image
from sensor.capture import expose
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.optics import camera_equation, form_image
from sensor.presets import preset, vary
from sensor.raw import RawImage
from sensor.response import behind_filters, channel_electrons
from sensor.shake import held_lens, shaken
from studies.budget.starting_points import plan_from_settings
from studies.metrics.appearance import psnr_db
from studies.metrics.truth import Light, light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit, develop_to_scale
from studies.study.levels import parse_exposure
from studies.study.lit_scene import make_transport, open_choice
from studies.study.study import OWN, Condition, RenderLimits, SceneChoice, Study
from studies.sweep.cells import device_stream, exposure_stream, shake_stream

RENDERS = "renders"  # folder of the renders, in the command's own folder
# Readings of Table 1, which can be understood in two ways, each with the SNR below which W replaces the luminance
# (docs/decisions/0005).
READINGS: Mapping[str, float] = MappingProxyType(
    {"table1_pixel": SUBSTITUTION_SNR_TABLE1_PIXEL, "table1_output": SUBSTITUTION_SNR}
)
TODAY = "low_noise"  # a pixel of today with Table 1's geometry, for comparison
# The paper's own method, by which its claims are tested, and the default, whose values are shown for comparison.
PAPER, DEFAULT = CAMERAS = ("interleaved_paper", "interleaved")
RESULT = {PAPER: "result", DEFAULT: "by the default"}  # words above the pictures
# Scenes that need only this share of the setup's samples: noise of the sensor hides that of the render in the dark
# half, and light from a constant environment has little noise.
_SPP_SHARE = {"lit_and_shadowed": 0.25, "slanted_edge": 0.25}


@dataclass(frozen=True)
class Setup:
    """Size and number of the figures' pictures, and the folder of the renders.

    Attributes
    ----------
    out : Path
        The command's folder.
    size : int
        Side of the pictures [pixels].
    spp : int
        Samples per pixel of the renders.
    band_nm : float
        Width of the renders' bands.
    seeds : int
        Number of exposures under each condition, 2 or more, because noise is their scatter.
    step : callable

    Raises
    ------
    InputError
        For a number out of its range.
    """

    out: Path
    size: Annotated[int, (16, 1024, "give the side of the pictures in pixels")] = 192
    spp: Annotated[int, (1, 1 << 16, "give samples per pixel")] = 256
    band_nm: float = 20.0
    seeds: Annotated[int, (2, 1000, "give 2 exposures or more: noise is their scatter")] = 4
    step: Step = lambda what, share: None

    def __post_init__(self) -> None:
        require_fields(self)


@dataclass(frozen=True, eq=False)
class View:
    """Scene that the cameras look at. Views are compared by identity, so that results can be cached per view.

    Attributes
    ----------
    scene, level : str
        Names as in a study.
    radiance : SpectralRadiance
    light : Light
        Light to which the cameras' colours are balanced.
    white_cd_m2 : float
        Luminance shown as white.
    """

    scene: str
    level: str
    radiance: SpectralRadiance
    light: Light
    white_cd_m2: float

    @cached_property
    def truth(self) -> Image:
        """Return linear sRGB of the noise-free scene, in which white is 1, shape (h, w, 3)."""
        return true_srgb(self.radiance, self.light, self.white_cd_m2)


@cache
def table1_sensor(reading: str, mosaic: str = "rgbw", pitch_um: int | None = None) -> SensorConfig:
    """Return Table 1's camera under one reading.

    With `pitch_um`, 2, 3 or 6, it is the camera of those figures that vary the pixel's size.
    """
    sensor = preset(reading)
    if pitch_um is not None:
        noise = {name: getattr(sensor.pixel, name) for name in ("read_noise_e", "dsnu_e")}
        pixel_preset = preset(f"table1_output_{pitch_um}um")
        sensor = replace(pixel_preset, pixel=replace(pixel_preset.pixel, **noise))
    return vary(sensor, mosaic)


@dataclass(frozen=True)
class Camera:
    """A reading of Table 1, and the processor that develops its exposures and decides its mosaic.

    Attributes
    ----------
    reading, processor : str
    pitch_um : int, optional
        As in `table1_sensor`.
    shake : str, optional
        As in `sensor.shake.held_lens`.
    """

    reading: str
    processor: str = PAPER
    pitch_um: int | None = None
    shake: str | None = None

    @property
    def sensor(self) -> SensorConfig:
        """Return the camera's sensor, with the processor's mosaic."""
        sensor = table1_sensor(self.reading, NAMED[self.processor].mosaic, self.pitch_um)
        return replace(sensor, lens=held_lens(sensor.lens, self.shake))


def view(setup: Setup, scene: str, luminance_cd_m2: float | None, white: str | None = None) -> View:
    """Return a scene at a mean luminance; if that is None, with its lights' own powers.

    The scene is rendered once; later calls read that render from the folder.

    Parameters
    ----------
    white : str, optional
        Light group to whose colour the cameras are balanced; left out, the scene's first.
    """
    spp = max(1, round(setup.spp * _SPP_SHARE.get(scene, 1.0)))
    study = Study((SceneChoice(scene),), ("1cd/m2",), render=RenderLimits(setup.size, setup.band_nm, spp))
    opened = open_choice(study.scenes[0], study)
    model = plan_from_settings(study).renders[opened.choice]
    transport, _ = make_transport(
        opened,
        study,
        model,
        setup.out / RENDERS,
        lambda share, error: setup.step(f"{scene}: {render_words(error, share)}", share),
    )
    group = transport.groups[white or next(iter(transport.groups))]
    return View(
        scene=scene,
        level=OWN if luminance_cd_m2 is None else f"{luminance_cd_m2:g}cd/m2",
        radiance=transport.relight(luminance_cd_m2=luminance_cd_m2),
        light=light_in_bands(group.spectrum, transport.wavelength_nm, transport.width_nm),
        white_cd_m2=shown_white_cd_m2(transport, luminance_cd_m2),
    )


def close_up(subject: View) -> View:
    """Return the middle of a view, about a quarter of its pixels, for figures that take hundreds of pictures."""
    rows, columns = (slice((size - side) // 2, (size + side) // 2) for size, side in _sides(subject.radiance.shape))
    return replace(subject, radiance=replace(subject.radiance, values=subject.radiance.values[rows, columns]))


def _sides(shape: tuple[int, int]) -> list[tuple[int, int]]:
    return [(size, min(size, max(size // 4 * 2, 24))) for size in shape]


def at_level(subject: View, luminance_cd_m2: float) -> View:
    """Return a view, which is given at 1 cd/m^2, at another mean luminance."""
    radiance = replace(subject.radiance, values=subject.radiance.values * luminance_cd_m2)
    white_cd_m2 = subject.white_cd_m2 * luminance_cd_m2
    return replace(subject, level=f"{luminance_cd_m2:.6g}cd/m2", radiance=radiance, white_cd_m2=white_cd_m2)


def exposures(camera: Camera, subject: View, exposure: str, count: int = 1) -> list[RawImage]:
    """Take `count` exposures, each by a chip of its own, with the random streams of a sweep.

    `exposure` is written as in a study, such as ``20ms``.
    """
    sensor = camera.sensor
    exposure_s = parse_exposure(exposure) or 0.0
    mosaic = NAMED[camera.processor].mosaic
    electrons = channel_electrons(form_image(subject.radiance, sensor), sensor, exposure_s)
    expected_e = behind_filters(electrons, sensor)
    name = camera.reading if camera.pitch_um is None else f"{camera.reading}_{camera.pitch_um}um"
    condition = Condition(
        scene=SceneChoice(subject.scene), spectrum=OWN, level=subject.level, exposure=exposure, sensor=name
    )
    raws = []
    for seed in range(count):
        device = draw_device(sensor, expected_e.shape, device_stream(name, mosaic, seed))
        stream = exposure_stream(condition, mosaic, seed)
        if sensor.lens.shake_um:
            expected_e = behind_filters(shaken(electrons, sensor, exposure_s, shake_stream(seed)), sensor)
        raws.append(expose(expected_e, sensor, exposure_s, device, stream, exact=True))
    return raws


@lru_cache(maxsize=4)
def colours_of(camera: Camera, subject: View) -> ColourFit:
    """Return the colours of a camera's processor, fitted under a view's light."""
    return colour_fit(camera.sensor, NAMED[camera.processor], subject.light)


def develop_view(
    camera: Camera, raw: RawImage, subject: View, substitution_snr: float | None = None
) -> tuple[Image, Picture]:
    """Develop an exposure as `develop_to_scale` does, with the colours fitted under the view's light.

    Parameters
    ----------
    substitution_snr : float, optional
        SNR below which W replaces the luminance, for `CAMERAS`; left out, that of the reading in `READINGS`.
    """
    sensor = camera.sensor
    processor = NAMED[camera.processor]
    options = {}
    if camera.processor in CAMERAS:
        options["substitution_snr"] = READINGS[camera.reading] if substitution_snr is None else substitution_snr
    neutral = neutral_electrons(sensor, subject.light, raw.exposure_s)
    return develop_to_scale(
        raw, processor, colours_of(camera, subject), sensor, neutral, subject.white_cd_m2, **options
    )


def noise(pictures: Sequence[Image]) -> float:
    """Return the noise of a picture: the standard deviation of its linear luminance over exposures.

    It is the root mean square over pixels, and free of blur and wrong colours.

    Parameters
    ----------
    pictures : sequence of (h, w, 3) float64
        Linear sRGB, two or more exposures by different chips.
    """
    luminances = np.stack([luminance_of_srgb(picture) for picture in pictures])
    return float(np.sqrt(luminances.var(axis=0, ddof=1).mean()))


def quality_db(pictures: Sequence[Image], truth: Image) -> Image:
    """Return the PSNR of each linear picture against the truth [dB], both encoded first, shape (picture,)."""
    return np.array([psnr_db(encode_srgb(picture), encode_srgb(truth)) for picture in pictures])


def photons(light: Light, luminance_cd_m2: float, sensor: SensorConfig) -> float:
    """Return the photons that reach the sensor from a uniform field in front of its lens [um^-2 s^-1]."""
    spectral = light.spectrum * luminance_cd_m2 * camera_equation(sensor.lens)
    return float((spectral * photons_per_joule(light.wavelength_nm) * light.width_nm).sum() * 1e-12)


def decibels(ratio: float) -> float:
    """Convert a ratio of amplitudes to dB; 0 gives minus infinity."""
    return float(20 * np.log10(ratio)) if ratio > 0 else -np.inf


def with_even_response(sensor: SensorConfig) -> SensorConfig:
    """Return the sensor with pixels that respond alike, as in a camera that corrects its fixed pattern."""
    return replace(sensor, pixel=replace(sensor.pixel, prnu=0.0))


def shot_noise_alone(sensor: SensorConfig) -> SensorConfig:
    """Return the sensor with shot noise alone, and with a converter so fine that it doesn't matter."""
    pixel = replace(sensor.pixel, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    return replace(sensor, pixel=pixel, bits=16)


def grey_picture(plane: NDArray[np.floating], white: float) -> Image:
    """Return a plane (h, w) as linear grey (h, w, 3), in which `white` is 1."""
    return np.repeat(np.asarray(plane, dtype=np.float64)[..., None] / white, 3, axis=-1)
