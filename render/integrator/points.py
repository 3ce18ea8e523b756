"""Random numbers of the paths: one Sobol sequence, which is scrambled for each pixel independently.

The sequence is Sobol's with the direction numbers of Joe and Kuo (2008), as SciPy has them: they lie in a file of this
package, since importing `scipy.stats` takes 1 s (``python tests/render/integrator/test_points.py`` writes it). Each
pixel and dimension has a nested uniform scramble of its own (Owen 1995), by the hash of Laine and Karras (2011) as
Burley gives it ("Practical Hash-based Owen Scrambling", JCGT 9(4), 2020): a pixel's points stay as even as the
sequence's, at any number of them and best at powers of two, and pixels are independent of each other.
"""

import json
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from render.integrator.variant_types import Float, Point2, UInt
from rodcone.jit import dr

DIRECTIONS = Path(__file__).parent.parent / "data" / "sobol_directions.json"
LOG2_POINTS = 15  # base-2 logarithm of the number of the sequence's points
DIMENSIONS = 34  # dimensions of the sequence; paths that need more get independent random numbers
# First dimension of each use: the film (or the meter's plate), the first bounce, further bounces, and so on.
FILM, FIRST_BOUNCE, FURTHER_BOUNCES, WAVELENGTH, FIRST_LOBE, APERTURE = 0, 2, 6, 30, 31, 32
A_BOUNCE = 6  # dimensions per bounce: 2 for the light, 2 for the direction, 1 for the lobe, and 1 unused to be even
EVEN_BOUNCES = 5  # bounces whose dimensions lie within the sequence


@cache
def sequence() -> NDArray[np.uint32]:
    """Compute the first points of Sobol's sequence in Gray code's order as numbers of 32 bits: (dimension, point).

    A point's number is the exclusive or of those direction numbers of the dimension at which its Gray code has a 1.
    """
    directions = np.array(json.loads(DIRECTIONS.read_text(encoding="utf-8")), dtype=np.uint32)
    index = np.arange(1 << LOG2_POINTS)
    gray = index ^ index >> 1
    points = np.zeros((DIMENSIONS, index.size), np.uint32)
    for bit in range(LOG2_POINTS):
        points[:, gray >> bit & 1 == 1] ^= directions[:, bit, None]
    return points


@cache
def _reversed_bits() -> NDArray[np.uint32]:
    """Reverse the bits of each number of the sequence: (dimension x point,), dimension by dimension."""
    reversed_bytes = np.array([int(f"{byte:08b}"[::-1], 2) for byte in range(256)], np.uint8)
    turned = reversed_bytes[sequence()[..., None].view(np.uint8)[..., ::-1]]
    return np.ascontiguousarray(turned).view(np.uint32).ravel()


@cache
def _on_device(mi: ModuleType) -> UInt:
    """Copy the sequence into Dr.Jit's own memory, because code that reads a NumPy array depends on its alignment."""
    sequence = mi.UInt32(_reversed_bits()) ^ dr.opaque(mi.UInt32, 0)
    dr.eval(sequence)
    return sequence


class Points:
    """Points of a wavefront, one per thread.

    It is no dataclass, because Dr.Jit would treat a dataclass's arrays as variables of a loop.

    Parameters
    ----------
    mi : module
    index : UInt32
        Number of the point in its pixel's sequence. Past its end the sequence begins again with another scramble.
    key : UInt32
        Key of the pixel, which decides the scramble.
    """

    def __init__(self, mi: ModuleType, index: UInt, key: UInt) -> None:
        self.mi, self.index = mi, index & ((1 << LOG2_POINTS) - 1)
        self.key = key + (index >> LOG2_POINTS) * 0x632BE5AB
        self.sequence = _on_device(mi)

    def at(self, dimension: UInt) -> Float:
        """Return the coordinate, in [0, 1), of each thread's point in a dimension."""
        mi = self.mi
        dimension = mi.UInt32(dimension)
        held = dimension < DIMENSIONS
        number = dr.gather(mi.UInt32, self.sequence, (dimension << LOG2_POINTS) + self.index, held)
        seed = _mixed(self.key + dimension * 0x9E3779B9)
        number = dr.select(held, number, _mixed(self.index * 0x85EBCA6B + seed))
        # Laine and Karras's hash of the reversed bits: each bit is flipped by a function of the higher ones.
        number ^= number * 0x3D20ADEA
        number += seed
        number *= (seed >> 16) | 1
        number ^= number * 0x05526C56
        number ^= number * 0x53A22864
        return dr.minimum(mi.Float(dr.brev(number)) * 2.0**-32, 1 - 2.0**-24)

    def pair(self, dimension: UInt) -> Point2:
        """Return the coordinates in a dimension and the next one."""
        return self.mi.Point2f(self.at(dimension), self.at(dimension + 1))

    def bounce(self, depth: UInt) -> tuple[Point2, Float, Point2]:
        """Return the coordinates of a bounce: light (2D), lobe and direction (2D). The first bounce has depth 0."""
        mi = self.mi
        further = FURTHER_BOUNCES + (depth - 1) * A_BOUNCE
        further = dr.select(depth < EVEN_BOUNCES, further, further + DIMENSIONS)
        first = depth == 0
        base = dr.select(first, mi.UInt32(FIRST_BOUNCE), further)
        lobe = dr.select(first, mi.UInt32(FIRST_LOBE), further + 4)
        return self.pair(base), self.at(lobe), self.pair(base + 2)

    def roulette(self, depth: UInt) -> Float:
        """Return the coordinate that decides whether a path goes on."""
        return self.at(depth + 0x10000)


def pixel_keys(mi: ModuleType, pixel: UInt, seed: int) -> UInt:
    """Derive each pixel's key from its number and a seed of 32 bits."""
    return _mixed(pixel * 0x9E3779B1 + dr.opaque(mi.UInt32, seed))


def _mixed(number: UInt) -> UInt:
    """Hash 32 bits (Wellons, "lowbias32", 2018)."""
    number ^= number >> 16
    number *= 0x7FEB352D
    number ^= number >> 15
    number *= 0x846CA68B
    return number ^ (number >> 16)
