"""Loading: what light groups share, that sharing changes no bit, and that a kernel compiles once for all passes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import in_new_python

from render.engine import render
from render.integrator.reflectance_table import STEPS, TableReader
from render.loader import Film, load_groups, mitsuba_module
from render.scene import Scene
from rodcone.jit import dr
from scenes.catalog import load

NM = np.arange(420.0, 700.0, 40.0)


def street() -> Scene:
    return replace(load("night_street"), reference_plane=None)


def test_groups_hold_the_same_shapes_and_surfaces() -> None:
    """Four lamps' shapes apart, each in four scenes: everything else is there once."""
    film = Film((4, 4), NM, np.full(NM.size, 40.0), 8)
    scenes = [loaded.mi_scene for loaded in load_groups(street(), film)]
    shapes = [set(map(id, scene.shapes())) for scene in scenes]
    assert len(set.intersection(*shapes)) == len(shapes[0]) - 4
    surfaces = [{id(shape.bsdf()) for shape in scene.shapes()} for scene in scenes]
    assert all(own == surfaces[0] for own in surfaces)


@pytest.mark.thorough
@pytest.mark.parametrize("group", ["moon", "led"])
def test_a_group_is_the_same_picture_as_a_scene_of_it_alone(group: str) -> None:
    """To the bit for the first group, whose seed is the same; shapes, surfaces and rows of the table are its own."""
    whole = street()
    whole = replace(whole, groups={group: whole.groups[group], **whole.groups})
    others = [path for name, lights in whole.groups.items() if name != group for path in lights.emitters]
    geometry = {
        key: {name: part for name, part in node.items() if f"{key}/{name}" not in others} if key != "type" else node
        for key, node in whole.geometry.items()
    }
    alone = replace(whole, geometry=geometry, groups={group: whole.groups[group]})
    options = {"wavelength_nm": NM, "width_nm": 40.0, "spp": 8, "seed": 3}
    one, all_four = render(alone, (12, 16), **options), render(whole, (12, 16), **options)
    assert np.ptp(one.radiance) > 0
    assert np.array_equal(one.radiance[0], all_four.radiance[0])


def test_tables_anywhere_in_memory_are_read_by_one_kernel() -> None:
    """An array on a multiple of 64 bytes, used where it lies, would be read by other code."""
    mi, memory = mitsuba_module(), np.arange(4096, dtype=np.float32)
    start = -memory.ctypes.data % 64 // 4
    kernels = set()
    for first in (start, start + 1, start + 4):
        table = memory[first : first + 2 * STEPS * 8].reshape(2, STEPS, 8)
        reader = TableReader(mi, table)
        row, step = dr.opaque(mi.UInt32, 1), dr.opaque(mi.UInt32, 3)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history()
            read = reader.read(row + dr.zeros(mi.UInt32, 16), step, mi.Bool(True))
            dr.eval(read)
            kernels |= {kernel["hash"] for kernel in dr.kernel_history() if "hash" in kernel}
        assert np.array_equal(np.array(read[1])[:, 0], table[1, 3, 4:])
    assert len(kernels) == 1


GUEST = """
import numpy as np
import rodcone
import mitsuba as mi
mi.set_variant("scalar_rgb")
before = repr(mi.file_resolver())
scene = mi.load_dict(mi.cornell_box())
picture = np.array(mi.render(scene, spp=1, seed=3))
first = rodcone.render(rodcone.load("cornell_box"), (4, 4), spp=4)
assert np.allclose(np.array(mi.render(scene, spp=1, seed=3)), picture, rtol=1e-4)  # threads add in any order
again = rodcone.render(rodcone.load("cornell_box"), (4, 4), spp=4)
again.relight(illuminance_lux=5.0)  # traces the meter, late
print(mi.variant(), repr(mi.file_resolver()) == before, np.array_equal(first.radiance, again.radiance))
"""


@pytest.mark.thorough
def test_a_users_own_variant_search_path_and_scene_are_as_they_were(tmp_path: Path) -> None:
    assert in_new_python(GUEST, folder=tmp_path) == "scalar_rgb True True"
