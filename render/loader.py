"""From a `Scene` to Mitsuba objects: variant, film, and the scene at unit emission."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.dense import LANES, dense_path
from render.errors import InputError
from render.jit import backend
from render.scene import Node, Scene, uniform_node
from render.spectrum import Floats

METER_PIXELS = 64  # film of the irradiance meter, each side

_VARIANTS = {"cuda": "cuda_ad_spectral", "llvm": "llvm_ad_spectral", "numpy": "scalar_spectral"}


def variant() -> str:
    """Mitsuba variant in use: CUDA where a device answers, else LLVM, else scalar."""
    return _VARIANTS[backend()]


@cache
def mitsuba_module() -> Any:
    """Mitsuba with its variant set and the dense integrator registered."""
    import mitsuba  # only now: its import loads Dr.Jit, which must find the LLVM that `render.jit` has chosen

    mitsuba.set_variant(variant())
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    if backend() != "numpy":
        mitsuba.register_integrator("densepath", dense_path(mitsuba))
    return mitsuba


@dataclass(frozen=True)
class Film:
    """What the film records: its size, bands and the deepest path.

    Attributes
    ----------
    size : (int, int)
        Height and width in pixels.
    wavelength_nm, width_nm : (band,) float64
    max_depth : int
        Longest path in segments; 2 is direct light.
    """

    size: tuple[int, int]
    wavelength_nm: Floats
    width_nm: Floats
    max_depth: int


def integrator_name() -> str:
    """Integrator in use, in words."""
    return "path + specfilm" if backend() == "numpy" else "dense path (all bands along each path)"


def load_unit(scene: Scene, group: str, film: Film) -> Any:
    """Mitsuba scene with one light group at unit spectral emission, sensor 0 the camera, sensor 1 the meter if any."""
    mi = mitsuba_module()
    description = scene.lit({group: uniform_node(1.0)})
    recorder = _recorder(film, film.size)
    description["sensor"] = {**description["sensor"], "film": recorder, "sampler": {"type": "multijitter"}}
    if scene.reference_plane:
        meter = {
            "type": "irradiancemeter",
            "film": _recorder(film, (METER_PIXELS, METER_PIXELS)),
            "sampler": {"type": "multijitter"},
        }
        description[scene.reference_plane] = {**description[scene.reference_plane], "illuminance_meter": meter}
    try:
        return mi.load_dict(description)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"scene {scene.name}: Mitsuba can't load it: {reason}; correct the description") from error


def load_direct(scene: Scene, film: Film) -> Any:
    """Mitsuba scene for one question: which pixels see a light directly. All groups at unit emission, depth 1."""
    one_band = Film(film.size, film.wavelength_nm[:1], film.width_nm[:1], max_depth=1)
    description = scene.lit({name: uniform_node(1.0) for name in scene.groups})
    recorder = _recorder(one_band, film.size)
    description["sensor"] = {**description["sensor"], "film": recorder, "sampler": {"type": "multijitter"}}
    return mitsuba_module().load_dict(description)


def _recorder(film: Film, size: tuple[int, int]) -> Node:
    """Film node; float32, since specfilm's default of half floats loses the night."""
    node: Node = {"width": size[1], "height": size[0], "component_format": "float32", "rfilter": {"type": "box"}}
    if backend() != "numpy":
        return {"type": "hdrfilm", "pixel_format": "luminance", **node}
    node["type"] = "specfilm"
    for index, (centre, width) in enumerate(zip(film.wavelength_nm, film.width_nm, strict=True)):
        edges = {"wavelength_min": float(centre - width / 2), "wavelength_max": float(centre + width / 2)}
        node[f"band{index:04d}"] = {"type": "regular", **edges, "values": "1,1"}
    return node


def integrators(film: Film, most_bands: int) -> list[Any]:
    """Integrators that together give all bands in order, each at most `most_bands` (a multiple of four).

    Compile time grows faster than the number of bands, and parts of one size share a kernel. A part is filled up to a
    multiple of four by repeating its last band; `parts` tells how many count.
    """
    mi = mitsuba_module()
    if backend() == "numpy":
        return [mi.load_dict({"type": "path", "max_depth": film.max_depth})]
    made = []
    for part in parts(film, most_bands):
        padded = np.concatenate([part, np.full(-part.size % LANES, part[-1])])
        bands = {
            name: ",".join(map(repr, values[padded].tolist()))
            for name, values in (("wavelength_nm", film.wavelength_nm), ("width_nm", film.width_nm))
        }
        made.append(mi.load_dict({"type": "densepath", "max_depth": film.max_depth, **bands}))
    return made


def parts(film: Film, most_bands: int) -> list[NDArray[np.int64]]:
    """Indices of the bands in each part, as even as can be: their sizes differ by one at most."""
    count = film.wavelength_nm.size
    return np.array_split(np.arange(count), -(-count // most_bands))
