"""A scene as plain data: what `mitsuba.load_dict` takes, its light groups, and where illuminance is measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from render.errors import InputError, unknown
from render.spectrum import VISIBLE_NM, Spectrum

Node: TypeAlias = dict[str, Any]

# Emitter plug-ins whose light is one spectrum, and the parameter that holds it.
EMISSION_PARAMETER = {
    "area": "radiance",
    "constant": "radiance",
    "point": "intensity",
    "spot": "intensity",
    "directional": "irradiance",
}
# Emitter plug-ins with colours of their own, which differ over directions: a spectrum can only filter them.
OWN_COLOUR_EMITTERS = ("envmap", "sunsky")
SUNSKY_NM = (320.0, 720.0)  # Mitsuba's tables (Hosek & Wilkie 2012) end here, and give 0 beyond: found by evaluating it
_REFUSED_EMITTERS = ("projector", "directionalarea", "timed_sunsky")
_SIZELESS_EMITTERS = ("point", "spot", "directional")  # rays can't meet them


@dataclass(frozen=True)
class LightGroup:
    """Emitters that share one spectrum and are dimmed together.

    Attributes
    ----------
    emitters : tuple of str
        Where they stand in the scene's dict: ``"sun"``, or ``"panel/emitter"`` for one inside a shape.
    spectrum : Spectrum
        Emission at power 1: W m^-2 sr^-1 nm^-1 for ``area`` and ``constant``, per m^2 less for the others. With
        `own_colour` a factor on what the emitters give by themselves, `flat()` to leave it as it is.
    power : float
        Factor on the spectrum.
    own_colour : bool
        The emitters keep the emission that stands in the scene's dict: an ``envmap``, a ``sunsky``, a textured panel.
    """

    emitters: tuple[str, ...]
    spectrum: Spectrum
    power: float = 1.0
    own_colour: bool = False


@dataclass(frozen=True)
class Scene:
    """A scene without light, and its lights.

    Attributes
    ----------
    name : str
    geometry : dict
        `mitsuba.load_dict` input with a perspective ``sensor``; emitters lack their spectrum. Lengths in metres.
    groups : mapping of str to LightGroup
        All of the scene's lights, each in one group.
    reference_plane : str or None
        Key of the shape on whose front illuminance is measured.

    Raises
    ------
    InputError
        Where a light is missing, of a kind that can't be relit, or in no group; where an ``envmap`` or ``sunsky`` is in
        a group without `own_colour`; or the plane isn't in the scene.
    """

    name: str
    geometry: Node
    groups: Mapping[str, LightGroup]
    reference_plane: str | None = None

    def __post_init__(self) -> None:
        grouped = [path for group in self.groups.values() for path in group.emitters]
        present = _emitter_paths(self.geometry)
        for path in grouped:
            if path not in present:
                raise unknown(f"scene {self.name}: emitter", path, present)
        tinted = {path for group in self.groups.values() if group.own_colour for path in group.emitters}
        for path, kind in present.items():
            if kind in _REFUSED_EMITTERS:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} of type {kind!r} can't be relit; "
                    f"allowed: {', '.join((*EMISSION_PARAMETER, *OWN_COLOUR_EMITTERS))}; replace it by one of these"
                )
            if grouped.count(path) != 1:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} is in {grouped.count(path)} light groups; put it in one"
                )
            if kind in OWN_COLOUR_EMITTERS and path not in tinted:
                raise InputError(
                    f"scene {self.name}: emitter {path!r} of type {kind!r} has colours of its own; "
                    "allowed: a light group with own_colour=True, whose spectrum is a factor; set it"
                )
        if self.reference_plane is not None and self.reference_plane not in self.geometry:
            raise unknown(f"scene {self.name}: reference_plane", self.reference_plane, self.geometry)

    def is_even_sky(self, group: str) -> bool:
        """Whether a group is one light of one spectrum and of the same radiance from all around."""
        lights = self.groups[group]
        kinds = [_emitter_paths(self.geometry)[path] for path in lights.emitters]
        return kinds == ["constant"] and not lights.own_colour

    def check_range(self, shortest_nm: float, longest_nm: float) -> None:
        """Raise `InputError` where data of a light or a surface end within the wavelengths asked for.

        Tables of surfaces may end anywhere within 380-780 nm, and are black from there on; beyond, black would pass for
        knowledge that nobody has.
        """
        low, high = SUNSKY_NM
        if "sunsky" in _emitter_paths(self.geometry).values() and (shortest_nm < low or longest_nm > high):
            raise InputError(
                f"scene {self.name}: bands reach {shortest_nm:g}-{longest_nm:g} nm, and a sunsky is known over "
                f"{low:g}-{high:g} nm alone; give wavelength_nm within, or light by area, constant and directional"
            )
        tables = _tables_nm(self.geometry)
        low = max((min(start, VISIBLE_NM[0]) for start, _ in tables), default=0.0)
        high = min((max(end, VISIBLE_NM[1]) for _, end in tables), default=np.inf)
        if shortest_nm < low or longest_nm > high:
            raise InputError(
                f"scene {self.name}: bands reach {shortest_nm:g}-{longest_nm:g} nm, and its surfaces are known over "
                f"{low:g}-{high:g} nm alone; give bands within, or a scene with longer tables, such as color_checker"
            )

    def check_meter(self) -> None:
        """Raise `InputError` where Mitsuba's own irradiance meter, whose rays have to meet a light, would read 0."""
        for path, kind in _emitter_paths(self.geometry).items():
            if self.reference_plane and kind in _SIZELESS_EMITTERS:
                raise InputError(
                    f"scene {self.name}: without LLVM or CUDA light of {path!r} of type {kind!r} can't be measured; "
                    "allowed: lights with a size; leave reference_plane out, or see `rodcone doctor`"
                )

    @property
    def description(self) -> Node:
        """Plain dict for `mitsuba.load_dict`, every light at its own spectrum and power.

        Lights of their own colour stand in it as they are: Mitsuba has no place for a factor on them.
        """
        return self.lit({name: spectrum_node(group.spectrum * group.power) for name, group in self.groups.items()})

    def lit(self, emission: Mapping[str, Node]) -> Node:
        """Plain dict with the named groups at the given emission (a Mitsuba spectrum); other groups are removed."""
        result: Node = _copy(self.geometry)
        for name, group in self.groups.items():
            for path in group.emitters:
                _replace_emitter(result, path.split("/"), emission.get(name), group.own_colour)
        return result


