"""Poisson draws in Dr.Jit, with one source for LLVM and CUDA: a table for small means, a quantile for large ones.

Below `EXACT_BELOW_E` a draw is the sum of two independent Poisson draws: one for the mean's whole part from
an alias table (Walker, "An efficient method for generating discrete random variables", ACM TOMS 3, 1977), one for the
rest by inversion, term by term in double precision. The only error is that of 32-bit words: `TABLE_ERROR`.

From there on it is the quantile of a normal draw by the asymptotic series of Giles, "Algorithm 955: approximation of
the inverse Poisson cumulative distribution function", ACM TOMS 42 (2016), Q_N2. Its error is largest at the lower end
of its range (`LARGEST_ERROR`), and falls as 1 / mean^1.5.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from rodcone.jit import Double, Float, Mask, UInt, arrays, dr

EXACT_BELOW_E = 30.0
TABLE_ERROR = 2e-9  # largest error of a distribution function under 30 e-: 128 bins of 25-bit shares
LARGEST_ERROR = 5e-6  # largest error of a distribution function from 30 e- on; 4.5e-6 at 30 e-, 3.7e-7 at 100 e-

_BINS = 128  # the probability of more than 127 at a mean of 29 is 1e-39
_SHARE_BITS = 25  # together with the 7 bits of a bin's number they fill a 32-bit word
_MOST_TERMS = 40  # ends a loop that rounding could keep alive; more at a mean below 1 has a probability of 1e-48


@cache
def alias_table() -> NDArray[np.uint32]:
    """Return the alias tables of the whole means 0..29, shape (30, 128).

    Each entry holds the share of the bin's own number << 7 | the other number.
    """
    table = np.empty((int(EXACT_BELOW_E), _BINS), dtype=np.uint32)
    counts = np.arange(_BINS)
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(counts[1:]))])
    for mean in range(len(table)):
        probability = np.exp(counts * np.log(mean) - mean - log_factorial) if mean else (counts == 0) * 1.0
        share, other = _alias(probability / probability.sum() * _BINS)
        table[mean] = np.minimum(np.rint(share * 2.0**_SHARE_BITS), 2**_SHARE_BITS - 1).astype(np.uint32) << 7 | other
    return table


def _alias(heights: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Cut columns with the mean height 1 into columns of height 1 with parts of at most two of the old ones.

    A new column's first part comes from the old column with the same number. Return this part's share, and the number
    of the other old column.
    """
    share = np.ones(heights.size)
    other = np.arange(heights.size, dtype=np.uint32)
    heights = heights.copy()
    low, high = list(np.flatnonzero(heights < 1)), list(np.flatnonzero(heights >= 1))
    while low and high:
        short = low.pop()
        tall = high[-1]
        share[short], other[short] = heights[short], tall
        heights[tall] -= 1.0 - heights[short]
        if heights[tall] < 1:
            low.append(high.pop())
    return share, other


def poisson_single(mean_e: Float, normal: Float, words: tuple[UInt, UInt], table: UInt) -> Float:
    """Draw a Poisson number in each thread, a whole number in Float.

    Parameters
    ----------
    mean_e : Float
        0 or more, finite.
    normal : Float
        Standard normal draw, used from `EXACT_BELOW_E` on.
    words : pair of UInt
        Random words, used below it.
    table : UInt
        `alias_table`, flat.
    """
    return dr.select(mean_e < EXACT_BELOW_E, _by_table(mean_e, words, table), _by_quantile(mean_e, normal))


def _by_table(mean_e: Float, words: tuple[UInt, UInt], table: UInt) -> Float:
    jit = arrays()
    whole = dr.minimum(dr.floor(mean_e), EXACT_BELOW_E - 1)
    first, second = words
    bin_number = first >> _SHARE_BITS
    entry = dr.gather(jit.UInt, table, jit.UInt(jit.Int(whole)) * _BINS + bin_number)
    is_first = (first & (2**_SHARE_BITS - 1)) < (entry >> 7)
    # Uniform in (0, 1) with steps of 2^-62 near 0: one photon in 10^9 pixels is not lost.
    upper, lower = (jit.Float64(jit.Int(word >> 1)) for word in (second, first))  # signed: native on every CPU
    uniform = (upper + (lower + 0.5) * 2.0**-31) * 2.0**-31
    rest = _by_inversion(jit.Float64(mean_e - whole), uniform, mean_e < EXACT_BELOW_E)
    return jit.Float(jit.Int(dr.select(is_first, bin_number, entry & (_BINS - 1)))) + rest


def _by_inversion(mean: Double, uniform: Double, active: Mask) -> Float:
    """Draw from a Poisson law with a mean below 1: the first number whose excess has at most the chance `uniform`."""
    jit = arrays()

    def next_number(number: Double, chance: Double, exceeded: Double) -> tuple[Double, Double, Double]:
        number = number + 1.0
        chance = chance * mean / number
        return number, chance, exceeded - chance

    none = dr.exp(-mean)
    start = (dr.zeros(jit.Float64, dr.width(mean)), none, 1.0 - none)
    number, _, _ = dr.while_loop(
        start, lambda number, _, exceeded: active & (uniform < exceeded) & (number < _MOST_TERMS), next_number
    )
    return jit.Float(number)


def _by_quantile(mean_e: Float, normal: Float) -> Float:
    """Draw from Poisson's law by its approximate quantile function Q_N2 of Giles (2016), for a normal number.

    The mean's whole part is added last, because rounding in a large sum would change the result.
    """
    whole = dr.floor(mean_e)
    square = dr.square(normal)
    root = dr.sqrt(mean_e)
    terms = dr.fma(root, normal, dr.fma(square, 1 / 6, 1 / 3))
    terms -= normal * dr.fma(square, 1 / 72, 1 / 36) / root
    terms += dr.fma(square, dr.fma(square, 1 / 270, 7 / 810), -8 / 405) / mean_e
    return whole + dr.floor(terms + (mean_e - whole))
