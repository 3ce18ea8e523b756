"""One photograph as raw files: a scene or a stored radiance in, digital negatives out."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from isp.remosaic import remosaic
from render.engine import render
from render.illuminants import illuminant
from render.radiance_files.radiance_source import is_radiance_file
from render.scene import Scene
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError, require_range, require_whole, unknown
from rodcone.files import check_place
from rodcone.memory import file_extent, memory, require_memory
from rodcone.progress import render_words
from sensor.capture import capture
from sensor.cfa import channels, check_covers, is_rgbw
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.exposure import AUTO, RULES, exposure_by_rule_s
from sensor.optics import form_image, left_out
from sensor.presets import preset
from sensor.raw_files.raw_file import check_ending, write_raw
from studies.photograph.calibrate import calibrate, iso_speed
from studies.study.levels import parse_level
from studies.study.radiance_file import LIGHT, check_radiance_file, open_radiance_file
from studies.study.scene_source import asked_level, film_size, open_scene

Step = Callable[[str, float], None]  # what is being done, and the share of the whole (0..1)
MOST_SATURATED = 0.5  # share of the pixels above which an exposure is hardly meant
_DEVICE, _FRAME = 0, 1  # second part of the seed: the chip's patterns, and this exposure's noise


@dataclass(frozen=True)
class Order:
    """What to photograph and how; None: the preset's mosaic, the exposure's rule, the scene's level, light and size."""

    source: str
    out: Path
    sensor: str = "low_noise"
    cfa: str | None = None
    exposure_s: float | None = None
    exposure: str = AUTO
    level: str | None = None
    white_balance: str | None = None
    size: int | None = None
    spp: int = 64
    seed: int = 0
    trust: bool = False
    extend: str | None = None
    force: bool = False


@dataclass(frozen=True)
class Taken:
    """Paths of the files written, facts of the exposure as JSON holds them, and what had to be assumed."""

    paths: tuple[Path, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]


def take(order: Order, step: Step = lambda what, share: None) -> Taken:
    """Photograph and write; a 2x2 RGBW negative gets a re-mosaiced Bayer one beside it, ``NAME_bayer.dng``.

    Raises
    ------
    InputError
        For an unknown name or a value out of range, before anything is rendered.
    OSError
        Where the folder can't be written.
    """
    sensor, opened = _check(order)

    # What is looked at, and the light that the camera's colours are set to.
    if opened is None:
        transport, light, notes = open_radiance_file(order.source, order.white_balance)
        luminance_cd_m2 = None if order.level is None else parse_level(order.level)[0]
        illuminance_lux = None
    else:
        light, notes = _light(order, opened.scene)
        notes += opened.notes
        luminance_cd_m2, illuminance_lux = asked_level(opened.scene, order.level)
    colour = calibrate(sensor, light) if set("RGB") <= set(channels(sensor.cfa)) else None
    check_place(order.out)  # before the render: it may take minutes
    if opened is not None:
        step(render_words(np.inf), 0.0)
        transport = render(
            opened.scene,
            film_size(opened.size, order.size),
            spp=order.spp,
            seed=order.seed,
            progress=lambda share, error: step(render_words(error), 0.9 * share),
        )

    # The exposure.
    step("exposure", 0.9)
    radiance = transport.relight(luminance_cd_m2=luminance_cd_m2, illuminance_lux=illuminance_lux)
    exposure_s = order.exposure_s
    if exposure_s is None:
        exposure_s = exposure_by_rule_s(order.exposure, form_image(radiance, sensor), sensor)
    device = draw_device(sensor, radiance.shape, np.random.default_rng([order.seed, _DEVICE]))
    raw = capture(radiance, sensor, exposure_s, device, np.random.default_rng([order.seed, _FRAME]))
    name = Path(order.sensor).stem.encode("ascii", "replace").decode()
    raw = replace(raw, camera=name, f_number=sensor.lens.f_number, iso=iso_speed(sensor), colour=colour)
    saturated = float(raw.saturated.mean())
    if saturated > MOST_SATURATED:
        notes += [
            f"{saturated:.0%} of the pixels are saturated at {raw.exposure_s:g} s; give a shorter --exposure-s "
            "(seconds: 20 ms is 0.02), or leave it out"
        ]

    # The files.
    bayer = remosaic(raw) if order.out.suffix.lower() == ".dng" and is_rgbw(raw.cfa) else None
    paths = write_raw(raw, order.out)
    if bayer is not None:
        paths += write_raw(bayer, order.out.with_stem(order.out.stem + "_bayer"))
    facts = {
        "paths": [str(path) for path in paths],
        "source": order.source,
        "sensor": order.sensor,
        "cfa": list(raw.cfa),
        "size": list(raw.shape),
        "seed": order.seed,
        "exposure_s": raw.exposure_s,
        "iso": raw.iso,
        "engine": raw.engine,
        "luminance_cd_m2": float(radiance.luminance().mean()),
        "relative_mc_error": radiance.relative_mc_error,
        "relative_level_error": radiance.relative_level_error,
        "saturated": saturated,
        "left_out": list(left_out(sensor)),
    }
    return Taken(paths, facts, tuple(notes))


