"""Photographs as scenes: the colour of each pixel upsampled to a reflectance.

The basis is that of I. Mallett and C. Yuksel, "Spectral primary decomposition for rendering with sRGB reflectance",
EGSR 2019: three reflectances, of red, green and blue, that add up to white. A photograph doesn't tell the spectra that
were there: each colour gets one of the many that look like it under D65.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from render.radiance import SpectralRadiance
from render.radiance_files.file_checks import require_file
from render.spectrum import DEFAULT_WAVELENGTH_NM
from rodcone.colour_spaces import decode_srgb
from rodcone.errors import InputError, read_errors
from rodcone.optional import quietly_imported
from rodcone.types import Floats

EXTENSIONS = (".jpg", ".jpeg", ".png")
MOST_SIDE = 4096  # pixels, before memory is taken for them


def srgb_basis(wavelength_nm: Floats) -> Floats:
    """Reflectances of red, green and blue of sRGB at wavelengths within 380-780 nm, shape (3, band)."""
    basis = quietly_imported("colour.recovery").MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    return np.stack([np.interp(wavelength_nm, basis.wavelengths, basis.values[:, index]) for index in range(3)])


def photo_size(path: str | Path) -> tuple[int, int]:
    """Height and width of a photograph, from its header alone."""
    with _opened(Path(path)) as image:
        return image.height, image.width


def read_photo(path: str | Path) -> SpectralRadiance:
    """Read a photograph as reflectances, which stand in the place of the radiance; its colours are taken as sRGB.

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
    encoded = encoded if encoded.ndim == 3 else np.repeat(encoded[..., None], 3, axis=-1)
    reflectance = decode_srgb(encoded) @ srgb_basis(DEFAULT_WAVELENGTH_NM)
    return SpectralRadiance(reflectance.astype(np.float32), DEFAULT_WAVELENGTH_NM)


def _opened(path: Path) -> Image.Image:
    require_file(path)
    with read_errors(f"{path}: it is no JPEG or PNG", "save it as one", Exception):  # of Pillow's many
        image = Image.open(path, formats=("JPEG", "PNG"))
    if max(image.size) > MOST_SIDE:
        image.close()
        raise InputError(f"{path}: {image.width} x {image.height} pixels; allowed: {MOST_SIDE} a side; scale it down")
    return image
