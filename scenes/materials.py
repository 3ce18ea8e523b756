"""Mitsuba nodes for surfaces and shapes, so that each scene reads as a list of things; the sky of charts."""

from collections.abc import Mapping
from math import radians, tan
from typing import Annotated, TypeAlias

import numpy as np

from render.geometry import look_at, rotate, scale, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene, spectrum_node
from render.spectrum import Spectrum, optical_constant
from rodcone.errors import InputError
from rodcone.types import Floats
from scenes.reflectances import grey, resampled

Greys: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.uint8]]  # 0 to 255
Metres: TypeAlias = Annotated[float, (1e-9, 1e9, "give metres")]
SKY_LUMINANCE_CD_M2 = 100.0


def matte(reflectance: Spectrum) -> Node:
    """Return a Lambertian surface, which can be lit from either side.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.matte(rodcone.grey(0.5))["type"]
    'twosided'
    """
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": spectrum_node(reflectance)}}


def glossy(reflectance: Spectrum, roughness: float) -> Node:
    """Return a coloured body under a rough clear coat of refractive index 1.5 (Beckmann roughness)."""
    return {
        "type": "roughplastic",
        "diffuse_reflectance": spectrum_node(reflectance),
        "int_ior": 1.5,
        "alpha": roughness,
        "nonlinear": True,
    }


def metal(material: str, roughness: float) -> Node:
    """Return a rough metal with the measured complex refractive index that Mitsuba has for it.

    Materials are ``Au``, ``Cu``, ``Al`` and others. The index is resampled to the common grid. If it were named as
    Mitsuba's `material`, each metal would have a grid of its own and take 7 s more to compile.
    """
    index: dict[str, Node] = {}
    for part in ("eta", "k"):
        table = optical_constant(material, part)
        if table is None:
            raise InputError(f"metal: Mitsuba has no {material!r}; allowed: names such as Au, Cu, Al; correct it")
        index[part] = spectrum_node(resampled(table.wavelength_nm, table.values))
    return {"type": "twosided", "bsdf": {"type": "roughconductor", **index, "alpha": roughness}}


def checks(first: Spectrum, second: Spectrum, columns: float, rows: float, turn_deg: float = 0.0) -> Node:
    """Return a matte cloth of small checks.

    `columns` and `rows` count pairs of checks over the shape; less than half a row makes stripes.
    """
    texture = {
        "type": "checkerboard",
        "color0": spectrum_node(first),
        "color1": spectrum_node(second),
        "to_uv": to_world(scale(columns, rows, 1.0), rotate((0, 0, 1), turn_deg)),
    }
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture}}


def printed(picture: str, dark: Spectrum, bright: Spectrum, repeats: float, turn_deg: float = 0.0) -> Node:
    """Return a matte surface that carries a grey picture, which mixes two reflectances at each point.

    The picture comes from scikit-image's wheel. Its stored value, 0 to 1, is the share of `bright`. The picture is
    repeated `repeats` times over the shape; every other repeat is mirrored.
    """
    share = {
        "type": "bitmap",
        "filename": f"skimage/data/{picture}.png",  # relative to the folder of wheels, wherever that is
        "raw": True,
        "wrap_mode": "mirror",
        "to_uv": to_world(scale(repeats, repeats, 1.0), rotate((0, 0, 1), turn_deg)),
    }
    dark_side, bright_side = ({"type": "diffuse", "reflectance": spectrum_node(x)} for x in (dark, bright))
    return {"type": "twosided", "bsdf": {"type": "blendbsdf", "weight": share, "a": dark_side, "b": bright_side}}