def spectrum_node(spectrum: Spectrum) -> Node:
    """Write a spectrum for Mitsuba: the same points, linear between them.

    Evenly spaced points become ``regular``, whose look-up is far cheaper than ``irregular``'s search; and materials
    on one common grid compile to one piece of code, which keeps a scene of fifty materials from taking minutes.
    """
    if not spectrum.values.any():
        return uniform_node(0.0)  # Mitsuba refuses a table without any value above 0
    nm, values = spectrum.wavelength_nm, ",".join(map(repr, spectrum.values.tolist()))
    if np.allclose(np.diff(nm), nm[1] - nm[0], rtol=1e-9):
        return {"type": "regular", "wavelength_min": float(nm[0]), "wavelength_max": float(nm[-1]), "values": values}
    return {"type": "irregular", "wavelengths": ",".join(map(repr, nm.tolist())), "values": values}


def uniform_node(value: float) -> Node:
    """Write a spectrum of one value as Mitsuba's ``uniform`` plug-in."""
    return {"type": "uniform", "value": value}


def _tables_nm(node: Node) -> list[tuple[float, float]]:
    """First and last wavelength of each spectrum that a scene's dict holds as a table."""
    found: list[tuple[float, float]] = []
    for value in node.values():
        if not isinstance(value, dict):
            continue
        if value.get("type") == "regular":
            found.append((float(value["wavelength_min"]), float(value["wavelength_max"])))
        elif value.get("type") == "irregular":
            nm = str(value["wavelengths"]).split(",")
            found.append((float(nm[0]), float(nm[-1])))
        found += _tables_nm(value)
    return found


def _emitter_paths(node: Node, prefix: str = "") -> dict[str, str]:
    """Path and type of each emitter in a scene's dict."""
    found: dict[str, str] = {}
    for key, value in node.items():
        if not isinstance(value, dict):
            continue
        path, kind = f"{prefix}{key}", value.get("type")
        if kind in (*EMISSION_PARAMETER, *OWN_COLOUR_EMITTERS, *_REFUSED_EMITTERS):
            found[path] = str(kind)
        found |= _emitter_paths(value, f"{path}/")
    return found


def _copy(value: Any) -> Any:
    """Copy nested dicts and lists, so that a description shares none with its scene."""
    if isinstance(value, dict):
        return {key: _copy(item) for key, item in value.items()}
    return list(value) if isinstance(value, list) else value


def _replace_emitter(node: Node, path: list[str], emission: Node | None, own_colour: bool) -> None:
    """Give the emitter at `path` its emission, or remove it; one of its own colour keeps what it has."""
    *way, key = path
    for step in way:
        node = node[step]
    if emission is None:
        del node[key]
    elif not own_colour:
        node[key][EMISSION_PARAMETER[node[key]["type"]]] = emission
