"""Slanted edge: the target from which ISO 12233 measures how sharp a camera is."""

from render.geometry import camera, look_at, rotate, translate
from render.scene import Scene
from rodcone.errors import require_range
from scenes.materials import matte, panel, under_sky
from scenes.reflectances import grey

BRIGHT = 0.6
SIDE_M = 2.0  # each half reaches far out of the picture, 0.5 m high


def slanted_edge(contrast: float = 4.0, angle_deg: float = 5.0, light: str = "D65") -> Scene:
    """Build a dark and a bright half that meet in an edge through the picture's middle, in a constant environment.

    Parameters
    ----------
    contrast : float
        Bright over dark reflectance; the bright one is 0.6. ISO 12233:2014 uses 4, so that sharpening doesn't clip.
    angle_deg : float
        Lean of the edge from the vertical, anticlockwise, up to 45 degrees; ISO 12233 uses 5.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    require_range("contrast", contrast, 1.0, 1e6, "give bright over dark: ISO 12233 takes 4")
    require_range("angle_deg", angle_deg, -45.0, 45.0, "give the lean from the vertical: ISO 12233 takes 5")
    facing = rotate((0, 0, 1), angle_deg) @ look_at((0, 0, 0), (0, 0, 1))
    shapes = {
        "dark": panel(facing @ translate(-SIDE_M / 2, 0, 0), SIDE_M, 2 * SIDE_M, matte(grey(BRIGHT / contrast))),
        "bright": panel(facing @ translate(SIDE_M / 2, 0, 0), SIDE_M, 2 * SIDE_M, matte(grey(BRIGHT))),
    }
    view = camera(20.0, (0, 0, 1.418), (0, 0, 0))  # 0.5 m / 2 / tan(10 degrees)
    return under_sky("slanted_edge", view, shapes, light, reference_plane="bright")
