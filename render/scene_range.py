"""Checks that the data of a scene's surfaces and lights cover the bands asked for."""

import warnings
from collections.abc import Container, Iterator
from functools import reduce
from operator import getitem

import numpy as np

from render.scene import Node, Scene, emitter_paths, table_of, walk
from render.spectrum import VISIBLE_NM, Spectrum, optical_constant
from rodcone.errors import InputError
from rodcone.types import Floats

SUNSKY_NM = (320.0, 720.0)  # end of Mitsuba's sunsky (Hosek & Wilkie 2012), which evaluates to 0 beyond
CIE_NM = (360.0, 830.0)  # Mitsuba's MI_CIE_MIN and MI_CIE_MAX, beyond which the plug-ins of the next two lines are 0
_WITHIN_CIE = ("blackbody", "d65")
_EMISSION_WITHIN_CIE = (*_WITHIN_CIE, "envmap", "rgb")  # as reflectance, rgb is known at every wavelength
_SLACK_NM = 0.01  # a thousandth of a band of 10 nm, for rounded edges


def check_range(scene: Scene, shortest_nm: float, longest_nm: float) -> None:
    """Raise `InputError` if data of a surface or a sunsky end within the bands asked for.

    Mitsuba makes a surface black outside its table, and a metal a perfect mirror. Both would look like real data.
    """
    prefix = f"scene {scene.name}: bands reach {shortest_nm:g}-{longest_nm:g} nm, and"
    paths = emitter_paths(scene.geometry)
    low, high = SUNSKY_NM
    if "sunsky" in paths.values() and (shortest_nm < low or longest_nm > high):
        raise InputError(
            f"{prefix} a sunsky is known over {low:g}-{high:g} nm alone; render it first by rodcone render --bands "
            f"{VISIBLE_NM[0]:g}:{high:g}:10 and give the .exr, or light it by area, constant and directional"
        )
    for path, (low, high), extends in _surfaces(scene.geometry, paths):
        if shortest_nm < low - _SLACK_NM or longest_nm > high + _SLACK_NM:
            extend = ", or hold its end values beyond: extend='hold' or --extend hold" if extends else ""
            raise InputError(f"{prefix} {path} is known over {low:g}-{high:g} nm alone; give bands within{extend}")


def known_range(scene: Scene) -> tuple[float, float] | None:
    """Return the range that all surfaces' tables cover; None without tables, or if a table can't be continued."""
    tables = [(range_nm, extends) for _, range_nm, extends in _surfaces(scene.geometry, emitter_paths(scene.geometry))]
    if not tables or not all(extends for _, extends in tables):
        return None
    return max(low for (low, _), _ in tables), min(high for (_, high), _ in tables)


def warn_of_coloured_lights(scene: Scene, wavelength_nm: Floats, width_nm: Floats) -> None:
    """Warn (`UserWarning`) if data of a coloured light end within the bands."""
    for path in (path for group in scene.groups.values() if group.coloured for path in group.emitters):
        light: Node = reduce(getitem, path.split("/"), scene.geometry)
        for part in (light, *(inner for _, inner in walk(light))):
            within_cie = Spectrum(np.array(CIE_NM), np.ones(2)) if part.get("type") in _EMISSION_WITHIN_CIE else None
            if table := within_cie or table_of(part):
                warn_of_dark_ends(f"scene {scene.name}: light {path!r}", table, wavelength_nm, width_nm)


def warn_of_dark_ends(light: str, spectrum: Spectrum, wavelength_nm: Floats, width_nm: Floats) -> None:
    """Warn (`UserWarning`) if a light's spectrum ends within the bands at a value other than 0."""
    shortest = (wavelength_nm - width_nm / 2).min()
    longest = (wavelength_nm + width_nm / 2).max()
    low, high = spectrum.wavelength_nm[[0, -1]]
    below = shortest < low - _SLACK_NM and spectrum.values[0] > 0
    if below or (longest > high + _SLACK_NM and spectrum.values[-1] > 0):
        warnings.warn(
            f"{light} is known over {low:g}-{high:g} nm, and bands reach {shortest:g}-{longest:g} nm: "
            "outside its table it is taken as dark",
            stacklevel=4,
        )


def _surfaces(scene: Node, emitters: Container[str]) -> Iterator[tuple[str, tuple[float, float], bool]]:
    """Yield for each table of a surface: its path, the wavelengths that it covers, and whether it can be continued."""
    # A spectrum that stands in the scene itself counts only if a surface refers to it.
    pending = [(key, part) for key, part in scene.items() if isinstance(part, dict) and not _range_nm(part)]
    for path, node in pending:
        if path in emitters:
            continue
        table = _named(scene, str(node.get("id"))) if node.get("type") == "ref" else node
        if range_nm := _range_nm(table):
            yield path, range_nm, table["type"] not in _WITHIN_CIE
        pending += [(f"{path}/{key}", part) for key, part in node.items() if isinstance(part, dict)]


def _range_nm(node: Node) -> tuple[float, float] | None:
    """Return the range over which a spectrum or a metal's index is known; None if the node is no table."""
    if node.get("type") in _WITHIN_CIE:
        return CIE_NM
    table = table_of(node)
    if table is None and isinstance(node.get("material"), str):
        table = optical_constant(node["material"], "eta")
    return (float(table.wavelength_nm[0]), float(table.wavelength_nm[-1])) if table else None


def _named(scene: Node, name: str) -> Node:
    """Return the part of the scene with an id; an empty dict if there is none."""
    return next((x for key, x in scene.items() if isinstance(x, dict) and name in (key, x.get("id"))), {})
