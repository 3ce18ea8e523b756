"""A scene as plain data: a dict for `mitsuba.load_dict`, light groups, and the plane where illuminance is measured."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import getitem
from typing import Any, TypeAlias

import numpy as np

from render.spectrum import Spectrum, optical_constant
from rodcone.display import brief, draw_curves, png_of
from rodcone.doors import method
from rodcone.errors import InputError, one_line, require_fields, require_keys, unknown
from rodcone.types import Floats

Node: TypeAlias = dict[str, Any]
Keys: TypeAlias = tuple[str, ...]  # keys from the scene to one of its parts

# Emitter plug-ins whose light is one spectrum, and the parameter that holds it.
EMISSION_PARAMETER = {
    "area": "radiance",
    "constant": "radiance",
    "point": "intensity",
    "spot": "intensity",
    "directional": "irradiance",
}
# Emitter plug-ins whose colour varies with direction, so that a spectrum can only filter them.
COLOURED_EMITTERS = ("envmap", "sunsky")
OWN_SIDE = 256  # side [pixels] of a scene that states no size
HELD_NM = (100.0, 20_000.0)  # range to which a table's end values are continued
_REFUSED_EMITTERS = ("projector", "directionalarea", "timed_sunsky")
# Plug-ins in a shape that aren't its surface.
_NO_SURFACES = (*EMISSION_PARAMETER, *COLOURED_EMITTERS, *_REFUSED_EMITTERS, "irradiancemeter")


@dataclass(frozen=True)
class LightGroup:
    """Emitters that share one spectrum and are dimmed together.

    Attributes
    ----------
    emitters : tuple of str
        Their keys in the scene's dict: ``"sun"``, or ``"panel/emitter"`` for one inside a shape.
    spectrum : Spectrum
        Emission at power 1. Its unit is W m^-2 sr^-1 nm^-1 for ``area`` and ``constant``, W sr^-1 nm^-1 for ``point``
        and ``spot``, and W m^-2 nm^-1 for ``directional``. With `coloured` it is a factor on the emitters' own
        emission; `flat()` leaves that unchanged.
    power : float
        Factor on the spectrum.
    coloured : bool
        Whether the emitters keep the emission that the scene's dict states, such as an ``envmap``, a ``sunsky`` or a
        textured panel.
    """

    emitters: tuple[str, ...]
    spectrum: Spectrum
    power: float = 1.0
    coloured: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)


@dataclass(frozen=True)
class Scene:
    """A scene whose lights have no spectrum yet, and its light groups, which give them one.

    Attributes
    ----------
    name : str
    geometry : dict
        Input of `mitsuba.load_dict` with a perspective ``sensor``; emitters have no spectrum. Lengths are in metres.
    groups : mapping of str to LightGroup
        The scene's lights; each belongs to one group.
    reference_plane : str or None
        Key of the shape on whose front illuminance is measured.
    extend : "hold" or None
        What surfaces do outside their tables of reflectance, transmittance or refractive index: ``"hold"`` continues
        the end values; with None, bands beyond them are refused.
    max_depth : int
        Longest path in segments, unless a render asks for another; 1 is emission alone, 2 direct light.
    rr_depth : int
        Russian roulette ends paths from this depth on; 5 as in Mitsuba's `path`.

    Raises
    ------
    InputError
        If a light is missing, of a type that can't be relit, or in no group; if an ``envmap``, ``sunsky`` or textured
        ``spot`` is in a group without `coloured`; if the plane isn't in the scene; if `extend` is something else.
    """

    name: str
    geometry: Node
    groups: Mapping[str, LightGroup]
    reference_plane: str | None = None
    extend: str | None = None
    max_depth: int = 8
    rr_depth: int = 5

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)
        grouped = [path for group in self.groups.values() for path in group.emitters]
        present = emitter_paths(self.geometry)
        require_keys(f"scene {self.name}: emitter", grouped, present)
        tinted = {path for group in self.groups.values() if group.coloured for path in group.emitters}
        for path, kind in present.items():
            if kind in _REFUSED_EMITTERS:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} of type {kind!r} can't be relit; "
                    f"allowed: {', '.join((*EMISSION_PARAMETER, *COLOURED_EMITTERS))}; replace it by one of these"
                )
            if grouped.count(path) != 1:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} is in {grouped.count(path)} light groups; put it in one"
                )
            textured = "texture" in reduce(getitem, path.split("/"), self.geometry)  # a spot may hold a slide
            if (kind in COLOURED_EMITTERS or textured) and path not in tinted:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} of type {kind!r} has colours of its own; "
                    "allowed: a light group with coloured=True, whose spectrum is a factor; set it"
                )
        if self.reference_plane is not None and self.reference_plane not in self.geometry:
            raise unknown(f"scene {self.name}: reference_plane", self.reference_plane, self.geometry)
        if self.extend not in (None, "hold"):
            raise unknown(f"scene {self.name}: extend", self.extend, ("hold",))
        object.__setattr__(self, "geometry", _with_black_lamps(self.geometry, present))
        if self.extend:
            object.__setattr__(self, "geometry", _hold(self.geometry, present))

    @property
    def size(self) -> tuple[int, int]:
        """Return height and width of the camera's film, for which the scene is composed; 256 x 256 without a film."""
        film = self.geometry["sensor"].get("film", {})
        return int(film.get("height", OWN_SIDE)), int(film.get("width", OWN_SIDE))

    def _repr_png_(self) -> bytes:
        curves = {
            name: (group.spectrum.wavelength_nm, group.power * group.spectrum.values)
            for name, group in self.groups.items()
        }
        return png_of(lambda axes: draw_curves(curves, axes, x="wavelength, nm", y="emission, per nm"))

    @property
    def description(self) -> Node:
        """Return a plain dict for `mitsuba.load_dict`, with every light at its own spectrum and power.

        Coloured emitters are unchanged, because Mitsuba has no parameter for a factor on them. Bitmaps whose ``data``
        are rows of bytes, as in `dead_leaves`, become Mitsuba's tensors by `render.loader.with_textures`.
        """
        return self.lit({name: spectrum_node(group.spectrum * group.power) for name, group in self.groups.items()})

    @method
    def lit(self, emission: Mapping[str, Node]) -> Node:
        """Return a plain dict with the named groups at given emissions (Mitsuba spectra), without the other groups."""
        result: Node = _copy(self.geometry)
        for name, group in self.groups.items():
            for path in group.emitters:
                *way, key = path.split("/")
                holder = reduce(getitem, way, result)
                if name not in emission:
                    del holder[key]
                elif not group.coloured:
                    holder[key][EMISSION_PARAMETER[holder[key]["type"]]] = emission[name]
        return result


