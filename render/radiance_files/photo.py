"""Photographs as scenes: the colour of each pixel upsampled to a reflectance.

A photograph doesn't tell the spectra that were there: each colour gets one of the many that look like it under D65, of
surfaces as they were measured, or a mixture of sRGB's three basis curves (`render.radiance_files.surface_spectra`).
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
MOST_SIDE = 4096  # pixels, before memory is taken for them
SURFACES, SRGB_BASIS = SPECTRA = ("surfaces", "srgb_basis")
NEARLY_WHITE = 0.9  # of all light: only one spectrum reflects all, whatever surfaces were measured
TOGETHER = 64  # rows of a photograph whose colours are decoded together
LEAST_TOLD = 0.01  # share of the pixels beyond the measured surfaces' reach, under which nothing is said


def photo_size(path: str | Path) -> tuple[int, int]:
    """Height and width of a photograph, from its header alone."""
    with _opened(Path(path)) as image:
        return image.height, image.width


def read_photo(path: str | Path, spectra: str = SURFACES) -> SpectralRadiance:
    """Read a photograph as reflectances, which stand in the place of the radiance; its colours are taken as sRGB.

    Parameters
    ----------
    path : str or Path
    spectra : str
        ``surfaces``, spectra as measured surfaces have them (Otsu et al. 2018), or ``srgb_basis``, mixtures of three
        curves (Mallett and Yuksel 2019), as Mitsuba has them.

    Raises
    ------
    InputError
        For a file that isn't a JPEG or PNG of at most 4096 pixels a side, or is damaged, and for other spectra.

    Warns
    -----
    UserWarning
        Where one pixel in a hundred or more has a colour that the measured surfaces don't reach.
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
    """Read a photograph whose reflectances are made band by band, and its height and width.

    They are those of `read_photo` by ``surfaces``, which warns and refuses likewise.
    """
    linear = read_colours(path)
    upsampled = Upsampled.of(linear.reshape(-1, 3))
    warn_of_reach(upsampled.share.reshape(linear.shape[:2]), linear)
    return upsampled, (linear.shape[0], linear.shape[1])


class PhotoPlanes:
    """Reflectances of a photograph as (1, band, h, w) float32, of which an array is made of what is asked for.

    Parameters
    ----------
    upsampled : Upsampled
        Of the photograph's pixels, row by row.
    shape : (int, int)
        Its height and width.
    """

    dtype = np.dtype(np.float32)

    def __init__(self, upsampled: Upsampled, shape: tuple[int, int]) -> None:
        self.upsampled = upsampled
        self.shape = (1, DEFAULT_WAVELENGTH_NM.size, *shape)
        self._whole: Planes | None = None

    def __getitem__(self, index: Any) -> Planes:
        """Return one plane, of ``[0, band]``, or some pixels in all bands, of ``[..., rows, columns]``."""
        if len(index) == 2:
            return self.upsampled.plane(index[1]).reshape(self.shape[2:])
        places = index[1] * self.shape[3] + index[2]
        return np.stack([self.upsampled.at(band, places.ravel()) for band in range(self.shape[1])]).reshape(
            1, -1, *places.shape
        )

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        if self._whole is None:  # once: whoever asks for all of it asks again
            self._whole = np.stack([self[0, band] for band in range(self.shape[1])])[None]
        return np.array(self._whole, dtype=dtype, copy=copy)


def warn_of_reach(of_basis: NDArray[np.floating], linear: Singles) -> None:
    """Warn where one pixel in a hundred or more takes of sRGB's basis, (h, w), but for those that are nearly white."""
    beyond = (of_basis > 0) & (linear.min(axis=-1) < NEARLY_WHITE)
    if beyond.mean() >= LEAST_TOLD:
        warnings.warn(
            f"{beyond.mean():.0%} of the pixels have colours that no mixture of a cluster's measured surfaces reaches "
            f"within 0 to 1; they take {of_basis[beyond].mean(dtype=np.float64):.0%} of sRGB's basis, and keep their "
            "colour",
            stacklevel=3,
        )


def read_colours(path: str | Path) -> Singles:
    """Read the colours of a photograph in linear sRGB, (h, w, 3); it fails as `read_pixels`."""
    samples, most = _samples(path)
    linear = np.empty((*samples.shape[:2], 3), np.float32)
    for first in range(0, len(samples), TOGETHER):
        rows = slice(first, first + TOGETHER)
        linear[rows] = decode_srgb(_encoded(samples[rows], most))
    return linear


def read_pixels(path: str | Path) -> Floats:
    """Read the pixels of a photograph, (h, w, 3) from 0 to 1 as the file encodes them, upright by its Exif.

    Raises
    ------
    InputError
        For a file that isn't a JPEG or PNG of at most 4096 pixels a side, or is damaged.
    """
    return _encoded(*_samples(path))


def _encoded(samples: NDArray[Any], most: float) -> Floats:
    """Samples (h, w) or (h, w, 3) of which the largest is `most`, as fractions (h, w, 3)."""
    encoded = np.clip(np.asarray(samples, dtype=np.float64) / most, 0.0, 1.0)
    return encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=-1)


def _samples(path: str | Path) -> tuple[NDArray[Any], float]:
    """Samples of a photograph as its file holds them, and the largest that there can be."""
    # damaged streams and Exif fail in many ways within Pillow
    damage = read_errors(f"{path}: its pixels can't be read", "save it again", Exception)
    with _opened(Path(path)) as image, damage:
        upright = ImageOps.exif_transpose(image)
        deep = upright.mode.startswith("I")
        samples = np.asarray(upright if deep else upright.convert("RGB"))
    return samples, 65535.0 if deep else 255.0


def _opened(path: Path) -> Image.Image:
    require_file(path)
    with read_errors(f"{path}: it is no JPEG or PNG", "save it as one", Exception):  # of Pillow's many
        image = Image.open(path, formats=("JPEG", "PNG"))
    if max(image.size) > MOST_SIDE:
        image.close()
        raise InputError(f"{path}: {image.width} x {image.height} pixels; allowed: {MOST_SIDE} a side; scale it down")
    return image
