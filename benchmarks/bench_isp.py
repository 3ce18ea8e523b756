"""Speed of the interleaved reconstruction beside other non-local means, in one run.

Run ``python benchmarks/bench_isp.py`` (five to ten minutes; ``--large`` adds 24 megapixels). It prints the environment,
the first call in a fresh process with an empty kernel cache, then

- one megapixel, 21x21 and 5x5, on frames for which the kernel does different work, preparation included, and three of
  them developed by `interleaved` with its default, one pixel a patch;
- the time of other programs: OpenCV's ``fastNlMeansDenoising`` on one 8-bit plane with the same windows (the yardstick
  of the ratios) and ``fastNlMeansDenoisingColored``, where `cv2` is installed, and scikit-image's ``denoise_nl_means``
  on four planes;
- frames from 0.25 megapixels up;
- `ple_rgbw` on light and dark frames beside `bayer_park`, nearly all of which is BM3D, where that is installed:
  processor seconds a megapixel. ``--piecewise`` runs this alone.

`rodcone bench` measures speed against error by patch and neighbourhood.

Times are medians of calls in turn, on the clock and of the processor; ratios are medians over pairs of calls. Where
other programs run, trust the ratios of processor time. All of it runs on CUDA where a device answers.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import numpy as np
from environment import beside, in_turn, print_environment, seconds_of
from skimage.restoration import denoise_nl_means

from isp.interleaved.reconstruction import reconstruct, reconstruct_with_noise
from isp.ple.tables import table
from isp.processors.catalogue import PROCESSORS
from isp.settings import Settings
from rodcone.jit import backend
from sensor.cfa import BAYER, RGBW, channel_map
from sensor.raw import RawImage

SIZE = 1024
FULL_E = 15000.0
READ_NOISE_E = 2.0
BLACK = 20.0
PATCHES = Settings(patch=5, sigma_s=8.0)  # of the comparisons: the default, one pixel a patch, is faster


def frame(mean_w_e: float, saturated_disc: float = 0.0, size: int = SIZE, height: int | None = None) -> RawImage:
    """Textured RGBW frame; a disc over `saturated_disc` of its area is far brighter."""
    rng, shape = np.random.default_rng(0), (height or size, size)
    y, x = np.indices(shape, dtype=np.float32)
    base = 1.0 + 0.5 * np.sin(x / 37.0) * np.cos(y / 23.0) + 0.4 * ((x // 24 + y // 40) % 2)
    base[(x - size / 2) ** 2 + (y - shape[0] / 2) ** 2 < saturated_disc * base.size / np.pi] = 1e4
    response = np.vectorize({"R": 0.1, "G": 1 / 6, "B": 0.1, "W": 1.0}.get)(channel_map(RGBW, (2, 2)))
    response = np.tile(response, (-(-shape[0] // 2), -(-shape[1] // 2)))[: shape[0], : shape[1]]
    electrons = np.minimum(rng.poisson(mean_w_e * base * response), FULL_E)
    dn = np.round(electrons + rng.normal(BLACK, READ_NOISE_E, shape))
    return RawImage(
        np.clip(dn, 0, 65535).astype(np.uint16), RGBW, BLACK, BLACK + FULL_E, 1.0, READ_NOISE_E, 0.0, 0.0, 0.01
    )


Call = Callable[[], object]


def compare(name: str, function: Call, yardstick: Call, rounds: int = 9) -> None:
    """Print a call's seconds beside the yardstick's."""
    print(beside(name, in_turn({name: function, "yardstick": yardstick}, rounds), "yardstick"), flush=True)


def first_call() -> None:
    """Time of the first calls in this process: two small frames that run every kernel of the fixed scale."""
    # With edges of saturation.
    small, edge = frame(300.0, size=96), frame(14000.0, size=96)
    wall, cpu = seconds_of(lambda: [reconstruct(raw, PATCHES) for raw in (small, edge)])
    print(f"first calls, all kernels of the fixed scale compiled: {wall:.2f} s, processor {cpu:.2f} s", flush=True)


def others() -> Call:
    """Time the other libraries; the yardstick is returned: OpenCV's call on one plane, or scikit-image's."""
    planes = np.random.default_rng(0).integers(0, 256, (SIZE, SIZE, 4), dtype=np.uint8)
    four = planes.astype(np.float32) / 255.0
    settings = {"patch_size": 5, "patch_distance": 10, "h": 0.1, "fast_mode": True, "channel_axis": -1}
    slow = partial(denoise_nl_means, four, **settings)
    if not find_spec("cv2"):
        print("OpenCV isn't installed (pip install rodcone[bench]): ratios are to scikit-image's denoise_nl_means")
        return slow
    import cv2

    plane, colour = planes[..., 0].copy(), planes[..., :3].copy()
    yardstick = partial(cv2.fastNlMeansDenoising, plane, None, 10.0, 5, 21)
    print(f"ratios are to OpenCV {cv2.__version__}'s fastNlMeansDenoising of one plane")
    coloured = partial(cv2.fastNlMeansDenoisingColored, colour, None, 10.0, 10.0, 5, 21)
    compare("OpenCV's, three planes in colour", coloured, yardstick, 3)
    compare("scikit-image, four planes together", slow, yardstick, 3)
    return yardstick


def ways(yardstick: Call) -> None:
    """Time frames for which the kernel does different work."""
    frames = {
        "one pixel a patch, the default": (frame(300.0), Settings()),
        "nothing saturated (W guides)": (frame(300.0), PATCHES),
        "3 % saturated": (frame(3000.0, saturated_disc=0.03), PATCHES),
        "5 % saturated": (frame(3000.0, saturated_disc=0.05), PATCHES),
        "all saturated (each channel guides itself)": (frame(1e6), PATCHES),
        "at the edge of saturation (both guide)": (frame(14000.0), PATCHES),
        "sigma_s = 0.5 (running maximum nearly everywhere)": (frame(300.0), replace(PATCHES, sigma_s=0.5)),
        "7x7 patches, nothing saturated": (frame(300.0), replace(PATCHES, patch=7)),
        "raw distance": (frame(300.0), replace(PATCHES, distance="raw", sigma_s=50.0)),
    }
    for name, (raw, settings) in frames.items():
        compare(name, partial(reconstruct, raw, settings), yardstick)
    compare("nothing saturated, with the noise", partial(reconstruct_with_noise, frame(300.0), PATCHES), yardstick)
    for name in ("one pixel a patch, the default", "3 % saturated", "at the edge of saturation (both guide)"):
        compare(f"developed: {name}", partial(PROCESSORS["interleaved"].develop, frames[name][0], np.eye(3)), yardstick)


def sizes(yardstick: Call, large: bool) -> None:
    """Frames of other sizes; a ratio over the size is the ratio a megapixel."""
    print()
    for width, height in [(512, 512), (1024, 1024), (2048, 2048), *([(6000, 4000)] if large else [])]:
        raw = frame(300.0, size=width, height=height)
        name = f"{raw.dn.size / SIZE**2:.2f} x 1024 x 1024"
        compare(name, partial(reconstruct, raw, PATCHES), yardstick, 3 if width > 3000 else 9)


def piecewise(large: bool) -> None:
    """Processor seconds a megapixel of `ple_rgbw`, tables made and to be made, beside BM3D's."""
    print()
    sides = [(1024, 1024), (2048, 2048), *([(6000, 4000)] if large else [])]
    colours = np.eye(3)
    yard = None
    if find_spec("bm3d") is not None:
        raw = replace(frame(300.0, size=384), cfa=BAYER)
        yard = seconds_of(partial(PROCESSORS["bayer_park"].develop, raw, colours))[1] / raw.dn.size * 1e6
        print(f"bayer_park (BM3D on one thread), 384 x 384: {yard:.1f} s/Mpx")
    for mean_w_e, (width, height) in [(300.0, side) for side in sides] + [(5.0, sides[0])]:
        table.cache_clear()
        raw = frame(mean_w_e, size=width, height=height)
        for name in ("first", "again"):
            clock_s, processor_s = seconds_of(partial(PROCESSORS["ple_rgbw"].develop, raw, colours))
            each = processor_s / raw.dn.size * 1e6
            ratio = "" if yard is None else f", 1/{yard / each:.1f} of BM3D's"
            print(
                f"ple_rgbw, {mean_w_e:g} e-, {width} x {height}, {name}: {each:.2f} s/Mpx{ratio}; {clock_s:.1f} s",
                flush=True,
            )


def main() -> None:
    print_environment()
    print(f"backend: {backend()}")
    if "--piecewise" in sys.argv[1:]:
        return piecewise("--large" in sys.argv[1:])
    with tempfile.TemporaryDirectory() as home:
        subprocess.run([sys.executable, __file__, "--first-call"], check=True, env={**os.environ, "HOME": home})
    yardstick = others()
    ways(yardstick)
    sizes(yardstick, "--large" in sys.argv[1:])
    return piecewise("--large" in sys.argv[1:])


if __name__ == "__main__":
    first_call() if "--first-call" in sys.argv[1:] else main()
