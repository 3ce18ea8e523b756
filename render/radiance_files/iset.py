"""Scenes of ISETCam, saved as ``.mat`` files: photons, or coefficients of basis functions.

The names and units are those of ISETCam's `sceneFromFile`, `vcReadImage`, `ieSaveMultiSpectralImage` and `sceneToFile`
(https://github.com/ISET/isetcam): photons s^-1 m^-2 sr^-1 nm^-1 at wavelengths in nm.
"""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.illuminants import unit_luminance
from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import SMALL_BYTES, bands_between, require_extent, require_file
from render.radiance_files.mat_file import read_numbers
from render.radiance_files.mat_reader import NAMES
from render.spectrum import Spectrum, photons_per_joule
from rodcone.errors import InputError, in_place, require_range
from rodcone.file_keys import require_known
from rodcone.types import Floats

MOST_NEGATIVE = 0.01  # largest share of stored photons that may be negative by noise
_KEYS = (
    *("scene/spectrum/wave", "scene/data/photons", "scene/data/dmin", "scene/data/dmax", "scene/data/min"),
    *("scene/data/max", "mcCOEF", "basis/basis", "basis/wave", "imgMean", "photons", "data", "wave", "wavelength"),
)
_PHOTONS = ("illuminant/data/photons", "illuminant/spectrum/wave")
_ENERGY = ("illuminant/data", "illuminant/wavelength")  # keys of older files, whose illuminants aren't structs
_OF_LAMP = tuple(place + key for place in ("scene/", "") for key in (*_PHOTONS, *_ENERGY))
# Field of view across the picture; the last key is that of ieSaveMultiSpectralImage.
_VIEWS_DEG = ("scene/wAngular", "scene/fov", "fov")
Numbers = Mapping[str, NDArray[Any]]  # a file's arrays by the keys above


def read_iset_scene(path: str | Path) -> SpectralRadiance:
    """Read an ISETCam multispectral scene as radiance.

    Three forms are tried in this order: a saved ``scene`` struct; ``mcCOEF`` and ``basis``, with ``imgMean`` if the
    mean was subtracted; ``photons`` (or ``data``) with ``wave`` (or ``wavelength``). Negative photons become 0, as in
    ISETCam, with a `UserWarning`; of photons that the file stores at most 1 % may be negative. Each sample of
    wavelength becomes a band as wide as the spacing.

    Parameters
    ----------
    path : path
        A level 5 file (``save -v6`` or ``-v7``).

    Returns
    -------
    SpectralRadiance
        float32, (h, w, band) over band-planar memory.

    Raises
    ------
    InputError
        If there is no such file, it has none of these forms, is ``-v7.3`` or damaged, its shapes don't fit, a side has
        over 32768 pixels, it takes over 8 GiB, over 1 % of stored photons are negative, or a value is not finite.
    """
    path = Path(path)
    numbers = read_numbers(path, (*_KEYS, *_OF_LAMP, *_VIEWS_DEG, NAMES))
    lamp = _lamp(numbers, path)
    view_deg = _view_deg(numbers, path)
    with in_place(str(path)):
        require_known("ISETCam variable", dict.fromkeys(str(name) for name in numbers[NAMES]))
        from_basis = "mcCOEF" in numbers and not any(key.startswith("scene/") for key in numbers)
        nm, shape, photons = _from_basis(numbers) if from_basis else _stored(numbers)
        centres, widths = bands_between(nm)
        require_extent(*shape, nm.size, require_file(path), SMALL_BYTES)
        planes = np.empty((nm.size, *shape), dtype=np.float32)
        with np.errstate(all="ignore"):  # SpectralRadiance reports a value that isn't finite
            for plane, band, per_joule in zip(planes, photons, photons_per_joule(nm), strict=True):
                plane[:] = band / per_joule
        _clip_negative(planes, 1.0 if from_basis else MOST_NEGATIVE)
        values = np.moveaxis(planes, 0, -1)
        return SpectralRadiance(values, centres, width_nm=widths, light=lamp, horizontal_view_deg=view_deg)


def read_iset_illuminant(path: str | Path) -> Spectrum | None:
    """Read an ISETCam scene's illuminant, scaled to 1 cd/m^2; return None if it has none, or one per pixel.

    Raises
    ------
    InputError
        For a file that can't be read, or an illuminant that is no spectrum.
    """
    return _lamp(read_numbers(Path(path), _OF_LAMP), path)


def _lamp(numbers: Numbers, path: str | Path) -> Spectrum | None:
    """Find the illuminant among a file's numbers and scale it to 1 cd/m^2."""
    for values_key, nm_key in zip(_OF_LAMP[::2], _OF_LAMP[1::2], strict=True):
        values, nm = (numbers.get(key, np.empty(0)).ravel().astype(np.float64) for key in (values_key, nm_key))
        if nm.size and values.size == nm.size and values.any():
            with in_place(f"{path}: illuminant"):
                per_joule = photons_per_joule(nm) if values_key.endswith("photons") else 1.0
                return unit_luminance(_to_edges(Spectrum(nm, values / per_joule)))
    return None


