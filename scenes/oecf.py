"""Grey scale on a ring, such as ISO 14524 uses to measure the opto-electronic conversion function (OECF).

On the ring all patches have one distance from the picture's middle, so that a lens's falloff is the same in each. As in
the standard, the cube roots of the patches' reflectances are evenly spaced.
"""

from math import cos, pi, sin

from render.geometry import camera, look_at, translate
from render.scene import Scene
from rodcone.errors import require_range, require_whole
from scenes.materials import matte, panel, under_sky
from scenes.reflectances import grey

BRIGHTEST = 0.9  # reflectance of the first patch
GROUND = 0.18
RADIUS_M = 0.17  # radius of the ring, in a picture 0.5 m high
FILL = 0.6  # side of a patch over the distance between neighbours


def oecf(patches: int = 12, contrast: float = 100.0, light: str = "D65") -> Scene:
    """Build a ring of grey patches on grey card in a constant environment, clockwise from bright to dark.

    Parameters
    ----------
    patches : int
        Number of patches, 4 to 36; ISO 14524 uses 12, and ISO 15739 up to 20.
    contrast : float
        Reflectance of the first patch, which is 0.9, over that of the last.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    require_whole("patches", patches, 4, 36, "give their number: ISO 14524 takes 12")
    facing = look_at((0, 0, 0), (0, 0, 1))
    side_m = FILL * 2 * RADIUS_M * sin(pi / patches)
    shapes = {"card": panel(translate(0, 0, -0.0002) @ facing, 4.0, 4.0, matte(grey(GROUND)))}
    for index, reflectance in enumerate(grey_scale(patches, contrast)):
        turn = 2 * pi * index / patches
        place = translate(RADIUS_M * sin(turn), RADIUS_M * cos(turn), 0)
        shapes[f"patch{index:02d}"] = panel(place @ facing, side_m, side_m, matte(grey(reflectance)))
    view = camera(20.0, (0, 0, 1.418), (0, 0, 0))  # 0.5 m / 2 / tan(10 degrees)
    return under_sky("oecf", view, shapes, light, reference_plane="card")


def grey_scale(patches: int, contrast: float) -> list[float]:
    """Return the patches' reflectances, whose cube roots are evenly spaced."""
    require_range("contrast", contrast, 1.0, 1e6, "give the first reflectance over the last: 100")
    top, bottom = BRIGHTEST ** (1 / 3), (BRIGHTEST / contrast) ** (1 / 3)
    return [(top + (bottom - top) * index / (patches - 1)) ** 3 for index in range(patches)]
