"""Time against error of the spectral render, beside stock Mitsuba in the same run.

Run ``python benchmarks/bench_render.py``; ``--scene``, ``--bands``, ``--size``, ``--spp`` and ``--repeats`` narrow it
down. It prints the environment, then for each scene and number of bands of ``--range``: seconds of one call and the
error of what it returns, for rodcone's ``render(...).relight()``, the scene's loading included, for Mitsuba's
``path`` into a ``specfilm`` of the same bands with the same sampler (``multijitter``), and for the same with Mitsuba's
default sampler (``independent``); stock's scene is loaded beforehand.

The error is the standard deviation over independent renders over their mean, the median over pixels and bands. Times
are medians of repeats in turn, on the clock and of the processor, after one that compiles. The ratio is stock's time
for rodcone's error over rodcone's time: (t_stock e_stock^2) / (t_rodcone e_rodcone^2), since error falls with one over
the root of time. Below it the same for the four wide channels of the RGBW sensor, which stock records as such (four
channels) and rodcone sums from its bands.

``--growth`` prints as CSV how one render grows with samples, side, bands and light groups instead: processor seconds
of the second of two calls, and the peak of Dr.Jit's allocator; ``docs/results/render_growth.csv`` holds it.
"""

import argparse
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from environment import in_turn, print_environment, seconds_of
from numpy.typing import NDArray

from render.engine import render
from render.loader import mitsuba_module, variant
from render.scene import Scene
from render.spectrum import photons_per_joule
from rodcone.jit import backend, dr
from scenes.catalogue import load
from sensor.curves import rgbw

SCENES = ("cornell_box", "still_life_outdoor", "color_checker")
BANDS = (4, 8, 16, 32, 64)
CHANNELS = ("R", "G", "B", "W")
DEPTH = 8
CURVE_NM = np.arange(380.0, 781.0, 5.0)
GROWTH = {
    "spp": (32, 128, 256),
    "size": (64, 256),
    "bands": (10, 40, 80),
    "scene": ("still_life_outdoor", "night_street"),
}
Draw = Callable[[int], NDArray[np.float64]]  # seed -> (channel, h, w)


def ours(scene: Scene, nm: NDArray[np.float64], size: int, spp: int) -> Draw:
    def draw(seed: int) -> NDArray[np.float64]:
        made = render(scene, (size, size), wavelength_nm=nm, spp=spp, max_depth=DEPTH, seed=seed)
        return np.moveaxis(made.relight().values, -1, 0).astype(np.float64)

    return draw


def stock(scene: Scene, channels: dict[str, dict[str, Any]], size: int, spp: int, sampler: str) -> Draw:
    mi, description = mitsuba_module(), scene.description
    film = {"type": "specfilm", "width": size, "height": size, "component_format": "float32", **channels}
    film["rfilter"] = {"type": "box"}
    description["sensor"] = {**description["sensor"], "film": film, "sampler": {"type": sampler}}
    loaded = mi.load_dict(description)
    path = mi.load_dict({"type": "path", "max_depth": DEPTH})

    def draw(seed: int) -> NDArray[np.float64]:
        image = np.asarray(mi.render(loaded, integrator=path, spp=spp, seed=seed), dtype=np.float64)
        return np.moveaxis(image, -1, 0)

    return draw


def boxes(nm: NDArray[np.float64]) -> dict[str, dict[str, Any]]:
    half = (nm[1] - nm[0]) / 2
    return {
        f"band{i:03d}": {"type": "regular", "wavelength_min": x - half, "wavelength_max": x + half, "values": "1,1"}
        for i, x in enumerate(nm.tolist())
    }


def responses() -> dict[str, dict[str, Any]]:
    """Electrons per joule of each channel, as `specfilm` takes them."""
    ends = {"wavelength_min": float(CURVE_NM[0]), "wavelength_max": float(CURVE_NM[-1])}
    curves = {channel: rgbw().curves[channel].band_average(CURVE_NM, 5.0) for channel in CHANNELS}
    scale = photons_per_joule(CURVE_NM) / photons_per_joule(550.0)
    return {
        f"letter_{x}": {"type": "regular", **ends, "values": ",".join(map(repr, (curves[x] * scale).tolist()))}
        for x in CHANNELS
    }


