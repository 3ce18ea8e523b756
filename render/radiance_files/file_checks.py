"""Checks of a picture file: the size that it declares, before memory is allocated, and bands from its wavelengths."""

import warnings
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from render.spectrum import band_widths
from rodcone.errors import InputError
from rodcone.types import Floats

MOST_SIDE = 1 << 15  # largest side [pixels], as in a render
MOST_BYTES = 1 << 33  # 8 GiB of float32 pixels, such as 4 Mpx with 500 bands; their render needs three times that
MOST_CHANNELS = 4096  # ten times the bands of 1 nm over the visible; OpenEXR's time grows with the number's square
# A black picture shrinks to 1/957 in ZIP, 1/405 in PIZ and 1/1264 in PXR24. A file that claims more doesn't hold it.
MOST_EXPANSION = 2000
MOST_OVER_ONE = 0.01  # share of reflectances over 1 that may be highlights and noise; more means another unit
SMALL_BYTES = 1 << 26  # 64 MiB, which a .mat file's numbers may take however small the file is


def require_file(path: Path) -> int:
    """Return the size of a file in bytes.

    Raises
    ------
    InputError
        If there is no file at `path`.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; allowed: the path of a file; correct it")
    return path.stat().st_size


def require_extent(height: int, width: int, channels: int, file_bytes: float = inf, small_bytes: int = 0) -> None:
    """Raise `InputError` for a declared size that isn't allowed, or that the file can't hold.

    A side has 1 to 32768 pixels, there are at most 4096 channels, and all pixels take, in float32, at most 8 GiB. They
    also take at most `MOST_EXPANSION` times the file's size, or `small_bytes` if that is more.
    """
    if not (0 < height <= MOST_SIDE and 0 < width <= MOST_SIDE):
        raise InputError(f"{height} x {width} pixels are not allowed; each side is 1 to {MOST_SIDE}; crop or scale it")
    if channels > MOST_CHANNELS:
        raise InputError(f"{channels} channels are not allowed; give at most {MOST_CHANNELS}; keep fewer bands")
    needed = 4 * height * width * channels
    if needed > MOST_BYTES:
        raise InputError(
            f"{height} x {width} pixels with {channels} channels are {needed} bytes; allowed: {MOST_BYTES}; "
            "crop it, or keep fewer bands"
        )
    if needed > max(small_bytes, MOST_EXPANSION * file_bytes):
        raise InputError(f"{file_bytes} bytes can't hold the {needed} bytes of pixels that it declares; save it again")


def require_reflectances(values: NDArray[np.float32]) -> None:
    """Raise `InputError` if more reflectances exceed 1 than highlights and noise explain."""
    over = float((values > 1).mean())
    if over > MOST_OVER_ONE:
        raise InputError(
            f"{over:.0%} of its reflectances exceed 1; allowed: {MOST_OVER_ONE:.0%}, of highlights; give scale, such "
            "as 0.01 for per cent"
        )


def bands_between(wavelength_nm: Floats) -> tuple[Floats, Floats]:
    """Derive band centres and widths [nm] from a file's wavelengths: each band is as wide as their spacing.

    If the spacing is uneven, bands meet half-way between neighbours, so that widths are those of the trapezoidal rule.
    A `UserWarning` says so, because a sample then isn't at its band's centre.

    Raises
    ------
    InputError
        For fewer than two wavelengths, or if they don't increase.
    """
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    if nm.size < 2 or not np.all(np.isfinite(nm)) or not np.all(nm[1:] > nm[:-1]) or nm[0] <= 0:
        return nm, band_widths(nm)  # this raises the error
    steps = np.diff(nm)
    if np.allclose(steps, steps[0], rtol=1e-6):
        return nm, band_widths(nm)
    warnings.warn(
        "its wavelengths are not evenly spaced and no widths are stated: edges half-way between them are taken",
        stacklevel=2,
    )
    edges = np.concatenate([[nm[0] - steps[0] / 2], (nm[1:] + nm[:-1]) / 2, [nm[-1] + steps[-1] / 2]])
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)
