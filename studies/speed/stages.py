"""Measure the stages of `rodcone bench`: for several settings of each, time, and error in unsaturated pixels [e-]."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.reconstruction import reconstruct
from isp.settings import Settings
from render.engine import render
from render.geometry import horizontal_view_deg
from render.radiance import SpectralRadiance
from render.scene import Scene
from render.spectrum import VISIBLE_NM, even_bands, fine_bands
from render.transport import Transport
from rodcone.errors import require_fields
from rodcone.types import Floats, Image
from sensor.capture import photograph_radiance
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.readout import noise_variance
from sensor.response import channel_electrons, expected_electrons
from studies.budget.bands import band_groups, wide_bands
from studies.speed.points import Times, Timing, electrons, mean_error, stage_json, time_calls, yardstick
from studies.study.levels import parse_level

MOST_BANDS = 40
STAGES = 5
Stage = dict[str, Any]  # a result of `studies.speed.points.stage_json`
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Scene, sensor and sizes of what is measured.

    Attributes
    ----------
    scene : str
        Scene by name.
    sensor : str
        Sensor preset by name, or a preset file.
    level : str
        Light level such as 25cd/m2 (mean scene luminance).
    size : int
        Side of the renders in pixels.
    picture : int
        Side of the pictures that lens, readout and reconstruction work on; mirror images of the render fill it.
    bands : tuple of int
        Numbers of bands; may be given several times, as all that follow.
    samples : tuple of int
        Samples per pixel, increasing; two renders of twice the last are the references.
    neighbourhoods : tuple of int
        Widths of the reconstruction's neighbourhood.
    patches : tuple of int
        Widths of its patches.
    repeats : int
        Calls after the first; their median counts.
    seed : int
        Seed of renders, chip and exposure.
    """

    scene: str = "still_life"
    sensor: str = "low_noise"
    level: str = "25cd/m2"
    size: Annotated[int, (16, 4096, "give pixels")] = 40
    picture: Annotated[int, (16, 4096, "give pixels")] = 128
    bands: tuple[int, ...] = (4, 8, 20, MOST_BANDS)
    samples: tuple[int, ...] = (32, 128, 512)
    neighbourhoods: tuple[int, ...] = (9, 15, 21)
    patches: tuple[int, ...] = (3, 5)
    repeats: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        require_fields(self)

    @property
    def level_cd_m2(self) -> float:
        """Return the mean scene luminance [cd/m^2]."""
        return parse_level(self.level)[0]


def stages(bench: Bench, scene: Scene, sensor: SensorConfig) -> Iterator[Stage]:
    """Measure one stage after the other, `STAGES` of them."""
    finest, stage = _bands(bench, scene, sensor)
    yield stage
    yield _samples(bench, scene, sensor)
    radiance = _mirrored(bench, finest)
    exposure_s = _auto_exposure_s(bench, sensor, finest)
    view_deg = horizontal_view_deg(scene.geometry["sensor"], radiance.shape[:2])
    yield _lens(bench, sensor, radiance, exposure_s, view_deg)
    yield _readout(bench, sensor, radiance, exposure_s)
    yield _reconstruction(bench, sensor, radiance, exposure_s)


def _bands(bench: Bench, scene: Scene, sensor: SensorConfig) -> tuple[Transport, Stage]:
    """Render the same paths in ever more bands; the finest is the reference."""
    nm, width_nm = fine_bands(group.spectrum for group in scene.groups.values())
    calls = {}
    for count in sorted({*bench.bands, MOST_BANDS}):
        bands = wide_bands(nm, width_nm, band_groups(width_nm, count))
        calls[f"{count} bands"] = _render(bench, scene, *bands, bench.samples[0], bench.seed)
    results = time_calls(calls, bench.repeats)
    finest, _ = results[f"{MOST_BANDS} bands"]
    error_e, noise_e = _render_errors(bench, sensor, finest)
    question = f"How many bands? {bench.scene}, {bench.size}x{bench.size}, {bench.samples[0]} samples a pixel"
    return finest, _stage("bands", question, f"{MOST_BANDS} bands of the same paths", noise_e, results, error_e)