def mixed(share: Greys, dark: Spectrum, bright: Spectrum) -> Node:
    """Return a matte surface of squares, each a mixture of two reflectances: `share` / 255 of `bright`.

    The first row is the upper one, as a camera sees the front of a panel that `look_at` turns to it.
    """
    rows = [row.tobytes().hex() for row in share[::-1]]  # Mitsuba counts them from below
    squares = {"type": "bitmap", "data": rows, "raw": True, "filter_type": "nearest", "wrap_mode": "clamp"}
    dark_side, bright_side = ({"type": "diffuse", "reflectance": spectrum_node(x)} for x in (dark, bright))
    return {"type": "twosided", "bsdf": {"type": "blendbsdf", "weight": squares, "a": dark_side, "b": bright_side}}


def panel(pose: Floats, width_m: Metres, height_m: Metres, bsdf: Node, **more: Node) -> Node:
    """Return a rectangle centred on the origin of `pose` and facing its +z."""
    size = scale(width_m / 2, height_m / 2, 1.0)
    return {"type": "rectangle", "to_world": to_world(pose, size), "bsdf": bsdf, **more}


def floor(x: float, y: float, z: float) -> Floats:
    """Return the pose at a point that faces up (+y)."""
    return translate(x, y, z) @ rotate((1, 0, 0), -90)


def disk(pose: Floats, radius_m: float, bsdf: Node, **more: Node) -> Node:
    """Return a round plate centred on the origin of `pose` and facing its +z."""
    return {"type": "disk", "to_world": to_world(pose, scale(radius_m, radius_m, 1.0)), "bsdf": bsdf, **more}


def far_disk(towards: tuple[float, float, float], distance_m: float, radius_deg: float) -> Node:
    """Return an emitting disk, such as the sun, of an angular radius seen from the origin; `towards` has length 1."""
    pose = look_at(tuple(distance_m * x for x in towards), (0.0, 0.0, 0.0))
    radius_m = distance_m * tan(radians(radius_deg))
    return disk(pose, radius_m, matte(grey(0.02)), emitter={"type": "area"})


def star(pose: Floats, radius_m: float, first: Spectrum, second: Spectrum, spokes: int) -> Node:
    """Return a disk with `spokes` sectors of each of two colours; its second texture coordinate is the angle."""
    return disk(pose, radius_m, checks(first, second, 0.4, spokes))  # 0.4: under half a check from middle to rim


def ball(x: float, y: float, z: float, radius_m: float, bsdf: Node) -> Node:
    """Return a sphere around a point."""
    return {"type": "sphere", "center": [x, y, z], "radius": radius_m, "bsdf": bsdf}


def block(pose: Floats, width_m: float, height_m: float, depth_m: float, bsdf: Node, **more: Node) -> Node:
    """Return a cuboid that stands on the origin of `pose`: x across, y up, z to the front."""
    half = scale(width_m / 2, height_m / 2, depth_m / 2)
    return {"type": "cube", "to_world": to_world(pose, translate(0, height_m / 2, 0), half), "bsdf": bsdf, **more}


def rod(start: tuple[float, float, float], end: tuple[float, float, float], radius_m: float, bsdf: Node) -> Node:
    """Return an open cylinder between two points."""
    ends = {"p0": [float(x) for x in start], "p1": [float(x) for x in end]}
    return {"type": "cylinder", **ends, "radius": radius_m, "bsdf": bsdf}


def glass() -> Node:
    """Return clear, smooth crown glass with one index for all wavelengths, so that one path serves all bands.

    1.5187 is Schott N-BK7's index at 546 nm; leaving out its dispersion shifts the refracted picture by 1 % at most.
    """
    return {"type": "dielectric", "int_ior": 1.5187, "ext_ior": 1.000277}


def under_sky(name: str, view: Node, shapes: Mapping[str, Node], light: str, reference_plane: str) -> Scene:
    """Build a scene of some shapes in a constant environment of 100 cd/m^2, the light group ``sky``."""
    geometry = {"type": "scene", "sensor": view, **shapes, "sky": {"type": "constant"}}
    groups = {"sky": LightGroup(("sky",), illuminant(light), SKY_LUMINANCE_CD_M2)}
    return Scene(name, geometry, groups, reference_plane=reference_plane)
