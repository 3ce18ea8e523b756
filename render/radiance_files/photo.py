"""Photographs as scenes: each pixel's colour is converted to a spectral reflectance.

A photograph doesn't show the true spectra. Each colour gets one of the many spectra that look like it under D65: one
like those of measured surfaces, or a mixture of sRGB's three basis curves (`render.radiance_files.surface_spectra`).
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray
from PIL import Image, ImageOps

from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import require_file
from render.radiance_files.surface_spectra import Upsampled, srgb_basis, surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM
from rodcone.colour_spaces import decode_srgb
from rodcone.errors import InputError, read_errors, require_name
from rodcone.types import Floats, Planes, Singles

EXTENSIONS = (".jpg", ".jpeg", ".png")
MOST_SIDE = 4096  # largest side [pixels], checked before memory is allocated
SURFACES, SRGB_BASIS = SPECTRA = ("surfaces", "srgb_basis")
NEARLY_WHITE = 0.9  # above this linear value a colour isn't reported, because white has only one spectrum anyway
TOGETHER = 64  # rows of a photograph that are decoded at once
LEAST_TOLD = 0.01  # share of pixels beyond the measured surfaces' reach from which on a warning is given


def photo_size(path: str | Path) -> tuple[int, int]:
    """Read the height and width of a photograph from its header."""
    with _opened(Path(path)) as image:
        return image.height, image.width


def read_photo(path: str | Path, spectra: str = SURFACES) -> SpectralRadiance:
    """Read a photograph as reflectances, the values of a `SpectralRadiance`; its colours are assumed to be sRGB.

    Parameters
    ----------
    path : str or Path
    spectra : str
        ``surfaces``, spectra like those of measured surfaces (Otsu et al. 2018), or ``srgb_basis``, mixtures of three
        curves (Mallett and Yuksel 2019), as in Mitsuba.

    Raises
    ------
    InputError
        For a file that isn't a JPEG or PNG of at most 4096 pixels per side, or is damaged; for another `spectra`.

    Warns
    -----
    UserWarning
        If one pixel in a hundred or more has a colour that the measured surfaces don't reach.
    """
    require_name("spectra", spectra, SPECTRA)
    if spectra == SRGB_BASIS:
        mixtures = decode_srgb(read_pixels(path)) @ srgb_basis(DEFAULT_WAVELENGTH_NM)
        return SpectralRadiance(mixtures.astype(np.float32), DEFAULT_WAVELENGTH_NM)
    linear = read_colours(path)
    reflectance, of_basis = surface_reflectances(linear)
    warn_of_reach(of_basis, linear)
    return SpectralRadiance(reflectance, DEFAULT_WAVELENGTH_NM)


def read_upsampled(path: str | Path) -> tuple[Upsampled, tuple[int, int]]:
    """Read a photograph whose reflectances are computed band by band; also return its height and width.

    The reflectances, warnings and errors are those of `read_photo` with ``surfaces``.
    """
    linear = read_colours(path)
    upsampled = Upsampled.of(linear.reshape(-1, 3))
    warn_of_reach(upsampled.share.reshape(linear.shape[:2]), linear)
    return upsampled, (linear.shape[0], linear.shape[1])


class PhotoPlanes:
    """Reflectances of a photograph, (1, band, h, w) float32, computed only for the planes or pixels that are read.

    Parameters
    ----------
    upsampled : Upsampled
        The photograph's pixels, row by row.
    shape : (int, int)
        Its height and width.
    """

    dtype = np.dtype(np.float32)

    def __init__(self, upsampled: Upsampled, shape: tuple[int, int]) -> None:
        self.upsampled = upsampled
        self.shape = (1, DEFAULT_WAVELENGTH_NM.size, *shape)
        self._whole: Planes | None = None

    def __getitem__(self, index: Any) -> Planes:
        """Compute one plane, for ``[0, band]``, or some pixels in all bands, for ``[..., rows, columns]``."""
        if len(index) == 2:
            return self.upsampled.plane(index[1]).reshape(self.shape[2:])
        places = index[1] * self.shape[3] + index[2]
        return np.stack([self.upsampled.at(band, places.ravel()) for band in range(self.shape[1])]).reshape(
            1, -1, *places.shape
        )

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        if self._whole is None:  # kept, because whoever needs all of it needs it several times
            self._whole = np.stack([self[0, band] for band in range(self.shape[1])])[None]
        return np.array(self._whole, dtype=dtype, copy=copy)


def warn_of_reach(of_basis: NDArray[np.floating], linear: Singles) -> None:
    """Warn if one pixel in a hundred or more isn't nearly white and has a share of sRGB's basis, `of_basis` (h, w)."""
    beyond = (of_basis > 0) & (linear.min(axis=-1) < NEARLY_WHITE)
    if beyond.mean() >= LEAST_TOLD:
        warnings.warn(
            f"{beyond.mean():.0%} of the pixels have colours that no mixture of a cluster's measured surfaces reaches "
            f"within 0 to 1; they take {of_basis[beyond].mean(dtype=np.float64):.0%} of sRGB's basis, and keep their "
            "colour",
            stacklevel=3,
        )


def read_colours(path: str | Path) -> Singles:
    """Read the colours of a photograph in linear sRGB, (h, w, 3); errors are those of `read_pixels`."""
    samples, most = _samples(path)
    linear = np.empty((*samples.shape[:2], 3), np.float32)
    for first in range(0, len(samples), TOGETHER):
        rows = slice(first, first + TOGETHER)
        linear[rows] = decode_srgb(_encoded(samples[rows], most))
    return linear


def read_pixels(path: str | Path) -> Floats:
    """Read the pixels of a photograph, (h, w, 3) from 0 to 1 as the file encodes them, turned upright by its Exif.

    Raises
    ------
    InputError
        For a file that isn't a JPEG or PNG of at most 4096 pixels per side, or is damaged.
    """
    return _encoded(*_samples(path))


def _encoded(samples: NDArray[Any], most: float) -> Floats:
    """Divide samples (h, w) or (h, w, 3) by `most`, the largest possible one; return (h, w, 3)."""
    encoded = np.clip(np.asarray(samples, dtype=np.float64) / most, 0.0, 1.0)
    return encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=-1)


def _samples(path: str | Path) -> tuple[NDArray[Any], float]:
    """Read a photograph's samples as the file stores them; also return the largest possible sample."""
    # Damaged streams and Exif make Pillow raise errors of many types.
    damage = read_errors(f"{path}: its pixels can't be read", "save it again", Exception)
    with _opened(Path(path)) as image, damage:
        upright = ImageOps.exif_transpose(image)
        deep = upright.mode.startswith("I")
        samples = np.asarray(upright if deep else upright.convert("RGB"))
    return samples, 65535.0 if deep else 255.0


def _opened(path: Path) -> Image.Image:
    require_file(path)
    with read_errors(f"{path}: it is no JPEG or PNG", "save it as one", Exception):  # Pillow raises many types
        image = Image.open(path, formats=("JPEG", "PNG"))
    if max(image.size) > MOST_SIDE:
        image.close()
        raise InputError(f"{path}: {image.width} x {image.height} pixels; allowed: {MOST_SIDE} a side; scale it down")
    return image
