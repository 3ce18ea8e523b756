"""The main job: one scene, one render, light levels in; two cameras' pictures and a report out."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.radiance_files.radiance_source import is_radiance_file
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.errors import InputError, require_range
from rodcone.files import replacing
from scenes.catalog import load
from scenes.levels import DEMO_LEVELS, LightLevel
from sensor.exposure import LONGEST_S, RULE, auto_exposure_s
from sensor.optics import form_image, left_out
from sensor.presets import preset
from sensor.response import expected_electrons
from studies.budget.budget import monte_carlo_share, pixel_share
from studies.budget.quiet_render import render_quietly
from studies.metrics.appearance import TruePicture, appearance, true_picture
from studies.metrics.target_figures import target_figures
from studies.metrics.truth import Light, light_in_bands, shown_white_cd_m2, true_srgb
from studies.pages.report import render_report
from studies.pages.results import (
    DISPLAY_WHITE,
    engines_told,
    environment,
    level_facts,
    notes,
    render_facts,
    sensor_facts,
)
from studies.photograph.camera import CAMERAS, Camera, Shot, build_camera, mean_electrons, photograph
from studies.photograph.clock import FIRST, Clock, timed
from studies.photograph.pictures import contact_sheet, to_bytes
from studies.study.levels import parse_level, resolve_level
from studies.study.radiance_file import check_radiance_file, open_radiance_file

# 20 bands of 20 nm: every spectrum in the demo is smooth, and the render costs half of 40 bands.
WAVELENGTH_NM = np.arange(390.0, 780.0, 20.0)

Step = Callable[[str, float], None]  # what is being done, and the share of the whole (0..1)


@dataclass(frozen=True)
class Demo:
    """What to run: scene, picture size, sensors, light levels (None: moonlight to daylight) and the render's limits.

    `scene` is a name, or a spectral picture file (``.exr``, ``.mat``), which brings its own size. `light` names the
    scene's light, or the light under which a file's colours are judged; None: the scene's own, D65 for a file.
    """

    scene: str = "still_life"
    size: int = 256
    sensors: tuple[str, ...] = ("low_noise", "table1_output")
    levels: tuple[str, ...] | None = None
    longest_s: float = LONGEST_S
    seed: int = 0
    spp: int = 512
    max_seconds: float = 65.0
    light: str | None = None


@dataclass(frozen=True)
class Outcome:
    """Results as `results.json` holds them, picture files by name, and the overview sheet."""

    results: dict[str, Any]
    pictures: Mapping[str, bytes]
    overview: bytes


def check(demo: Demo) -> None:
    """Raise `InputError` for anything in `demo` that can be told before the render."""
    if demo.light is not None:
        illuminant(demo.light)
    if is_radiance_file(demo.scene):
        check_radiance_file(demo.scene, demo.levels or ())
    else:
        load(demo.scene, **_options(demo))
    require_range("size", demo.size, 16, 4096, "give the picture's side in pixels")
    require_range("seed", demo.seed, 0, 2**31, "give a whole number")
    require_range("longest exposure", demo.longest_s, 1e-9, 1e4, "give seconds above 0")
    require_range("spp", demo.spp, 1, 1 << 16, "give samples per pixel")
    require_range("max_seconds", demo.max_seconds, 1e-3, 1e7, "give seconds")
    for name in demo.sensors:
        preset(name)
    for level in demo.levels or ():
        parse_level(level)
    for given in (demo.sensors, demo.levels or ("",)):
        if not given or len(set(given)) != len(given):
            raise InputError(f"demo: {given!r} is not allowed; give sensors and levels, each once")


def run(demo: Demo, step: Step = lambda what, share: None) -> Outcome:
    """Render once, then photograph every level with every camera.

    Raises
    ------
    InputError
        For an unknown scene, sensor or unit, or a value out of range; before anything is rendered.
    """
    check(demo)
    clock = Clock()
    step("render", 0.0)
    with clock.stage("render"):
        if is_radiance_file(demo.scene):
            transport, spectrum, assumed = open_radiance_file(demo.scene, demo.light)
        else:
            (transport, spectrum), assumed = _rendered(demo, step), []
    levels = _levels(demo, transport)
    light = light_in_bands(spectrum, transport.wavelength_nm, transport.width_nm)
    truth = _truth(transport, light)
    cameras = _cameras(demo, light, transport.coverage.shape)
    cells: list[dict[str, Any]] = []
    encoded: dict[str, NDArray[np.float64]] = {}
    for index, level in enumerate(levels):
        step(f"photographs at {level.name}", 0.6 + 0.35 * index / len(levels))
        for cell, picture in _photograph_level(demo, transport, light, truth, cameras, index, level, clock):
            cells.append(cell)
            encoded[cell["picture"]] = picture
    step("report", 0.95)
    sheet = [
        [encoded[_name(i, sensor, camera)] for i in range(len(levels))] for sensor in demo.sensors for camera in CAMERAS
    ]
    with clock.stage("pictures' files"):
        pictures = {name: to_bytes(picture) for name, picture in {**encoded, "truth": truth.encoded}.items()}
        overview = to_bytes(contact_sheet(sheet), "PNG")
    return Outcome(_results(demo, transport, levels, cells, clock, assumed), pictures, overview)


def write(outcome: Outcome, folder: Path) -> Path:
    """Write ``report.html``, ``results.json`` and ``overview.png``; each appears whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "results.json": (json.dumps(outcome.results, indent=1, allow_nan=False) + "\n").encode(),
        "overview.png": outcome.overview,
        "report.html": render_report(outcome.results, outcome.pictures).encode(),
    }
    with replacing(*(folder / name for name in files)) as places:
        for place, content in zip(places, files.values(), strict=True):
            place.write_bytes(content)
    return folder / "report.html"


