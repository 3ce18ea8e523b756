"""The camera's choices measured: lens, precision, readout, and the reconstruction."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from isp.interleaved import reconstruct
from isp.reference import reconstruct_reference
from render.radiance import SpectralRadiance
from render.scene import Scene
from render.transport import Transport
from sensor.capture import capture
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.lanes import expected_electrons_single
from sensor.optics import form_image
from sensor.response import channel_electrons, electrons_per_irradiance, expected_electrons
from studies.bench_points import Point, Stage, timed
from studies.bench_setup import MOST_BANDS, Bench, exposure_s_of, noise_e_of, rms_e
from studies.plan_terms import horizontal_view_deg


@dataclass(frozen=True)
class Camera:
    """The sensor, its exposure and what it sees: radiance as large as the bench's picture."""

    sensor: SensorConfig
    full_lens: LensConfig
    exposure_s: float
    radiance: SpectralRadiance


def camera_of(bench: Bench, scene: Scene, sensor: SensorConfig, transport: Transport) -> Camera:
    """Camera before the render's picture, which mirror images make as large as the bench asks for."""
    radiance = transport.relight(luminance_cd_m2=bench.level_cd_m2)
    times = -(-bench.picture // bench.size)
    wide = np.pad(radiance.values, [(0, (times - 1) * bench.size)] * 2 + [(0, 0)], mode="symmetric")
    planes = np.ascontiguousarray(np.moveaxis(wide[: bench.picture, : bench.picture], -1, 0))
    seen = SpectralRadiance(np.moveaxis(planes, 0, -1), radiance.wavelength_nm, 0.0, radiance.width_nm)
    view_deg = horizontal_view_deg(scene.geometry["sensor"], (bench.picture, bench.picture))
    lens = replace(sensor.lens, diffraction=1.0, veiling_glare=0.01, horizontal_view_deg=view_deg)
    return Camera(sensor, lens, exposure_s_of(bench, sensor, transport), seen)


def by_lens(bench: Bench, camera: Camera) -> Stage:
    """Terms of the lens, one after the other; all of them are the reference."""
    plain, full = camera.sensor.lens, camera.full_lens
    lenses = {
        "plain": plain,
        "+ cos^4": replace(plain, horizontal_view_deg=full.horizontal_view_deg),
        "+ cos^4, glare": replace(full, diffraction=0.0),
        "+ cos^4, glare, diffraction": full,
    }
    images, times = {}, {}
    for name, lens in lenses.items():
        sensor = replace(camera.sensor, lens=lens)
        image, first_s, seconds = timed(partial(form_image, camera.radiance, sensor), bench.repeats + 1)
        times[name] = first_s, seconds
        images[name] = expected_electrons(image, sensor, camera.exposure_s)
    truth = images[list(lenses)[-1]]
    points = [Point(name, *times[name], rms_e(images[name], truth, camera.sensor)) for name in lenses]
    noise_e = noise_e_of(truth, camera.sensor, camera.exposure_s)
    question = f"What does the lens do? {bench.picture}x{bench.picture}, {MOST_BANDS} bands"
    return Stage("lens", question, "the whole lens", noise_e, tuple(points), points[-1].seconds)


def by_readout(bench: Bench, camera: Camera) -> Iterator[Stage]:
    """Single against double precision of the expected electrons, and the fast against the exact readout."""
    sensor, exposure_s = camera.sensor, camera.exposure_s
    image = form_image(camera.radiance, sensor)
    double = replace(image, values=image.values.astype(np.float64))
    weights = electrons_per_irradiance(sensor, image.wavelength_nm, image.widths_nm, exposure_s)
    choices: dict[str, Callable[[], NDArray[np.floating]]] = {
        "Dr.Jit, single": lambda: expected_electrons_single(image.values, weights, sensor),
        "NumPy, single": lambda: expected_electrons(image, sensor, exposure_s),
        "NumPy, double": lambda: expected_electrons(double, sensor, exposure_s),
    }
    yield _against_last("precision", "In which precision are electrons summed?", choices, camera, bench.repeats + 1)
    device = draw_device(sensor, camera.radiance.shape, np.random.default_rng(bench.seed))
    points = []
    for name, exact in (("fast", False), ("exact", True)):
        rng = np.random.default_rng(bench.seed)
        take = partial(capture, camera.radiance, sensor, exposure_s, device, rng, exact=exact)
        raw, first_s, seconds = timed(take, bench.repeats + 1)
        # Both draw other frames of the same statistics: what differs for sure is the mean over the whole frame.
        points.append((name, first_s, seconds, float(raw.electrons.mean())))
    truth = points[-1][3]
    yield Stage(
        "readout",
        "Which readout? Error: of the frame's mean, whose own random error both frames have",
        "NumPy's exact sampler",
        noise_e_of(expected_electrons(image, sensor, exposure_s), sensor, exposure_s),
        tuple(Point(name, first_s, seconds, abs(mean - truth)) for name, first_s, seconds, mean in points),
        points[-1][2],
    )


def by_reconstruction(bench: Bench, camera: Camera) -> Iterator[Stage]:
    """Neighbourhood and patch against the noise-free channels, and the kernel against NumPy in double precision."""
    sensor, exposure_s = camera.sensor, camera.exposure_s
    device = draw_device(sensor, camera.radiance.shape, np.random.default_rng(bench.seed))
    raw = capture(camera.radiance, sensor, exposure_s, device, np.random.default_rng(bench.seed))
    image = form_image(camera.radiance, sensor)
    truth = channel_electrons(image, sensor, exposure_s)
    points = []
    for patch in bench.patches:
        for neighbourhood in bench.neighbourhoods:
            look = partial(reconstruct, raw, neighbourhood=neighbourhood, patch=patch)
            estimate, first_s, seconds = timed(look, bench.repeats)
            error_e = rms_e(np.asarray(estimate, dtype=np.float64), truth, sensor)
            points.append(Point(f"{neighbourhood}x{neighbourhood}, patch {patch}", first_s, seconds, error_e))
    noise_e = noise_e_of(expected_electrons(image, sensor, exposure_s), sensor, exposure_s)
    words = "the noise-free channels; times: of the largest neighbourhood and patch"
    question = f"How far does the reconstruction look? {bench.picture}x{bench.picture}"
    yield Stage("neighbourhood and patch", question, words, noise_e, tuple(points), points[-1].seconds)
    small = replace(raw, dn=raw.dn[:64, :64])
    width, patch = bench.neighbourhoods[0], bench.patches[0]
    choices: dict[str, Callable[[], NDArray[np.floating]]] = {
        "Dr.Jit, single": lambda: reconstruct(small, neighbourhood=width, patch=patch),
        "NumPy, double": lambda: reconstruct_reference(small, neighbourhood=width, patch=patch),
    }
    yield _against_last("reconstruction's precision", "Kernel or the equations as written?", choices, camera, 1)


def _against_last(
    name: str, question: str, choices: dict[str, Callable[[], NDArray[np.floating]]], camera: Camera, repeats: int
) -> Stage:
    """Stage whose last choice is the reference."""
    made = {choice: timed(function, repeats) for choice, function in choices.items()}
    truth, _, reference_s = made[list(choices)[-1]]
    points = [
        Point(choice, first_s, seconds, float(np.sqrt(np.mean((result.astype(np.float64) - truth) ** 2))))
        for choice, (result, first_s, seconds) in made.items()
    ]
    expected = expected_electrons(form_image(camera.radiance, camera.sensor), camera.sensor, camera.exposure_s)
    noise_e = noise_e_of(expected, camera.sensor, camera.exposure_s)
    return Stage(name, question, list(choices)[-1], noise_e, tuple(points), reference_s)
