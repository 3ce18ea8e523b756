"""From a `Scene` to Mitsuba objects: variant, film, and the scene at unit emission."""

from dataclasses import dataclass, replace
from functools import cache, reduce
from operator import getitem
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.integrator.dense import LANES, dense_path
from render.integrator.matte import matte_surface, with_matte_surfaces
from render.integrator.reflectance_table import band_offsets, reflectance_table, with_rows
from render.integrator.scattered_path import scattered_path
from render.scene import EMISSION_PARAMETER, OWN_COLOUR_EMITTERS, Node, Scene, uniform_node
from render.spectrum import Floats, Spectrum
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError, one_line
from rodcone.jit import backend

METER_PIXELS = 64  # film of the irradiance meter, each side

# Bands traced together. More share the work of tracing, but a kernel's first compilation grows faster than their
# number: 40 bands of `still_life_outdoor`, 96x96, 16 samples, take 0.89 s of processor time in two parts and 0.69 s in
# one, and compile in 5 and 12 s.
PART_BANDS = 40
_SAMPLER = {"type": "multijitter"}  # 8.7 times less error than "independent" under sun and sky at 64 samples, as fast
_METER_SAMPLER = _SAMPLER | {"seed": 1}  # Mitsuba makes equal objects one: they would share a count
_VARIANTS = {"cuda": "cuda_ad_spectral", "llvm": "llvm_ad_spectral", "numpy": "scalar_spectral"}


def variant() -> str:
    """Mitsuba variant in use: CUDA where a device answers, else LLVM, else scalar."""
    return _VARIANTS[backend()]


@cache
def mitsuba_module() -> Any:
    """Mitsuba with its variant set and the dense integrator registered."""
    import mitsuba  # only now: its import loads Dr.Jit, which must find the LLVM that `rodcone.jit` has chosen

    mi: Any = mitsuba
    mi.set_variant(variant())
    mi.set_log_level(mi.LogLevel.Error)
    mi.set_file_resolver(search_path(mi))
    if backend() == "numpy":
        mi.register_integrator("scatteredpath", scattered_path(mi))
    else:
        mi.register_integrator("densepath", dense_path(mi))
        mi.register_bsdf("matte", matte_surface(mi))
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
    """Mitsuba's scene of one light group, or of one and an even sky.

    Attributes
    ----------
    mi_scene : mitsuba.Scene
    groups : tuple of int
        Which of the scene's groups it tells, by their order. A second one is the even sky, which isn't in `mi_scene`:
        paths that escape bring its light.
    own_colour : bool
        Whether emission depends on wavelength; at unit emission it is evaluated once.
    sample_lights : bool
        Whether paths go to look for lights.
    curves : tuple of Spectrum
        Reflectances that are read from a table, row by row. None where lights have colours of their own: a line in them
        would be met at few of the table's wavelengths.
    covering : mitsuba.Scene or None
        The same scene with a film of one band and lights of 1 whatever their colours: it shows what they cover. None
        with Dr.Jit, where the camera's paths tell.
    """

    mi_scene: Any
    groups: tuple[int, ...]
    own_colour: bool
    sample_lights: bool
    curves: tuple[Spectrum, ...] = ()
    covering: Any = None

    @property
    def camera(self) -> Any:
        """Mitsuba's sensor."""
        return self.mi_scene.sensors()[0]

    @property
    def meter(self) -> Any | None:
        """Mitsuba's irradiance meter on the reference plane, if the scene states one."""
        return next(iter(self.mi_scene.sensors()[1:]), None)


def samples_drawn(spp: int) -> int:
    """Samples a pixel that Mitsuba's stratified sampler draws where so many are asked for: it fills a grid."""
    sampler = mitsuba_module().load_dict(_SAMPLER)
    sampler.set_sample_count(spp)
    return int(sampler.sample_count())


def integrator_name() -> str:
    """Integrator in use, in words."""
    return "path + specfilm" if backend() == "numpy" else "dense path (all bands along each path)"


def load_units(scene: Scene, film: Film) -> list[Loaded]:
    """Load what is rendered one after the other: each light group by itself, and an even sky along with the first."""
    names = list(scene.groups)
    skies = [] if backend() == "numpy" or len(names) == 1 else [name for name in names if scene.is_even_sky(name)][:1]
    units = [_load_unit(scene, name, film) for name in names if name not in skies]
    if skies:
        units[0] = replace(units[0], groups=(*units[0].groups, names.index(skies[0])))
    return units


