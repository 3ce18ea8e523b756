"""Limits on the size that a picture file declares, checked before memory is allocated; bands from its wavelengths."""

import warnings
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from render.spectrum import band_widths
from rodcone.errors import InputError
from rodcone.types import Floats

MOST_SIDE = 1 << 15  # pixels; the engine's own limit
MOST_BYTES = 1 << 33  # of float32 pixels: 8 GiB, such as 4 Mpx with 500 bands; a render that size needs three times it
MOST_CHANNELS = 4096  # ten times the bands of 1 nm over the visible; OpenEXR's time grows with their square
# A black picture shrinks by 957 in ZIP, 405 in PIZ, 1264 in PXR24; more is a file that claims what it doesn't hold.
MOST_EXPANSION = 2000
MOST_OVER_ONE = 0.01  # of a reflectance's values: highlights and noise; more is another unit
SMALL_BYTES = 1 << 26  # of a .mat file's numbers, which is no harm: 64 MiB


def require_file(path: Path) -> int:
    """Size of a file in bytes.

    Raises
    ------
    InputError
        Where there is no file at `path`.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; allowed: the path of a file; correct it")
    return path.stat().st_size


def require_extent(height: int, width: int, channels: int, file_bytes: float = inf, small_bytes: int = 0) -> None:
    """Raise `InputError` for float32 pixels that a file shouldn't or can't hold.

    A side is 1 to 32768 pixels, there are at most 4096 channels, and all pixels take at most 8 GiB, and at most
    `MOST_EXPANSION` times the file or `small_bytes`.
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
    """Raise `InputError` where more than the share of highlights and noise exceeds a reflectance of 1."""
    over = float((values > 1).mean())
    if over > MOST_OVER_ONE:
        raise InputError(
            f"{over:.0%} of its reflectances exceed 1; allowed: {MOST_OVER_ONE:.0%}, of highlights; give scale, such "
            "as 0.01 for per cent"
        )


def bands_between(wavelength_nm: Floats) -> tuple[Floats, Floats]:
    """Band centres and widths [nm] of a file that states its samples' wavelengths alone: they are as wide as spaced.

    Where the spacing is uneven, bands meet half-way between neighbours (widths as in the trapezoidal rule), with a
    `UserWarning`: a sample then lies beside its band's centre.

    Raises
    ------
    InputError
        For fewer than two wavelengths, or where they don't increase.
    """
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    if nm.size < 2 or not np.all(np.isfinite(nm)) or not np.all(nm[1:] > nm[:-1]) or nm[0] <= 0:
        return nm, band_widths(nm)  # which refuses it
    steps = np.diff(nm)
    if np.allclose(steps, steps[0], rtol=1e-6):
        return nm, band_widths(nm)
    warnings.warn(
        "its wavelengths are not evenly spaced and no widths are stated: edges half-way between them are taken",
        stacklevel=2,
    )
    edges = np.concatenate([[nm[0] - steps[0] / 2], (nm[1:] + nm[:-1]) / 2, [nm[-1] + steps[-1] / 2]])
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)
