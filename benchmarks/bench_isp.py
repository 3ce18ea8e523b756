"""How long the interleaved reconstruction takes for one megapixel, 21x21 neighbourhood and 5x5 patches.

Run ``python benchmarks/bench_isp.py``. It prints the environment, then the first call in a fresh process with an empty
kernel cache (compilation included), then the best of three calls, preparation included, on frames that take the
kernel's different ways: dark (W judges similarity), a few per cent saturated, saturated throughout (each band judges
itself), and at the edge of saturation (both judge nearly everywhere). Ratios are against OpenCV's fast non-local means
on one 8-bit plane of the same size with the same windows, where `cv2` is installed; compare ratios of one run.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from environment import print_environment

from isp.interleaved import reconstruct
from sensor.cfa import RGBW, letter_map
from sensor.raw import RawImage

SIZE = 1024
FULL_E = 15000.0
READ_NOISE_E = 2.0
BLACK = 20.0


def frame(mean_w_e: float, saturated_disc: float = 0.0, size: int = SIZE) -> RawImage:
    """Textured RGBW frame; a disc over `saturated_disc` of its area is far brighter."""
    rng = np.random.default_rng(0)
    y, x = np.indices((size, size))
    base = 1.0 + 0.5 * np.sin(x / 37.0) * np.cos(y / 23.0) + 0.4 * ((x // 24 + y // 40) % 2)
    base[(x - size / 2) ** 2 + (y - size / 2) ** 2 < saturated_disc * size**2 / np.pi] = 1e4
    response = np.vectorize({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}.get)(letter_map(RGBW, (size, size)))
    electrons = np.minimum(rng.poisson(mean_w_e * base * response), FULL_E)
    dn = np.round(electrons + rng.normal(BLACK, READ_NOISE_E, (size, size)))
    return RawImage(
        np.clip(dn, 0, 65535).astype(np.uint16), RGBW, BLACK, BLACK + FULL_E, 1.0, READ_NOISE_E, 0.0, 0.0, 0.01
    )


def best(function: Callable[[], object], repeats: int = 3) -> float:
    """Shortest of several calls [s], after one that doesn't count."""
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def first_call() -> None:
    """Time of the first call in this process, on a small frame that takes both of the kernel's ways."""
    small = frame(14000.0, size=64)
    start = time.perf_counter()
    reconstruct(small)
    print(f"first call, 64x64, compilation included: {time.perf_counter() - start:.2f} s", flush=True)


def main() -> None:
    print_environment()
    with tempfile.TemporaryDirectory() as home:
        subprocess.run([sys.executable, __file__, "--first-call"], check=True, env={**os.environ, "HOME": home})
    opencv = None
    if find_spec("cv2"):
        import cv2

        plane = np.random.default_rng(0).integers(0, 256, (SIZE, SIZE), dtype=np.uint8)
        opencv = best(lambda: cv2.fastNlMeansDenoising(plane, None, 10.0, 5, 21))
        print(f"OpenCV {cv2.__version__} fastNlMeansDenoising, one 8-bit plane: {opencv:.2f} s")
    else:
        print("OpenCV isn't installed (pip install opencv-python-headless): no ratios")
    frames = {
        "dark, nothing saturated": frame(300.0),
        "5 % saturated": frame(3000.0, saturated_disc=0.05),
        "all saturated": frame(1e6),
        "at the edge of saturation": frame(14000.0),
    }
    for name, raw in frames.items():
        seconds = best(lambda raw=raw: reconstruct(raw))
        ratio = f", {seconds / opencv:.1f} x OpenCV's one plane" if opencv else ""
        print(f"{name}: {seconds:.2f} s{ratio}", flush=True)


if __name__ == "__main__":
    first_call() if "--first-call" in sys.argv[1:] else main()
