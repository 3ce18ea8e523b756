"""Time against error of the spectral render, beside stock Mitsuba in the same run.

Run ``python benchmarks/bench_render.py``; ``--scene``, ``--bands``, ``--size``, ``--spp`` and ``--repeats`` narrow it
down. It prints the environment, then for each scene and number of bands between 380 and 780 nm: seconds of one render
and its error, for rodcone, for Mitsuba's ``path`` into a ``specfilm`` of the same bands with the same sampler
(``multijitter``), and for the same with Mitsuba's default sampler (``independent``).

The error is the standard deviation over independent renders over their mean, the median over pixels and bands. Times
are the least of the repeats, which take turns, after one that compiles. The ratio is stock's time for rodcone's error
over rodcone's time: (t_stock e_stock^2) / (t_rodcone e_rodcone^2), since error falls with one over the root of time.
Below it the same for the four wide channels of the RGBW sensor, which stock records as such (four channels) and
rodcone sums from its bands. A scene of two light groups is rendered twice by rodcone, which can then be relit; both
its renders count. An even sky needs no render of its own.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from environment import print_environment
from numpy.typing import NDArray

from render.loader import PART_BANDS, Film, load_units, mitsuba_module, variant
from render.passes import band_parts
from render.photometry import photons_per_joule
from render.scene import Scene
from render.spectrum import band_widths
from render.transport import emission
from scenes.catalog import load
from sensor.curves import rgbw

SCENES = ("cornell_box", "still_life_outdoor", "color_checker")
BANDS = (4, 8, 16, 32, 64)
LETTERS = ("R", "G", "B", "W")
DEPTH = 8
CURVE_NM = np.arange(380.0, 781.0, 5.0)
Render = Callable[[int], NDArray[np.float64]]  # seed -> (channel, h, w)


@dataclass(frozen=True)
class Measured:
    """Seconds of one render, and the relative error of it."""

    seconds: float
    error: float


def film_of(bands: int, size: int) -> Film:
    edges = np.linspace(380.0, 780.0, bands + 1)
    centres = (edges[1:] + edges[:-1]) / 2
    return Film((size, size), centres, band_widths(centres, np.diff(edges)), DEPTH)


def ours(scene: Scene, film: Film, spp: int) -> Render:
    loaded = load_units(scene, film)
    lights = emission(scene.groups, film.wavelength_nm, film.width_nm)

    def draw(seed: int) -> NDArray[np.float64]:
        total = np.zeros((film.wavelength_nm.size, *film.size))
        for index, unit in enumerate(loaded):
            camera, groups = unit.mi_scene.sensors()[0], list(unit.groups)
            for first, planes in band_parts(unit, camera, film, PART_BANDS, spp, 1000 * index + seed):
                here = slice(first, first + planes.shape[1])
                total[here] += (lights[groups, here, None, None] * planes).sum(axis=0)
        return total

    return draw


def stock(scene: Scene, channels: dict[str, dict[str, Any]], size: int, spp: int, sampler: str) -> Render:
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


def boxes(film: Film) -> dict[str, dict[str, Any]]:
    edges = zip(film.wavelength_nm - film.width_nm / 2, film.wavelength_nm + film.width_nm / 2, strict=True)
    return {
        f"band{i:03d}": {"type": "regular", "wavelength_min": float(a), "wavelength_max": float(b), "values": "1,1"}
        for i, (a, b) in enumerate(edges)
    }


def responses() -> dict[str, dict[str, Any]]:
    """Electrons per joule of each letter, as `specfilm` takes them."""
    ends = {"wavelength_min": float(CURVE_NM[0]), "wavelength_max": float(CURVE_NM[-1])}
    curves = {letter: rgbw().curves[letter].band_average(CURVE_NM, 5.0) for letter in LETTERS}
    scale = photons_per_joule(CURVE_NM) / photons_per_joule(550.0)
    return {
        f"letter_{x}": {"type": "regular", **ends, "values": ",".join(map(repr, (curves[x] * scale).tolist()))}
        for x in LETTERS
    }


def into_channels(draw: Render, film: Film) -> Render:
    """Wide channels summed from bands."""
    weights = rgbw().band_average(LETTERS, film.wavelength_nm, film.width_nm) * film.width_nm
    weights = weights * photons_per_joule(film.wavelength_nm) / photons_per_joule(550.0)
    return lambda seed: np.tensordot(weights, draw(seed), axes=1)


def measure(renders: dict[str, Render], repeats: int) -> dict[str, Measured]:
    """Render in turns, so that what else the machine does falls on all alike."""
    for draw in renders.values():
        draw(0)
    seconds: dict[str, list[float]] = {name: [] for name in renders}
    sums: dict[str, Any] = dict.fromkeys(renders, 0.0)
    squares: dict[str, Any] = dict.fromkeys(renders, 0.0)
    for seed in range(1, repeats + 1):
        for name, draw in renders.items():
            start = time.process_time()
            image = draw(seed)
            seconds[name].append(time.process_time() - start)
            sums[name], squares[name] = sums[name] + image, squares[name] + image**2

    found = {}
    for name in renders:
        mean = sums[name] / repeats
        variance = np.maximum(squares[name] / repeats - mean**2, 0.0) * repeats / (repeats - 1)
        lit = mean > 0
        found[name] = Measured(min(seconds[name]), float(np.median(np.sqrt(variance[lit]) / mean[lit])))
    return found


def line(label: str, found: dict[str, Measured], own: str, others: tuple[str, ...]) -> None:
    us = found[own]
    parts = [f"{label:34s} rodcone {us.seconds:6.2f} s {us.error:8.5f}"]
    for name in others:
        it = found[name]
        ratio = it.seconds * it.error**2 / (us.seconds * us.error**2)
        parts.append(f"{name} {it.seconds:6.2f} s {it.error:8.5f} ratio {ratio:7.1f}")
    print(" | ".join(parts), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", help="scene by name; may be given several times")
    parser.add_argument("--bands", type=int, action="append")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=8)
    given = parser.parse_args()
    print_environment()
    print(f"Mitsuba {mitsuba_module().__version__}, {variant()}")
    print(f"{given.size}x{given.size}, {given.spp} samples a pixel, depth {DEPTH}, {given.repeats} repeats")
    for name in given.scene or SCENES:
        scene = load(name)
        for bands in given.bands or BANDS:
            film = film_of(bands, given.size)
            own = ours(scene, film, given.spp)
            narrow = {
                "rodcone": own,
                "same sampler": stock(scene, boxes(film), given.size, given.spp, "multijitter"),
                "independent": stock(scene, boxes(film), given.size, given.spp, "independent"),
            }
            line(f"{name}, {bands} bands", measure(narrow, given.repeats), "rodcone", ("same sampler", "independent"))
            wide = {
                "rodcone": into_channels(own, film),
                "same sampler": stock(scene, responses(), given.size, given.spp, "multijitter"),
                "independent": stock(scene, responses(), given.size, given.spp, "independent"),
            }
            line(f"{name}, RGBW from {bands}", measure(wide, given.repeats), "rodcone", ("same sampler", "independent"))


if __name__ == "__main__":
    main()
