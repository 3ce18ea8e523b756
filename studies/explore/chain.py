"""Make a picture from a rendered scene and the controls, in stages; a stage runs again only when its inputs change.

Light adds up. So each light group is imaged by lens and filters alone, at power 1 and for 1 s, and the result is kept.
Power, level and exposure time are factors on it, as in a sweep, whose frames are those at 1 cd/m^2 and 1 s.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb
from rodcone.errors import require_keys
from rodcone.types import Image
from sensor.burst import merged_raw
from sensor.capture import expose
from sensor.config import SensorConfig, frame_interval_s
from sensor.device import Device, draw_device
from sensor.exposure import AUTO, AUTO_INFORMATION, amplified, at_level_s, best_exposure, exposure_of_electrons_s
from sensor.flicker.photograph import frame_starts_s
from sensor.flicker.rows import flickering, steady_exposure_s
from sensor.lens.illumination import framed
from sensor.optics import SpectralIrradiance, form_image
from sensor.presets import preset, vary
from sensor.raw import RawImage
from sensor.readout import draw_mean_frame, read_out
from sensor.response import behind_filters, channel_electrons
from sensor.shake import shaken
from studies.explore.controls import TIME, Controls, Lamp, camera_of, lamps_of, lit_transport, only_group, options_of
from studies.explore.memo import Memo
from studies.metrics.truth import Light, neutral_electrons, true_srgb, white_of_pixels
from studies.photograph.camera import colour_fit, develop_to_scale
from studies.study.gain import iso_speed
from studies.study.study import AS_SHOT

Development = Callable[[], tuple[Image, Picture]]  # linear sRGB at the scale of the truth, and the processor's result
_CHIP, _FRAME, _START = 0, 1, 2  # second part of each stream's seed, the same as in `studies.photograph.shot`
_LONGEST_S = 1e7


@dataclass(frozen=True)
class GroupFrame:
    """Image of one light group at power 1, behind the lens and the filters, in 1 s.

    Attributes
    ----------
    irradiance : SpectralIrradiance
    electrons : (h, w, channel) float64
    """

    irradiance: SpectralIrradiance
    electrons: Image


@dataclass(frozen=True)
class Exposure:
    """Light that the camera is given, and the raw image that it makes of it.

    Attributes
    ----------
    sensor : SensorConfig
    transport : Transport
        The transport with the lamps' spectra and powers.
    light : Light
        The light that the camera's colours are set to.
    scale : float
        Factor on the lamps' powers by which the scene has the controls' level.
    white_at_own_cd_m2 : float
        Luminance that is shown as white if the lamps have the powers in `transport`.
    frames : mapping of str to GroupFrame
        Images of the light groups that shine, each at power 1.
    exposure_s : float
        Exposure time of each frame of the burst.
    expected_e : (h, w) float64
        Photo-electrons of one frame, without dark current.
    device : Device
    raw : RawImage
    shot_noise : bool
        As in `Controls`.
    iso : float or None
        Saturation-based speed at the gain of the exposure; None for a camera that has none.
    """

    sensor: SensorConfig
    transport: Transport
    light: Light
    scale: float
    white_at_own_cd_m2: float
    frames: dict[str, GroupFrame]
    exposure_s: float
    expected_e: Image
    device: Device
    raw: RawImage
    shot_noise: bool
    iso: float | None

    @property
    def white_cd_m2(self) -> float:
        """Return the luminance that is shown as white."""
        return self.white_at_own_cd_m2 * self.scale


@dataclass(frozen=True)
class Shot:
    """A photograph beside its truth.

    Attributes
    ----------
    exposed : Exposure
    linear, true : (h, w, 3) float64
        Linear sRGB in which `exposed.white_cd_m2` is 1.
    truth : (h, w, 3) uint8
        `true` as the page shows it, sRGB of 8 bits.
    developed : Picture
    """

    exposed: Exposure
    linear: Image
    true: Image
    truth: NDArray[np.uint8]
    developed: Picture

    @property
    def picture(self) -> NDArray[np.uint8]:
        """Encode the picture as the page shows it, sRGB of 8 bits, (h, w, 3)."""
        return to_bytes(self.linear)


def photograph(transport: Transport, controls: Controls, memo: Memo | None = None) -> Shot:
    """Photograph a rendered scene and develop the raw image.

    Parameters
    ----------
    transport : Transport
    controls : Controls
    memo : Memo, optional
        Results of earlier calls for the same transport.

    Raises
    ------
    InputError
        For a light group that the scene doesn't have, lamps that give no light, or a value that the chain refuses.
    """
    memo = memo or Memo()
    exposed = expose_scene(transport, controls, memo)
    linear, picture = development_of(exposed, controls, memo)()
    return Shot(exposed, linear, *true_picture_of(exposed, controls, memo), picture)


def expose_scene(transport: Transport, controls: Controls, memo: Memo) -> Exposure:
    """Light the scene, form its image, and read out the chip."""
    require_keys("lamps: light group", controls.lamps, transport.groups)
    lamps = tuple((name, controls.lamps.get(name, Lamp())) for name in transport.groups)
    terms = (
        _items(controls.lens),
        _items(controls.pixel),
        controls.bits,
        controls.gain,
        controls.iso,
        controls.shot_noise,
        controls.row_time_us,
        controls.flicker_depth > 0,
        controls.lens_table,
    )
    camera = (controls.sensor, controls.mosaic, *terms)
    optics = (controls.sensor, controls.mosaic, _items(controls.lens), controls.lens_table)
    spectra = tuple((name, lamp.spectrum, lamp.table) for name, lamp in lamps)

    # Light.
    lit, light, scale_1 = memo.of(
        "light", (lamps, controls.reference_light), lit_transport, transport, dict(lamps), controls.reference_light
    )
    scale = controls.level_cd_m2 * scale_1
    base = memo.of("own camera", optics[:2], lambda: vary(preset(controls.sensor), controls.mosaic))
    sensor = memo.of("camera", camera, camera_of, controls, base)
    own_gain = sensor.gain
    speed = memo.of("speed", camera, iso_speed, sensor)

    # Lens and filters.
    frames = {}
    for (name, group), spectrum in zip(lit.groups.items(), spectra, strict=True):
        if group.power > 0:
            radiance = memo.of("radiance", spectrum, only_group(lit, name).relight)
            # Cameras that differ by mosaic share an image, because forming one behind a lens by data takes seconds.
            seen_so = (spectrum, sensor.site_pitch_um, sensor.lens)
            image = memo.of("image", seen_so, form_image, radiance, sensor)
            frames[name] = memo.of("frame", (spectrum, optics), _group_frame, image, sensor)
    powers = tuple(lit.groups[name].power for name in frames)
    lit_so = (spectra, powers, optics)
    white_1 = memo.of("white", (spectra, powers), _white, lit, spectra, memo)
    per_second_e = memo.of("electrons", lit_so, _weighted, powers, [frame.electrons for frame in frames.values()])
    mosaicked_e = memo.of("mosaicked", lit_so, behind_filters, per_second_e, sensor)

    # Exposure.
    exposure_s = controls.exposure_s
    if controls.exposure != TIME:
        rule = AUTO if controls.exposure == AUTO_INFORMATION else controls.exposure
        # The rule uses a percentile of the light, which is proportional to the level.
        metered = (lit_so, rule, sensor.top_e, sensor.pixel.dark_current_e_per_s, sensor.pixel.crosstalk)
        unit_s = memo.of("rule", metered, exposure_of_electrons_s, rule, per_second_e, sensor, _LONGEST_S)
        time_s = at_level_s(unit_s, scale, rule, sensor)
        if controls.exposure == AUTO_INFORMATION:
            exposure_s, sensor = best_exposure(mosaicked_e * scale, sensor, time_s, exposure_s)
        else:
            exposure_s, sensor = amplified(sensor, time_s, exposure_s)
        exposure_s = steady_exposure_s(lamps_of(controls), exposure_s)
    expected_e = mosaicked_e * (scale * exposure_s)
    shape = (expected_e.shape[0], expected_e.shape[1])
    chip = (controls.sensor, controls.mosaic, _items(controls.pixel), controls.seed)
    device = memo.of("device", chip, draw_device, sensor, shape, np.random.default_rng([controls.seed, _CHIP]))
    exposures, frames_e = [], []
    for number in range(controls.exposure_number, controls.exposure_number + controls.frames):
        memo.check()
        rng = np.random.default_rng([controls.seed, _FRAME, number])
        frames_e.append(_in_time(expected_e, controls, sensor, exposure_s, number))
        frame_e = frames_e[-1]
        if sensor.lens.shake_um:
            frame_e = behind_filters(shaken(per_second_e * (scale * exposure_s), sensor, exposure_s, rng), sensor)
        take = expose if controls.shot_noise else partial(read_out, draw=draw_mean_frame)
        exposures.append(take(frame_e, sensor, exposure_s=exposure_s, device=device, rng=rng))
    if controls.flicker_depth:
        expected_e = np.mean(frames_e, axis=0)
    raw = merged_raw(exposures)
    iso = None if speed is None else speed * sensor.gain / own_gain  # the exposure may have raised the gain
    return Exposure(
        *(sensor, lit, light, scale, white_1, frames, exposure_s, expected_e, device, raw, controls.shot_noise, iso)
    )


def development_of(exposed: Exposure, controls: Controls, memo: Memo) -> Development:
    """Return a function that develops an exposure; it can be pickled, and called in this process or another."""
    raw, sensor, light = exposed.raw, exposed.sensor, exposed.light
    fitted = (controls.sensor, controls.mosaic, controls.processor, light.spectrum.tobytes(), sensor.pixel.crosstalk)
    processor = PROCESSORS[controls.processor]
    colours = memo.of("colours", fitted, colour_fit, sensor, processor, light)
    neutral = neutral_electrons(sensor, light, raw.exposure_s)
    options = options_of(controls)
    if controls.white_balance == AS_SHOT:
        options["balance"] = neutral
    sensor = replace(sensor, lens=framed(sensor.lens, exposed.transport.horizontal_view_deg))
    return partial(develop_to_scale, raw, processor, colours, sensor, neutral, exposed.white_cd_m2, **options)


def true_picture_of(exposed: Exposure, controls: Controls, memo: Memo) -> tuple[Image, NDArray[np.uint8]]:
    """Return the noise-free picture, linear and in 8 bits; the same at every level, because white follows the level."""
    lamps = tuple((name, controls.lamps.get(name, Lamp())) for name in exposed.transport.groups)
    return memo.of("truth", (lamps, controls.reference_light), _truth, exposed, controls, memo)


def to_bytes(linear: Image) -> NDArray[np.uint8]:
    """Encode linear sRGB in 8 bits."""
    return np.asarray(np.rint(encode_srgb(linear) * 255), dtype=np.uint8)


# Stages


def _in_time(expected_e: Image, controls: Controls, sensor: SensorConfig, exposure_s: float, number: int) -> Image:
    """Return the expected electrons of one exposure of a burst under lamps that may flicker.

    `number` counts the burst's exposures from 0; each starts when the one before has been read out.
    """
    lamps = lamps_of(controls)
    if not lamps:
        return expected_e
    shape = (expected_e.shape[0], expected_e.shape[1])
    (first_s,) = frame_starts_s(sensor, shape, exposure_s, np.random.default_rng([controls.seed, _START]))
    start_s = first_s + number * frame_interval_s(sensor, shape[0] // sensor.sites, exposure_s)
    return flickering(expected_e, [(lamp, expected_e) for lamp in lamps], sensor, exposure_s, start_s)


def _group_frame(irradiance: SpectralIrradiance, sensor: SensorConfig) -> GroupFrame:
    return GroupFrame(irradiance, channel_electrons(irradiance, sensor, 1.0))


def _truth(exposed: Exposure, controls: Controls, memo: Memo) -> tuple[Image, NDArray[np.uint8]]:
    groups = exposed.transport.groups
    light = exposed.light
    planes = []
    for name in exposed.frames:
        lamp = controls.lamps.get(name, Lamp())
        spectrum = (name, lamp.spectrum, lamp.table)
        radiance = memo.of("radiance", spectrum, only_group(exposed.transport, name).relight)
        planes.append(memo.of("true", (spectrum, light.spectrum.tobytes()), true_srgb, radiance, light, 1.0))
    true = _weighted([groups[name].power / exposed.white_at_own_cd_m2 for name in exposed.frames], planes)
    return true, to_bytes(true)


def _white(lit: Transport, spectra: tuple[tuple[str, Any, Any], ...], memo: Memo) -> float:
    shining = [spectrum for spectrum in spectra if lit.groups[spectrum[0]].power > 0]
    planes = [memo.of("scattered", lamp, only_group(lit, lamp[0]).scattered_luminance) for lamp in shining]
    return white_of_pixels(_weighted([lit.groups[lamp[0]].power for lamp in shining], planes), lit.coverage.mean)


def _weighted(weights: Sequence[float], planes: list[Image]) -> Image:
    total = weights[0] * planes[0]
    for weight, plane in zip(weights[1:], planes[1:], strict=True):
        total += weight * plane
    return np.asarray(total)


def _items(terms: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(terms.items()))
