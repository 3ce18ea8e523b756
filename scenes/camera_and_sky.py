"""The camera that scenes are seen through, and the constant environment of charts and targets."""

from collections.abc import Mapping

from render.geometry import look_at, to_world
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene

SKY_LUMINANCE_CD_M2 = 100.0


def camera(
    fov_deg: float,
    origin: tuple[float, float, float],
    target: tuple[float, float, float],
    size: tuple[int, int] | None = None,
) -> Node:
    """Perspective camera of `fov_deg` over the picture's shorter side; `size` is the picture's own height and width."""
    pose = to_world(look_at(origin, target))
    view: Node = {"type": "perspective", "fov": fov_deg, "fov_axis": "smaller", "to_world": pose}
    return view | ({"film": {"type": "hdrfilm", "height": size[0], "width": size[1]}} if size else {})


def under_sky(name: str, view: Node, shapes: Mapping[str, Node], light: str, reference_plane: str) -> Scene:
    """Scene of some shapes in a constant environment of 100 cd/m^2, the light group ``sky``."""
    geometry = {"type": "scene", "sensor": view, **shapes, "sky": {"type": "constant"}}
    groups = {"sky": LightGroup(("sky",), illuminant(light), SKY_LUMINANCE_CD_M2)}
    return Scene(name, geometry, groups, reference_plane=reference_plane)
