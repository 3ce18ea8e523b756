"""Fruit, metal, glass and cloth on a garden table in front of a sunlit wall: sun and sky as two light groups."""

from math import cos, pi, radians, sin, sqrt

from render.geometry import camera, rotate, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from scenes.materials import ball, block, checks, disk, far_disk, floor, glass, glossy, matte, metal, panel, rod
from scenes.reflectances import band, edge, grey

# The sun 41.8 degrees high, where its light crosses 1.5 atmospheres. Its beam then brings 97.1 klx to a surface
# that faces it: ASTM G173-03, direct and circumsolar, weighted with V. Over its solid angle that is 1.4e9 cd/m^2.
SUN_HEIGHT_DEG, SUN_BEARING_DEG = 41.8, 62.0  # bearing: from straight behind the camera to the left
SUN_BEAM_LUX = 97_100.0
SUN_RADIUS_DEG = 0.2666  # IAU 2015 nominal solar radius at one astronomical unit
SUN_SR = 2 * pi * (1 - cos(radians(SUN_RADIUS_DEG)))
SUN_DISTANCE_M = 100.0
# Diffuse light of a clear sky on level ground [lux]: 800 + 15 500 sqrt(sin(height)), Gillette, Pierpoint and Treado
# 1984 (IES RP-21). Spread evenly here, without the bright ring about the sun. Its colour is that of ASTM G173-03's
# global light less its beam, which is 14 klx of 8300 K.
SKY_LUX = 800.0 + 15_500.0 * sqrt(sin(radians(SUN_HEIGHT_DEG)))
SKY_LIGHT = "D8300K"
APPLE = edge(605, 14, 0.05, 0.55)
LEAF = band(550, 30, 0.04, 0.30)
WOOD = (0.33, 0.27, 0.36, 0.30, 0.25, 0.34)


def still_life_outdoor() -> Scene:
    """Build a garden table about 1 m wide in late-morning sun; ``sun`` and ``sky`` are light groups in true proportion.

    The glass stands in the shade of the crate, because sunlight that glass focuses on a surface can't be sampled.
    """
    height, bearing = radians(SUN_HEIGHT_DEG), radians(SUN_BEARING_DEG)
    to_sun = (-sin(bearing) * cos(height), sin(height), cos(bearing) * cos(height))
    blue = matte(band(465, 34, 0.05, 0.42))
    slat = rotate((1, 0, 0), 35)
    geometry: Node = {
        "type": "scene",
        "sensor": camera(26.0, (0.10, 0.62, 2.05), (0.0, 0.17, 0.0)),
        # terrace, whitewashed wall and a blue shutter with slats
        "terrace": panel(floor(0, -0.74, 3.0), 30.0, 30.0, matte(edge(560, 60, 0.20, 0.34))),
        "wall": block(translate(0, -0.74, -0.62), 12.0, 3.2, 0.2, matte(edge(470, 40, 0.58, 0.72))),
        **{
            f"slat{i:02d}": block(translate(0.40, 0.03 + 0.034 * i, -0.49) @ slat, 0.30, 0.036, 0.006, blue)
            for i in range(19)
        },
        **{f"frame{i}": block(translate(x, -0.05, -0.49), 0.035, 0.80, 0.04, blue) for i, x in enumerate((0.24, 0.56))},
        # table and cloth
        **{
            f"plank{i}": block(
                translate(0, -0.03, 0.50 - 0.142 * i), 1.7, 0.03, 0.139, matte(edge(590, 45, 0.06, high))
            )
            for i, high in enumerate(WOOD)
        },
        "cloth": panel(floor(0.13, 0.002, 0.33), 0.36, 0.42, checks(edge(600, 12, 0.06, 0.60), grey(0.80), 15, 17)),
        "meter_card": panel(floor(-0.22, 0.0002, 0.50), 0.10, 0.06, matte(edge(590, 45, 0.06, WOOD[0]))),
        **_fruit(),
        **_vessels(),
        # black-backed disk of the sun's angular radius, seen from the middle of the table
        "sun": far_disk(to_sun, SUN_DISTANCE_M, SUN_RADIUS_DEG),
        "sky": {"type": "constant"},
    }
    groups = {
        "sun": LightGroup(("sun/emitter",), illuminant("sunlight"), SUN_BEAM_LUX / SUN_SR),
        "sky": LightGroup(("sky",), illuminant(SKY_LIGHT), SKY_LUX / pi),
    }
    return Scene("still_life_outdoor", geometry, groups, reference_plane="meter_card")


