"""Street, room or table drawn at random from a number: textures, gloss, several lamps; day, dusk or night."""

from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np

from render.geometry import camera, rotate, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from rodcone.errors import require_whole
from rodcone.types import Floats
from scenes.generated import LARGEST_SEED
from scenes.materials import ball, block, checks, disk, far_disk, floor, glossy, matte, metal, panel, printed, rod
from scenes.reflectances import color_checker_reflectances, grey

# Grey pictures in scikit-image's wheel on which no page judges. CC0: brick and gravel (CC0Textures), grass
# (linolafett), camera (L. Varshney), horse (A. Preuss); public domain: text; no known restrictions: coins (Brooklyn
# Museum). All but horse and text also trained the prior of `ple` (`studies.training.pictures`).
PICTURES_LICENCE = "scikit-image's pictures are CC0 or public domain, its coins without known restrictions"
TILES = ("brick", "grass", "gravel")
PRINTS = ("camera", "coins", "horse", "text")
LAMPS = ("A", "F2", "F11", "LED-B1", "LED-B3", "LED-B5", "LED-RGB1", "LED-V1", "sodium_high")
# Least and greatest colour temperature of daylight [K].
KELVIN = {"day": (5500, 9000), "dusk": (8000, 20000), "night": (4100, 6000)}
SKY_LUX = {"day": (6e3, 2e4), "dusk": (5, 40), "night": (0.1, 1)}
WINDOW_CD_M2 = {"day": (1500, 4000), "dusk": (20, 100)}
SUN_RADIUS_DEG, SUN_DISTANCE_M = 0.27, 400.0
SUN_SR = 2 * pi * (1 - cos(radians(SUN_RADIUS_DEG)))
Rng = np.random.Generator
Nodes = dict[str, Node]
Pair = tuple[float, float]


@dataclass(frozen=True)
class _Stage:
    """Ground on which things stand, the camera's view of it, and places for lamps.

    `cells` are the middles of the ground's cells [m], `unit_m` is the size of things in them. `window` is the pose of
    an opening for daylight, None under the open sky, and `window_m` its size.
    """

    nodes: Nodes
    view: Node
    cells: list[Pair]
    unit_m: float
    lamps: list[tuple[float, float, float]]
    panes: tuple[str, ...] = ()
    window: Floats | None = None


def diorama(seed: int = 0) -> Scene:
    """Build a random street, room or table by day, at dusk or by night.

    Its light groups are ``sun``, ``sky``, ``window``, ``lamps0`` and so on.

    Parameters
    ----------
    seed : int
        0 to 2^160 - 1, such as a commit's hash: nobody chose it.

    Raises
    ------
    InputError
        For a seed out of range.
    """
    require_whole("seed", seed, 0, LARGEST_SEED, "give a number, such as a commit's hash as int(text, 16)")
    rng = np.random.default_rng(seed)
    stage = (_street, _room, _table)[rng.integers(3)](rng)
    nodes = dict(stage.nodes)
    for index, (x, z) in enumerate(stage.cells):
        if rng.random() < 0.6:
            nodes |= {f"thing{index:02d}_{key}": node for key, node in _thing(rng, x, z, stage.unit_m).items()}
    lights, groups = _lights(rng, list(KELVIN)[rng.integers(3)], stage)
    nodes |= {key: nodes.get(key, {}) | node for key, node in lights.items()}  # a lamp, or the light of a pane
    name = f"diorama-{seed:x}" if seed else "diorama"
    return Scene(name, {"type": "scene", "sensor": stage.view, **nodes}, groups, reference_plane="meter_card")


