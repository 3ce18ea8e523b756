"""Light groups together: their emission in bands, and the sum of what each gives."""

from collections.abc import Mapping

import numpy as np

from render.scene import LightGroup
from rodcone.jit import arrays, backend, dr
from rodcone.types import Floats, Planes


def emission(lights: Mapping[str, LightGroup], wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Spectral emission of each group, band averages, shape (group, band)."""
    return np.array([x.spectrum.band_average(wavelength_nm, width_nm) * x.power for x in lights.values()])


def combine(coefficients: Floats, planes: Planes) -> Planes:
    """Sum over groups, shape (band, h, w): in float64, rounded once; every value is read once."""
    groups, bands, height, width = planes.shape
    pixels = height * width
    flat = planes.reshape(groups, bands, pixels)
    if backend() == "numpy":
        result = np.empty((bands, pixels), dtype=np.float32)
        for band in range(bands):
            result[band] = coefficients[:, band] @ flat[:, band].astype(np.float64)
        return result.reshape(bands, height, width)
    types = arrays()
    sums, index = dr.empty(types.Float, bands * pixels), dr.arange(types.UInt, pixels)
    for band in range(bands):  # a kernel each, all of one code; arrays of the host are read where they are
        total = types.Float64(0)
        for group in range(groups):
            factor = dr.opaque(types.Float64, float(coefficients[group, band]))
            total = dr.fma(types.Float64(types.Float(flat[group, band])), factor, total)
        dr.scatter(sums, types.Float(total), index + dr.opaque(types.UInt, band * pixels), mode=dr.ReduceMode.Permute)
        dr.eval(sums)
    return np.asarray(sums.numpy()).reshape(bands, height, width)
