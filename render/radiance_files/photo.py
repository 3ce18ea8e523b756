"""Photographs as scenes: the colour of each pixel upsampled to a reflectance.

A photograph doesn't tell the spectra that were there: each colour gets one of the many that look like it under D65, of
surfaces as they were measured, or a mixture of sRGB's three basis curves (`render.radiance_files.surface_spectra`).
"""

import warnings
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import require_file
from render.radiance_files.surface_spectra import srgb_basis, surface_reflectances
from render.spectrum import DEFAULT_WAVELENGTH_NM
from rodcone.colour_spaces import decode_srgb
from rodcone.errors import InputError, read_errors, require_name
from rodcone.types import Floats

EXTENSIONS = (".jpg", ".jpeg", ".png")
MOST_SIDE = 4096  # pixels, before memory is taken for them
SURFACES, SRGB_BASIS = SPECTRA = ("surfaces", "srgb_basis")
NEARLY_WHITE = 0.9  # of all light: only one spectrum reflects all, whatever surfaces were measured
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
    encoded = read_pixels(path)
    if spectra == SRGB_BASIS:
        mixtures = decode_srgb(encoded) @ srgb_basis(DEFAULT_WAVELENGTH_NM)
        return SpectralRadiance(mixtures.astype(np.float32), DEFAULT_WAVELENGTH_NM)
    linear = decode_srgb(encoded)
    reflectance, of_basis = surface_reflectances(linear)
    beyond = (of_basis > 0) & (linear.min(axis=-1) < NEARLY_WHITE)
    if beyond.mean() >= LEAST_TOLD:
        warnings.warn(
            f"{beyond.mean():.0%} of the pixels have colours that no mixture of a cluster's measured surfaces reaches "
            f"within 0 to 1; they take {of_basis[beyond].mean():.0%} of sRGB's basis, and keep their colour",
            stacklevel=2,
        )
    return SpectralRadiance(reflectance, DEFAULT_WAVELENGTH_NM)


def read_pixels(path: str | Path) -> Floats:
    """Read the pixels of a photograph, (h, w, 3) from 0 to 1 as the file encodes them, upright by its Exif.

    Raises
    ------
    InputError
        For a file that isn't a JPEG or PNG of at most 4096 pixels a side, or is damaged.
    """
    # damaged streams and Exif fail in many ways within Pillow
    damage = read_errors(f"{path}: its pixels can't be read", "save it again", Exception)
    with _opened(Path(path)) as image, damage:
        upright = ImageOps.exif_transpose(image)
        deep = upright.mode.startswith("I")
        pixels = np.asarray(upright if deep else upright.convert("RGB"), dtype=np.float64)
    encoded = np.clip(pixels / (65535.0 if deep else 255.0), 0.0, 1.0)
    return encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=-1)


def _opened(path: Path) -> Image.Image:
    require_file(path)
    with read_errors(f"{path}: it is no JPEG or PNG", "save it as one", Exception):  # of Pillow's many
        image = Image.open(path, formats=("JPEG", "PNG"))
    if max(image.size) > MOST_SIDE:
        image.close()
        raise InputError(f"{path}: {image.width} x {image.height} pixels; allowed: {MOST_SIDE} a side; scale it down")
    return image
