"""From a `Scene` to Mitsuba objects: variant, film, and the scene at unit emission."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, reduce
from operator import getitem
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.integrator.dense import SPECTRUM_SIZE, dense_path
from render.integrator.matte import matte_surface, with_matte_surfaces
from render.integrator.reflectance_table import band_offsets, reflectance_table, with_rows
from render.integrator.scattered_path import scattered_path
from render.scene import COLOURED_EMITTERS, EMISSION_PARAMETER, Node, Scene, uniform_node, walk
from render.spectrum import Spectrum
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError, one_line
from rodcone.jit import backend
from rodcone.types import Floats

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


def mitsuba_words(error: BaseException) -> str:
    """Mitsuba's message on one line, without its source locations, and of an object's long description its name."""
    without_places = re.sub(r"\[\w+\.cpp:\d+\] ", "", one_line(error))
    return re.sub(r'\[ name = ("[^"]*"),.* \]', r" \1", without_places)


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
    """Mitsuba's scene of one light group, or of one and a constant environment.

    Attributes
    ----------
    mi_scene : mitsuba.Scene
    groups : tuple of int
        Which of the scene's groups it gives, by their order. A second one is the constant environment, which isn't in
        `mi_scene`: paths that escape bring its light.
    coloured : bool
        Whether emission depends on wavelength; at unit emission it is evaluated once.
    sample_lights : bool
        Whether directions are sampled towards lights.
    curves : tuple of Spectrum
        Reflectances that are read from a table, row by row. None for coloured lights: a line in them
        would be met at few of the table's wavelengths.
    covering : mitsuba.Scene or None
        The same scene with a film of one band and lights of 1 whatever their colours: it shows what they cover. None
        with Dr.Jit, whose camera paths record it.
    """

    mi_scene: Any
    groups: tuple[int, ...]
    coloured: bool
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


def load_groups(scene: Scene, film: Film) -> list[Loaded]:
    """Load what is rendered one after the other: each light group, and a constant environment along with the first."""
    hair = ["/".join(path) for path, node in walk(scene.geometry) if node.get("type") == "hair"]
    if hair and backend() != "numpy" and film.wavelength_nm.size > SPECTRUM_SIZE:
        raise InputError(
            f"scene {scene.name}: {', '.join(hair)} of type 'hair' chooses where light goes by wavelength; allowed: "
            f"{SPECTRUM_SIZE} bands a render; replace it, nearest: principled or roughplastic"
        )
    names = list(scene.groups)
    carried = [] if backend() == "numpy" or len(names) == 1 else [x for x in names if scene.is_environment(x)][:1]
    loaded = [_load_group(scene, name, film) for name in names if name not in carried]
    if carried:
        loaded[0] = replace(loaded[0], groups=(*loaded[0].groups, names.index(carried[0])))
    return loaded


def _load_group(scene: Scene, group: str, film: Film) -> Loaded:
    """Load a scene with one light group at unit spectral emission (or its own colours)."""
    description = scene.lit({group: uniform_node(1.0)})
    description["sensor"] = {**description["sensor"], "film": _recorder(film, film.size), "sampler": _SAMPLER}
    if scene.reference_plane:
        if backend() == "numpy":
            scene.check_meter()
        recorder = _recorder(film, (METER_PIXELS, METER_PIXELS))
        meter = {"type": "irradiancemeter", "film": recorder, "sampler": _METER_SAMPLER}
        description[scene.reference_plane] = {**description[scene.reference_plane], "illuminance_meter": meter}
    index, coloured = (list(scene.groups).index(group),), scene.groups[group].coloured
    if backend() == "numpy":
        covering = _load(scene, group, _covering(scene, group, film))
        mi_scene = _load(scene, group, description)
        return Loaded(mi_scene=mi_scene, groups=index, coloured=coloured, sample_lights=True, covering=covering)
    matte = with_matte_surfaces(description)
    tabulated, curves = (matte, ()) if coloured else with_rows(matte)
    mi_scene = _load(scene, group, tabulated)
    # A constant environment is met in every direction: directions sampled for the surface alone leave less noise than a
    # mixture with ones sampled for the light, and half of the rays are saved.
    environment = [light.class_name() for light in mi_scene.emitters()] == ["ConstantBackgroundEmitter"]
    return Loaded(mi_scene=mi_scene, groups=index, coloured=coloured, sample_lights=not environment, curves=curves)


def _covering(scene: Scene, group: str, film: Film) -> Node:
    """Describe the scene with the group's lights at 1, on a film of one band."""
    description = scene.lit({group: uniform_node(1.0)})
    one_band = replace(film, wavelength_nm=film.wavelength_nm[:1], width_nm=film.width_nm[:1])
    description["sensor"] = {**description["sensor"], "film": _recorder(one_band, film.size), "sampler": _SAMPLER}
    for path in scene.groups[group].emitters if scene.groups[group].coloured else ():
        *way, key = path.split("/")
        holder = reduce(getitem, way, description)
        kind = "constant" if holder[key]["type"] in COLOURED_EMITTERS else holder[key]["type"]
        holder[key] = {"type": kind, EMISSION_PARAMETER[kind]: uniform_node(1.0)}
    return description


def _load(scene: Scene, group: str, description: Node) -> Any:
    mi = mitsuba_module()
    config = mi.parser.ParserConfig(variant())
    # Merging meshes orders a scene's shapes anew at each load, and its lights with them. A path chooses a light by its
    # number, so several keep their order only without.
    config.merge_meshes = len(scene.groups[group].emitters) == 1
    try:
        state = mi.parser.parse_dict(config, description)
        mi.parser.transform_all(config, state)
        return mi.parser.instantiate(config, state)
    except RuntimeError as error:
        words = mitsuba_words(error)
        raise InputError(f"scene {scene.name}: Mitsuba can't load it: {words}; correct the description") from error


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


def integrators(
    film: Film, part_bands: int, loaded: Loaded, seed: int, meter: bool = False
) -> Iterator[tuple[NDArray[np.int64], Any]]:
    """Indices of some bands and their integrator, which together give all bands in order.

    With Dr.Jit each has at most `part_bands` (a multiple of four), their numbers as even as can be: parts of one size
    share a kernel. A part is filled up to a multiple of four by repeating its last band. The seed decides where in the
    bands the paths' wavelengths lie.
    """
    mi, count = mitsuba_module(), film.wavelength_nm.size
    if backend() == "numpy":
        plug_in = "path" if meter else "scatteredpath"
        yield np.arange(count), mi.load_dict({"type": plug_in, "max_depth": film.max_depth})
        return
    offsets = band_offsets(seed)
    for part in np.array_split(np.arange(count), -(-count // part_bands)):
        padded = np.concatenate([part, np.full(-part.size % SPECTRUM_SIZE, part[-1])])
        centre, width = film.wavelength_nm[padded], film.width_nm[padded]
        made = mi.load_dict(
            {
                "type": "densepath",
                "max_depth": film.max_depth,
                "meter": meter,
                "coloured": loaded.coloured,
                "sample_lights": loaded.sample_lights,
                "environment": len(loaded.groups) > 1,
                "wavelength_nm": ",".join(map(repr, centre.tolist())),
                "width_nm": ",".join(map(repr, width.tolist())),
            }
        )
        if loaded.curves:
            made.tracer.prepare(offsets, reflectance_table(loaded.curves, centre + width * offsets[:, None]))
        yield part, made
