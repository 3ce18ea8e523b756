"""The camera that scenes are seen through, and the constant environment of charts and targets."""

from collections.abc import Mapping

from render.geometry import look_at, to_world
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene

SKY_LUMINANCE_CD_M2 = 100.0


def camera(fov_deg: float, origin: tuple[float, float, float], target: tuple[float, float, float]) -> Node:
    """Perspective camera; `fov_deg` is the angle of view over the picture's shorter side."""
    pose = to_world(look_at(origin, target))
    return {"type": "perspective", "fov": fov_deg, "fov_axis": "smaller", "to_world": pose}


def under_sky(name: str, view: Node, shapes: Mapping[str, Node], light: str, reference_plane: str) -> Scene:
    """Scene of some shapes in a constant environment of 100 cd/m^2, the light group ``sky``."""
    geometry = {"type": "scene", "sensor": view, **shapes, "sky": {"type": "constant"}}
    groups = {"sky": LightGroup(("sky",), illuminant(light), SKY_LUMINANCE_CD_M2)}
    return Scene(name, geometry, groups, reference_plane=reference_plane)