def film_size(proportions: tuple[int, int], longest: int | None) -> tuple[int, int]:
    """Scale height and width so that the longer side is `longest`; None leaves them."""
    scale = 1.0 if longest is None else longest / max(proportions)
    return max(1, round(proportions[0] * scale)), max(1, round(proportions[1] * scale))


def spectrum_node(spectrum: Spectrum) -> Node:
    """Convert a spectrum to Mitsuba's description, with the same points and linear between them.

    Evenly spaced points become ``regular``, whose look-up is far cheaper than the search of ``irregular``. Materials on
    one common grid also share compiled code, without which a scene of fifty materials would compile for minutes.
    """
    if not spectrum.values.any():
        return uniform_node(0.0)  # Mitsuba refuses a table without any value above 0
    nm = spectrum.wavelength_nm
    values = ",".join(map(repr, spectrum.values.tolist()))
    if np.allclose(np.diff(nm), nm[1] - nm[0], rtol=1e-9):
        return {"type": "regular", "wavelength_min": float(nm[0]), "wavelength_max": float(nm[-1]), "values": values}
    return {"type": "irregular", "wavelengths": ",".join(map(repr, nm.tolist())), "values": values}


def uniform_node(value: float) -> Node:
    """Describe a spectrum of one value as Mitsuba's ``uniform`` plug-in."""
    return {"type": "uniform", "value": value}


