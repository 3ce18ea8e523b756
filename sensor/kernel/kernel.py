"""Expected electrons and the readout in Dr.Jit, a pixel a lane: one source for LLVM and CUDA.

Every number that changes between calls is an evaluated array of one value or more, so that one compiled kernel serves
all cameras, keys and frame sizes (of one number of bands and letters). Draws depend on key, row, column and term alone.
"""

from dataclasses import dataclass
from math import pi
from typing import Any

from rodcone.jit import arrays, dr
from sensor.kernel.poisson import poisson
from sensor.random import MULTIPLIERS, ROUNDS, WEYL, Term

_FINITE_E = 1e30  # over any well; times any response in single precision's range


@dataclass(frozen=True)
class Divisor:
    """A whole number to divide by: itself (UInt) and its inverse (Float64), which CPUs multiply by in vectors."""

    number: Any
    inverse: Any


@dataclass(frozen=True)
class Frame:
    """Where the lanes' pixels lie.

    Attributes
    ----------
    first : UInt
        Number of the first pixel, counted row by row from the frame's corner.
    width : Divisor
        Columns of the frame.
    """

    first: Any
    width: Divisor


@dataclass(frozen=True)
class Chip:
    """What reading needs to know of camera, chip and exposure.

    Attributes
    ----------
    key : pair of UInt
        Lower and upper half.
    photo_response, dark_offset_e : Float64
        A value a pixel.
    column_gain : Float64 or None
        A value a column, None where all are 1.
    dark_e : Float
        Expected dark electrons: one value, or one a pixel.
    most_e, full_well_e : Float
        Bound of the mean, and the well.
    read_noise_e, gain_e_per_dn, black_dn, white_dn : Float64
    table : UInt
        `sensor.kernel.poisson.alias_table`, flat.
    """

    key: tuple[Any, Any]
    photo_response: Any
    dark_offset_e: Any
    column_gain: Any
    dark_e: Any
    most_e: Any
    full_well_e: Any
    read_noise_e: Any
    gain_e_per_dn: Any
    black_dn: Any
    white_dn: Any
    table: Any


def letter_lanes(cells: Any, height: Divisor, width: Divisor, frame: Frame, count: int) -> Any:
    """Number of each pixel's letter, UInt: `cells` holds those of the tile's `height` x `width` cells."""
    row, column = _place(frame, count)
    cell = _modulo(row, height) * width.number + _modulo(column, width)
    return dr.gather(arrays().UInt, cells, cell)


def expected_lanes(planes: list[Any], weights: list[list[Any]], letter: Any) -> Any:
    """Sum over bands behind each pixel's own filter.

    Parameters
    ----------
    planes : list of Float
        Each band's pixels.
    weights : list of lists of Float
        One value for each letter and band.
    letter : UInt
        As `letter_lanes` gives it.
    """
    # All letters are summed, then one is chosen: the bands' memory takes longer than the arithmetic.
    chosen = _weighted_sum(planes, weights[0])
    for number, own in enumerate(weights[1:], 1):
        chosen = dr.select(letter == number, _weighted_sum(planes, own), chosen)
    return chosen


def read_lanes(expected_e: Any, chip: Chip, frame: Frame) -> Any:
    """DN of each pixel, Int: the order of `sensor.readout.read_out`."""
    jit = arrays()
    row, column = _place(frame, len(expected_e))
    words = philox((column, row, jit.UInt(int(Term.EXPOSURE)), jit.UInt(0)), chip.key)
    shot, read = normal_pair(words[0], words[1])
    finite_e = dr.minimum(expected_e, _FINITE_E)  # an infinite sum times a pixel that doesn't answer is no number
    mean_e = dr.fma(finite_e, jit.Float(chip.photo_response), chip.dark_e)
    collected_e = poisson(dr.minimum(mean_e, chip.most_e), shot, words[2:], chip.table)
    read_e = jit.Float64(dr.minimum(collected_e, chip.full_well_e))
    if chip.column_gain is not None:
        read_e *= dr.gather(jit.Float64, chip.column_gain, column)
    read_e += chip.dark_offset_e + chip.read_noise_e * jit.Float64(read)
    # Double precision here: whole electrons lie on the same DN as in the NumPy form.
    return jit.Int(dr.clip(dr.round(read_e / chip.gain_e_per_dn + chip.black_dn), 0.0, chip.white_dn))


def philox(counter: tuple[Any, ...], key: tuple[Any, Any]) -> tuple[Any, ...]:
    """Philox4x32-10, as `sensor.random.philox`: four random words for each counter."""
    (c0, c1, c2, c3), (k0, k1) = counter, key
    first, second = (arrays().UInt(int(multiplier)) for multiplier in MULTIPLIERS)
    for _ in range(ROUNDS):
        c0, c1, c2, c3 = (
            dr.mul_hi(c2, second) ^ c1 ^ k0,
            c2 * second,
            dr.mul_hi(c0, first) ^ c3 ^ k1,
            c0 * first,
        )
        k0, k1 = k0 + WEYL[0], k1 + WEYL[1]
    return c0, c1, c2, c3


def normal_pair(first: Any, second: Any) -> tuple[Any, Any]:
    """Two independent standard normal draws of two words (Box-Muller); they end at 6.7 standard deviations."""
    jit = arrays()
    radius = dr.sqrt(-2.0 * dr.log(dr.fma(jit.Float(jit.Int(first >> 1)), 2.0**-31, 2.0**-32)))
    sine, cosine = dr.sincos(jit.Float(jit.Int(second >> 1)) * (2.0 * pi * 2.0**-31))
    return radius * sine, radius * cosine


def _weighted_sum(planes: list[Any], weights: list[Any]) -> Any:
    total = planes[0] * weights[0]
    for plane, weight in zip(planes[1:], weights[1:], strict=True):
        total = dr.fma(plane, weight, total)
    return total


def _place(frame: Frame, count: int) -> tuple[Any, Any]:
    """Row and column of each lane's pixel."""
    index = dr.arange(arrays().UInt, count) + frame.first
    row = _quotient(index, frame.width)
    return row, index - row * frame.width.number


def _quotient(number: Any, divisor: Divisor) -> Any:
    """Whole quotient; exact, for half a step to the next whole number is far above the rounding of 2^31 / divisor."""
    jit = arrays()
    return jit.UInt(jit.Int((jit.Float64(jit.Int(number)) + 0.5) * divisor.inverse))


def _modulo(number: Any, divisor: Divisor) -> Any:
    return number - _quotient(number, divisor) * divisor.number
