"""The lights of a user's scene: their groups, and the spectrum of each as Mitsuba evaluates it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from render.loader import mitsuba_words
from render.scene import EMISSION_PARAMETER, Keys, LightGroup, Node, table_of, walk
from render.spectrum import Spectrum, flat
from render.user_scene.allowed_plugins import ALLOWED, SPECTRA
from rodcone.errors import InputError
from rodcone.jit import dr
from rodcone.types import Floats

# MI_CIE_MIN to MI_CIE_MAX, outside of which Mitsuba's own spectra (rgb, d65, blackbody) are zero, and one point more,
# which makes 472, by fours.
_GRID_NM: Floats = np.arange(360.0, 832.0)


def type_of(part: Any) -> str:
    """Plug-in that a value in a scene's dict names; empty where it is a plain value."""
    return str(part["type"]) if isinstance(part, dict) else ""


def attach_area_lights(name: str, geometry: Node) -> None:
    """Move area lights that stand in the scene into the shape that refers to them, as Mitsuba does itself.

    Raises
    ------
    InputError
        For one that no shape or several refer to.
    """
    for key in [key for key, part in geometry.items() if type_of(part) == "area"]:
        light: Node = {"id": key, **geometry.pop(key)}
        held = [
            (shape, key_in_shape)
            for shape in geometry.values()
            if isinstance(shape, dict)
            for key_in_shape, part in shape.items()
            if type_of(part) == "ref" and part.get("id") in (key, light["id"])
        ]
        if len(held) != 1:
            raise InputError(
                f"scene {name}: area light {key!r} is on {len(held)} shapes; allowed: one; give each its own"
            )
        shape, key_in_shape = held[0]
        shape[key_in_shape] = light


def light_groups(mi: Any, name: str, geometry: Node, parts: Mapping[str, Node]) -> dict[str, LightGroup]:
    """Light groups of a scene, by the lights' ids.

    Parameters
    ----------
    mi : module
        Mitsuba, with its variant set.
    name : str
    geometry : dict
        The spectra that relighting replaces are taken out of it.
    parts : mapping of str to dict
        What references point to.

    Raises
    ------
    InputError
        For a spectrum that Mitsuba refuses.
    """
    members: dict[str, list[tuple[Keys, Node]]] = {}
    for path, node in walk(geometry):
        if node["type"] in ALLOWED["emitter"]:
            light_id = str(node.get("id") or geometry[path[0]].get("id") or path[0])
            members.setdefault(light_id.split(":", maxsplit=1)[0] or light_id, []).append((path, node))
    groups = {}
    for group, lights in members.items():
        spectra = [_emission(mi, f"scene {name}: {'/'.join(path)}", node, parts) for path, node in lights]
        common = spectra[0] if all(_same(spectra[0], spectrum) for spectrum in spectra) else None
        if common is not None:
            for _, node in lights:
                node.pop(EMISSION_PARAMETER[node["type"]], None)
        emitters = tuple("/".join(path) for path, _ in lights)
        groups[group] = LightGroup(emitters, flat() if common is None else common, coloured=common is None)
    return groups


def _same(a: Spectrum | None, b: Spectrum | None) -> bool:
    if a is None or b is None:
        return False
    return np.array_equal(a.wavelength_nm, b.wavelength_nm) and np.array_equal(a.values, b.values)


def _emission(mi: Any, where: str, emitter: Node, parts: Mapping[str, Node]) -> Spectrum | None:
    """Spectrum of an emitter, as Mitsuba evaluates it; None where its colour varies over position or direction."""
    if emitter["type"] not in EMISSION_PARAMETER or "texture" in emitter:  # a spot may hold a slide
        return None
    value: Any = emitter.get(EMISSION_PARAMETER[emitter["type"]])
    while type_of(value) == "ref":
        value = parts[value["id"]]
    inner = [node["type"] for _, node in walk({"": value} if isinstance(value, dict) else {})]
    if any(kind not in (*SPECTRA, "rgb") for kind in inner):
        return None
    try:  # the `constant` emitter: its emission depends on wavelength alone
        probe = mi.load_dict({"type": "constant"} | ({} if value is None else {"radiance": value}))
    except RuntimeError as error:
        raise InputError(f"{where}: {mitsuba_words(error)}; correct its spectrum") from None
    return _stated(value) or Spectrum(_GRID_NM[:-1], np.maximum(_evaluate(mi, probe)[:-1], 0.0))


def _stated(value: Any) -> Spectrum | None:
    """Spectrum given by its own points, taken as it is: a line may lie between the points of any grid."""
    if type_of(value) == "uniform" and set(value) - {"type", "id"} == {"value"}:
        return flat(float(value["value"]))
    return table_of(value) if isinstance(value, dict) else None


def _evaluate(mi: Any, emitter: Any) -> Floats:
    """Emission on `_GRID_NM`, four wavelengths to an evaluation; all at once where the variant holds arrays."""
    fours = _GRID_NM.reshape(-1, 4)
    interaction = dr.zeros(mi.SurfaceInteraction3f, len(fours))
    interaction.wavelengths = mi.Spectrum(*(mi.Float(column) for column in fours.T))
    return np.array(emitter.eval(interaction), dtype=np.float64).T.ravel()