def table_of(node: Node) -> Spectrum | None:
    """Read a spectrum that a node states point by point; return None for a node of another type.

    Raises
    ------
    InputError
        If its table is malformed.
    """
    kind = node.get("type")
    keys = node.keys() - {"type", "id"}
    try:
        if kind == "irregular" and keys == {"wavelengths", "values"}:
            return Spectrum(_numbers(node["wavelengths"]), _numbers(node["values"]))
        if kind == "regular" and keys == {"wavelength_min", "wavelength_max", "values"}:
            values = _numbers(node["values"])
            nm = np.linspace(float(node["wavelength_min"]), float(node["wavelength_max"]), values.size)
            return Spectrum(nm, values)
    except (ValueError, TypeError) as error:  # InputError is a ValueError
        raise InputError(f"{kind} spectrum: {one_line(error)}; give numbers, separated by commas") from None
    return None


def _numbers(text: object) -> Floats:
    return np.array(str(text).replace(",", " ").split(), dtype=np.float64)


def _with_black_lamps(geometry: Node, emitters: Mapping[str, str]) -> Node:
    """Copy a scene and give every area light without a surface a black one.

    Mitsuba makes a shape without a BSDF black if it emits, and otherwise grey (0.5). When another light group is
    rendered, a lamp is such a shape without its emitter, and must stay black.
    """
    result = geometry
    for path in [path for path, kind in emitters.items() if kind == "area" and "/" in path]:
        *way, _ = path.split("/")
        shape = reduce(getitem, way, result)
        if not any(map(_is_surface, shape.values())):
            result = _with_part(result, way, {**shape, "black": {"type": "diffuse", "reflectance": uniform_node(0.0)}})
    return result


def _is_surface(part: object) -> bool:
    """Return whether a part of a shape is its surface: a description, a reference, or a BSDF of Mitsuba's."""
    if isinstance(part, dict):
        return part.get("type") not in _NO_SURFACES
    return any(kind.__name__ == "BSDF" for kind in type(part).__mro__)


def _with_part(node: Node, way: Sequence[str], part: Node) -> Node:
    """Copy a node and replace the part at the end of the keys `way`."""
    if not way:
        return part
    return {**node, way[0]: _with_part(node[way[0]], way[1:], part)}


def _hold(node: Node, emitters: Mapping[str, str], prefix: str = "") -> Node:
    """Copy a node and continue all tables that don't belong to lights at their end values."""
    if (table := table_of(node)) is not None:
        return spectrum_node(_held(table))
    result: Node = {}
    for key, value in node.items():
        path = f"{prefix}{key}"
        nested = isinstance(value, dict) and path not in emitters
        result[key] = _hold(value, emitters, f"{path}/") if nested else value
    material = result.get("material")
    index = {part: optical_constant(material, part) for part in ("eta", "k")} if isinstance(material, str) else {}
    held = {part: spectrum_node(_held(table)) for part, table in index.items() if table}
    if len(held) == 2:
        del result["material"]
        result |= held
    return result


def _held(table: Spectrum) -> Spectrum:
    """Continue a table at its end values."""
    nm = table.wavelength_nm
    far = np.unique([min(HELD_NM[0], nm[0]), *nm, max(HELD_NM[1], nm[-1])])
    return Spectrum(far, np.interp(far, nm, table.values))


def walk(node: Node, path: Keys = ()) -> Iterator[tuple[Keys, Node]]:
    """Yield every part under a node with its keys from there, parents first."""
    for key, child in node.items():
        if isinstance(child, dict):
            yield (*path, key), child
            yield from walk(child, (*path, key))


def emitter_paths(node: Node) -> dict[str, str]:
    """Return the type of each emitter in a scene's dict by its keys, joined by slashes."""
    kinds = (*EMISSION_PARAMETER, *COLOURED_EMITTERS, *_REFUSED_EMITTERS)
    return {"/".join(path): part["type"] for path, part in walk(node) if part.get("type") in kinds}


def _copy(value: object) -> Any:
    """Copy nested dicts and lists, so that a description shares none of them with its scene."""
    if isinstance(value, dict):
        return {key: _copy(item) for key, item in value.items()}
    return list(value) if isinstance(value, list) else value
