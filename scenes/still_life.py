"""A table with fruit, metal, glass, cloth and charts under one softbox: colours, texture, light and shade."""

from math import cos, pi, sin

from render.geometry import camera, look_at, rotate, scale, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from scenes.color_checker import color_checker_nodes
from scenes.materials import ball, checks, floor, glass, glossy, matte, metal, panel, rod
from scenes.reflectances import band, edge, grey

LIGHT_LUMINANCE_CD_M2 = 1000.0
BLACK, WHITE = grey(0.04), grey(0.85)
SPOKES, BARS = 36, 33


def still_life(light: str = "D65") -> Scene:
    """Build a still life about 0.9 m wide, lit by a large softbox from the left.

    Parameters
    ----------
    light : str
        Illuminant of the softbox, the only light (group ``softbox``).
    """
    card = translate(0.14, 0.150, -0.30) @ rotate((1, 0, 0), -8)
    softbox = look_at((-1.5, 1.75, 1.35), (0.05, 0.15, -0.05))
    geometry: Node = {
        "type": "scene",
        "sensor": camera(26.0, (0.0, 0.52, 2.05), (0.0, 0.21, 0.0)),
        # table, wall and cloth
        "table": panel(floor(0, 0, 0.2), 3.0, 2.2, matte(grey(0.42))),
        "wall": panel(translate(0, 0.9, -0.55), 4.0, 2.4, matte(grey(0.38))),
        "meter_card": panel(floor(0.0, 0.001, 0.55), 0.16, 0.08, matte(grey(0.18))),
        "cloth": panel(floor(-0.28, 0.002, 0.30), 0.40, 0.34, checks(edge(590, 12, 0.10, 0.62), WHITE, 26, 22)),
        # things
        "orange": ball(-0.36, 0.062, 0.26, 0.060, glossy(edge(575, 14, 0.05, 0.72), 0.18)),
        "lime": ball(-0.23, 0.050, 0.36, 0.048, glossy(band(545, 32, 0.05, 0.52), 0.15)),
        "plum": ball(-0.20, 0.050, 0.20, 0.048, glossy(band(450, 36, 0.05, 0.34), 0.10)),
        "bowl_ball": ball(0.06, 0.075, 0.16, 0.075, metal("Au", 0.25)),
        "glass_ball": ball(-0.075, 0.048, 0.27, 0.048, glass()),
        "steel_rod": rod((0.335, 0.0, 0.02), (0.335, 0.36, 0.02), 0.018, metal("Al", 0.15)),
        "box": _box(0.30, 0.08, 0.26, 0.16, 0.16, 24, matte(band(465, 38, 0.06, 0.55))),
        "book": _box(0.29, 0.175, 0.26, 0.20, 0.03, 10, matte(edge(605, 16, 0.05, 0.55))),
        # charts
        **color_checker_nodes(card),
        "star_back": panel(translate(-0.24, 0.19, -0.32), 0.34, 0.34, matte(WHITE)),
        **_star(-0.24, 0.19, -0.318, 0.155),
        **_combs(),
        "softbox": panel(softbox, 1.7, 1.7, matte(BLACK), emitter={"type": "area"}),
    }
    groups = {"softbox": LightGroup(("softbox/emitter",), illuminant(light), LIGHT_LUMINANCE_CD_M2)}
    return Scene("still_life", geometry, groups, reference_plane="meter_card")


def _box(x: float, y: float, z: float, width: float, height: float, turn: float, bsdf: Node) -> Node:
    pose = to_world(translate(x, y, z), rotate((0, 1, 0), turn), scale(width / 2, height / 2, width / 2.6))
    return {"type": "cube", "to_world": pose, "bsdf": bsdf}


def _star(x: float, y: float, z: float, radius: float) -> dict[str, Node]:
    """Return thin black spokes, which hold every spatial frequency at once (a Siemens star)."""
    nodes: dict[str, Node] = {}
    width = 2 * radius * sin(pi / (2 * SPOKES)) * 0.9
    middle = 0.58 * radius
    for index in range(SPOKES):
        angle = 360.0 * index / SPOKES
        centre = translate(x + middle * cos(angle * pi / 180), y + middle * sin(angle * pi / 180), z)
        nodes[f"spoke{index:02d}"] = panel(centre @ rotate((0, 0, 1), angle), 0.84 * radius, width, matte(BLACK))
    return nodes


def _combs() -> dict[str, Node]:
    """Return coloured bars, ever finer, on a white strip in front, to show colour resolution."""
    colours: tuple[Spectrum, ...] = (edge(600, 12, 0.05, 0.75), band(530, 35, 0.05, 0.6), band(455, 30, 0.05, 0.6))
    nodes = {"comb_back": panel(floor(0.02, 0.001, 0.40), 0.34, 0.10, matte(WHITE))}
    x = -0.14
    for index in range(BARS):
        step = 0.0165 * 0.96**index
        nodes[f"bar{index:02d}"] = panel(floor(x, 0.002, 0.40), step / 2, 0.09, matte(colours[index % 3]))
        x += step
    return nodes
