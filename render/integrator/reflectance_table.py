"""Reflectance of matte surfaces at every wavelength that a pass uses, in one table for the dense path.

Looking reflectance up in Mitsuba's textures was two thirds of what a band cost. All surfaces share a few wavelengths a
pass: each band at `STEPS` offsets. A path draws one of them, and reads a row of all bands at once. Emission of a colour
of its own may hold lines, which so few wavelengths would miss or hit for all paths alike: with it there is no table.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.scene import Node, table_of, uniform_node
from render.spectrum import Spectrum
from rodcone.jit import dr
from rodcone.types import Floats

STEPS = 16  # offsets within a band: a pass's mean over them is off by under 1e-4 of the steepest reflectance here


def band_offsets(seed: int) -> Floats:
    """Offsets from a band's centre in widths, one in each of `STEPS` equal parts of the band, shape (step,).

    The offset is uniform over its part, so that averages over passes are band averages without bias. Neighbours lie
    mirrored, so that their mean is the centre's in each pass: a reflectance that rises evenly is then averaged exactly.
    """
    within = np.random.default_rng(seed).random()
    step = np.arange(STEPS)
    return (step + np.where(step % 2, 1 - within, within)) / STEPS - 0.5


def reflectance_table(curves: tuple[Spectrum, ...], wavelength_nm: Floats) -> NDArray[np.float32]:
    """Reflectance of each curve at (step, band) wavelengths, 0 outside its points, shape (curve, step, band)."""
    rows = [np.interp(wavelength_nm, x.wavelength_nm, x.values, left=0.0, right=0.0) for x in curves]
    return np.array(rows, dtype=np.float32)


class TableReader:
    """The table on the device. A plain object: Dr.Jit takes arrays apart that it finds in a loop's variables."""

    def __init__(self, mi: Any, table: NDArray[np.float32]) -> None:
        self._spectrum = mi.Spectrum
        self._groups = table.shape[2] // dr.size_v(mi.Spectrum)
        # By way of a list, into memory of Dr.Jit's own: an array of NumPy's is used where it lies, and one that happens
        # to lie on a multiple of 64 bytes is read by other code, which is compiled anew.
        self._values = mi.Float(table.ravel().tolist())

    def read(self, row: Any, step: Any, active: Any) -> list[Any]:
        """Reflectance of a path's surface at all its wavelengths, four an entry."""
        first = (row * STEPS + step) * self._groups
        return [dr.gather(self._spectrum, self._values, first + group, active) for group in range(self._groups)]


def with_rows(node: Node) -> tuple[Node, tuple[Spectrum, ...]]:
    """Copy of a scene's dict in which matte surfaces name the rows of the table; and its curves.

    A surface of one tabulated spectrum gets ``row``, a blend of two ``other_row`` as well, a checkerboard of two
    ``row``, ``other_row`` and ``which``, a texture of 0 and 1. Others, such as bitmaps of colours, stay as they are,
    and are evaluated wavelength by wavelength.
    """
    curves: dict[bytes, Spectrum] = {}
    made = _with_rows(node, curves)
    return made, tuple(curves.values())


def _with_rows(node: Node, curves: dict[bytes, Spectrum]) -> Node:
    made = {key: _with_rows(value, curves) if isinstance(value, dict) else value for key, value in node.items()}
    texture = node.get("reflectance")
    if node.get("type") != "matte" or not isinstance(texture, dict):
        return made
    if (table := table_of(texture)) is not None:
        if "other" not in node:
            return {**made, "row": _row(table, curves)}
        second = table_of(node["other"])
        return {**made, "row": _row(table, curves), "other_row": _row(second, curves)} if second else made
    if texture.get("type") == "checkerboard" and "other" not in node:
        colours = [texture.get(colour) for colour in ("color0", "color1")]
        tables = [table_of(colour) if isinstance(colour, dict) else None for colour in colours]
        if tables[0] and tables[1]:
            row, other = _row(tables[0], curves), _row(tables[1], curves)
            which = {**texture, "color0": uniform_node(0.0), "color1": uniform_node(1.0)}
            return {**made, "row": row, "other_row": other, "which": which}
    return made


def _row(table: Spectrum, curves: dict[bytes, Spectrum]) -> int:
    """Row of a spectrum; equal ones share it."""
    key = np.stack([table.wavelength_nm, table.values]).tobytes()
    curves.setdefault(key, table)
    return list(curves).index(key)