def _name(level: int, sensor: str, camera: str) -> str:
    return f"{level}/{sensor}/{camera}"


def _options(demo: Demo) -> dict[str, str]:
    """Options of the scene's builder."""
    return {} if demo.light is None else {"light": demo.light}


def _rendered(demo: Demo, step: Step) -> tuple[Transport, Spectrum]:
    """Transport of a scene by name, and its light."""
    scene = load(demo.scene, **_options(demo))
    transport = render_quietly(
        scene,
        (demo.size, demo.size),
        lambda made: brightest_share(demo, made),
        wavelength_nm=WAVELENGTH_NM,
        max_spp=demo.spp,
        max_seconds=demo.max_seconds,
        seed=demo.seed,
        progress=lambda share, error: step(f"render, relative error {error:.3f}", 0.6 * share),
    )
    return transport, next(iter(scene.groups.values())).spectrum


def brightest_share(demo: Demo, transport: Transport) -> float:
    """Largest `pixel_share` of the sensors at the brightest level: where a render's noise shows most."""
    brightest = max(level.luminance_cd_m2 for level in _levels(demo, transport))
    sensors = [preset(name, mosaic) for name in demo.sensors for mosaic, _ in CAMERAS.values()]
    return max(pixel_share(transport, sensor, brightest, demo.longest_s) for sensor in sensors)


def _levels(demo: Demo, transport: Transport) -> Sequence[LightLevel]:
    return DEMO_LEVELS if demo.levels is None else [resolve_level(level, transport) for level in demo.levels]


def _cameras(demo: Demo, light: Light, shape: tuple[int, int]) -> list[Camera]:
    """Every camera with its chip; the chip's patterns come from the seed and its place alone."""
    return [
        build_camera(name, sensor, light, shape, np.random.default_rng([demo.seed, s, c, 0]))
        for s, sensor in enumerate(demo.sensors)
        for c, name in enumerate(CAMERAS)
    ]


def _truth(transport: Transport, light: Light) -> TruePicture:
    """The noise-free picture: the same at every level, since the luminance of white goes with the level."""
    radiance = transport.relight(luminance_cd_m2=1.0)
    return true_picture(true_srgb(radiance, light, shown_white_cd_m2(transport, 1.0)))


