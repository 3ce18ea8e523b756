"""Conversion of a `Scene` to Mitsuba's objects: variant, film, and the scene at unit emission."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from render.integrator.matte import matte_surface, with_matte_surfaces, with_rows
from render.integrator.variant_types import SPECTRUM_SIZE, MitsubaScene
from render.scene import Node, Scene, emitter_paths, uniform_node, walk
from render.spectrum import Spectrum
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError, one_line
from rodcone.jit import at_least_two_threads, backend
from rodcone.types import Floats

INTEGRATOR = "dense path (all bands along each path)"
METER_PIXELS = 64  # side of the irradiance meter's film

# Bands that are traced together. More bands share the work of tracing, but the time of a kernel's first compilation
# grows faster than their number: 40 bands of `still_life_outdoor`, 96x96, 16 samples, take 0.89 s of processor time in
# two parts and 0.69 s in one, and compile in 5 and 12 s.
PART_BANDS = 40
_search_path: list[Any] = []  # this program's file resolver, kept here while a user's own is in place
_VARIANTS = {"cuda": "cuda_ad_spectral", "llvm": "llvm_ad_spectral", "numpy": "none"}


def variant() -> str:
    """Return the Mitsuba variant in use: CUDA if there is a device, else LLVM, else ``none``."""
    return _VARIANTS[backend()]


@cache
def mitsuba_module() -> ModuleType:
    """Import Mitsuba, set its variant and its search path, and register this program's surface `matte`.

    Raises
    ------
    InputError
        Where Dr.Jit has neither LLVM nor CUDA, because nothing else traces paths.
    """
    if backend() == "numpy":
        raise InputError(
            "render: Dr.Jit has neither LLVM nor CUDA here, and nothing else traces paths; allowed: stored radiance, "
            "captures and development; install LLVM 17 or newer, see `rodcone doctor`"
        )
    import mitsuba  # only now: its import loads Dr.Jit, which must find the LLVM that `rodcone.jit` has chosen

    mi: ModuleType = mitsuba
    mi.set_variant(variant())
    mi.set_log_level(mi.LogLevel.Error)
    mi.set_file_resolver(search_path(mi))
    mi.register_bsdf("matte", matte_surface(mi))
    return mi


@contextmanager
def own_mitsuba_variant() -> Iterator[None]:
    """Set this program's Mitsuba variant and search path while the context lasts, then restore the user's.

    A user who had chosen no variant keeps this program's, because Mitsuba can't go back to none.
    """
    import mitsuba

    mi: ModuleType = mitsuba
    variant_before = mi.variant()
    resolver_before = mi.file_resolver()
    mitsuba_module()
    mi.set_variant(variant())
    mi.set_file_resolver(_search_path.pop() if _search_path else search_path(mi))
    try:
        yield
    finally:
        _search_path[:] = [mi.file_resolver()]  # a trusted scene may have added folders
        mi.set_file_resolver(resolver_before)
        if variant_before:
            mi.set_variant(variant_before)


def mitsuba_words(error: BaseException) -> str:
    """Return Mitsuba's message on one line, without source locations, and with names in place of descriptions."""
    without_places = re.sub(r"\[\w+\.cpp:\d+\] ", "", one_line(error))
    return re.sub(r'\[ name = ("[^"]*"),.* \]', r" \1", without_places)


@dataclass(frozen=True)
class Film:
    """Size and bands that a render records, and the largest depth of its paths.

    Attributes
    ----------
    size : (int, int)
        Height and width in pixels.
    wavelength_nm, width_nm : (band,) float64
    max_depth : int
        Longest path in segments; 1 is emission alone, 2 direct light.
    rr_depth : int
        As in `Scene`.
    """

    size: tuple[int, int]
    wavelength_nm: Floats
    width_nm: Floats
    max_depth: int
    rr_depth: int = Scene.rr_depth


@dataclass(frozen=True)
class LoadedScene:
    """Mitsuba's scene with one light group, and perhaps a constant environment beside it.

    Attributes
    ----------
    mi_scene : mitsuba.Scene
    groups : tuple of int
        Indices of the groups whose light is rendered. A second one is the constant environment, which isn't in
        `mi_scene`: paths that escape bring its light.
    coloured : bool
        Whether emission depends on wavelength; at unit emission it is evaluated once.
    sample_lights : bool
        Whether directions are sampled towards lights.
    curves : tuple of Spectrum
        Reflectances that are read from a table, row by row. There are none under coloured lights, because few of the
        table's wavelengths would meet a line in such a light.
    """

    mi_scene: MitsubaScene
    groups: tuple[int, ...]
    coloured: bool
    sample_lights: bool
    curves: tuple[Spectrum, ...] = ()

    def channels(self, bands: int, *, split: bool = False) -> int:
        """Return the approximate number of channels that `render.integrator.dense.Tracer.camera` gives."""
        return (bands + 4) * (len(self.groups) * (1 + split) + self.coloured)


def load_groups(scene: Scene, film: Film, *, metered: bool = False) -> list[LoadedScene]:
    """Load the scenes that are rendered one after the other: one per light group.

    A constant environment is rendered along with the first group. With `metered` the reference plane carries an
    irradiance meter.
    """
    hair = ["/".join(path) for path, node in walk(scene.geometry) if node.get("type") == "hair"]
    if hair and film.wavelength_nm.size > SPECTRUM_SIZE:
        raise InputError(
            f"scene {scene.name}: {', '.join(hair)} of type 'hair' chooses where light goes by wavelength; allowed: "
            f"{SPECTRUM_SIZE} bands a render; replace it, nearest: principled or roughplastic"
        )
    names = list(scene.groups)
    along = [] if len(names) == 1 else [x for x in names if is_environment(scene, x)][:1]
    launched = [name for name in names if name not in along]
    geometry, curves = with_rows(with_matte_surfaces(scene.geometry))
    scene = replace(scene, geometry=geometry, extend=None)  # the geometry already contains the continued tables
    scene = _with_common_shapes(scene) if len(launched) > 1 else scene
    loaded = [_load_group(scene, name, film, curves, metered) for name in launched]
    if along:
        loaded[0] = replace(loaded[0], groups=(*loaded[0].groups, names.index(along[0])))
    return loaded


