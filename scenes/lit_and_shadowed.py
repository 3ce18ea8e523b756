"""A cabinet of two halves with the same things in both: the left one in the dark of night, the right one lit.

After Figure 1a of Parmar and Wandell 2009: a photograph whose left part is scotopic and whose right part is well lit.
"""

from render.geometry import camera, rotate, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from rodcone.errors import require_range
from rodcone.types import Floats
from scenes.color_checker import color_checker_nodes
from scenes.materials import ball, block, checks, disk, floor, glossy, matte, metal, panel, rod, star
from scenes.reflectances import band, edge, grey

# Below 0.005 cd/m^2 vision is scotopic, above 5 photopic (CIE 191:2010); 25 cd/m^2 is the paper's Table 1.
DARK_CD_M2, LIT_CD_M2 = 0.002, 25.0
# Mean luminance of each half of the picture over that of its lamps, rendered once with 40 bands and max_depth 8, within
# 0.2 %. The two halves differ because their lights have different colours.
NIGHT_HALF_PER_LAMP, LAMP_HALF_PER_LAMP = 0.00587, 0.00582
WIDTH_M, HEIGHT_M, DEPTH_M, BOARD_M = 0.58, 1.16, 0.45, 0.02  # inside of each half; thickness of its boards
SHELF_M = 0.50
OAK = edge(585, 45, 0.10, 0.46)
WHITE, BLACK = grey(0.80), grey(0.04)


def lit_and_shadowed(dark_cd_m2: float = DARK_CD_M2, lit_cd_m2: float = LIT_CD_M2) -> Scene:
    """Build an open cabinet 1.2 m wide; light groups ``night`` in the left half and ``lamp`` in the right one.

    No light gets from one half to the other, because nothing stands in front on which it could fall.

    Parameters
    ----------
    dark_cd_m2, lit_cd_m2 : float
        Mean luminance of the left and the right half of a square picture.
    """
    for name, value in (("dark_cd_m2", dark_cd_m2), ("lit_cd_m2", lit_cd_m2)):
        require_range(name, value, 0.0, 1e9, "give the mean luminance of that half")
    geometry: Node = {"type": "scene", "sensor": camera(26.0, (0, 0.58, 2.55), (0, 0.58, 0))}
    for side, sign in (("left", -1), ("right", 1)):
        middle = translate(sign * (WIDTH_M + BOARD_M) / 2, 0, 0)
        geometry |= {f"{side}_{key}": node for key, node in _half(middle).items()}
    groups = {
        "night": LightGroup(_lamps("left"), illuminant("moonlight"), dark_cd_m2 / NIGHT_HALF_PER_LAMP),
        "lamp": LightGroup(_lamps("right"), illuminant("LED-B3"), lit_cd_m2 / LAMP_HALF_PER_LAMP),
    }
    return Scene("lit_and_shadowed", geometry, groups, reference_plane="right_meter_card")


def _lamps(side: str) -> tuple[str, ...]:
    return tuple(f"{side}_{where}_lamp/emitter" for where in ("upper", "lower"))


