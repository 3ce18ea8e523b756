"""Siemens star: spokes that narrow towards the middle, every spatial frequency in every direction."""

from render.geometry import look_at, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Scene
from rodcone.errors import require_whole
from scenes.materials import matte, panel, star
from scenes.reflectances import grey

SKY_LUMINANCE_CD_M2 = 100.0
RADIUS_M = 0.2
BLACK, WHITE = grey(0.04), grey(0.85)


def siemens_star(spokes: int = 72, light: str = "D65") -> Scene:
    """Star of black spokes on a white card, under an even sky.

    On a circle of radius r it has `spokes` / (2 pi r) line pairs per metre.

    Parameters
    ----------
    spokes : int
        Black spokes, with as many white ones between them; 2 to 720.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    require_whole("spokes", spokes, 2, 720, "give the number of black spokes")
    camera = {
        "type": "perspective",
        "fov": 20.0,
        "fov_axis": "smaller",
        "to_world": to_world(look_at((0, 0, 1.25), (0, 0, 0))),  # 0.44 m high
    }
    facing = look_at((0, 0, 0), (0, 0, 1))
    geometry = {
        "type": "scene",
        "sensor": camera,
        "card": panel(translate(0, 0, -0.0002) @ facing, 4.0, 4.0, matte(WHITE)),
        "star": star(facing, RADIUS_M, BLACK, WHITE, spokes),
        "sky": {"type": "constant"},
    }
    groups = {"sky": LightGroup(("sky",), illuminant(light), SKY_LUMINANCE_CD_M2)}
    return Scene("siemens_star", geometry, groups, reference_plane="card")
