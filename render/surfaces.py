"""Depth, normal, object and material at the middle of each pixel, whatever the light."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.loader import load_unlit, mitsuba_module, own_mitsuba_variant
from render.scene import EMISSION_PARAMETER, Node, Scene
from rodcone.digests import digest
from rodcone.display import brief
from rodcone.jit import dr


@dataclass(frozen=True)
class Surfaces:
    """First surface on a ray through the middle of each pixel, without lens blur.

    Attributes
    ----------
    depth_m : (h, w) float32
        Distance along the camera's axis; 0 if the ray meets nothing.
    normal : (h, w, 3) float32
        Unit vector towards the camera, with x to the right, y down and z into the scene; 0 if the ray meets nothing.
    object_id, material_id : (h, w) uint16
        Number in `objects` and `materials`, counted from 1; 0 if the ray meets nothing.
    objects, materials : tuple of str
        Names of the scene's shapes; for each material, the name of the first shape that is made of it.
    """

    depth_m: NDArray[np.float32]
    normal: NDArray[np.float32]
    object_id: NDArray[np.uint16]
    material_id: NDArray[np.uint16]
    objects: tuple[str, ...]
    materials: tuple[str, ...]

    __repr__ = brief


@own_mitsuba_variant()
def see_surfaces(scene: Scene, size: tuple[int, int]) -> Surfaces:
    """Trace one ray per pixel to the first surface; glass and mirrors count as surfaces.

    Parameters
    ----------
    scene : Scene
    size : (int, int)
        Height and width in pixels.

    Raises
    ------
    InputError
        If Mitsuba can't load the scene, or there is neither LLVM nor CUDA.
    """
    mi = mitsuba_module()
    mi_scene = load_unlit(scene, size)
    sensor = mi_scene.sensors()[0]
    pixel = dr.arange(mi.UInt32, size[0] * size[1])
    row = pixel // size[1]
    middle = mi.Point2f((mi.Float(pixel - row * size[1]) + 0.5) / size[1], (mi.Float(row) + 0.5) / size[0])
    ray, _ = sensor.sample_ray(0.0, 0.5, middle, mi.Point2f(0.5))
    interaction = mi_scene.ray_intersect(ray)
    hit = interaction.is_valid()
    towards = dr.select(dr.dot(interaction.sh_frame.n, ray.d) > 0, -interaction.sh_frame.n, interaction.sh_frame.n)
    to_camera = sensor.world_transform().inverse()
    normal = to_camera @ mi.Vector3f(towards)
    place = to_camera @ mi.Point3f(interaction.p)
    # Mitsuba's camera has x to the left and y up.
    planes = [dr.select(hit, plane, 0.0) for plane in (place.z, -normal.x, -normal.y, normal.z)]
    depth, *normals = (np.array(mi.Float(plane), np.float32).reshape(size) for plane in planes)
    numbers = np.array(dr.select(hit, _number(mi, interaction.shape), 0)).reshape(size)
    instances = np.array(dr.select(hit, _number(mi, interaction.instance), 0)).reshape(size)
    names = {int(_number(mi, mi.ShapePtr(shape))[0]): shape.id() for shape in mi_scene.shapes()}
    objects = tuple(dict.fromkeys(names.values()))
    of_objects = _materials(scene, objects)
    materials = tuple(dict.fromkeys(of_objects.values()))
    object_id = np.zeros(size, np.uint16)
    for number, name in names.items():
        object_id[np.where(instances > 0, instances, numbers) == number] = objects.index(name) + 1
    table = np.array([0, *(materials.index(of_objects[name]) + 1 for name in objects)], np.uint16)
    return Surfaces(
        depth_m=depth,
        normal=np.stack(normals, axis=-1),
        object_id=object_id,
        material_id=table[object_id],
        objects=objects,
        materials=materials,
    )


def _number(mi: ModuleType, shape: Any) -> Any:
    """Return the number under which Dr.Jit knows a shape; 0 for none."""
    return dr.reinterpret_array(mi.UInt32, shape)


def _materials(scene: Scene, objects: tuple[str, ...]) -> dict[str, str]:
    """Find for each object the first object of the same material, which has equal parts except lights."""
    first = dict[str, str]()
    result = {}
    for name in objects:
        part: Node = scene.geometry.get(name, {"type": name})
        made_of = {
            key: node for key, node in part.items() if isinstance(node, dict) and node["type"] not in EMISSION_PARAMETER
        }
        result[name] = first.setdefault(digest(made_of or part), name)
    return result