def _samples(bench: Bench, scene: Scene, sensor: SensorConfig) -> Stage:
    """Render with ever more samples, and compare with two references, whose own noise doesn't change the mean error."""
    call = partial(_render, bench, scene, *even_bands(VISIBLE_NM, 8))
    results = time_calls({f"{spp} samples": call(spp, bench.seed) for spp in bench.samples}, bench.repeats)
    most = 2 * bench.samples[-1]
    (first, reference_times), (second, _) = time_calls({str(n): call(most, bench.seed + n) for n in (1, 2)}, 0).values()
    relit = [rendered.relight(luminance_cd_m2=bench.level_cd_m2) for rendered in (first, second)]
    yard = yardstick((relit[0], relit[1]), (first.coverage.mean > 0) | (second.coverage.mean > 0), sensor)
    points = []
    for choice, (transport, times) in results.items():
        image_e = electrons(transport.relight(luminance_cd_m2=bench.level_cd_m2), sensor, yard.exposure_s)
        points.append(Timing(choice, times, *mean_error(image_e, yard)))
    question = f"How many samples a pixel? {bench.scene}, {bench.size}x{bench.size}, 8 bands"
    reference = f"two renders of {most} samples and other seeds, whose own noise falls out of the mean"
    noise_e = float(np.sqrt(yard.noise_e2[yard.inside].mean()))
    return stage_json("samples", question, reference, noise_e, points, reference_times)


def _lens(bench: Bench, sensor: SensorConfig, radiance: SpectralRadiance, exposure_s: float, view_deg: float) -> Stage:
    """Add the terms of the lens one after the other; the lens with all of them is the reference."""
    plain = replace(sensor.lens, diffraction=0.0)
    falloff = replace(plain, horizontal_view_deg=view_deg)
    glare = replace(falloff, veiling_glare=0.01)
    lenses = {
        "plain": plain,
        "+ cos^4": falloff,
        "+ cos^4, glare": glare,
        "+ cos^4, glare, diffraction": replace(glare, diffraction=1.0),
    }
    sensors = {name: replace(sensor, lens=lens) for name, lens in lenses.items()}
    calls = {name: _capture(bench, lens_sensor, radiance, exposure_s) for name, lens_sensor in sensors.items()}
    times = {name: times for name, (_, times) in time_calls(calls, bench.repeats + 1).items()}
    images = {name: _electrons(radiance, lens_sensor, exposure_s) for name, lens_sensor in sensors.items()}
    truth = list(images.values())[-1]
    results = {name: (image, times[name]) for name, image in images.items()}
    question = f"What does the lens do? Captures, {bench.picture}x{bench.picture}, {MOST_BANDS} bands"
    noise_e = _noise_e(truth, sensor, exposure_s)
    return _stage("lens", question, "the whole lens", noise_e, results, lambda image: _rms_e(image, truth, sensor))


def _readout(bench: Bench, sensor: SensorConfig, radiance: SpectralRadiance, exposure_s: float) -> Stage:
    """Compare the fast readout with the exact one."""
    calls = {name: _capture(bench, sensor, radiance, exposure_s, exact=name == "exact") for name in ("fast", "exact")}
    frames = time_calls(calls, bench.repeats + 1)
    # The two draw different frames with the same statistics, so that only the mean over the frame can be compared.
    means = {name: (float(raw.electrons.mean()), times) for name, (raw, times) in frames.items()}
    question = "Which readout? Error: of the frame's mean, whose own random error both frames have"
    noise_e = _noise_e(_electrons(radiance, sensor, exposure_s), sensor, exposure_s)
    return _stage(
        "readout", question, "NumPy's exact sampler", noise_e, means, lambda mean_e: abs(mean_e - means["exact"][0])
    )


