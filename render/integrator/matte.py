"""A Lambertian surface for the dense path, whose reflectance is looked up once for value, density and sample.

Most of a band's cost is looking up reflectance. Mitsuba's ``twosided`` evaluates front and back, and each of them looks
reflectance up twice, for the light's direction and for the sampled one: eight look-ups per wavelength, where two would
do. If one table holds the reflectances of all surfaces, none is needed. The table holds each band at `STEPS` offsets
from its centre. A path draws one of these offsets and reads a row of all bands at once. Coloured emission may contain
lines, which so few wavelengths would miss or hit for all paths alike; with such emission there is no table.
"""

from collections.abc import Callable
from types import ModuleType
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from render.integrator.variant_types import (
    Bsdf,
    BsdfContext,
    BsdfSample,
    Float,
    Interaction,
    Mask,
    Point2,
    Properties,
    Spectra,
    Spectrum4,
    UInt,
    Vector,
)
from render.scene import Node, table_of, uniform_node
from render.spectrum import Spectrum, at_wavelengths
from rodcone.jit import dr
from rodcone.types import Floats

T = TypeVar("T")
STEPS = 16  # offsets within a band; their mean errs by less than 1e-4 for the steepest reflectance of these scenes


def band_offsets(seed: int) -> Floats:
    """Draw offsets from a band's centre in units of its width, one in each of `STEPS` equal parts, shape (step,).

    Each offset is uniform over its part, so that averages over seeds are unbiased band averages. The offsets in
    neighbouring parts mirror each other, so that a reflectance that rises evenly is averaged exactly by any seed.
    """
    within = np.random.default_rng(seed).random()
    step = np.arange(STEPS)
    return (step + np.where(step % 2, 1 - within, within)) / STEPS - 0.5


def reflectance_table(curves: tuple[Spectrum, ...], wavelength_nm: Floats) -> NDArray[np.float32]:
    """Tabulate each curve at (step, band) wavelengths, 0 outside its points, shape (curve, step, band)."""
    return at_wavelengths(curves, wavelength_nm).astype(np.float32)


class TableReader:
    """The table in the device's memory. It is no dataclass, whose arrays Dr.Jit would treat as variables of a loop."""

    def __init__(self, mi: ModuleType, table: NDArray[np.float32]) -> None:
        self._spectrum = mi.Spectrum
        self._groups = table.shape[2] // dr.size_v(mi.Spectrum)
        # A list is copied into Dr.Jit's own memory. A NumPy array would be used in place, and if it happens to lie on a
        # multiple of 64 bytes, other code reads it, which is compiled again.
        self._values = mi.Float(table.ravel().tolist())

    def read(self, row: UInt, step: UInt, active: Mask) -> Spectra:
        """Read the reflectances of a path's surface at all its wavelengths, four per entry."""
        first = (row * STEPS + step) * self._groups
        return [dr.gather(self._spectrum, self._values, first + group, active) for group in range(self._groups)]


Table: TypeAlias = TableReader | None  # None if no surface of the scene is in a table


def matte_surface(mi: ModuleType) -> type[Bsdf]:
    """Build the BSDF class for the variant that is set; register it as ``matte``.

    Properties of the plug-in are ``reflectance`` (a texture) and ``twosided``. If the reflectance is in the table,
    ``row`` is its row. A checkerboard also has ``other_row`` and ``which``, a texture that is 1 where the other row
    applies. A blend of two has the second reflectance as ``other``, and the texture of its share as ``weight``.
    """

    class Matte(mi.BSDF):  # type: ignore[name-defined, misc]
        def __init__(self, props: Properties) -> None:
            super().__init__(props)
            self.reflectance = props.get_texture("reflectance")
            self.other, self.weight = (props.get_texture(x) if x in props else None for x in ("other", "weight"))
            self.twosided = bool(props.get("twosided", False))
            # Opaque numbers are data of the surface. Literal numbers would compile the code again for each surface.
            self.row = dr.opaque(mi.UInt32, int(props["row"])) if "row" in props else None
            self.other_row = dr.opaque(mi.UInt32, int(props["other_row"])) if "other_row" in props else None
            self.which = props.get("which", None)
            sides = mi.BSDFFlags.FrontSide | (mi.BSDFFlags.BackSide if self.twosided else mi.BSDFFlags.Empty)
            self.m_components = [mi.BSDFFlags.DiffuseReflection | sides]
            self.m_flags = self.m_components[0]

        # What the dense path calls

        def scatter_bands(
            self, si: Interaction, wo: Vector, angle: Point2, wavelengths: Spectra, table: Table, step: UInt
        ) -> tuple[Spectra, Float, BsdfSample, Spectra]:
            """Evaluate value and density towards a light, and sample a direction and its weights."""
            density = _density(si.wi, wo, self.twosided)
            sample, weights = self.sample_bands(si, angle, wavelengths, table, step)
            return [weight * density for weight in weights], density, sample, weights

        def sample_bands(
            self, si: Interaction, angle: Point2, wavelengths: Spectra, table: Table, step: UInt
        ) -> tuple[BsdfSample, Spectra]:
            """Give a sampled direction and its weights, which are the reflectance."""
            sample = _sampled(mi, si.wi, angle, self.twosided)
            if self.row is not None and table is not None:
                return sample, _weights_at(self, si, table, step, sample.pdf > 0)
            return sample, at_all(wavelengths, si, lambda: _reflectance_at(self, si) & (sample.pdf > 0))

        # What Mitsuba calls

        def sample(
            self, ctx: BsdfContext, si: Interaction, sample1: Float, sample2: Point2, active: Mask = True
        ) -> tuple[BsdfSample, Spectrum4]:
            sample = _sampled(mi, si.wi, sample2, self.twosided)
            return sample, _reflectance_at(self, si, active) & (active & (sample.pdf > 0))

        def eval(self, ctx: BsdfContext, si: Interaction, wo: Vector, active: Mask = True) -> Spectrum4:
            return _reflectance_at(self, si, active) * _density(si.wi, wo, self.twosided)

        def pdf(self, ctx: BsdfContext, si: Interaction, wo: Vector, active: Mask = True) -> Float:
            return _density(si.wi, wo, self.twosided)

    return Matte


