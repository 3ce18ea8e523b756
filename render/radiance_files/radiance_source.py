"""Radiance from a file in place of a rendered scene."""

from pathlib import Path

import numpy as np

from render.level import SceneMeans
from render.radiance import SpectralRadiance
from render.radiance_files.exr import read_exr
from render.radiance_files.iset import read_iset_scene
from render.scene import LightGroup
from render.spectrum import LONGEST_NM, SHORTEST_NM, Spectrum
from render.transport import Transport
from rodcone.errors import unknown

_READERS = {".exr": read_exr, ".mat": read_iset_scene}


def is_radiance_file(name: str | Path) -> bool:
    """Whether a name ends as a file that `load_radiance` reads."""
    return Path(name).suffix.lower() in _READERS


def load_radiance(path: str | Path) -> SpectralRadiance:
    """Read spectral OpenEXR (``.exr``) or an ISETCam scene (``.mat``).

    Raises
    ------
    InputError
        For another ending, and as `read_exr` and `read_iset_scene`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _READERS:
        raise unknown(f"{path}: ending", suffix, _READERS)
    return _READERS[suffix](path)


def as_transport(radiance: SpectralRadiance, name: str = "scene") -> Transport:
    """Transport whose one light group gives the radiance as it is at a spectrum of 1.

    It has no reference plane, and no light counts as seen directly. The variance is what the radiance's
    relative Monte Carlo error says, the same share in every pixel; `half_difference` is 0, since one picture holds no
    two halves.

    Parameters
    ----------
    radiance : SpectralRadiance
    name : str
        Of the light group. Its spectrum stands for the factor on the file's own light: 1 in every band.
    """
    planes = np.ascontiguousarray(np.moveaxis(radiance.values, -1, 0), dtype=np.float32)[None]
    nm, width = radiance.wavelength_nm, radiance.widths_nm
    ends = np.clip([(nm - width).min(), (nm + width).max()], SHORTEST_NM, LONGEST_NM)
    whole = Spectrum(ends, np.ones(2))
    none, dark = np.broadcast_to(np.float32(0), planes.shape), np.zeros((1, *radiance.shape), np.float32)
    means = planes.mean(axis=(2, 3), dtype=np.float64)
    error = radiance.relative_mc_error
    variance = np.minimum((error * planes.astype(np.float64)) ** 2, np.finfo(np.float32).max).astype(np.float32)
    return Transport(
        radiance=planes,
        half_difference=none,
        variance=variance if error else none,
        coverage=dark[0],
        coverage_difference=dark[0],
        seen=(dark,),
        seen_difference=(dark,),
        scene_means=SceneMeans(means, 1.0, np.zeros((means.size + 1,) * 2)),
        groups={name: LightGroup((), whole)},
        wavelength_nm=nm,
        width_nm=width,
        counts=np.zeros(dark.shape[1:], np.uint32),
        stopped_by="samples",
        seconds=0.0,
        integrator="file",
        variant="none",
    )
