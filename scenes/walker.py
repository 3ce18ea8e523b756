"""A scene that moves: somebody crosses the street of `scenes.night_street` by night."""

from dataclasses import replace
from math import cos, pi, radians, sin

from render.scene import Node, Scene
from rodcone.errors import require_range
from scenes.materials import ball, glossy, matte, rod
from scenes.night_street import night_street
from scenes.reflectances import band, edge, grey

SPEED_M_S = 1.4  # comfortable pace of adults (Bohannon 1997, Age and Ageing 26: 1.27 to 1.46 m/s)
STRIDE_M = 1.4  # length of two steps
_SWING_DEG = 25.0  # angle by which a leg swings forwards and backwards
_START_M, _DEPTH_M = -1.5, -3.8  # place of the walker at time 0: across the street, and along it towards the camera
_HIP_M, _SHOULDER_M, _HEAD_M = 0.90, 1.42, 1.64


def walker(time_s: float = 0.0) -> Scene:
    """Build the street of `night_street` with somebody in a red coat who walks across it to the right.

    Parameters
    ----------
    time_s : float
        Time since the walker was at the start, 1.5 m left of the middle of the street.

    Raises
    ------
    InputError
        For a time more than a minute before or after that.
    """
    require_range("time_s", time_s, -60.0, 60.0, "give seconds of the walk")
    street = night_street()
    return replace(street, name="walker", geometry={**street.geometry, **_figure(time_s)})


def _figure(time_s: float) -> dict[str, Node]:
    """Build the walker: legs and arms that swing once per stride, a coat, a pale scarf, a head with a cap."""
    x = _START_M + SPEED_M_S * time_s
    phase = 2 * pi * SPEED_M_S * time_s / STRIDE_M
    swing = radians(_SWING_DEG) * sin(phase)
    trousers, skin = matte(grey(0.05)), matte(edge(590, 60, 0.20, 0.55))
    coat = matte(edge(600, 15, 0.04, 0.45))
    nodes = {
        "coat": rod((x, 0.75, _DEPTH_M), (x, _SHOULDER_M, _DEPTH_M), 0.19, coat),
        "shoulders": ball(x, _SHOULDER_M, _DEPTH_M, 0.19, coat),
        "scarf": rod((x, 1.46, _DEPTH_M), (x, 1.54, _DEPTH_M), 0.10, matte(grey(0.70))),
        "head": ball(x, _HEAD_M, _DEPTH_M, 0.11, skin),
        "cap": rod(
            (x, _HEAD_M + 0.03, _DEPTH_M), (x, _HEAD_M + 0.13, _DEPTH_M), 0.115, matte(band(470, 50, 0.04, 0.3))
        ),
    }
    for name, turn, z in (("near", swing, _DEPTH_M + 0.10), ("far", -swing, _DEPTH_M - 0.10)):
        foot = (x + _HIP_M * sin(turn), _HIP_M * (1 - cos(turn)) + 0.05, z)
        nodes[f"{name}_leg"] = rod(foot, (x, _HIP_M, z), 0.075, trousers)
        nodes[f"{name}_shoe"] = ball(foot[0] + 0.06, foot[1] + 0.03, z, 0.07, glossy(grey(0.03), 0.1))
        hand = (x - 0.6 * sin(turn), _SHOULDER_M - 0.6 * cos(turn), z + (0.14 if z > _DEPTH_M else -0.14))
        nodes[f"{name}_arm"] = rod((x, _SHOULDER_M, hand[2]), hand, 0.055, coat)
        nodes[f"{name}_hand"] = ball(*hand, 0.06, skin)
    return {f"walker_{key}": node for key, node in nodes.items()}