def _load_unit(scene: Scene, group: str, film: Film) -> Loaded:
    """Load a scene with one light group at unit spectral emission (or its own colour)."""
    description = scene.lit({group: uniform_node(1.0)})
    description["sensor"] = {**description["sensor"], "film": _recorder(film, film.size), "sampler": _SAMPLER}
    if scene.reference_plane:
        if backend() == "numpy":
            scene.check_meter()
        meter = {
            "type": "irradiancemeter",
            "film": _recorder(film, (METER_PIXELS, METER_PIXELS)),
            "sampler": _METER_SAMPLER,
        }
        description[scene.reference_plane] = {**description[scene.reference_plane], "illuminance_meter": meter}
    place, own_colour = (list(scene.groups).index(group),), scene.groups[group].own_colour
    if backend() == "numpy":
        covering = _load(scene, _covering(scene, group, film))
        return Loaded(_load(scene, description), place, own_colour, sample_lights=True, covering=covering)
    matte = with_matte_surfaces(description)
    tabulated, curves = (matte, ()) if own_colour else with_rows(matte)
    mi_scene = _load(scene, tabulated)
    return Loaded(mi_scene, place, own_colour, not _is_even_sky(mi_scene), curves)


def _covering(scene: Scene, group: str, film: Film) -> Node:
    """Describe the scene with the group's lights at 1, on a film of one band."""
    description = scene.lit({group: uniform_node(1.0)})
    one_band = replace(film, wavelength_nm=film.wavelength_nm[:1], width_nm=film.width_nm[:1])
    description["sensor"] = {**description["sensor"], "film": _recorder(one_band, film.size), "sampler": _SAMPLER}
    for path in scene.groups[group].emitters if scene.groups[group].own_colour else ():
        *way, key = path.split("/")
        holder = reduce(getitem, way, description)
        kind = "constant" if holder[key]["type"] in OWN_COLOUR_EMITTERS else holder[key]["type"]
        holder[key] = {"type": kind, EMISSION_PARAMETER[kind]: uniform_node(1.0)}
    return description


def _load(scene: Scene, description: Node) -> Any:
    try:
        return mitsuba_module().load_dict(description)
    except RuntimeError as error:
        words = one_line(error)
        raise InputError(f"scene {scene.name}: Mitsuba can't load it: {words}; correct the description") from error


def _is_even_sky(mi_scene: Any) -> bool:
    """Whether the one light is a sky of the same radiance all around.

    Every direction finds it, so that directions sampled for the surface alone leave less noise than a mixture with ones
    sampled for the sky; and half of the rays are saved.
    """
    emitters = mi_scene.emitters()
    return len(emitters) == 1 and emitters[0].class_name() == "ConstantBackgroundEmitter"


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


def integrators(film: Film, part_bands: int, unit: Loaded, seed: int, meter: bool = False) -> list[Any]:
    """Integrators that together give all bands in order, each at most `part_bands` (a multiple of four).

    Parts of one size share a kernel. A part is filled up to a multiple of four by repeating its last band; `parts`
    tells how many count. The seed decides where in the bands the paths' wavelengths lie.
    """
    mi = mitsuba_module()
    if backend() == "numpy":
        kind = "path" if meter else "scatteredpath"
        return [mi.load_dict({"type": kind, "max_depth": film.max_depth})]
    how = {"coloured": unit.own_colour, "sample_lights": unit.sample_lights, "environment": len(unit.groups) > 1}
    offsets, made = band_offsets(seed), []
    for part in parts(film, part_bands):
        padded = np.concatenate([part, np.full(-part.size % LANES, part[-1])])
        centre, width = film.wavelength_nm[padded], film.width_nm[padded]
        bands = {
            name: ",".join(map(repr, values.tolist()))
            for name, values in (("wavelength_nm", centre), ("width_nm", width))
        }
        made.append(mi.load_dict({"type": "densepath", "max_depth": film.max_depth, "meter": meter, **how, **bands}))
        if unit.curves:
            made[-1].tracer.prepare(offsets, reflectance_table(unit.curves, centre + width * offsets[:, None]))
    return made


def seen_directly() -> Any:
    """Integrator of the light that the camera sees directly, without LLVM or CUDA."""
    return mitsuba_module().load_dict({"type": "path", "max_depth": 1})


def parts(film: Film, part_bands: int) -> list[NDArray[np.int64]]:
    """Indices of the bands in each part, as even as can be: their sizes differ by one at most. One without Dr.Jit."""
    count = film.wavelength_nm.size
    if backend() == "numpy":
        return [np.arange(count)]
    return np.array_split(np.arange(count), -(-count // part_bands))
