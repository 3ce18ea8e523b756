"""How long a capture takes from 40 float32 bands to digital numbers, for 1 and 4 megapixels, beside its parts.

Run ``python benchmarks/bench_sensor.py``. It prints the environment, the first capture of a fresh process with an empty
kernel cache (compilation included), then for each size and light the shortest of interleaved rounds: the whole capture;
its parts, the sum over bands and the readout; reading the bands' memory once, which nothing can undercut; and NumPy's
`Generator.poisson` alone on the same means, which the whole is measured against. At the end, the exact form and a lens
that diffracts, and the largest memory of two fresh processes (``--memory`` runs these alone): 24 megapixels taken from
strips, and the picture behind the lens that diffracts, beside the size of its bands. Rounds are interleaved and the
shortest counts because other work may share the CPU: compare ratios of one run. Processor time of all threads together
stands beside the time on the clock: NumPy's sampler runs on one thread, and the kernel's two or more get less of a CPU
that others use too.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from environment import print_environment

from render.jit import backend
from render.radiance import SpectralRadiance
from sensor.capture import capture, capture_strips
from sensor.device import draw_device
from sensor.lanes import expected_electrons_single, read_frame
from sensor.optics import camera_equation, form_image
from sensor.presets import preset
from sensor.response import electrons_per_irradiance

NM = np.arange(385.0, 780.0, 10.0)
EXPOSURE_S = 0.02
LIGHTS = {
    "daylight": 1e-2,
    "a lit room": 1e-4,
    "moonlight": 1e-6,
}  # radiance [W m^-2 sr^-1 nm^-1]: W 10^4.5 e- and down
ROUNDS = 9
NUMPY = "NumPy's poisson"


def scene(side: int, radiance: float) -> SpectralRadiance:
    """Textured picture over two decades, float32 and band-planar."""
    y, x = np.indices((side, side), dtype=np.float32)
    base = (1.1 + np.sin(x / 37.0) * np.cos(y / 23.0)) * 10.0 ** -((x // 24 + y // 40) % 3 / 2)
    planes = np.empty((NM.size, side, side), dtype=np.float32)
    for band, tint in enumerate(np.linspace(0.5, 1.5, NM.size)):
        planes[band] = base * (radiance * tint)
    return SpectralRadiance(np.moveaxis(planes, 0, -1), NM)


def shortest(functions: Mapping[str, Callable[[], object]], rounds: int = ROUNDS) -> dict[str, tuple[float, float]]:
    """Shortest time on the clock and of the processor [ms] over rounds in which all take turns, after one uncounted."""
    times: dict[str, tuple[float, float]] = {}
    for lap in range(rounds + 1):
        for name, function in functions.items():
            wall, cpu = time.perf_counter(), time.process_time()
            function()
            took = (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3
            times[name] = took if lap < 2 else (min(times[name][0], took[0]), min(times[name][1], took[1]))
    return times


def parts(radiance: SpectralRadiance) -> dict[str, Callable[[], object]]:
    """The capture and what it is measured against."""
    sensor = preset("low_noise")
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    weights = electrons_per_irradiance(sensor, NM, radiance.widths_nm, EXPOSURE_S) * camera_equation(sensor.lens)
    planes = np.moveaxis(radiance.values, -1, 0)
    expected = expected_electrons_single(radiance.values, weights, sensor)
    means, rng, threads = expected.astype(np.float64), np.random.default_rng(2), ThreadPoolExecutor(os.cpu_count())
    print(f"  means of {means.min():.2g} to {means.max():.2g} e-, median {np.median(means):.2g}")
    return {
        "capture": lambda: capture(radiance, sensor, EXPOSURE_S, device, rng),
        "  sum over bands": lambda: expected_electrons_single(radiance.values, weights, sensor),
        "  readout": lambda: read_frame(expected, sensor, device, EXPOSURE_S, 3),
        "reading the bands": lambda: list(threads.map(np.max, planes)),
        NUMPY: lambda: rng.poisson(means),
    }


def first_call() -> None:
    """Time of the first capture in this process."""
    sensor, radiance = preset("low_noise"), scene(64, 1e-4)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    start = time.perf_counter()
    capture(radiance, sensor, EXPOSURE_S, device, np.random.default_rng(2))
    print(f"first capture, 64x64, compilation included: {time.perf_counter() - start:.2f} s", flush=True)


def peak_gb() -> float:
    """Largest memory of this process so far [GB]."""
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, kibibytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def strips_memory() -> None:
    """Time and memory of 24 megapixels whose radiance is made strip by strip."""
    shape, rows = (4000, 6000), 100
    sensor, part = preset("low_noise"), scene(rows, LIGHTS["a lit room"])
    device = draw_device(sensor, shape, np.random.default_rng(1))

    def strips() -> Iterator[SpectralRadiance]:
        for _ in range(shape[0] // rows):
            values = np.tile(np.moveaxis(part.values, -1, 0), (1, 1, shape[1] // rows))
            yield SpectralRadiance(np.moveaxis(values, 0, -1), NM)

    start = time.perf_counter()
    capture_strips(strips(), sensor, EXPOSURE_S, device, np.random.default_rng(2))
    print(f"24 megapixels from strips of {rows} rows: {time.perf_counter() - start:.1f} s, at most {peak_gb():.2f} GB")


def lens_memory() -> None:
    """Memory of an image behind a lens that diffracts, over that of the bands it is made from."""
    sensor, radiance = preset("low_noise"), scene(1024, LIGHTS["a lit room"])
    lens = replace(sensor.lens, diffraction=1.0, veiling_glare=0.02)
    before, cube = peak_gb(), radiance.values.nbytes / 1e9
    form_image(radiance, replace(sensor, lens=lens))
    print(
        f"1024x1024 behind a lens that diffracts: bands {cube:.2f} GB, image and all that its making takes "
        f"{(peak_gb() - before) / cube:.2f} x that on top"
    )


def memory() -> None:
    for part in ("--strips", "--lens"):
        subprocess.run([sys.executable, __file__, part], check=True)


def main() -> None:
    print_environment()
    with tempfile.TemporaryDirectory() as home:
        subprocess.run([sys.executable, __file__, "--first-call"], check=True, env={**os.environ, "HOME": home})
    if backend() == "numpy":
        print("Dr.Jit has neither LLVM nor CUDA here: only the exact form runs, and there is nothing to compare")
        return
    for side in (1024, 2048):
        for light, level in LIGHTS.items():
            print(f"{side}x{side}, {light}; in brackets over NumPy's poisson")
            times = shortest(parts(scene(side, level)))
            for name, took in times.items():
                wall, cpu = (own / numpy for own, numpy in zip(took, times[NUMPY], strict=True))
                print(f"  {name:18s} {took[0]:7.1f} ms ({wall:4.2f} x), processor {took[1]:7.1f} ms ({cpu:4.2f} x)")
    sensor, radiance = preset("low_noise"), scene(1024, LIGHTS["a lit room"])
    device, rng = draw_device(sensor, radiance.shape, np.random.default_rng(1)), np.random.default_rng(2)
    lens = replace(sensor.lens, diffraction=1.0, veiling_glare=0.02)
    slow = {
        "exact capture": lambda: capture(radiance, sensor, EXPOSURE_S, device, rng, exact=True),
        "image behind a lens that diffracts": lambda: form_image(radiance, replace(sensor, lens=lens)),
    }
    for name, took in shortest(slow, rounds=2).items():
        print(f"1024x1024, {name}: {took[0]:.0f} ms, processor {took[1]:.0f} ms", flush=True)
    memory()


PARTS = {"--first-call": first_call, "--strips": strips_memory, "--lens": lens_memory, "--memory": memory}

if __name__ == "__main__":
    PARTS.get(" ".join(sys.argv[1:]), main)()
