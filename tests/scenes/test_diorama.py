"""Streets, rooms and tables drawn from a number: two hundred of them, and the ground that a street stands on."""

import numpy as np

from render.scene import walk
from render.surfaces import see_surfaces
from rodcone.digests import digest
from scenes.catalog import load

COUNT = 200


def test_two_hundred_dioramas_are_lit_and_differ():
    scenes = [load(f"diorama-{seed:x}") for seed in range(1, COUNT + 1)]
    assert len({digest(scene.geometry) for scene in scenes}) == COUNT
    kinds = [next(kind for kind in ("pole0", "ceiling", "table") if kind in scene.geometry) for scene in scenes]
    assert min(kinds.count(kind) for kind in set(kinds)) > COUNT / 6
    assert len(set(kinds)) == 3
    lights = {name for scene in scenes for name in scene.groups}
    assert lights == {"sun", "sky", "window", "lamps0", "lamps1", "panes"}
    assert all(group.power > 0 for scene in scenes for group in scene.groups.values())


def test_a_diorama_names_its_pictures_alike_on_every_machine():
    parts = (node for seed in range(9) for _, node in walk(load("diorama", seed=seed).geometry))
    files = {node["filename"] for node in parts if "filename" in node}
    assert files
    assert all(name.startswith("skimage/data/") for name in files)


def test_the_ground_of_a_street_is_a_plane_that_faces_up():
    scene = next(x for x in (load("diorama", seed=seed) for seed in range(99)) if "pole0" in x.geometry)
    rows, columns = 48, 64
    seen = see_surfaces(scene, (rows, columns))
    to_world = np.array(scene.geometry["sensor"]["to_world"], dtype=float)
    row, column = np.nonzero(seen.object_id == seen.objects.index("ground") + 1)
    assert row.size > 100
    # Mitsuba's camera has x to the left and y up; the field of view is over the shorter side.
    half = np.tan(np.radians(scene.geometry["sensor"]["fov"] / 2)) / (rows / 2)
    across, up = (columns / 2 - column - 0.5) * half, (rows / 2 - row - 0.5) * half
    places = seen.depth_m[row, column] * np.stack([across, up, np.ones(row.size)])
    heights = (to_world @ np.vstack([places, np.ones(row.size)]))[1]
    np.testing.assert_allclose(heights, 0.0, atol=1e-4 * seen.depth_m.max())
    normals = seen.normal[row, column] * [-1, -1, 1] @ to_world[:3, :3].T
    np.testing.assert_allclose(normals, [[0.0, 1.0, 0.0]] * row.size, atol=1e-5)
