"""Random numbers by coordinates: a draw depends on key, row, column and term, not on threads or order.

Philox4x32-10 is the counter-based generator of Salmon et al., "Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

_U32 = np.uint64(0xFFFFFFFF)
MULTIPLIERS = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))
WEYL = (0x9E3779B9, 0xBB67AE85)
ROUNDS = 10
_PIXELS_AT_ONCE = 1 << 14  # random words take ten times a draw's memory; those of so few pixels stay in the cache


class NoiseTerm(IntEnum):
    """Noise term: each has an independent stream."""

    PRNU = 1
    DSNU = 2
    SHOT = 3
    READ = 4
    COLUMN_GAIN = 5
    COLUMN_OFFSET = 6
    HOT = 7
    EXPOSURE = 8  # shot and read noise of one pixel together, in `sensor.kernel.kernel`
    SHAKE = 9  # the path of the image in one exposure: axes and time steps stand for rows and columns
    ROW = 10  # the part of the read noise that the pixels of a row share
    TELEGRAPH = 11  # which pixels jump and how high, of a device; their traps' states, of an exposure


def draw_key(rng: np.random.Generator) -> int:
    """Draw a 64-bit key from a generator; all random numbers of a device or an exposure derive from it."""
    return int(rng.integers(0, 2**64, dtype=np.uint64))


def philox(counter: tuple[NDArray[np.uint64], ...], key: int) -> tuple[NDArray[np.uint64], ...]:
    """Return four 32-bit words (in uint64) for each counter of four 32-bit words, under a 64-bit key."""
    c0, c1, c2, c3 = counter
    k0 = key & 0xFFFFFFFF
    k1 = key >> 32
    for _ in range(ROUNDS):
        first, second = c0 * MULTIPLIERS[0], c2 * MULTIPLIERS[1]
        c0 = (second >> np.uint64(32)) ^ c1 ^ np.uint64(k0)
        c1 = second & _U32
        c2 = (first >> np.uint64(32)) ^ c3 ^ np.uint64(k1)
        c3 = first & _U32
        k0, k1 = (k0 + WEYL[0]) & 0xFFFFFFFF, (k1 + WEYL[1]) & 0xFFFFFFFF
    return c0, c1, c2, c3


def normals(key: int, term: NoiseTerm, shape: tuple[int, int], number: int = 0) -> NDArray[np.float64]:
    """Draw a standard normal number for each pixel, shape `shape` (Box-Muller on two 53-bit uniforms).

    Draws of another `number` are independent: each reading of one charge, and each pattern of one chip, has its own.
    """
    draws = np.empty(shape)
    columns = np.arange(shape[1], dtype=np.uint64)[None, :]
    terms, numbers = (np.full((1, 1), word, dtype=np.uint64) for word in (int(term), number))
    rows_at_once = max(1, _PIXELS_AT_ONCE // max(1, shape[1]))
    for first in range(0, shape[0], rows_at_once):
        rows = np.arange(first, min(first + rows_at_once, shape[0]), dtype=np.uint64)[:, None]
        words = philox((columns, rows, terms, numbers), key)
        radius, turn = (
            (((a << np.uint64(32)) | b) >> np.uint64(11)).astype(np.float64) * 2.0**-53
            for a, b in (words[:2], words[2:])
        )
        normal = np.sqrt(-2.0 * np.log1p(-radius)) * np.cos(2.0 * np.pi * turn)
        draws[first : first + rows_at_once] = normal
    return draws


def poisson(key: int, term: NoiseTerm, mean: NDArray[np.float64]) -> NDArray[np.int64]:
    """Draw an exact Poisson number for each pixel of `mean` (h, w), with one random stream per row."""
    draws = np.empty(mean.shape, dtype=np.int64)
    words = np.array([key, 0], dtype=np.uint64)  # a plain list with a large integer would go through float64
    for row, row_mean in enumerate(mean):
        stream = np.random.Philox(key=words, counter=np.array([0, 0, row, int(term)], dtype=np.uint64))
        draws[row] = np.random.Generator(stream).poisson(row_mean)
    return draws
