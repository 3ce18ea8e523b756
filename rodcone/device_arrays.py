"""Aligned upload of NumPy arrays to Dr.Jit, and exact division of whole numbers."""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rodcone.jit import Double, UInt, arrays, dr

ALIGNMENT = 64  # bytes; for memory that isn't aligned Dr.Jit compiles another, slower kernel without packet loads


def aligned(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return an empty array whose memory starts at a multiple of `ALIGNMENT`; Dr.Jit uses it without a copy."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return np.asarray(memory[start : start + size].view(dtype).reshape(shape))


def upload(values: NDArray[Any], *, copy_under: float = inf) -> Any:
    """Return an evaluated, flat Dr.Jit array of the same values and type.

    It uses the memory of the values themselves if they are contiguous and aligned, or have `copy_under` bytes or more;
    otherwise it uses an aligned copy.
    """
    jit = arrays()
    kinds = {"f4": jit.Float, "f8": jit.Float64, "u4": jit.UInt, "i4": jit.Int}
    flat = values.ravel()
    if flat.ctypes.data % ALIGNMENT and flat.nbytes < copy_under:
        copy = aligned(flat.shape, flat.dtype)
        copy[:] = flat
        flat = copy
    return kinds[flat.dtype.str[1:]](flat)


@dataclass(frozen=True)
class Divisor:
    """A whole number to divide by (UInt), and its inverse (Float64), because CPUs multiply in vectors."""

    number: UInt
    inverse: Double


def divisor(number: int) -> Divisor:
    """Make a divisor that is data of the kernel, so that another number doesn't recompile it."""
    jit = arrays()
    return Divisor(dr.opaque(jit.UInt, number), dr.opaque(jit.Float64, 1 / number))


def tile_cell(pixel: UInt, width: Divisor, tile: tuple[Divisor, Divisor]) -> UInt:
    """Return the number of each pixel's cell in a tile of (height, width) that is repeated over a picture.

    Pixels and cells are both numbered row by row.
    """
    row, column = divide(pixel, width)
    return divide(row, tile[0])[1] * tile[1].number + divide(column, tile[1])[1]


def divide(number: UInt, by: Divisor) -> tuple[UInt, UInt]:
    """Return the quotient and remainder of whole numbers (UInt) below 2^31.

    The result is exact: number + 1/2 is at least half a step of 1/divisor from the next multiple, far above the
    rounding of its double-precision quotient. CPUs convert Int to Float64 in vectors, but not UInt.
    """
    jit = arrays()
    quotient = jit.UInt(jit.Int((jit.Float64(jit.Int(number)) + 0.5) * by.inverse))
    return quotient, number - quotient * by.number