def _half(middle: Floats) -> dict[str, Node]:
    """Build one half of the cabinet and what stands in it; `middle` is the middle of its bottom's front edge."""
    # carcass and shelf, and below the top and below the shelf a lamp behind a black lip
    oak = matte(OAK)
    side = (WIDTH_M + BOARD_M) / 2
    across = WIDTH_M + 2 * BOARD_M
    z = -DEPTH_M / 2
    nodes = {
        "bottom": block(middle @ translate(0, -BOARD_M, z), across, BOARD_M, DEPTH_M, oak),
        "top": block(middle @ translate(0, HEIGHT_M, z), across, BOARD_M, DEPTH_M, oak),
        "side0": block(middle @ translate(-side, 0, z), BOARD_M, HEIGHT_M, DEPTH_M, oak),
        "side1": block(middle @ translate(side, 0, z), BOARD_M, HEIGHT_M, DEPTH_M, oak),
        "back": block(middle @ translate(0, 0, -DEPTH_M), across, HEIGHT_M, BOARD_M, matte(grey(0.55))),
        "shelf": block(middle @ translate(0, SHELF_M - BOARD_M, -0.265), WIDTH_M, BOARD_M, 0.37, oak),
        "meter_card": panel(middle @ floor(0.0, 0.001, -0.05), 0.20, 0.06, oak),
    }
    for where, y, front in (("upper", HEIGHT_M, -0.006), ("lower", SHELF_M - BOARD_M, -0.086)):
        lamp = middle @ translate(0, y - 0.004, front - 0.07) @ rotate((1, 0, 0), 90)
        nodes[f"{where}_lamp"] = panel(lamp, 0.44, 0.06, matte(BLACK), emitter={"type": "area"})
        nodes[f"{where}_lip"] = block(middle @ translate(0, y - 0.05, front), WIDTH_M, 0.05, 0.012, matte(BLACK))

    # on the shelf: colour chart, star, books, a copper mug and a gilt ball
    books = (
        (0.125, 0.25, edge(605, 16, 0.05, 0.50)),
        (0.160, 0.22, band(465, 38, 0.05, 0.45)),
        (0.195, 0.27, band(545, 40, 0.05, 0.35)),
        (0.232, 0.24, edge(570, 20, 0.06, 0.60)),
    )
    on_shelf = middle @ translate(0, SHELF_M, 0)
    card = on_shelf @ translate(-0.10, 0.115, -0.36) @ rotate((1, 0, 0), -10)
    nodes |= {
        **color_checker_nodes(card),
        "star": star(middle @ translate(-0.10, 0.90, -0.4395), 0.13, BLACK, WHITE, 36),
        **{
            f"book{i}": block(on_shelf @ translate(x, 0, -0.36), 0.032, height, 0.16, matte(cover))
            for i, (x, height, cover) in enumerate(books)
        },
        **_cup(on_shelf @ translate(0.055, 0, -0.25), "mug", 0.035, 0.085, metal("Cu", 0.2)),
        "gilt_ball": _ball(on_shelf, (-0.215, 0.04, -0.25), 0.04, metal("Au", 0.2)),
    }

    # on the bottom: fruit on a checked cloth, a blue box with a steel ball, a terracotta pot
    orange = glossy(edge(575, 14, 0.05, 0.72), 0.2)
    box = matte(band(465, 38, 0.06, 0.55))
    cloth = checks(edge(600, 12, 0.06, 0.60), WHITE, 16, 15)
    return nodes | {
        "orange0": _ball(middle, (-0.19, 0.047, -0.19), 0.045, orange),
        "orange1": _ball(middle, (-0.10, 0.047, -0.22), 0.045, orange),
        "orange2": _ball(middle, (-0.145, 0.118, -0.205), 0.043, orange),
        "lime": _ball(middle, (-0.07, 0.036, -0.12), 0.034, glossy(band(548, 30, 0.04, 0.45), 0.15)),
        "plum": _ball(middle, (-0.17, 0.034, -0.10), 0.032, glossy(band(440, 36, 0.04, 0.25), 0.12)),
        "cloth": panel(middle @ floor(-0.11, 0.002, -0.18), 0.32, 0.30, cloth),
        "box": block(middle @ translate(0.14, 0.0005, -0.22) @ rotate((0, 1, 0), 22), 0.17, 0.15, 0.14, box),
        "steel_ball": _ball(middle, (0.14, 0.1955, -0.22), 0.045, metal("Al", 0.25)),
        **_cup(middle @ translate(0.03, 0, -0.36), "pot", 0.05, 0.12, matte(edge(590, 22, 0.08, 0.38))),
    }


def _ball(pose: Floats, middle: tuple[float, float, float], radius_m: float, bsdf: Node) -> Node:
    x, y, z = (pose @ (*middle, 1.0))[:3].tolist()
    return ball(x, y, z, radius_m, bsdf)


def _cup(pose: Floats, name: str, radius_m: float, height_m: float, bsdf: Node) -> dict[str, Node]:
    """Return an open cylinder that stands on the origin of `pose`, and its floor."""
    x, y, z = pose[:3, 3].tolist()
    return {
        name: rod((x, y + 0.0005, z), (x, y + height_m, z), radius_m, bsdf),
        f"{name}_floor": disk(floor(x, y + 0.003, z), radius_m, bsdf),
    }