def load_unlit(scene: Scene, size: tuple[int, int]) -> MitsubaScene:
    """Load the scene without lights and without merging meshes, to find what each pixel sees, whatever the light."""
    description = scene.lit({})
    description["sensor"] = {**description["sensor"], "film": _recorder(size)}
    return _load(scene, description)


def is_environment(scene: Scene, group: str) -> bool:
    """Return whether a group is a single light of one spectrum, with the same radiance from all directions."""
    lights = scene.groups[group]
    kinds = [emitter_paths(scene.geometry)[path] for path in lights.emitters]
    return kinds == ["constant"] and not lights.coloured


def _with_common_shapes(scene: Scene) -> Scene:
    """Load the shapes that belong to no light, and the surfaces of lamps, once for all groups' scenes.

    Dr.Jit's kernels include every surface and shape that exists, in whichever scene. With a copy per group, tracing
    took as many times longer as there are groups.
    """
    mi = mitsuba_module()
    lit = {path.split("/")[0] for group in scene.groups.values() for path in group.emitters}
    parts = scene.geometry.items()
    unlit = {x: part for x, part in parts if x not in {scene.reference_plane, *lit} and _is(part, mi.ObjectType.Shape)}
    shapes = _load(scene, {"type": "scene", **unlit}, merge_meshes=True).shapes()
    rest = {x: part for x, part in parts if x not in unlit}
    for x in [x for x in rest if x in lit]:
        surfaces = {name: part for name, part in rest[x].items() if _is(part, mi.ObjectType.BSDF)}
        rest[x] = rest[x] | {name: _load(scene, part) for name, part in surfaces.items()}
    return replace(scene, geometry=rest | dict(zip(unlit, shapes, strict=False)))  # merged meshes are fewer


def _is(part: object, kind: object) -> bool:
    """Return whether a part of a scene's dict has a Mitsuba type and holds no reference."""
    if not isinstance(part, dict) or part["type"] == "shapegroup":
        return False
    if any(node.get("type") == "ref" for _, node in walk({"": part})):
        return False
    mi = mitsuba_module()
    python_plugins = {"matte": mi.ObjectType.BSDF}  # a plug-in written in Python, whose kind Mitsuba doesn't know
    return bool(kind == (python_plugins.get(part["type"]) or mi.PluginManager.instance().plugin_type(part["type"])))


def _load_group(scene: Scene, group: str, film: Film, curves: tuple[Spectrum, ...], metered: bool) -> LoadedScene:
    """Load a scene with one light group at unit spectral emission (or its own colours).

    `curves` are the rows of the table to which the scene's matte surfaces refer.
    """
    description = scene.lit({group: uniform_node(1.0)})
    description["sensor"] = {**description["sensor"], "film": _recorder(film.size)}
    if metered and scene.reference_plane:
        meter = {"type": "irradiancemeter", "film": _recorder((METER_PIXELS, METER_PIXELS))}
        description[scene.reference_plane] = {**description[scene.reference_plane], "illuminance_meter": meter}
    index = (list(scene.groups).index(group),)
    coloured = scene.groups[group].coloured
    # When Mitsuba merges meshes, the order of shapes and lights changes from load to load. A path chooses a light by
    # its number, so meshes are merged only if there is a single light.
    mi_scene = _load(scene, description, merge_meshes=len(scene.groups[group].emitters) == 1)
    if not mi_scene.shapes():
        raise InputError(f"scene {scene.name}: it has no shape, so nothing is lit; add one")
    # A constant environment is met in every direction. Directions that are sampled for the surface alone leave less
    # noise than a mixture with directions sampled for the light, and save half of the rays.
    environment = [light.class_name() for light in mi_scene.emitters()] == ["ConstantBackgroundEmitter"]
    return LoadedScene(
        mi_scene=mi_scene,
        groups=index,
        coloured=coloured,
        sample_lights=not environment,
        curves=() if coloured else curves,
    )


def _load(scene: Scene, description: Node, *, merge_meshes: bool = False) -> MitsubaScene:
    mi = mitsuba_module()
    config = mi.parser.ParserConfig(variant())
    config.merge_meshes = merge_meshes
    try:
        state = mi.parser.parse_dict(config, with_textures(description))
        mi.parser.transform_all(config, state)
        with at_least_two_threads():
            return mi.parser.instantiate(config, state)
    except RuntimeError as error:
        words = mitsuba_words(error)
        raise InputError(f"scene {scene.name}: Mitsuba can't load it: {words}; correct the description") from error


def with_textures(node: Node) -> Node:
    """Return a copy of a scene's dict in which bitmaps with ``data`` of hexadecimal rows are tensors of 0 to 1."""
    made = {key: with_textures(value) if isinstance(value, dict) else value for key, value in node.items()}
    if made.get("type") == "bitmap" and isinstance(made.get("data"), list):
        rows = np.array([list(bytes.fromhex(row)) for row in made["data"]], np.float32)
        made["data"] = mitsuba_module().TensorXf(rows[..., None] / 255)
    return made


def _recorder(size: tuple[int, int]) -> Node:
    """Describe a film, of which only the size counts, because `render.integrator.wavefront` sums the paths."""
    return {"type": "hdrfilm", "width": size[1], "height": size[0], "pixel_format": "luminance"}