def _street(rng: Rng) -> _Stage:
    """Build a street between house fronts with windows, poles and trees."""
    half_m = float(rng.uniform(3.5, 6.0))
    nodes = {
        "ground": panel(floor(0, 0, -40), 120.0, 120.0, _tile(rng, 25)),
        "meter_card": panel(floor(-0.8, 0.02, 1.0), 0.6, 0.6, matte(grey(0.18))),
    }
    panes = []
    for side, turn_deg in ((-1, 90), (1, -90)):
        z = 6.0
        while z > -50:
            width, height = rng.uniform(6, 12), rng.uniform(4, 11)
            pose = translate(side * half_m, 0, z - width / 2) @ rotate((0, 1, 0), turn_deg)
            house = f"house{len(nodes)}"
            nodes[house] = block(pose @ translate(0, 0, -4), width, height, 8.0, _tile(rng, width / 4))
            glass = glossy(grey(0.03), 0.08)
            for column, row in np.ndindex(3 if z > -25 else 0, int(height / 3)):
                at = pose @ translate((column - 1) * width / 3, 1.8 + 2.8 * row, 0.02)
                panes.append(f"{house}_pane{column}{row}")
                nodes[panes[-1]] = panel(at, 1.1, 1.5, glass)
            z -= width + rng.uniform(0, 3)
    panes = [str(pane) for pane in rng.choice(panes, 3, replace=False)]
    for index in range(int(rng.integers(0, 4))):
        x = rng.uniform(0.55, 0.8) * half_m * rng.choice((-1, 1))
        z = rng.uniform(-30, 1)
        nodes |= {f"tree{index}_{key}": node for key, node in _tree(rng, x, z).items()}
    if rng.random() < 0.5:  # what closes the street
        nodes["end"] = block(translate(0, 0, -56), 60.0, rng.uniform(3, 14), 4.0, _tile(rng, 8))
    lamps = [(side * (half_m - 1.2), rng.uniform(3.5, 5.5), z) for z in (-2.0, -14.0) for side in (-1, 1)]
    for index, (x, y, z) in enumerate(lamps):
        nodes[f"pole{index}"] = rod((x, 0.0, z), (x, y + 0.3, z), 0.05, matte(grey(0.12)))
    origin = (rng.uniform(-0.5, 0.5) * half_m, rng.uniform(1.3, 3.0), 9.0)
    view = camera(rng.uniform(30, 55), origin, (rng.uniform(-2, 2), rng.uniform(1.0, 3.0), -12.0))
    cells = [(x * half_m, 3.0 - 3.0 * z) for x in (-0.6, -0.3, 0.0, 0.3, 0.6) for z in range(6)]
    return _Stage(nodes, view, cells, 0.9, lamps, tuple(panes))


def _room(rng: Rng) -> _Stage:
    """Build a closed room with pictures on its walls and a window on its left."""
    width, height, depth = rng.uniform(4, 6), rng.uniform(2.4, 3.2), rng.uniform(5, 9)
    nodes = {
        "floor": panel(floor(0, 0, 0), width, depth, _surface(rng, 4)),
        "ceiling": panel(translate(0, height, 0) @ rotate((1, 0, 0), 90), width, depth, matte(grey(0.75))),
        "meter_card": panel(floor(0.0, 0.003, depth / 2 - 2.0), 0.3, 0.2, matte(grey(0.18))),
    }
    walls = {
        "back": (translate(0, height / 2, -depth / 2), width),
        "left": (translate(-width / 2, height / 2, 0) @ rotate((0, 1, 0), 90), depth),
        "right": (translate(width / 2, height / 2, 0) @ rotate((0, 1, 0), -90), depth),
        "front": (translate(0, height / 2, depth / 2) @ rotate((0, 1, 0), 180), width),
    }
    for wall, (pose, length) in walls.items():
        nodes[wall] = panel(pose, length, height, _tile(rng, 2) if rng.random() < 0.7 else matte(_paint(rng, 0.6)))
        if wall != "front":  # behind the camera
            nodes |= _leaves(rng, wall, pose @ translate(0, 0.1, 0.01), (0.42 * length, 0.35 * height), (0.3, 1.6), 10)
    window = translate(0.02 - width / 2, 0.6 * height, rng.uniform(-0.2, 0.2) * depth) @ rotate((0, 1, 0), 90)
    places = (-0.3, 0.1), (0.3, -0.1), (0.0, -0.35)
    lamps = [(x * width, height - rng.uniform(0.05, 0.8), z * depth) for x, z in places]
    fov_deg = rng.uniform(40, 60)
    origin = rng.uniform(-0.3, 0.3) * width, rng.uniform(1.2, 1.7), depth / 2 - 0.3
    view = camera(fov_deg, origin, (0.0, 0.9, -1.0))
    cells = [((x + 0.5) * width / 6 - width / 2, 0.4 + (z + 0.5) * 0.7 - depth / 2) for x in range(6) for z in range(5)]
    return _Stage(nodes, view, cells, 0.6, lamps, window=window @ translate(0, 0, 0.01))


