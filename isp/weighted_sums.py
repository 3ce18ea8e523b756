"""Sums of eqs. (1) and (3), one sample after the other, in units that don't underflow.

The quick form counts weights in units of 2^-HEADROOM of the largest possible; where the sum ends under LEAST_WEIGHT
nearly all of a pixel's weights may have underflowed, and the exact form serves: it counts in units of the largest
weight met so far.
"""

from typing import Any

from rodcone.jit import arrays, dr

HEADROOM = 55.0  # log2: squares of weights, and 16-bit samples times weights, 10^5 of each, stay under 2^127
LOWEST_EXPONENT = -62.0  # weights end here: their squares are still normal numbers, which all processors treat alike
LEAST_WEIGHT = 2.0**-30  # 441 weights that end at 2^-62 are 1e-7 of it
FARTHEST = -1e28  # log weights end here, far under any that comes from sigmas of 0.001 and 16 bits
NOTHING = -1e29  # largest log weight before the first sample
NO_OFFSET = -1e30  # log weight that fills up a list: it ends at 2^-62, under any rounding of the sums, as what is far
# 2^f for 0 <= f <= 1, lowest power first: minimax of the relative error, 7.5e-5 (Remez exchange). Two samples that
# share a pixel share it wrongly by a quarter of twice this: 3.8e-5 of their difference. One power more takes a tenth
# more time.
EXP2 = (0.99992522, 0.69583354, 0.22606716, 0.07802452)


def at_least(value: Any, least: float) -> Any:
    """The larger one; `dr.maximum` takes three instructions, to treat numbers that aren't any."""
    return dr.select(value > least, value, least)


def start_sums(*, exact: bool, noise: bool) -> tuple[float, ...]:
    """Sums before the first sample: weight, value, square where `noise`, log2 of the unit where `exact`."""
    return (0.0, 0.0) + (0.0,) * noise + (NOTHING,) * exact


def add_quickly(sums: tuple[Any, ...], log_weight: Any, sample: Any) -> tuple[Any, ...]:
    """Add one sample in fixed units. The log weight has HEADROOM added."""
    weight, value, *square = sums
    new = _exp2(at_least(log_weight, LOWEST_EXPONENT))
    return weight + new, dr.fma(new, sample, value), *(dr.fma(new, new, old) for old in square)


def add_exactly(sums: tuple[Any, ...], log_weight: Any, sample: Any) -> tuple[Any, ...]:
    """Add one sample in units of the largest weight: it counts as 1, so W_y is never 0."""
    weight, value, *square, largest = sums
    bounded = at_least(log_weight, FARTHEST)
    ahead = bounded - largest
    smaller = _exp2(at_least(-dr.abs(ahead), LOWEST_EXPONENT))  # one exponential: of the two weights the larger is 1
    is_larger = ahead > 0.0
    old = dr.select(is_larger, smaller, 1.0)
    new = dr.select(is_larger, 1.0, smaller)
    return (
        dr.fma(weight, old, new),
        dr.fma(value, old, new * sample),
        *(dr.fma(total, dr.square(old), dr.square(new)) for total in square),
        dr.select(is_larger, bounded, largest),
    )


def _exp2(exponent: Any) -> Any:
    """2^exponent for -125 <= exponent < 127, right to 8e-5.

    The bits of a float are its logarithm, but for the fraction: 2^n (1 + m) holds (n + 127 + m) 2^23. So n + 2^f - 1 is
    formed for 0 <= f < 1, scaled and taken as bits (Schraudolph 1999, with a cubic in place of his straight line).
    """
    jit = arrays()
    whole = dr.floor(exponent)
    fraction = exponent - whole
    mantissa = dr.fma(dr.fma(jit.Float(EXP2[3]), fraction, EXP2[2]), fraction, EXP2[1])
    bits = dr.fma(dr.fma(mantissa, fraction, whole), 2.0**23, (126.0 + EXP2[0]) * 2.0**23)
    return dr.reinterpret_array(jit.Float, jit.Int(bits))
