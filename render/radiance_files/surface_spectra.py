"""Realistic reflectances from colours, by the eight clusters of measured spectra of Otsu et al. (2018).

H. Otsu, M. Yamamoto, T. Hachisuka, "Reproducing spectral reflectances from tristimulus colours", Computer Graphics
Forum 37(6), 2018; the data are colour-science's. A colour's chromaticity under D65 picks a cluster, whose mean m and
three principal curves B give the reflectance with exactly that colour. Unlike the paper, the reflectance is computed at
the cluster's mean luminance Y_m and then scaled, so that shade changes no spectrum,

    r(XYZ) = (Y / Y_m) r_0 + B M^-1 XYZ,   r_0 = m - B M^-1 XYZ_m,

where M holds the colours of B, one matrix for each cluster. Where r leaves 0 to 1, it is mixed with the reflectance of
sRGB's basis, which never does. The mixture has the same colour, and the least share of the basis that keeps it within 0
to 1. From 730 nm on, where the data end, curves keep their last value.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths, tristimulus
from rodcone.colour_spaces import SRGB_TO_XYZ
from rodcone.optional import quietly_imported
from rodcone.types import Floats, Singles

Spectra = NDArray[np.float32]
STRIP = 1 << 15  # pixels that are computed together; they fit into a core's cache


def srgb_basis(wavelength_nm: Floats) -> Floats:
    """Return the reflectances of sRGB's red, green and blue at wavelengths within 380-780 nm, shape (3, band).

    The basis is that of I. Mallett and C. Yuksel, "Spectral primary decomposition for rendering with sRGB reflectance",
    EGSR 2019: three reflectances that add up to white.
    """
    basis = quietly_imported("colour.recovery").MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    return np.stack([np.interp(wavelength_nm, basis.wavelengths, basis.values[:, index]) for index in range(3)])


def surface_reflectances(linear_srgb: Floats | Singles) -> tuple[NDArray[np.float32], Floats]:
    """Convert colours to reflectances in the bands of `DEFAULT_WAVELENGTH_NM`.

    Parameters
    ----------
    linear_srgb : (..., 3) float32 or float64
        Colours under D65, 0 to 1.

    Returns
    -------
    (..., band) float32
        Reflectances, 0 to 1.
    (...) float64
        Share of sRGB's basis in each reflectance: 0 if its cluster reaches the colour, at most 1.
    """
    colours = np.asarray(linear_srgb, dtype=np.float32).reshape(-1, 3)
    result = np.empty((DEFAULT_WAVELENGTH_NM.size, len(colours)), np.float32)  # band by band, as light transport is
    share = np.zeros(len(colours))
    for first in range(0, len(colours), STRIP):
        strip = slice(first, first + STRIP)
        for _, within, spectra, taken in _by_cluster(colours[strip]):
            result[:, strip][:, within] = spectra
            share[strip][within] = taken
    shape = np.shape(linear_srgb)[:-1]
    return np.moveaxis(result.reshape(-1, *shape), 0, -1), share.reshape(shape)


@dataclass(frozen=True)
class Upsampled:
    """Reflectances of colours, computed one band at a time, with the same bits as by `surface_reflectances`.

    Attributes
    ----------
    colours : (colour, 3) float32
        Linear sRGB.
    cluster : (colour,) uint8
        Number of each colour's cluster.
    share : (colour,) float32
        Share of sRGB's basis in each reflectance.
    """

    colours: Spectra
    cluster: NDArray[np.uint8]
    share: Spectra

    @classmethod
    def of(cls, colours: Spectra) -> "Upsampled":
        """Find the clusters and shares of colours in linear sRGB, (colour, 3)."""
        cluster, share = np.empty(len(colours), np.uint8), np.zeros(len(colours), np.float32)
        for first in range(0, len(colours), STRIP):
            strip = slice(first, first + STRIP)
            for number, within, _, taken in _by_cluster(colours[strip]):
                cluster[strip][within] = number
                share[strip][within] = taken
        return cls(colours, cluster, share)

    def at(self, band: int, places: NDArray[np.intp]) -> Spectra:
        """Compute the reflectances of some colours in one band, (place,)."""
        return _of_band(band, self.colours[places], self.cluster[places], self.share[places])

    def plane(self, band: int) -> Spectra:
        """Compute the reflectances of all colours in one band, (colour,)."""
        result = np.empty(len(self.colours), np.float32)
        for first in range(0, len(result), STRIP):
            strip = slice(first, first + STRIP)
            result[strip] = _of_band(band, self.colours[strip], self.cluster[strip], self.share[strip])
        return result


def _of_band(band: int, colours: Spectra, cluster: NDArray[np.uint8], share: Spectra) -> Spectra:
    """Compute reflectances in one band, (colour,), in the same order of operations as `_mixed` and `_brought_back`."""
    amounts = colours.T
    values = _mixed_at(_maps()[:, band][cluster].T, amounts)
    beyond = np.flatnonzero(share)
    inside = _mixed_at(_basis()[band, :, None], amounts[:, beyond])
    values[beyond] += share[beyond] * (inside - values[beyond])
    return np.clip(values, 0, 1, out=values)


def _mixed_at(curves: Spectra, amounts: Spectra) -> Spectra:
    return np.asarray(curves[0] * amounts[0] + curves[1] * amounts[1] + curves[2] * amounts[2])


def _by_cluster(colours: Spectra) -> Iterator[tuple[int, NDArray[np.intp], Spectra, Spectra]]:
    """Yield for each cluster its number, its colours' indices, and their spectra (band, index) and basis shares."""
    number = cluster_of(colours @ SRGB_TO_XYZ.T.astype(np.float32))
    for cluster in np.flatnonzero(np.bincount(number)).tolist():
        within = np.flatnonzero(number == cluster)
        of_cluster = colours[within].T
        spectra = _mixed(_maps()[cluster], of_cluster)
        share = np.zeros(within.size, np.float32)
        beyond = np.flatnonzero((spectra.min(axis=0) < 0) | (spectra.max(axis=0) > 1))
        if beyond.size:
            spectra[:, beyond], share[beyond] = _brought_back(
                spectra[:, beyond], _mixed(_basis(), of_cluster[:, beyond])
            )
        yield cluster, within, spectra, share


