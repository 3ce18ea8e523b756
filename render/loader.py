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
from render.scene_paths import search_path
from render.spectrum import Floats

METER_PIXELS = 64  # film of the irradiance meter, each side

# Bands traced together. More share the work of tracing, but the kernel's first compilation grows faster than their
# number, and with several kinds of material little is saved: 40 bands of `still_life`, 128x128, 16 samples on two cores
# take 2.3, 1.6, 1.6 s of processor time in parts of 12, 20, 40, and compile in 5, 9, 27 s. With matte surfaces alone
# 32 bands compile in 2 s, and take 0.84 s where two parts of 16 take 1.4.
PART_BANDS, MATTE_PART_BANDS = 20, 40

_SAMPLER = {"type": "multijitter"}  # 8.7 times less error than "independent" under sun and sky at 64 samples, as fast
_VARIANTS = {"cuda": "cuda_ad_spectral", "llvm": "llvm_ad_spectral", "numpy": "scalar_spectral"}


def variant() -> str:
    """Mitsuba variant in use: CUDA where a device answers, else LLVM, else scalar."""
    return _VARIANTS[backend()]


@cache
def mitsuba_module() -> Any:
    """Mitsuba with its variant set and the dense integrator registered."""
    import mitsuba  # only now: its import loads Dr.Jit, which must find the LLVM that `render.jit` has chosen

    mi: Any = mitsuba
    mi.set_variant(variant())
    mi.set_log_level(mi.LogLevel.Error)
    mi.set_file_resolver(search_path(mi))
    if backend() != "numpy":
        mi.register_integrator("densepath", dense_path(mi))
    return mi


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


@dataclass(frozen=True)
class Loaded:
    """One light group's Mitsuba scene: sensor 0 is the camera, sensor 1 the irradiance meter if any.

    Attributes
    ----------
    mi_scene : mitsuba.Scene
    own_colour : bool
        Whether emission depends on wavelength; at unit emission it is evaluated once.
    part_bands : int
        Bands that the camera traces together.
    """

    mi_scene: Any
    own_colour: bool
    part_bands: int


def integrator_name() -> str:
    """Integrator in use, in words."""
    return "path + specfilm" if backend() == "numpy" else "dense path (all bands along each path)"


def load_unit(scene: Scene, group: str, film: Film) -> Loaded:
    """Load a scene with one light group at unit spectral emission (or its own colour)."""
    description = scene.lit({group: uniform_node(1.0)})
    description["sensor"] = {**description["sensor"], "film": _recorder(film, film.size), "sampler": _SAMPLER}
    if scene.reference_plane:
        meter = {
            "type": "irradiancemeter",
            "film": _recorder(film, (METER_PIXELS, METER_PIXELS)),
            "sampler": _SAMPLER,
        }
        description[scene.reference_plane] = {**description[scene.reference_plane], "illuminance_meter": meter}
    mi_scene = _load(scene, description)
    part_bands = MATTE_PART_BANDS if _is_matte(mi_scene) else PART_BANDS
    return Loaded(mi_scene, scene.groups[group].own_colour, part_bands)


def load_direct(scene: Scene, film: Film) -> Loaded:
    """Load a scene for one question: which pixels see a light directly. All groups at unit emission, depth 1."""
    description = scene.lit({name: uniform_node(1.0) for name in scene.groups})
    description["sensor"] = {**description["sensor"], "film": _recorder(film, film.size), "sampler": _SAMPLER}
    return Loaded(_load(scene, description), own_colour=True, part_bands=LANES)


def _load(scene: Scene, description: Node) -> Any:
    try:
        return mitsuba_module().load_dict(description)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"scene {scene.name}: Mitsuba can't load it: {reason}; correct the description") from error


def _is_matte(mi_scene: Any) -> bool:
    """Whether all surfaces are Lambertian."""
    flags = mitsuba_module().BSDFFlags
    diffuse = flags.DiffuseReflection | flags.FrontSide | flags.BackSide | flags.SpatiallyVarying
    return all(int(shape.bsdf().flags()) & ~int(diffuse) == 0 for shape in mi_scene.shapes() if shape.bsdf())


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


def integrators(film: Film, part_bands: int, own_colour: bool, meter: bool = False) -> list[Any]:
    """Integrators that together give all bands in order, each at most `part_bands` (a multiple of four).

    Parts of one size share a kernel. A part is filled up to a multiple of four by repeating its last band; `parts`
    tells how many count.
    """
    mi = mitsuba_module()
    if backend() == "numpy":
        return [mi.load_dict({"type": "path", "max_depth": film.max_depth})]
    made = []
    for part in parts(film, part_bands):
        padded = np.concatenate([part, np.full(-part.size % LANES, part[-1])])
        bands = {
            name: ",".join(map(repr, values[padded].tolist()))
            for name, values in (("wavelength_nm", film.wavelength_nm), ("width_nm", film.width_nm))
        }
        options = {"max_depth": film.max_depth, "own_colour": own_colour, "meter": meter}
        made.append(mi.load_dict({"type": "densepath", **options, **bands}))
    return made


def parts(film: Film, part_bands: int) -> list[NDArray[np.int64]]:
    """Indices of the bands in each part, as even as can be: their sizes differ by one at most."""
    count = film.wavelength_nm.size
    return np.array_split(np.arange(count), -(-count // part_bands))