def _to_edges(lamp: Spectrum) -> Spectrum:
    """Extend an illuminant's first and last values to the outer edges of their bands."""
    nm = lamp.wavelength_nm
    if nm.size == 1:
        return lamp
    ends = nm[0] - (nm[1] - nm[0]) / 2, nm[-1] + (nm[-1] - nm[-2]) / 2
    return Spectrum(np.array([ends[0], *nm, ends[1]]), np.array([lamp.values[0], *lamp.values, lamp.values[-1]]))


def _view_deg(numbers: Numbers, path: str | Path) -> float | None:
    """Return the field of view across the picture [degrees]; None if the file states none, or NaN."""
    for key in _VIEWS_DEG:
        value = numbers.get(key, np.empty(0)).ravel()
        if value.size == 1 and np.isfinite(value[0]):
            with in_place(str(path)):
                require_range(key.replace("/", "."), float(value[0]), 1e-3, 175.0, "give degrees across the picture")
            return float(value[0])
    return None


def _stored(numbers: Numbers) -> tuple[Floats, tuple[int, int], Iterator[NDArray[np.float64]]]:
    """Read stored photons: return wavelengths, (height, width), and an iterator over the bands' photons."""
    if any(key.startswith("scene/") for key in numbers):
        wave, data, photons = "scene/spectrum/wave", "scene/data/", "scene/data/photons"
    else:
        wave = "wave" if "wave" in numbers else "wavelength"
        data = ""
        photons = "photons" if "photons" in numbers else "data"
    nm = _numbers(numbers, wave).ravel().astype(np.float64)
    cube = _cube(numbers, photons, nm.size)
    scale, offset = _quantised(cube.dtype, numbers, data)
    return nm, cube.shape[:2], (cube[:, :, k].astype(np.float64) * scale + offset for k in range(nm.size))


def _quantised(dtype: np.dtype[Any], numbers: Numbers, data: str) -> tuple[float, float]:
    """Return the scale and offset of stored photons. Old files hold integers from least to most (ieCompressData)."""
    if dtype.kind == "f":
        return 1.0, 0.0
    for least, most in (("dmin", "dmax"), ("min", "max")):
        if dtype in (np.uint16, np.uint32) and {data + least, data + most} <= numbers.keys():
            low, high = (float(_numbers(numbers, data + name).ravel()[0]) for name in (least, most))
            return (high - low) / float(np.iinfo(dtype).max), low
    raise InputError(f"photons are {dtype}; allowed: floating, or uint16 or uint32 with dmin and dmax; save them so")


def _from_basis(numbers: Numbers) -> tuple[Floats, tuple[int, int], Iterator[NDArray[np.float64]]]:
    """Compute photons from coefficients, basis and mean; return as `_stored` does."""
    nm = _numbers(numbers, "basis/wave").ravel().astype(np.float64)
    functions = np.atleast_2d(_numbers(numbers, "basis/basis").astype(np.float64))
    if functions.shape[0] != nm.size:
        raise InputError(f"basis.basis: shape {functions.shape} has not one row for each of {nm.size} wavelengths")
    coefficients = _cube(numbers, "mcCOEF", functions.shape[1]).astype(np.float64)
    mean = _numbers(numbers, "imgMean").ravel().astype(np.float64) if "imgMean" in numbers else np.zeros(nm.size)
    if mean.size != nm.size:
        raise InputError(f"imgMean: {mean.size} values don't fit {nm.size} wavelengths; give one each")
    bands = (coefficients @ weights + offset for weights, offset in zip(functions, mean, strict=True))
    return nm, coefficients.shape[:2], bands


def _clip_negative(planes: NDArray[np.float32], most: float) -> None:
    """Set negative values to 0 and warn of their share; if it exceeds `most`, leave them to be refused."""
    share = sum(int(np.count_nonzero(plane < 0)) for plane in planes) / planes.size
    if 0 < share <= most and np.isfinite(planes.min()):
        np.maximum(planes, 0.0, out=planes)
        warnings.warn(f"{100 * share:.3g}% of its photons were negative and became 0, as in ISETCam", stacklevel=3)


def _numbers(numbers: Numbers, name: str) -> NDArray[Any]:
    if name not in numbers or not numbers[name].size:
        stated = name.replace("/", ".")
        raise InputError(
            f"it has no numbers {stated!r}; allowed: an ISETCam scene, as sceneToFile saves it, or any cube that a "
            ".toml of the same name describes; write that file"
        )
    return numbers[name]


def _cube(numbers: Numbers, name: str, depth: int) -> NDArray[Any]:
    """Return an array as (h, w, depth), because MATLAB drops a last axis of length 1."""
    value = _numbers(numbers, name)
    cube = value[:, :, None] if value.ndim == 2 and depth == 1 else value
    if cube.ndim != 3 or cube.shape[2] != depth:
        raise InputError(f"{name.replace('/', '.')}: shape {value.shape} is not (h, w, {depth}); correct it")
    return cube