def _fruit() -> dict[str, Node]:
    """Place the fruit: apples in the crate, oranges and a lime on the cloth, grapes beside them."""
    orange = glossy(edge(575, 14, 0.04, 0.72), 0.2)
    grape = glossy(band(430, 40, 0.03, 0.12), 0.15)
    places = {
        "orange0": ball(0.11, 0.047, 0.28, 0.045, orange),
        "orange1": ball(0.20, 0.045, 0.34, 0.043, orange),
        "lime": ball(0.08, 0.034, 0.42, 0.032, glossy(band(548, 30, 0.04, 0.45), 0.18)),
    }
    for i, (x, z) in enumerate(((-0.36, 0.06), (-0.27, 0.09), (-0.19, 0.05), (-0.32, -0.02), (-0.23, -0.02))):
        places[f"apple{i}"] = ball(x, 0.205 + 0.006 * (i % 2), z, 0.044, glossy(APPLE, 0.15))
        places[f"stalk{i}"] = rod((x, 0.24, z), (x + 0.008, 0.268, z), 0.0022, matte(edge(590, 45, 0.05, 0.2)))
    row = ((0.0, 0.0), (0.024, 0.004), (0.047, 0.0), (0.012, 0.021), (0.035, 0.023), (0.060, 0.020), (0.024, 0.043))
    for i, (x, z) in enumerate((*row, *((x + 0.012, z + 0.009) for x, z in row[:5]))):
        places[f"grape{i:02d}"] = ball(0.215 + x, 0.013 + (0.019 if i >= len(row) else 0.0), 0.42 + z, 0.0125, grape)
    return places


def _vessels() -> dict[str, Node]:
    """Build a crate, a glass ball in its shade, a copper mug, a steel ball and a terracotta pot with a tree."""
    crate, terracotta = matte(edge(580, 40, 0.12, 0.48)), matte(edge(590, 22, 0.08, 0.38))
    copper = metal("Cu", 0.18)
    boards = {
        f"board{i}": block(translate(-0.275, 0.004 + 0.062 * i, 0.14), 0.29, 0.056, 0.012, crate) for i in range(3)
    }
    sides = {
        f"side{i}": block(translate(x, 0.004, 0.03), 0.012, 0.18, 0.21, crate) for i, x in enumerate((-0.415, -0.135))
    }
    return {
        **boards,
        **sides,
        "crate_back": block(translate(-0.275, 0.004, -0.07), 0.29, 0.18, 0.012, crate),
        "crate_floor": block(translate(-0.275, 0.004, 0.03), 0.28, 0.155, 0.20, crate),
        "glass_ball": ball(-0.075, 0.042, 0.05, 0.042, glass()),
        "mug": rod((0.02, 0.0, 0.14), (0.02, 0.10, 0.14), 0.040, copper),
        "mug_floor": disk(floor(0.02, 0.004, 0.14), 0.040, copper),
        "steel_ball": ball(0.30, 0.05, 0.22, 0.05, metal("Al", 0.25)),
        "pot": rod((0.20, 0.0, -0.10), (0.20, 0.13, -0.10), 0.075, terracotta),
        "earth": disk(floor(0.20, 0.12, -0.10), 0.075, terracotta),
        **_tree(0.20, 0.24, -0.10, 0.115),
    }


def _tree(x: float, y: float, z: float, radius: float) -> dict[str, Node]:
    """Build a clipped box tree: a ball of leafy tufts, evenly spread (golden angle)."""
    tufts = {}
    count = 90
    for i in range(count):
        up = 1 - 2 * (i + 0.5) / count
        turn = i * pi * (3 - sqrt(5))
        out = radius * (0.95 + 0.07 * (i % 3))
        across = out * sqrt(1 - up * up)
        middle = (x + across * cos(turn), y + out * up, z + across * sin(turn))
        tufts[f"tuft{i:02d}"] = ball(*middle, 0.019 + 0.002 * (i % 4), matte(LEAF))
    return tufts
