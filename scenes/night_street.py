"""A street by night: moon, sodium lamp, LED lamp and a lit window, seven decades of luminance in one picture."""

from math import cos, pi, radians, sin

from render.geometry import camera, rotate, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from rodcone.types import Floats
from scenes.materials import block, disk, far_disk, floor, glossy, matte, panel, rod
from scenes.reflectances import band, edge, grey

# Full moon high in a clear sky: 0.25 lux on a surface that faces it (Kyba, Mohar and Posch 2017, Astronomy &
# Geophysics 58: 0.32 lux at the very most, 0.05 to 0.2 usual). Its mean angular radius is 0.259 degrees.
MOON_LUX, MOON_RADIUS_DEG, MOON_DISTANCE_M = 0.25, 0.259, 300.0
MOON_SR = 2 * pi * (1 - cos(radians(MOON_RADIUS_DEG)))
MOON_HEIGHT_DEG, MOON_BEARING_DEG = 22.0, 6.0  # bearing: from straight ahead to the right
# A flat diffuse emitter of luminance L and area A gives pi L A. 70 W of high-pressure sodium give 6000 lm (IEC 60662),
# LED heads of the same class 4000; a fifth of either stays inside the luminaire.
SODIUM_LM, LED_LM = 0.8 * 6000.0, 0.8 * 4000.0
OPENING_M = (0.40, 0.20)
WINDOW_CD_M2 = 60.0  # a room's white wall at 300 lux (EN 12464-1) and reflectance 0.6
ASPHALT, KERB = edge(560, 80, 0.06, 0.09), edge(540, 60, 0.22, 0.30)
FRAME = grey(0.60)
DARK = grey(0.03)


def night_street() -> Scene:
    """Build a street 5 m wide between house fronts, with four light groups, all of them in view.

    The groups are ``moon``, ``sodium``, ``led`` and ``window``.
    """
    left, right = rotate((0, 1, 0), 90), rotate((0, 1, 0), -90)
    line = matte(grey(0.50))
    kerb = matte(KERB)
    height, bearing = radians(MOON_HEIGHT_DEG), radians(MOON_BEARING_DEG)
    to_moon = (sin(bearing) * cos(height), sin(height), -cos(bearing) * cos(height))
    geometry: Node = {
        "type": "scene",
        "sensor": camera(58.0, (-0.5, 1.65, 9.0), (0.1, 3.3, -9.0)),
        # asphalt, pavements 1.5 m wide behind kerbs 0.12 m high, a broken white line, a garden wall at the end
        "asphalt": panel(floor(0, 0, -20), 60.0, 80.0, matte(ASPHALT)),
        **{f"pavement{i}": block(translate(x, 0, -10), 1.6, 0.12, 44.0, kerb) for i, x in enumerate((-3.3, 3.3))},
        **{f"mark{i}": panel(floor(0, 0.002, 5.0 - 4.5 * i), 0.12, 2.5, line) for i in range(6)},
        "garden_wall": block(translate(3.6, 0, -25), 5.4, 1.8, 0.3, matte(edge(592, 20, 0.08, 0.30))),
        "meter_card": panel(floor(-1.0, 0.001, -3.0), 0.6, 0.6, matte(ASPHALT)),
        # houses, lamps, a car
        **_house("left0", translate(-4, 0, -2) @ left, 8.2, edge(480, 60, 0.34, 0.52)),
        **_house("left1", translate(-4, 0, -14) @ left, 9.0, edge(560, 45, 0.18, 0.50)),
        **_house("right0", translate(4, 0, -2) @ right, 8.8, edge(592, 20, 0.08, 0.30)),
        **_house("right1", translate(4, 0, -14) @ right, 7.6, band(470, 60, 0.22, 0.36)),
        **_house("end", translate(-5, 0, -24), 6.6, edge(580, 40, 0.16, 0.40)),
        **_lamp("sodium", -2.75, -3.0, 1),
        **_lamp("led", 2.75, -11.0, -1),
        **_car(translate(1.45, 0, -1.5)),
        "moon": far_disk(to_moon, MOON_DISTANCE_M, MOON_RADIUS_DEG),
    }
    geometry["right0_pane01"] |= {"emitter": {"type": "area"}}
    opening_m2 = OPENING_M[0] * OPENING_M[1]
    groups = {
        "moon": LightGroup(("moon/emitter",), illuminant("moonlight"), MOON_LUX / MOON_SR),
        "sodium": LightGroup(("sodium_opening/emitter",), illuminant("sodium_high"), SODIUM_LM / (pi * opening_m2)),
        "led": LightGroup(("led_opening/emitter",), illuminant("LED-B3"), LED_LM / (pi * opening_m2)),
        "window": LightGroup(("right0_pane01/emitter",), illuminant("3000K"), WINDOW_CD_M2),
    }
    return Scene("night_street", geometry, groups, reference_plane="meter_card")


