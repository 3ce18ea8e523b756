"""The sum over light groups: their emission in bands, and the light that they give together."""

from collections.abc import Mapping

import numpy as np

from render.scene import LightGroup
from rodcone.jit import arrays, backend, dr
from rodcone.types import Floats, Planes


def emission(lights: Mapping[str, LightGroup], wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Average the spectral emission of each group over the bands, shape (group, band)."""
    return np.array([x.spectrum.band_average(wavelength_nm, width_nm) * x.power for x in lights.values()])


def combine(maps: Floats, planes: Planes) -> Planes:
    """Sum over groups and bands, shape (band, h, w): in float64, rounded once.

    Parameters
    ----------
    maps : (group, band, band) float64
        Factors from each group's bands (last axis) to the bands of the sum, of which there may be fewer. Planes whose
        factors are 0 aren't read.
    planes : (group, band, h, w) float32
    """
    groups, read_bands, height, width = planes.shape
    bands, pixels = maps.shape[1], height * width
    flat = planes.reshape(groups * read_bands, pixels)
    factors = np.moveaxis(maps, 0, 1).reshape(bands, groups * read_bands)
    read = [np.flatnonzero(row) for row in factors]
    if backend() == "numpy":
        result = np.empty((bands, pixels), dtype=np.float32)
        for band, chosen in enumerate(read):
            result[band] = factors[band, chosen] @ flat[chosen].astype(np.float64)
        return result.reshape(bands, height, width)
    types = arrays()
    sums = dr.empty(types.Float, bands * pixels)
    index = dr.arange(types.UInt, pixels)
    most = max(groups, *map(len, read))
    for band, chosen in enumerate(read):  # one launch per band of one kernel; arrays in host memory are read in place
        total = types.Float64(0)
        padded = [*chosen, *[0] * (most - chosen.size)]
        for number, plane in enumerate(padded):
            factor = dr.opaque(types.Float64, float(factors[band, plane]) if number < chosen.size else 0.0)
            total = dr.fma(types.Float64(types.Float(flat[plane])), factor, total)
        dr.scatter(sums, types.Float(total), index + dr.opaque(types.UInt, band * pixels), mode=dr.ReduceMode.Permute)
        dr.eval(sums)
    return np.asarray(sums.numpy()).reshape(bands, height, width)
