"""The camera's choices measured: lens, readout, and the reconstruction."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from isp.interleaved import reconstruct
from isp.reference import reconstruct_reference
from isp.settings import Settings
from render.radiance import SpectralRadiance
from render.scene import Scene
from render.transport import Transport
from sensor.capture import capture
from sensor.config import LensConfig, SensorConfig
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.raw import RawImage
from sensor.response import channel_electrons, expected_electrons
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
    sensors = {name: replace(camera.sensor, lens=lens) for name, lens in lenses.items()}
    images = {
        name: expected_electrons(form_image(camera.radiance, sensor), sensor, camera.exposure_s)
        for name, sensor in sensors.items()
    }
    made = timed({name: _capture(bench, camera, sensor) for name, sensor in sensors.items()}, bench.repeats + 1)
    truth = images[list(lenses)[-1]]
    points = tuple(Point(name, times, rms_e(images[name], truth, camera.sensor)) for name, (_, times) in made.items())
    noise_e = noise_e_of(truth, camera.sensor, camera.exposure_s)
    question = f"What does the lens do? Captures, {bench.picture}x{bench.picture}, {MOST_BANDS} bands"
    return Stage("lens", question, "the whole lens", noise_e, points, points[-1].times)


def _capture(bench: Bench, camera: Camera, sensor: SensorConfig, *, exact: bool = False) -> Callable[[], RawImage]:
    """Call that takes one frame, the same each time."""
    device = draw_device(sensor, camera.radiance.shape, np.random.default_rng(bench.seed))
    return lambda: capture(
        camera.radiance, sensor, camera.exposure_s, device, np.random.default_rng(bench.seed), exact=exact
    )


def by_readout(bench: Bench, camera: Camera) -> Stage:
    """The fast against the exact readout."""
    calls = {name: _capture(bench, camera, camera.sensor, exact=name == "exact") for name in ("fast", "exact")}
    made = timed(calls, bench.repeats + 1)
    # Both draw other frames of the same statistics: what differs for sure is the mean over the whole frame.
    means = {name: float(raw.electrons.mean()) for name, (raw, _) in made.items()}
    points = tuple(Point(name, times, abs(means[name] - means["exact"])) for name, (_, times) in made.items())
    question = "Which readout? Error: of the frame's mean, whose own random error both frames have"
    return Stage("readout", question, "NumPy's exact sampler", _noise_e(camera), points, points[-1].times)


def by_reconstruction(bench: Bench, camera: Camera) -> Iterator[Stage]:
    """Neighbourhood and patch against the noise-free channels, and the kernel against NumPy in double precision."""
    sensor, exposure_s = camera.sensor, camera.exposure_s
    raw = _capture(bench, camera, sensor)()
    truth = channel_electrons(form_image(camera.radiance, sensor), sensor, exposure_s)
    calls = {
        f"{neighbourhood}x{neighbourhood}, patch {patch}": partial(
            reconstruct, raw, Settings(neighbourhood=neighbourhood, patch=patch)
        )
        for patch in bench.patches
        for neighbourhood in bench.neighbourhoods
    }
    points = tuple(
        Point(name, times, rms_e(np.asarray(estimate, dtype=np.float64), truth, sensor))
        for name, (estimate, times) in timed(calls, bench.repeats).items()
    )
    words = "the noise-free channels; times: of the largest neighbourhood and patch"
    question = f"How far does the reconstruction look? {bench.picture}x{bench.picture}"
    noise_e = _noise_e(camera)
    yield Stage("neighbourhood and patch", question, words, noise_e, points, points[-1].times)
    small = replace(raw, dn=raw.dn[:64, :64])
    settings = Settings(neighbourhood=bench.neighbourhoods[0], patch=bench.patches[0])
    forms: dict[str, Callable[[], NDArray[np.floating]]] = {
        "Dr.Jit, single": partial(reconstruct, small, settings),
        "NumPy, double": partial(reconstruct_reference, small, settings),
    }
    made = timed(forms, 1)
    exact = made["NumPy, double"][0]
    points = tuple(
        Point(name, times, float(np.sqrt(np.mean((result.astype(np.float64) - exact) ** 2))))
        for name, (result, times) in made.items()
    )
    question = "Kernel or the equations as written?"
    yield Stage("reconstruction's precision", question, "NumPy, double", noise_e, points, points[-1].times)


def _noise_e(camera: Camera) -> float:
    expected_e = expected_electrons(form_image(camera.radiance, camera.sensor), camera.sensor, camera.exposure_s)
    return noise_e_of(expected_e, camera.sensor, camera.exposure_s)