def _house(name: str, pose: Floats, height: float, front: Spectrum) -> dict[str, Node]:
    """Build a house front 12 m wide that faces the +z of `pose`: rows of windows, a door, an eaves board."""
    frame = matte(FRAME)
    pane = glossy(DARK, 0.08)
    nodes = {
        "body": block(pose @ translate(0, 0, -4), 12.0, height, 8.0, matte(front)),
        "plinth": block(pose @ translate(0, 0, 0.02), 12.0, 0.6, 0.04, matte(KERB)),
        "eaves": block(pose @ translate(0, height, -3.8), 12.2, 0.25, 8.4, matte(DARK)),
        "door": block(pose @ translate(4.6, 0.12, 0.02), 1.1, 2.2, 0.06, matte(edge(600, 18, 0.05, 0.22))),
    }
    for row, sill in enumerate((1.3, 4.3)):
        for column in range(4 if row else 3):
            x = -4.4 + 2.9 * column
            at = pose @ translate(x, sill, 0)
            cell = f"{row}{column}"
            nodes[f"frame{cell}"] = block(at @ translate(0, -0.08, 0.01), 1.30, 1.71, 0.06, frame)
            nodes[f"sill{cell}"] = block(at @ translate(0, -0.14, 0.06), 1.45, 0.06, 0.16, matte(KERB))
            nodes[f"pane{cell}"] = panel(at @ translate(0, 0.775, 0.045), 1.10, 1.55, pane)
            nodes[f"bar{cell}"] = block(at @ translate(0, 0, 0.05), 0.06, 1.55, 0.03, frame)
            nodes[f"rail{cell}"] = block(at @ translate(0, 1.0, 0.05), 1.10, 0.05, 0.03, frame)
    return {f"{name}_{key}": node for key, node in nodes.items()}


def _lamp(name: str, x: float, z: float, towards: int) -> dict[str, Node]:
    """Build a street lamp 6 m high on the pavement, with its arm over the street (`towards` = 1: to the right)."""
    steel = matte(grey(0.12))
    head = x + 1.1 * towards
    down = translate(head, 6.025, z) @ rotate((1, 0, 0), 90)
    return {
        f"{name}_pole": rod((x, 0.0, z), (x, 6.1, z), 0.06, steel),
        f"{name}_arm": rod((x, 6.1, z), (head, 6.1, z), 0.04, steel),
        f"{name}_head": block(translate(head, 6.03, z), 0.60, 0.12, 0.28, steel),
        f"{name}_opening": panel(down, *OPENING_M, matte(DARK), emitter={"type": "area"}),
    }


def _car(pose: Floats) -> dict[str, Node]:
    """Build a parked car 4.1 m long, seen from behind: boxes, glazing, wheels, rear lamps, number plate."""
    paint = glossy(band(460, 40, 0.03, 0.30), 0.1)
    glazing = glossy(DARK, 0.08)
    tyre = matte(DARK)
    nodes = {
        "body": block(pose @ translate(0, 0.30, 0), 1.72, 0.55, 4.10, paint),
        "cabin": block(pose @ translate(0, 0.85, 0.30), 1.46, 0.52, 2.30, glazing),
        "roof": block(pose @ translate(0, 1.37, 0.30), 1.40, 0.05, 2.05, paint),
        "bumper": block(pose @ translate(0, 0.32, 2.05), 1.66, 0.18, 0.10, tyre),
        "plate": block(pose @ translate(0, 0.58, 2.05), 0.52, 0.11, 0.02, matte(grey(0.75))),
    }
    for index, (x, z) in enumerate(((-0.80, 1.30), (0.80, 1.30), (-0.80, -1.30), (0.80, -1.30))):
        outer = pose @ translate(x + (0.07 if x > 0 else -0.07), 0.31, z)
        inner = pose @ translate(x - (0.10 if x > 0 else -0.10), 0.31, z)
        nodes[f"tyre{index}"] = rod(tuple(outer[:3, 3]), tuple(inner[:3, 3]), 0.31, tyre)
        for side, at in (("outer", outer), ("inner", inner)):
            nodes[f"{side}{index}"] = disk(at @ rotate((0, 1, 0), 90), 0.31, tyre)
        hub = outer @ translate(0.003 if x > 0 else -0.003, 0, 0) @ rotate((0, 1, 0), 90)
        nodes[f"hub{index}"] = disk(hub, 0.19, matte(FRAME))
    for index, x in enumerate((-0.72, 0.72)):
        red = matte(edge(610, 10, 0.02, 0.45))
        nodes[f"rear_lamp{index}"] = block(pose @ translate(x, 0.60, 2.05), 0.20, 0.14, 0.02, red)
    return {f"car_{key}": node for key, node in nodes.items()}