def into_channels(draw: Draw, nm: NDArray[np.float64]) -> Draw:
    """Wide channels summed from bands."""
    width_nm = np.full(nm.size, nm[1] - nm[0])
    weights = rgbw().band_average(CHANNELS, nm, width_nm) * width_nm
    weights = weights * photons_per_joule(nm) / photons_per_joule(550.0)
    return lambda seed: np.tensordot(weights, draw(seed), axes=1)


def compare(label: str, draws: dict[str, Draw], repeats: int) -> None:
    """Print each one's seconds and error, and how much longer the others take to rodcone's error."""
    made: dict[str, list[NDArray[np.float64]]] = {name: [] for name in draws}

    def keep(name: str, draw: Draw) -> None:
        made[name].append(draw(len(made[name])))

    times = in_turn({name: partial(keep, name, draw) for name, draw in draws.items()}, repeats)
    costs = {}
    for name, images in made.items():
        mean, deviation = np.mean(images, axis=0), np.std(images, axis=0, ddof=1)
        lit, (wall, cpu) = mean > 0, np.median(times[name], axis=0)
        error = float(np.median(deviation[lit] / mean[lit]))
        costs[name] = times[name] * error**2
        wall_ratio, cpu_ratio = np.median(costs[name] / costs["rodcone"], axis=0)
        print(
            f"{label:28s} {name:13s} {wall:6.2f} s, processor {cpu:6.2f} s, error {error:8.5f}; "
            f"to rodcone's error {wall_ratio:7.1f} x, processor {cpu_ratio:7.1f} x",
            flush=True,
        )


def growth() -> None:
    base: dict[str, Any] = {"scene": "still_life", "size": 128, "bands": 20, "spp": 64}
    print(",".join([*base, "groups", "processor_s", "seconds_a_band", "peak_mib"]))
    for case in (base, *(base | {name: value} for name, values in GROWTH.items() for value in values)):
        scene, nm = load(case["scene"]), 380.0 + 400.0 / case["bands"] * (np.arange(case["bands"]) + 0.5)
        draw = partial(ours(scene, nm, case["size"], case["spp"]), 0)
        dr.flush_malloc_cache()
        dr.detail.malloc_clear_statistics()
        _, (_, processor_s) = seconds_of(draw), seconds_of(draw)
        kind = dr.JitBackend.CUDA if backend() == "cuda" else dr.JitBackend.LLVM
        peak_mib, a_band_s = dr.detail.malloc_watermark(kind) / (1 << 20), processor_s / case["bands"]
        row = [*case.values(), len(scene.groups), f"{processor_s:.3g}", f"{a_band_s:.3g}", f"{peak_mib:.0f}"]
        print(",".join(map(str, row)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", help="scene by name; may be given several times")
    parser.add_argument("--bands", type=int, action="append")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--range", type=float, nargs=2, default=(380.0, 780.0), help="first and last wavelength, nm")
    parser.add_argument("--growth", action="store_true")
    given = parser.parse_args()
    if given.growth:
        growth()
        return
    print_environment()
    print(f"Mitsuba {mitsuba_module().__version__}, {variant()}")
    print(f"{given.size}x{given.size}, {given.spp} samples a pixel, depth {DEPTH}, {given.repeats} repeats")
    for name in given.scene or SCENES:
        scene = load(name)
        for bands in given.bands or BANDS:
            first_nm, last_nm = given.range
            nm = first_nm + (last_nm - first_nm) / bands * (np.arange(bands) + 0.5)
            own, size_spp = ours(scene, nm, given.size, given.spp), (given.size, given.spp)
            wide = into_channels(own, nm)
            for label, mine, channels in (
                (f"{name}, {bands} bands", own, boxes(nm)),
                (f"{name}, RGBW from {bands}", wide, responses()),
            ):
                draws = {"rodcone": mine, "same sampler": stock(scene, channels, *size_spp, "multijitter")}
                draws["independent"] = stock(scene, channels, *size_spp, "independent")
                compare(label, draws, given.repeats)


if __name__ == "__main__":
    main()