def _table(rng: Rng) -> _Stage:
    """Build a table in front of a near or far wall with leaves, indoors or outdoors."""
    far_m = float(rng.choice((0.7, 3.0, 8.0)))
    wall = translate(0, 0.5, -far_m)
    nodes = {
        "ground": panel(floor(0, -0.75, 0), 60.0, 60.0, _tile(rng, 20)),
        "table": block(translate(0, -0.03, 0), 1.7, 0.03, 1.1, _surface(rng, 3)),
        "meter_card": panel(floor(0.0, 0.001, 0.5), 0.1, 0.06, matte(grey(0.18))),
        "wall": panel(wall, 40.0, rng.uniform(2.5, 6), _tile(rng, 12)),
    }
    sizes_m = 0.1 + 0.05 * far_m, 0.5 + 0.3 * far_m
    nodes |= _leaves(rng, "wall", wall @ translate(0, 0, 0.01), (0.9 + 0.3 * far_m, 0.5), sizes_m, 40)
    lamps = [(x, rng.uniform(0.5, 1.2), z) for x, z in ((-0.9, 0.3), (0.9, -0.2), (-0.1, 0.8))]
    view = camera(rng.uniform(18, 28), (rng.uniform(-0.5, 0.5), rng.uniform(0.35, 0.9), 2.1), (0.0, 0.15, 0.0))
    cells = [(0.16 * x - 0.56, 0.2 * z - 0.4) for x in range(8) for z in range(5)]
    window = translate(-2.0, 1.0, 0.8) @ rotate((0, 1, 0), 110)
    return _Stage(nodes, view, cells, 0.09, lamps, window=window if rng.random() < 0.5 else None)


def _lights(rng: Rng, hour: str, stage: _Stage) -> tuple[Nodes, dict[str, LightGroup]]:
    """Build the lights: sun and sky or a window, and lamps of one or two spectra."""
    nodes: Nodes = {}
    groups: dict[str, LightGroup] = {}
    area: Node = {"emitter": {"type": "area"}}
    if stage.window is None:
        nodes["sky"] = {"type": "constant"}
        lux = {name: rng.uniform(*bounds) for name, bounds in SKY_LUX.items()}[hour]
        groups["sky"] = LightGroup(("sky",), illuminant(f"D{rng.integers(*KELVIN[hour])}K"), lux / pi)
        if hour == "day" and rng.random() < 0.7:
            height, bearing = radians(rng.uniform(15, 65)), radians(rng.uniform(-130, 130))
            towards = sin(bearing) * cos(height), sin(height), cos(bearing) * cos(height)
            nodes["sun"] = far_disk(towards, SUN_DISTANCE_M, SUN_RADIUS_DEG)
            groups["sun"] = LightGroup(("sun/emitter",), illuminant("sunlight"), rng.uniform(2e4, 9e4) / SUN_SR)
    elif hour in WINDOW_CD_M2:
        size_m = rng.uniform(1.0, 1.6)
        luminance = rng.uniform(*WINDOW_CD_M2[hour])
        nodes["window"] = panel(stage.window, size_m, size_m, matte(grey(0.04)), **area)
        groups["window"] = LightGroup(("window/emitter",), illuminant(f"D{rng.integers(*KELVIN[hour])}K"), luminance)
    if hour == "day":
        return nodes, groups
    # lamps light the ground below by 10 to 100 lux; those of one spectrum are of one luminance
    spectra = rng.choice(LAMPS, int(rng.integers(1, 3)), replace=False)
    side_m = 0.5 * stage.unit_m
    for index, name in enumerate(spectra):
        emitters = []
        for number, (x, y, z) in enumerate(stage.lamps[index :: len(spectra)]):
            head = f"lamp{index}{number}"
            nodes[f"{head}_shade"] = block(translate(x, y, z), side_m, 0.2 * side_m, side_m, matte(grey(0.2)))
            pose = translate(x, y - 0.01 * side_m, z) @ rotate((1, 0, 0), 90)
            nodes[head] = panel(pose, 0.9 * side_m, 0.9 * side_m, matte(grey(0.04)), **area)
            emitters.append(f"{head}/emitter")
        luminance = rng.uniform(10, 100) * stage.lamps[index][1] ** 2 / (0.9 * side_m) ** 2
        groups[f"lamps{index}"] = LightGroup(tuple(emitters), illuminant(str(name)), luminance)
    if stage.panes:
        nodes |= dict.fromkeys(stage.panes, area)
        emitters = [f"{pane}/emitter" for pane in stage.panes]
        groups["panes"] = LightGroup(tuple(emitters), illuminant("3000K"), rng.uniform(3, 30))
    return nodes, groups


def _paint(rng: Rng, purest: float = 1.0) -> Spectrum:
    """Draw a reflectance: that of a measured patch, mixed with grey and darkened."""
    _, patch = color_checker_reflectances()[rng.integers(24)]
    share = purest * rng.uniform(0.6, 1)
    level = rng.uniform(0.03, 0.8)
    return Spectrum(patch.wavelength_nm, rng.uniform(0.5, 1) * (share * patch.values + (1 - share) * level))


def _tile(rng: Rng, repeats: float) -> Node:
    """Draw a material of brick, grass or gravel: muted stones with dark gaps between them."""
    return printed(TILES[rng.integers(3)], grey(0.02), _paint(rng, 0.9), repeats * rng.uniform(0.5, 1.5), 90.0)


