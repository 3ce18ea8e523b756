"""A scene to render: one of the catalogue by name, or a Mitsuba scene of the user's own."""

from dataclasses import replace
from pathlib import Path

from render.scene import Scene
from render.user_scene.scene_file import load_scene_file
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError
from scenes.catalog import load
from studies.study.levels import parse_level

CATALOGUE_SIDE = 256  # pixels, where neither the scene nor the user states a size


def open_scene(source: str, trust: bool = False, extend: str | None = None) -> SceneFile:
    """Scene, the size of its film and notes; `trust` and `extend` as of `load_scene_file`.

    Raises
    ------
    InputError
        For an unknown name, a scene file that isn't allowed, or trust in a scene by name.
    """
    if Path(source).suffix.lower() == ".xml":
        return load_scene_file(source, trust=trust, extend=extend)
    if trust:
        raise InputError(f"trust-scene: {source!r} is no .xml scene; leave --trust-scene out")
    return SceneFile(replace(load(source), extend=extend), (CATALOGUE_SIDE, CATALOGUE_SIDE), ())


def asked_level(scene: Scene, text: str | None) -> tuple[float | None, float | None]:
    """Level as mean luminance [cd m^-2] or as illuminance [lux]; neither for the scene's own lights.

    Raises
    ------
    InputError
        For what is no light level, or lux in a scene without a reference plane.
    """
    if text is None:
        return None, None
    value, unit = parse_level(text)
    if unit == "lux" and scene.reference_plane is None:
        raise InputError(
            f"level: {text!r} needs a reference plane, which scene {scene.name} doesn't state; give it in cd/m2, "
            "or put an irradiancemeter on a shape"
        )
    return (None, value) if unit == "lux" else (value, None)