def _check(order: Order) -> tuple[SensorConfig, SceneFile | None]:
    """Sensor and scene (None: a stored radiance), or `InputError`."""
    sensor = preset(order.sensor, order.cfa)
    check_ending(order.out, sensor.cfa)
    require_whole("spp", order.spp, 1, 1 << 16, "give samples per pixel")
    require_whole("seed", order.seed, 0, 2**31, "give a whole number")
    if order.size is not None:
        require_whole("size", order.size, 1, 8192, "give the picture's longer side in pixels")
    if order.exposure not in RULES:
        raise unknown("exposure", order.exposure, RULES)
    if order.exposure_s is not None:
        require_range("exposure_s", order.exposure_s, 0.0, 1e7, "give seconds, 0 or more")
    elif "G" not in channels(sensor.cfa):
        raise InputError(f"cfa: {sensor.cfa} has no G for the auto exposure; allowed: a mosaic with G; give exposure_s")
    if order.exposure != AUTO and order.exposure_s is not None:
        raise InputError(
            f"exposure_s: {order.exposure_s!r} and exposure {order.exposure!r}; allowed: one; leave one out"
        )
    if order.exposure != AUTO and "W" not in channels(sensor.cfa):
        raise InputError(
            f"exposure: {order.exposure!r} looks at W, which {sensor.cfa} lacks; allowed: a mosaic with W; "
            f"give {AUTO}, or exposure_s"
        )
    if is_radiance_file(order.source):
        if order.trust:
            raise InputError(f"trust-scene: {order.source!r} is no .xml scene; leave --trust-scene out")
        if order.extend:
            raise InputError(f"extend: {order.source!r} is a picture, which has no surfaces; leave --extend out")
        check_radiance_file(order.source, () if order.level is None else (order.level,))
        require_memory(memory(*file_extent(order.source)), order.force)
        return sensor, None
    opened = open_scene(order.source, order.trust, order.extend)
    asked_level(opened.scene, order.level)
    height, width = film_size(opened.size, order.size)
    check_covers(sensor.cfa, (height, width))
    require_memory(memory(height * width, DEFAULT_WAVELENGTH_NM.size, len(opened.scene.groups)), order.force)
    return sensor, opened


def _light(order: Order, scene: Scene) -> tuple[Spectrum, list[str]]:
    """Light that the camera's colours are set to, and what had to be assumed."""
    if order.white_balance is not None:
        return illuminant(order.white_balance), []
    name, first = next(iter(scene.groups.items()))
    if not first.coloured:
        return first.spectrum, []
    assumed = f"scene {scene.name}: light group {name!r} has colours of its own; white balance is set to {LIGHT}"
    return illuminant(LIGHT), [f"{assumed}, --white-balance sets it otherwise"]
