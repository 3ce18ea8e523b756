"""Siemens star: spokes that narrow towards the middle and so show every spatial frequency in every direction."""

from render.geometry import camera, look_at, translate
from render.scene import Scene
from rodcone.errors import require_whole
from scenes.materials import matte, panel, star, under_sky
from scenes.reflectances import grey

RADIUS_M = 0.2
BLACK, WHITE = grey(0.04), grey(0.85)


def siemens_star(spokes: int = 72, light: str = "D65") -> Scene:
    """Build a star of black spokes on a white card, in a constant environment.

    On a circle of radius r it has `spokes` / (2 pi r) line pairs per metre.

    Parameters
    ----------
    spokes : int
        Black spokes, with as many white ones between them; 2 to 720.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    require_whole("spokes", spokes, 2, 720, "give the number of black spokes")
    facing = look_at((0, 0, 0), (0, 0, 1))
    shapes = {
        "card": panel(translate(0, 0, -0.0002) @ facing, 4.0, 4.0, matte(WHITE)),
        "star": star(facing, RADIUS_M, BLACK, WHITE, spokes),
    }
    view = camera(20.0, (0, 0, 1.25), (0, 0, 0))  # 0.44 m high
    return under_sky("siemens_star", view, shapes, light, reference_plane="card")