def _reconstruction(bench: Bench, sensor: SensorConfig, radiance: SpectralRadiance, exposure_s: float) -> Stage:
    """Measure the error of the reconstruction by neighbourhood and patch, against the noise-free channels."""
    raw = _capture(bench, sensor, radiance, exposure_s)()
    noise_e = _noise_e(_electrons(radiance, sensor, exposure_s), sensor, exposure_s)
    truth = channel_electrons(form_image(radiance, sensor), sensor, exposure_s)
    calls = {
        f"{width}x{width}, patch {patch}": partial(reconstruct, raw, Settings(neighbourhood=width, patch=patch))
        for patch in bench.patches
        for width in bench.neighbourhoods
    }
    question = f"How far does the reconstruction look? {bench.picture}x{bench.picture}"
    reference = "the noise-free channels; times: of the largest neighbourhood and patch"
    results = time_calls(calls, bench.repeats)
    return _stage(
        "neighbourhood and patch", question, reference, noise_e, results, lambda image: _rms_e(image, truth, sensor)
    )


def _stage(
    name: str,
    question: str,
    reference: str,
    noise_e: float,
    timings: Mapping[str, tuple[T, Times]],
    error_e: Callable[[T], float],
) -> Stage:
    """Measure the error of each choice; the last choice is the reference for the times."""
    points = [Timing(choice, times, error_e(result)) for choice, (result, times) in timings.items()]
    return stage_json(name, question, reference, noise_e, points, points[-1].times)


def _render(bench: Bench, scene: Scene, nm: Floats, width_nm: Floats, spp: int, seed: int) -> Callable[[], Transport]:
    size = (bench.size, bench.size)
    return partial(render, scene, size, wavelength_nm=nm, width_nm=width_nm, spp=spp, seed=seed)


def _render_errors(
    bench: Bench, sensor: SensorConfig, reference: Transport
) -> tuple[Callable[[Transport], float], float]:
    """Return a function for a render's error against the reference's mosaic [e-], and the sensor's own noise [e-]."""
    exposure_s = _auto_exposure_s(bench, sensor, reference)

    def mosaic_e(transport: Transport) -> Image:
        return _electrons(transport.relight(luminance_cd_m2=bench.level_cd_m2), sensor, exposure_s)

    truth = mosaic_e(reference)
    return lambda transport: _rms_e(mosaic_e(transport), truth, sensor), _noise_e(truth, sensor, exposure_s)


def _mirrored(bench: Bench, transport: Transport) -> SpectralRadiance:
    """Return a render's radiance, continued by mirror images to the size of the bench's picture."""
    radiance = transport.relight(luminance_cd_m2=bench.level_cd_m2)
    times = -(-bench.picture // bench.size)
    wide = np.pad(radiance.values, [(0, (times - 1) * bench.size)] * 2 + [(0, 0)], mode="symmetric")
    planes = np.ascontiguousarray(np.moveaxis(wide[: bench.picture, : bench.picture], -1, 0))
    return replace(radiance, values=np.moveaxis(planes, 0, -1), relative_mc_error=0.0)


def _capture(
    bench: Bench, sensor: SensorConfig, radiance: SpectralRadiance, exposure_s: float, *, exact: bool = False
) -> Callable[[], RawImage]:
    """Return a call that takes one frame, the same each time."""
    device = draw_device(sensor, radiance.shape, np.random.default_rng(bench.seed))
    return lambda: photograph_radiance(
        radiance, sensor, exposure_s, device, np.random.default_rng(bench.seed), exact=exact
    )


def _auto_exposure_s(bench: Bench, sensor: SensorConfig, transport: Transport) -> float:
    return auto_exposure_s(form_image(transport.relight(luminance_cd_m2=bench.level_cd_m2), sensor), sensor)


def _electrons(radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float) -> Image:
    """Return the expected electrons of the mosaic, shape (h, w)."""
    return expected_electrons(form_image(radiance, sensor), sensor, exposure_s)


def _rms_e(image_e: NDArray[np.floating], truth_e: Image, sensor: SensorConfig) -> float:
    """Return the root mean square of a difference over pixels below saturation [e-]."""
    below = truth_e < sensor.pixel.full_well_e
    return float(np.sqrt(np.mean((image_e.astype(np.float64) - truth_e)[below] ** 2)))


def _noise_e(expected_e: Image, sensor: SensorConfig, exposure_s: float) -> float:
    """Return the sensor's own noise, the root of its mean variance over pixels below saturation [e-]."""
    below = expected_e < sensor.pixel.full_well_e
    return float(np.sqrt(noise_variance(expected_e, sensor, exposure_s)[below].mean()))
