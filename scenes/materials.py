"""Mitsuba nodes for surfaces and flat shapes, so that each scene reads as a list of things."""

from render.geometry import rotate, scale, to_world, translate
from render.scene import Node, spectrum_node
from render.spectrum import Floats, Spectrum


def matte(reflectance: Spectrum) -> Node:
    """Lambertian surface, lit from either side."""
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": spectrum_node(reflectance)}}


def glossy(reflectance: Spectrum, roughness: float) -> Node:
    """Coloured body under a rough clear coat of refractive index 1.5 (Beckmann roughness)."""
    return {
        "type": "roughplastic",
        "diffuse_reflectance": spectrum_node(reflectance),
        "int_ior": 1.5,
        "alpha": roughness,
        "nonlinear": True,
    }


def metal(material: str, roughness: float) -> Node:
    """Rough metal with Mitsuba's measured complex refractive index (``Au``, ``Cu``, ``Al``, ...)."""
    return {"type": "twosided", "bsdf": {"type": "roughconductor", "material": material, "alpha": roughness}}


def checks(first: Spectrum, second: Spectrum, columns: float, rows: float) -> Node:
    """Matte cloth of small checks; `columns` and `rows` count pairs over the shape."""
    texture = {
        "type": "checkerboard",
        "color0": spectrum_node(first),
        "color1": spectrum_node(second),
        "to_uv": to_world(scale(columns, rows, 1.0)),
    }
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture}}


def panel(place: Floats, width_m: float, height_m: float, bsdf: Node, **more: Node) -> Node:
    """Rectangle centred on the origin of `place`, facing its +z."""
    return {
        "type": "rectangle",
        "to_world": to_world(place, scale(width_m / 2, height_m / 2, 1.0)),
        "bsdf": bsdf,
        **more,
    }


def floor(x: float, y: float, z: float) -> Floats:
    """Place that faces up (+y) at a point."""
    return translate(x, y, z) @ rotate((1, 0, 0), -90)