def _photograph_level(
    demo: Demo,
    transport: Transport,
    light: Light,
    truth: TruePicture,
    cameras: Sequence[Camera],
    index: int,
    level: LightLevel,
    clock: Clock,
) -> list[tuple[dict[str, Any], NDArray[np.float64]]]:
    """Cell and encoded picture of each camera at one level; all look at the same radiance."""
    with clock.stage("relight"):
        radiance = transport.relight(luminance_cd_m2=level.luminance_cd_m2)
        halves = transport.relight_halves(luminance_cd_m2=level.luminance_cd_m2)
        white = shown_white_cd_m2(transport, level.luminance_cd_m2)
    made = []
    for place, camera in enumerate(cameras):
        with clock.stage("form image"):
            irradiance = form_image(radiance, camera.sensor)
            exposure_s = auto_exposure_s(irradiance, camera.sensor, demo.longest_s)
            expected_e = expected_electrons(irradiance, camera.sensor, exposure_s)
        rng = np.random.default_rng([demo.seed, *divmod(place, len(CAMERAS)), 1, index])
        shot = photograph(camera, expected_e, truth.encoded, light, white, exposure_s, rng)
        seen, appearance_s, first_s = timed(
            lambda shot=shot: (  # type: ignore[misc]
                appearance(shot.linear, truth, white),
                target_figures(demo.scene, shot.linear, truth.linear),
            ),
            "appearance",
        )
        measure_s = shot.measure_s + appearance_s
        for stage, seconds in (
            ("capture", shot.capture_s),
            (f"develop {camera.name}", shot.develop_s),
            ("metrics", measure_s),
            (FIRST, shot.first_s + first_s),
        ):
            clock.add(stage, seconds)
        share = monte_carlo_share(expected_e, halves, camera.sensor, exposure_s)
        figures = {**asdict(shot.quality), **asdict(seen[0]), **asdict(seen[1]), "mc_share": share}
        made.append((_cell(camera, shot, expected_e, index, figures, measure_s), shot.encoded))
    return made


def _cell(
    camera: Camera,
    shot: Shot,
    expected_e: NDArray[np.float64],
    level: int,
    figures: dict[str, float | None],
    measure_s: float,
) -> dict[str, Any]:
    return {
        "level": level,
        "sensor": camera.sensor_name,
        "camera": camera.name,
        "exposure_s": shot.raw.exposure_s,
        **figures,
        "snr_db": shot.picture.snr_db,
        "substitution": shot.picture.substituted,
        "balance": dict(shot.picture.balance),
        "saturated": float(shot.raw.saturated.mean()),
        "mean_electrons": mean_electrons(camera.sensor, expected_e),
        "engines": {"capture": shot.raw.engine, "develop": shot.picture.engine},
        "seconds": {"capture": shot.capture_s, "develop": shot.develop_s, "measure": measure_s},
        "picture": _name(level, camera.sensor_name, camera.name),
    }


def _results(
    demo: Demo,
    transport: Transport,
    levels: Sequence[LightLevel],
    cells: list[dict[str, Any]],
    clock: Clock,
    assumed: Sequence[str],
) -> dict[str, Any]:
    return {
        "rodcone": metadata.version("rodcone"),
        "seed": demo.seed,
        "scene": Path(demo.scene).name,
        "size": list(transport.coverage.shape),
        "environment": environment() | engines_told(cells),
        "render": {
            **render_facts(transport),
            "relative_level_error": transport.level().relative_error,
            "brightest_share": brightest_share(demo, transport),
        },
        "exposure_rule": RULE.format(longest=demo.longest_s * 1e3),
        "display_white": DISPLAY_WHITE,
        "levels": level_facts(levels, transport),
        "sensors": [sensor_facts(name) for name in demo.sensors],
        "cameras": list(CAMERAS),
        "cells": cells,
        "left_out": list(dict.fromkeys(line for name in demo.sensors for line in left_out(preset(name)))),
        "notes": [*notes(), *assumed],
        "stages": [{"name": name, "seconds": seconds} for name, seconds in clock.stages().items()],
    }