def _mixed(curves: Spectra, amounts: Spectra) -> Spectra:
    """Mix curves (band, 3) in amounts (3, colour), shape (band, colour); BLAS would take three times as long."""
    return np.asarray(curves[:, :1] * amounts[0] + curves[:, 1:2] * amounts[1] + curves[:, 2:] * amounts[2])


def _brought_back(outside: Spectra, inside: Spectra) -> tuple[Spectra, Spectra]:
    """Mix spectra (band, colour) that leave 0 to 1 with the least share of spectra that stay within; also return it."""
    limit = np.clip(outside, 0, 1)
    needed = np.divide(limit - outside, inside - outside, out=np.zeros_like(outside), where=limit != outside)
    taken = np.clip(needed.max(axis=0), 0, 1)
    return np.clip(outside + taken * (inside - outside), 0, 1), taken


def cluster_of(xyz: NDArray[np.floating]) -> NDArray[np.intp]:
    """Find the cluster of each colour's chromaticity, shape (colour,); black belongs to white's cluster."""
    x, y, z = xyz.T
    total = x + y + z
    lit = total > 0
    chromaticity = [
        np.divide(part, total, out=np.full_like(total, at), where=lit) for part, at in ((x, 0.3127), (y, 0.3290))
    ]
    lines, cluster = _selector()
    above = np.zeros(len(xyz), dtype=np.intp)
    for bit, (value, axis) in enumerate(lines):
        above += (chromaticity[axis] > value) * (1 << bit)
    return cluster[above]


@cache
def _selector() -> tuple[list[tuple[float, int]], NDArray[np.intp]]:
    """Return the lines that separate the clusters, (value, axis), and a table of clusters by the lines below a colour.

    Axis 0 is x and axis 1 is y. Bit i of a table's index says whether a colour lies above line i. The data are a tree
    with a row per line: value, axis, a number for colours at or below the line, and a number for colours above it. Such
    a number is a cluster or, if it is negative, minus the row of the next line.
    """
    tree = quietly_imported("colour.recovery").SELECTOR_ARRAY_OTSU2018
    cluster = np.empty(1 << len(tree), dtype=np.intp)
    for above in range(len(cluster)):
        row = 0
        while (following := int(tree[row, 2 + (above >> row & 1)])) < 0:
            row = -following
        cluster[above] = following
    return [(float(value), int(axis)) for value, axis in tree[:, :2]], cluster


@cache
def _basis() -> Spectra:
    """Return `srgb_basis` in the bands of `DEFAULT_WAVELENGTH_NM`, shape (band, 3)."""
    return srgb_basis(DEFAULT_WAVELENGTH_NM).T.astype(np.float32)


@cache
def _maps() -> NDArray[np.float32]:
    """Compute each cluster's matrix from linear sRGB to reflectance, shape (cluster, band, 3)."""
    recovery = quietly_imported("colour.recovery")
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(nm)
    light = illuminant("D65").band_average(nm, width)
    white_y = tristimulus(light, nm, width)[1]
    known = recovery.SPECTRAL_SHAPE_OTSU2018.wavelengths
    maps = []
    for curves, mean in zip(recovery.BASIS_FUNCTIONS_OTSU2018, recovery.CLUSTER_MEANS_OTSU2018, strict=True):
        in_bands = np.stack([np.interp(nm, known, row) for row in (*curves, mean)])
        *_, middle = colours = tristimulus(in_bands * light, nm, width) / white_y
        of_colour = np.linalg.solve(colours[:3], in_bands[:3])  # (XYZ, band)
        rest = in_bands[3] - middle @ of_colour
        of_colour[1] += rest / middle[1]
        maps.append((SRGB_TO_XYZ.T @ of_colour).T)
    return np.asarray(maps, dtype=np.float32)
