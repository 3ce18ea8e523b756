"""White furnace: surfaces that absorb nothing, under a sky of radiance 1, look like the sky."""

from render.geometry import look_at, rotate, scale, to_world, translate
from render.scene import LightGroup, Scene
from render.spectrum import flat
from scenes.materials import matte
from scenes.reflectances import grey


def furnace() -> Scene:
    """Build a ball and a block of reflectance 1 under a sky of 1 W m^-2 sr^-1 nm^-1: every pixel and band is 1.

    Light that is reflected to and fro between the two is cut off at the render's `max_depth`. At 8 less than 1e-6 is
    lost, because no point of one sees more than a quarter of the hemisphere filled by the other. Both are convex.
    """
    camera = {"type": "perspective", "fov": 30.0, "to_world": to_world(look_at((0, 1.2, 4.0), (0, 0, 0)))}
    white = matte(grey(1.0))
    block = to_world(translate(0.75, -0.1, 0), rotate((0, 1, 0), 30), rotate((1, 0, 0), 20), scale(0.4, 0.4, 0.4))
    geometry = {
        "type": "scene",
        "sensor": camera,
        "ball": {"type": "sphere", "center": [-0.65, 0, 0], "radius": 0.6, "bsdf": white},
        "block": {"type": "cube", "to_world": block, "bsdf": white},
        "sky": {"type": "constant"},
    }
    return Scene("furnace", geometry, {"sky": LightGroup(("sky",), flat())}, reference_plane="block")
