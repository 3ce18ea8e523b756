"""Depth, normals and numbers of surfaces against closed geometry: a ball before a wall."""

import numpy as np

from render.geometry import camera, look_at, to_world, translate
from render.illuminants import illuminant
from render.scene import LightGroup, Scene
from render.surfaces import see_surfaces
from scenes.materials import ball, matte, panel
from scenes.reflectances import grey

SIZE, FOV_DEG = (24, 32), 40.0
CENTRE, RADIUS_M = np.array([0.3, 0.2, 0.0]), 0.5
RED, BLUE = matte(grey(0.2)), matte(grey(0.7))


def scene() -> Scene:
    """Ball to the right and above the middle, half a wall behind it, a card of the ball's own paint."""
    shapes = {
        "wall": panel(translate(-2.0, 0.0, -1.0), 4.0, 20.0, BLUE),
        "ball": ball(*CENTRE, RADIUS_M, RED),
        "card": panel(translate(-0.8, -0.5, 0.0), 0.4, 0.4, RED),
        "lamp": panel(look_at((0, 3, 0), (0, 0, 0.01)), 1.0, 1.0, BLUE, emitter={"type": "area"}),
    }
    view = camera(FOV_DEG, (0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
    return Scene(
        "ball", {"type": "scene", "sensor": view, **shapes}, {"lamp": LightGroup(("lamp/emitter",), illuminant("D65"))}
    )


def directions() -> np.ndarray:
    """Through the middle of each pixel: x right, y up, -z into the scene, which is where the camera looks."""
    tangent = np.tan(np.radians(FOV_DEG / 2))
    y = (1 - 2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0]) * tangent
    x = (2 * (np.arange(SIZE[1]) + 0.5) / SIZE[1] - 1) * tangent * SIZE[1] / SIZE[0]
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)


def test_depth_and_normals_of_a_ball_and_a_wall_are_those_of_geometry() -> None:
    seen, rays = see_surfaces(scene(), SIZE), directions()
    start = np.array([0.0, 0.0, 4.0])
    # |start + t d - centre| = radius
    a, b = (rays**2).sum(-1), rays @ (start - CENTRE)
    c = (start - CENTRE) @ (start - CENTRE) - RADIUS_M**2
    root = b**2 - a * c
    ball_depth = (-b - np.sqrt(np.maximum(root, 0))) / a
    rim = np.abs(root) < 0.02  # single precision decides there
    on_ball = root > 0
    assert on_ball.sum() > 20
    at = on_ball & ~rim
    np.testing.assert_allclose(seen.depth_m[at], ball_depth[at], rtol=2e-6)
    outward = (start + rays * ball_depth[..., None] - CENTRE) / RADIUS_M
    np.testing.assert_allclose(seen.normal[at], (outward * [1, -1, -1])[at], atol=2e-5)
    assert {seen.objects[number - 1] for number in seen.object_id[at]} == {"ball"}
    # the wall ends at x = 0, 5 m away; beyond it is nothing
    at_wall = (rays[..., 0] < -0.01) & ~on_ball & (seen.object_id != seen.objects.index("card") + 1)
    np.testing.assert_allclose(seen.depth_m[at_wall], 5.0, rtol=2e-6)
    np.testing.assert_allclose(seen.normal[at_wall], np.broadcast_to([0, 0, -1], seen.normal[at_wall].shape), atol=1e-6)
    nothing = (rays[..., 0] > 0.01) & ~on_ball & ~rim
    assert nothing.any()
    for plane in (seen.depth_m, seen.normal, seen.object_id, seen.material_id):
        assert not plane[nothing].any()


def test_things_of_one_paint_have_one_material() -> None:
    seen = see_surfaces(scene(), SIZE)
    numbers = {
        name: seen.material_id[seen.object_id == seen.objects.index(name) + 1] for name in ("ball", "card", "wall")
    }
    assert all(values.size for values in numbers.values())
    assert set(numbers["ball"]) == set(numbers["card"]) != set(numbers["wall"])
    assert set(seen.materials) == {"wall", "ball"}


def test_a_mirrored_camera_mirrors_the_normals() -> None:
    mirrored = scene()
    pose = np.array(mirrored.geometry["sensor"]["to_world"]) @ np.diag([-1.0, 1.0, 1.0, 1.0])
    mirrored.geometry["sensor"]["to_world"] = to_world(pose)
    plain, seen = see_surfaces(scene(), SIZE), see_surfaces(mirrored, SIZE)
    np.testing.assert_allclose(seen.normal[:, ::-1] * [-1, 1, 1], plain.normal, atol=2e-5)