def at_all(wavelengths: Spectra, interaction: Interaction, evaluate: Callable[[], T]) -> list[T]:
    """Evaluate a function of an interaction at all wavelengths, four at a time."""
    values = []
    for group in wavelengths:
        interaction.wavelengths = group
        values.append(evaluate())
    return values


def _row_at(surface: Bsdf, si: Interaction) -> UInt:
    """Return the row of the reflectance at a point; a checkerboard has two."""
    if surface.which is None:
        return surface.row
    return dr.select(surface.which.eval(si)[0] > 0.5, surface.other_row, surface.row)


def _weights_at(surface: Bsdf, si: Interaction, table: TableReader, step: UInt, active: Mask) -> Spectra:
    """Read the reflectance at a point from the table, for all wavelengths of a path."""
    ones = table.read(_row_at(surface, si), step, active)
    if surface.weight is None:
        return ones
    share = _share_at(surface, si)
    others = table.read(surface.other_row, step, active)
    return [dr.lerp(one, other, share) for one, other in zip(ones, others, strict=True)]


def _reflectance_at(surface: Bsdf, si: Interaction, active: Mask = True) -> Spectrum4:
    """Evaluate the reflectance at a point by its textures, at the four wavelengths of the interaction."""
    one = surface.reflectance.eval(si, active)
    if surface.weight is None:
        return one
    return dr.lerp(one, surface.other.eval(si, active), _share_at(surface, si))


def _share_at(surface: Bsdf, si: Interaction) -> Float:
    """Return the share of the second reflectance of a blend, 0 to 1."""
    return dr.clip(surface.weight.eval_1(si), 0, 1)


def _density(wi: Vector, wo: Vector, twosided: bool) -> Float:
    """Compute cosine over pi, which is BRDF times cosine for a reflectance of 1.

    It is 0 unless both directions are on the same side, and that side reflects.
    """
    lit = wi.z * wo.z > 0 if twosided else (wi.z > 0) & (wo.z > 0)
    return dr.select(lit, dr.abs(wo.z) * dr.inv_pi, 0.0)


def _sampled(mi: ModuleType, wi: Vector, angle: Point2, twosided: bool) -> BsdfSample:
    sample = dr.zeros(mi.BSDFSample3f)
    sample.wo = mi.warp.square_to_cosine_hemisphere(angle)
    if twosided:
        sample.wo.z = dr.select(wi.z < 0, -sample.wo.z, sample.wo.z)
    sample.pdf = _density(wi, sample.wo, twosided)
    sample.eta = 1.0
    sample.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
    return sample


def with_matte_surfaces(node: Node) -> Node:
    """Return a copy of a scene's dict in which (twosided) Lambertian surfaces and bitmaps' blends are ``matte``."""
    return {key: _as_matte(value) if isinstance(value, dict) else value for key, value in node.items()}


def _as_matte(node: Node) -> Node:
    """Convert the node of one surface to ``matte`` if it can be; else convert the surfaces within it."""
    if node.get("type") == "diffuse" and isinstance(node.get("reflectance"), dict):
        return {**node, "type": "matte"}
    inner = [key for key, value in node.items() if isinstance(value, dict)]
    weight = node.get("weight")
    if node.get("type") == "blendbsdf" and isinstance(weight, dict) and weight.get("type") == "bitmap":
        parts = [_as_matte(node[key]) for key in inner if key != "weight"]
        plain = all(part["type"] == "matte" and part.keys() == {"type", "reflectance"} for part in parts)
        if plain and len(parts) == 2 and node.keys() == {"type", *inner}:
            return {**parts[0], "other": parts[1]["reflectance"], "weight": weight}
    if node.get("type") == "twosided" and len(inner) == 1:
        surface = _as_matte(node[inner[0]])
        if surface["type"] == "matte":
            properties = {key: value for key, value in node.items() if key not in ("type", inner[0])}
            return {**surface, **properties, "twosided": True}
    return with_matte_surfaces(node)


def with_rows(node: Node) -> tuple[Node, tuple[Spectrum, ...]]:
    """Return a copy of a scene's dict in which matte surfaces name rows of a table, and the table's curves.

    A surface of one tabulated spectrum gets ``row``, a blend of two ``other_row`` as well, a checkerboard of two
    ``row``, ``other_row`` and ``which``, a texture of 0 and 1. Others, such as bitmaps of colours, stay as they are,
    and are evaluated wavelength by wavelength.
    """
    curves: dict[bytes, Spectrum] = {}
    made = _with_rows(node, curves)
    return made, tuple(curves.values())


def _with_rows(node: Node, curves: dict[bytes, Spectrum]) -> Node:
    """Apply `with_rows` to a node and all nodes within it; new rows are appended to `curves`."""
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
    """Find the row of a spectrum, or append it; equal spectra share a row."""
    key = np.stack([table.wavelength_nm, table.values]).tobytes()
    curves.setdefault(key, table)
    return list(curves).index(key)