def _surface(rng: Rng, repeats: float = 1.0) -> Node:
    """Draw any surface but glass."""
    kind = rng.random()
    turn_deg = float(rng.uniform(0, 180))
    if kind < 0.15:
        return printed(PRINTS[rng.integers(4)], _paint(rng) * 0.2, _paint(rng), 1.0)
    if kind < 0.3:
        return _tile(rng, repeats)
    if kind < 0.55:
        columns, rows = repeats * 10 ** rng.uniform(0.3, 1.5, 2)
        return checks(_paint(rng), _paint(rng), columns, rows if rng.random() < 0.5 else 0.3, turn_deg)
    if kind < 0.75:
        return glossy(_paint(rng), float(rng.uniform(0.06, 0.3)))
    if kind < 0.85:
        return metal(("Au", "Cu", "Al")[rng.integers(3)], float(rng.uniform(0.1, 0.3)))
    return matte(_paint(rng))


def _leaves(rng: Rng, wall: str, pose: Floats, half_m: Pair, sizes_m: Pair, count: int) -> Nodes:
    """Put pictures and sheets on a wall, with sizes by a power law, each in front of the ones drawn earlier."""
    nodes = {}
    low, high = sizes_m
    half, up = half_m
    for index in range(count):
        side_m = low * (1 - rng.random() * (1 - (low / high) ** 1.5)) ** (-1 / 1.5)
        at = pose @ translate(rng.uniform(-half, half), rng.uniform(-up, up), 0.0005 * index)
        nodes[f"{wall}_leaf{index:02d}"] = panel(at, side_m, side_m * rng.uniform(0.4, 1.4), _surface(rng))
    return nodes


def _tree(rng: Rng, x: float, z: float) -> Nodes:
    """Build a tree: a trunk and a crown of leafy balls."""
    height_m, radius_m = rng.uniform(1.5, 3), rng.uniform(0.6, 1.4)
    leaf = _tile(rng, 2)
    nodes = {"trunk": rod((x, 0.0, z), (x, height_m + radius_m, z), 0.1, matte(_paint(rng, 0.5)))}
    for index in range(16):
        away = rng.normal(size=3)
        middle = np.array([x, height_m + radius_m, z]) + radius_m * rng.uniform(0.4, 1) * away / np.linalg.norm(away)
        at_x, at_y, at_z = middle.tolist()
        nodes[f"tuft{index}"] = ball(at_x, at_y, at_z, radius_m * rng.uniform(0.25, 0.5), leaf)
    return nodes


def _thing(rng: Rng, x: float, z: float, unit_m: float) -> Nodes:
    """Put a thing on the ground: a ball, block, pillar, pole, stack or heap of many small balls."""
    kind = rng.random()
    surface = _surface(rng)
    size_m = float(unit_m * rng.uniform(0.4, 1.0))
    x, z = x + rng.uniform(-0.2, 0.2) * unit_m, z + rng.uniform(-0.2, 0.2) * unit_m
    turned = translate(x, 0.002 * unit_m, z) @ rotate((0, 1, 0), float(rng.uniform(0, 180)))
    if kind < 0.2:
        return {"ball": ball(x, size_m / 2, z, size_m / 2, surface)}
    if kind < 0.45:
        return {"block": block(turned, size_m, size_m * float(rng.uniform(0.3, 2.5)), size_m * 0.7, surface)}
    if kind < 0.6:
        top_m = size_m * float(rng.uniform(0.5, 2.5))
        pillar = rod((x, 0.0, z), (x, top_m, z), 0.3 * size_m, surface)
        return {"pillar": pillar, "lid": disk(floor(x, top_m, z), 0.3 * size_m, _surface(rng))}
    if kind < 0.75:
        lean = rng.uniform(-0.3, 0.3, 2) * size_m
        end = (x + float(lean[0]), float(size_m * rng.uniform(2, 4)), z + float(lean[1]))
        return {"pole": rod((x, 0.0, z), end, 0.03 * size_m, surface), "knob": ball(*end, 0.08 * size_m, _surface(rng))}
    if kind < 0.85:
        upper = turned @ translate(0, 0.5 * size_m, 0) @ rotate((0, 1, 0), float(rng.uniform(0, 60)))
        return {
            "lower": block(turned, size_m, 0.5 * size_m, size_m, surface),
            "upper": block(upper, 0.6 * size_m, 0.4 * size_m, 0.6 * size_m, _surface(rng)),
        }
    bits = [(rng.uniform(0.05, 0.15), *rng.uniform(-0.5, 0.5, 2).tolist()) for _ in range(12)]  # radius, place
    sized = ((size_m * r, x + dx * size_m, z + dz * size_m) for r, dx, dz in bits)
    return {f"bit{index:02d}": ball(at_x, r_m, at_z, r_m, surface) for index, (r_m, at_x, at_z) in enumerate(sized)}
