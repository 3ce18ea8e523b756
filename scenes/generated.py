"""A scene drawn at random from a number: things, colours, textures and light for which no setting was tuned."""

from math import cos, radians, sin

import numpy as np

from render.geometry import camera, look_at, rotate, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from rodcone.errors import require_whole
from scenes.materials import ball, block, checks, disk, floor, glass, glossy, matte, metal, panel, rod, star
from scenes.reflectances import band, edge, grey

LIGHTS = ("D65", "A", "LED-B3", "FL11")
LIGHT_LUMINANCE_CD_M2 = 1000.0
LEAVES = 90  # number of leaves on the wall, which overlap
LARGEST_SEED = 2**160 - 1  # the largest SHA-1


def generated(seed: int = 0, light: str | None = None) -> Scene:
    """Build a table in front of a wall of overlapping leaves, all drawn from `seed`, lit by one softbox (``softbox``).

    Parameters
    ----------
    seed : int
        0 to 2^160 - 1, such as a commit's hash: nobody chose it.
    light : str, optional
        Illuminant of the softbox; left out, it is drawn too.

    Raises
    ------
    InputError
        For a seed out of range, or an unknown illuminant.
    """
    require_whole("seed", seed, 0, LARGEST_SEED, "give a number, such as a commit's hash as int(text, 16)")
    rng = np.random.default_rng(seed)
    nodes: dict[str, Node] = {
        "table": panel(floor(0, 0, 0.2), 3.0, 2.2, _cloth(rng)),
        "wall": panel(translate(0, 0.9, -0.55), 4.0, 2.4, matte(grey(rng.uniform(0.15, 0.6)))),
        "meter_card": panel(floor(0.0, 0.001, 0.75), 0.16, 0.08, matte(grey(0.18))),
    }

    # on the wall: leaves, each in front of those drawn earlier; their sizes follow a power law, as in nature
    for index in range(LEAVES):
        size_m = 0.02 * (1 - rng.random() * (1 - (0.02 / 0.35) ** 1.5)) ** (-1 / 1.5)
        pose = translate(rng.uniform(-0.65, 0.65), rng.uniform(0.0, 0.8), -0.5 + 0.0005 * index)
        pose = pose @ rotate((0, 0, 1), rng.uniform(0, 180))
        surface = _cloth(rng) if rng.random() < 0.3 else matte(_colour(rng))
        if rng.random() < 0.4:
            nodes[f"leaf{index:02d}"] = disk(pose, size_m / 2, surface)
        else:
            nodes[f"leaf{index:02d}"] = panel(pose, size_m, size_m * float(rng.uniform(0.3, 1)), surface)
    for index in range(2):
        pose = translate(rng.uniform(-0.4, 0.4), rng.uniform(0.15, 0.6), -0.45 + 0.01 * index)
        pose = pose @ rotate((0, 0, 1), rng.uniform(0, 180))
        spokes = int(rng.integers(10, 40))
        nodes[f"star{index}"] = star(pose, rng.uniform(0.05, 0.12), _colour(rng), _colour(rng), spokes)

    # on the table: a thing in some of the cells of a grid, so that none stands in another
    for index, (column, row) in enumerate(np.ndindex(5, 3)):
        if rng.random() < 0.25:
            continue
        x, z = -0.44 + 0.22 * column + rng.uniform(-0.03, 0.03), -0.2 + 0.24 * row + rng.uniform(-0.03, 0.03)
        nodes[f"thing{index:02d}"] = _thing(rng, x, z)

    turn = radians(rng.uniform(-70, 70))
    height_m = rng.uniform(1.2, 2.2)
    at = (1.9 * sin(turn), height_m, 1.9 * cos(turn))
    side_m = rng.uniform(0.3, 1.8)
    nodes["softbox"] = panel(look_at(at, (0.0, 0.2, 0.0)), side_m, side_m, matte(grey(0.04)), emitter={"type": "area"})
    view = camera(rng.uniform(20, 27), (rng.uniform(-0.3, 0.3), rng.uniform(0.45, 0.8), 2.05), (0.0, 0.24, 0.0))
    drawn = LIGHTS[rng.integers(len(LIGHTS))]
    groups = {"softbox": LightGroup(("softbox/emitter",), illuminant(light or drawn), LIGHT_LUMINANCE_CD_M2)}
    name = f"generated-{seed:x}" if seed else "generated"
    return Scene(name, {"type": "scene", "sensor": view, **nodes}, groups, reference_plane="meter_card")


def _colour(rng: np.random.Generator) -> Spectrum:
    """Draw a reflectance: grey, an edge or a bump, more or less saturated."""
    kind = rng.random()
    low, high = rng.uniform(0.03, 0.3), rng.uniform(0.3, 0.85)
    if kind < 0.3:
        return grey(rng.uniform(0.03, 0.9))
    if kind < 0.65:
        return edge(rng.uniform(480, 630), rng.uniform(10, 40), low, high)
    return band(rng.uniform(430, 640), rng.uniform(20, 60), low, high)


def _cloth(rng: np.random.Generator) -> Node:
    return checks(_colour(rng), _colour(rng), float(rng.uniform(3, 40)), float(rng.uniform(3, 40)))


def _thing(rng: np.random.Generator, x: float, z: float) -> Node:
    """Put a ball, block or rod of any of the materials on the table."""
    kind = rng.random()
    if kind < 0.1:
        surface = glass()
    elif kind < 0.25:
        surface = metal(("Au", "Cu", "Al")[rng.integers(3)], float(rng.uniform(0.1, 0.3)))
    elif kind < 0.6:
        surface = glossy(_colour(rng), float(rng.uniform(0.08, 0.3)))
    else:
        surface = matte(_colour(rng))
    radius_m, height_m = float(rng.uniform(0.03, 0.07)), float(rng.uniform(0.08, 0.3))
    shape = rng.random()
    if shape < 0.5 or kind < 0.1:
        return ball(x, radius_m + 0.002, z, radius_m, surface)
    if shape < 0.8:
        pose = translate(x, 0.002, z) @ rotate((0, 1, 0), float(rng.uniform(0, 90)))
        return block(pose, 2 * radius_m, height_m, 1.4 * radius_m, surface)
    return rod((x, 0.0, z), (x, height_m, z), radius_m / 2, surface)
