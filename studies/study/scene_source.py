"""A scene to render: one of the catalogue by name, or a Mitsuba scene of the user's own."""

from dataclasses import replace
from pathlib import Path

from render.radiance_files.radiance_source import ENDINGS
from render.scene import Scene
from render.user_scene.scene_file import load_scene_file
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError, require_absent, require_whole
from scenes.catalog import load
from studies.study.levels import parse_level

_OTHER_FILES = {
    **dict.fromkeys((".dng", ".tif", ".tiff", ".nef", ".cr2", ".cr3", ".arw"), "a raw file, for rodcone develop"),
    **dict.fromkeys(ENDINGS, "a picture, for rodcone capture or a study"),
    ".toml": "a study or a sensor, for rodcone sweep or --sensor",
}


def open_scene(
    source: str, trust: bool = False, extend: str | None = None, light: str | None = None, chart: str | None = None
) -> SceneFile:
    """Scene, the size of its film and notes.

    Parameters
    ----------
    source : str
        Name in the catalogue, or a Mitsuba scene (``.xml``).
    trust, extend
        As of `load_scene_file`.
    light, chart : str, optional
        Options of a catalogue scene's builder: its light, and a CSV file of reflectances for color_checker's patches.

    Raises
    ------
    InputError
        For an unknown name, a scene file that isn't allowed, `trust` for a catalogue scene, or `light` or `chart` for a
        file.
    """
    if Path(source).suffix.lower() == ".xml":
        require_absent(f"for {source}, a file that has its own", light=light, chart=chart)
        return load_scene_file(source, trust=trust, extend=extend)
    require_absent(f"for {source!r}; allowed: with an .xml scene", trust_scene=trust)
    if suffix := Path(source).suffix.lower():
        what = _OTHER_FILES.get(suffix, f"no file that is a scene ({suffix})")
        read = (".xml",) if suffix in ENDINGS else (".xml", *ENDINGS)
        raise InputError(f"scene: {source!r} is {what}; allowed: {', '.join(read)}, or a name of rodcone list scenes")
    options = {name: value for name, value in (("light", light), ("chart", chart)) if value is not None}
    scene = load(source, **options)
    return SceneFile(replace(scene, extend=extend), scene.size, ())


def asked_size(size: tuple[int, int], height: int | None, width: int | None) -> tuple[int, int]:
    """Height and width that were asked for; the one that wasn't keeps the proportions of `own`."""
    for name, pixels in (("height", height), ("width", width)):
        if pixels is not None:
            require_whole(name, pixels, 1, 1 << 15, "give pixels")
    if height is not None:
        return height, width if width is not None else max(1, round(height * size[1] / size[0]))
    return (max(1, round(width * size[0] / size[1])), width) if width is not None else size


def asked_level(scene: Scene, text: str | None) -> dict[str, float]:
    """Level as `render.transport.Transport.relight` takes it: luminance_cd_m2, illuminance_lux, or the lights' own.

    Raises
    ------
    InputError
        For what is no light level, or lux in a scene without a reference plane.
    """
    if text is None:
        return {}
    value, unit = parse_level(text)
    if unit == "lux" and scene.reference_plane is None:
        raise InputError(
            f"level: {text!r} needs a reference plane, which scene {scene.name} doesn't state; give it in cd/m2, "
            "or put an irradiancemeter on a shape"
        )
    return {"illuminance_lux" if unit == "lux" else "luminance_cd_m2": value}
