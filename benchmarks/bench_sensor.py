"""How long a capture takes from 40 float32 bands to digital numbers, for 1 and 4 megapixels.

Run ``python benchmarks/bench_sensor.py``. It prints the environment, the first capture of a fresh process with an empty
kernel cache (compilation included), then for each size and light the medians of rounds in turn: a capture; reading
the bands' memory once, which nothing can undercut; and NumPy's `Generator.poisson` alone on the same means, which the
whole is measured against. Before that, processor time and largest memory of fresh processes (``--memory`` runs them
alone) that image a picture behind a lens that diffracts, beside the size of its bands. NumPy's
sampler runs on one thread, and the capture's two or more get less of a CPU that others use too: trust the ratios of
processor time. `rodcone bench` measures the exact readout and the lens.
"""

import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from environment import beside, in_turn, print_environment, seconds_of

from render.radiance import SpectralRadiance
from rodcone.jit import backend
from sensor.capture import photograph_radiance
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import preset
from sensor.response import channel_electrons, expected_electrons, imaged_electrons

NM = np.arange(385.0, 780.0, 10.0)
EXPOSURE_S = 0.02
LIGHTS = {
    "daylight": 1e-2,
    "a lit room": 1e-4,
    "moonlight": 1e-6,
}  # radiance [W m^-2 sr^-1 nm^-1]: W 10^4.5 e- and down
NUMPY = "NumPy's poisson"


def scene(side: int, radiance: float) -> SpectralRadiance:
    """Textured picture over two decades, float32 and band-planar."""
    y, x = np.indices((side, side), dtype=np.float32)
    base = (1.1 + np.sin(x / 37.0) * np.cos(y / 23.0)) * 10.0 ** -((x // 24 + y // 40) % 3 / 2)
    planes = np.empty((NM.size, side, side), dtype=np.float32)
    for band, tint in enumerate(np.linspace(0.5, 1.5, NM.size)):
        planes[band] = base * (radiance * tint)
    return SpectralRadiance(np.moveaxis(planes, 0, -1), NM)


def calls(radiance: SpectralRadiance) -> dict[str, Callable[[], object]]:
    """The capture and what it is measured against."""
    sensor = preset("low_noise")
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    planes = np.moveaxis(radiance.values, -1, 0)
    means = expected_electrons(form_image(radiance, sensor), sensor, EXPOSURE_S).astype(np.float64)
    rng, threads = np.random.default_rng(2), ThreadPoolExecutor(os.cpu_count())
    print(f"  means of {means.min():.2g} to {means.max():.2g} e-, median {np.median(means):.2g}")
    return {
        "capture": lambda: photograph_radiance(radiance, sensor, EXPOSURE_S, device, rng),
        "reading the bands": lambda: list(threads.map(np.max, planes)),
        NUMPY: lambda: rng.poisson(means),
    }


def first_call() -> None:
    """Time of the first capture in this process."""
    sensor, radiance = preset("low_noise"), scene(64, 1e-4)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    wall, cpu = seconds_of(lambda: photograph_radiance(radiance, sensor, EXPOSURE_S, device, np.random.default_rng(2)))
    print(f"first capture, 64x64, compilation included: {wall:.2f} s, processor {cpu:.2f} s", flush=True)


def peak_gb() -> float:
    """Largest memory of this process so far [GB]."""
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, kibibytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9


def behind_lens(way: str, side: int) -> None:
    """Time and memory of the channels' electrons behind a lens that diffracts, beside the bands that they come from."""
    sensor, radiance = preset("low_noise"), scene(side, LIGHTS["a lit room"])
    before, cube = peak_gb(), radiance.values.nbytes / 1e9
    ways: dict[str, Callable[[], object]] = {
        "each band there and back": lambda: channel_electrons(form_image(radiance, sensor), sensor, EXPOSURE_S),
        "bands summed on the way": lambda: imaged_electrons(radiance, sensor, EXPOSURE_S),
    }
    cpu = min(seconds_of(ways[way])[1] for _ in range(3))
    taken = (peak_gb() - before) / cube
    print(f"  {way}: processor {cpu:.2f} s, {cpu / side**2 * 1e6:.1f} s/Mpx; {taken:.2f} x {cube:.2f} GB on top")


def memory() -> None:
    """Time and memory behind a lens, each way in a process of its own."""
    for side in (512, 1024, 2048):
        print(f"{side}x{side}, {NM.size} bands, behind a lens that diffracts", flush=True)
        for way in ("each band there and back", "bands summed on the way"):
            subprocess.run([sys.executable, __file__, "--lens", way, str(side)], check=True)


def main() -> None:
    print_environment()
    with tempfile.TemporaryDirectory() as home:
        subprocess.run([sys.executable, __file__, "--first-call"], check=True, env={**os.environ, "HOME": home})
    memory()  # while this process is small: Linux counts its peak as its children's
    if backend() == "numpy":
        print("Dr.Jit has neither LLVM nor CUDA here: only the exact form runs, and there is nothing to compare")
        return
    for side in (1024, 2048):
        for light, level in LIGHTS.items():
            print(f"{side}x{side}, {light}; in brackets over NumPy's poisson")
            times = in_turn(calls(scene(side, level)), 9)
            print("\n".join("  " + beside(name, times, NUMPY) for name in times), flush=True)


PARTS: dict[str, Callable[[], None]] = {"--first-call": first_call, "--memory": memory}

if __name__ == "__main__":
    if sys.argv[1:2] == ["--lens"]:
        behind_lens(sys.argv[2], int(sys.argv[3]))
    else:
        PARTS.get(" ".join(sys.argv[1:]), main)()
