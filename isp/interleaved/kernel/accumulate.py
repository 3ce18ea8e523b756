"""The sums of eqs. (1) and (3), accumulated sample by sample in units that don't underflow.

At the fixed scale, weights are in units of 2^-HEADROOM of the largest possible one. If a sum ends below LEAST_WEIGHT,
nearly all of a pixel's weights may have underflowed. For such pixels there is the running maximum (online soft-max):
weights are in units of the largest one so far, so that W_y is never 0.

The reconstruction's limits, all of them (log weights and exponents are logarithms to base 2):

| name                   | value  | it must be                                                                         |
|------------------------|--------|------------------------------------------------------------------------------------|
| HEADROOM               | 55     | so small that sums of 10^5 squared weights, or weights times 16 bits, stay < 2^127 |
| LOWEST_EXPONENT        | -62    | over -63: the square of 2^-62 is a normal number, which all processors treat alike |
| LEAST_WEIGHT           | 2^-30  | 10^7 times as much as 441 weights that end at 2^LOWEST_EXPONENT                    |
| LOWEST_LOG_WEIGHT      | -1e28  | under any log weight of a sample: sigmas of 0.001 and 16 bits give -1e15           |
| NO_LOG_WEIGHT          | -1e29  | under LOWEST_LOG_WEIGHT: the largest log weight before the first sample            |
| OUTSIDE                | 1e13   | 10^4 times a billion electrons, yet its square is finite: h_i outside the frame    |
| LEAST_INVERSE_VARIANCE | 2e-24  | so large that OUTSIDE^2 gives the weight 2^-200, which never counts, and so small  |
|                        |        | that 25 squares of a billion electrons count as similar (weight 2^-0.00005)        |
| ROOT_SCALE             | 2^-32  | so small that the product of two scaled squared distances is finite                |
"""

from rodcone.jit import Float, dr

HEADROOM = 55.0
LOWEST_EXPONENT = -62.0
LEAST_WEIGHT = 2.0**-30
LOWEST_LOG_WEIGHT = -1e28
NO_LOG_WEIGHT = -1e29
OUTSIDE = 1e13
LEAST_INVERSE_VARIANCE = 2e-24
ROOT_SCALE = 2.0**-32

# Coefficients of 2^f for 0 <= f <= 1, lowest power first, by Remez exchange. A weight errs by at most 7.5e-5. If two
# samples of equal weight err by so much in opposite directions, their mean errs by 1/4 * 2 * 7.5e-5 = 3.8e-5 of their
# difference. With a fourth power the kernel would take a tenth longer.
EXP2 = (0.99992522, 0.69583354, 0.22606716, 0.07802452)

Sums = tuple[Float, ...]  # sums of weights, of weight times sample, of squared weights[, largest log weight so far]


def start_sums(running: bool) -> tuple[float, ...]:
    """Return the sums before the first sample."""
    return (0.0, 0.0, 0.0) + (NO_LOG_WEIGHT,) * running


def add_samples(
    sums: list[Sums], log_weights: list[Float], samples: list[Float], brightest: list[Float], *, running: bool
) -> list[Sums]:
    """Add one sample to each pixel's sums; samples over `brightest` don't count.

    At the fixed scale the given log weights already include HEADROOM.
    """
    add = _add_to_running_maximum if running else _add_at_fixed_scale
    return [add(*pixel) for pixel in zip(sums, log_weights, samples, brightest, strict=True)]


def squared_distances(
    at_x: dict[int, list[Float]], at_y: dict[int, list[Float]], pixels: list[tuple[int, int]], patch: int
) -> list[Float]:
    """Compute the squared distance between the patches of each pixel.

    Parameters
    ----------
    at_x, at_y : mapping of int to list
        Rows that the patches around x and y cover; a pixel's patch begins at its own row and column.
    """
    # y - x and not x - y, because the x stay in memory, and a CPU subtracts memory from a register.
    squares = {i: [dr.square(y - x) for x, y in zip(at_x[i], at_y[i], strict=True)] for i in at_x}
    columns = sorted({c for _, c in pixels})
    lines = {c: {i: _sum(line, c, patch) for i, line in squares.items()} for c in columns}
    return [_sum(lines[c], r, patch) for r, c in pixels]


def mixed_squares(colour: list[Float], white: list[Float], alpha: list[Float]) -> list[Float]:
    """Compute the square of eq. (5) from both squared distances; for alpha 0 or 1 it is exactly one of them.

    (a sqrt(colour) + (1 - a) sqrt(white))^2 = a^2 colour + (1 - a)^2 white + 2 a (1 - a) sqrt(colour white): one root.
    """
    results = []
    for d_own, d_white, share in zip(colour, white, alpha, strict=True):
        rest = 1.0 - share
        cross = share * rest * (2.0 / ROOT_SCALE) * dr.sqrt(d_own * ROOT_SCALE * (d_white * ROOT_SCALE))
        results.append(dr.fma(dr.square(share), d_own, dr.fma(dr.square(rest), d_white, cross)))
    return results


def _sum(values: list[Float] | dict[int, Float], first: int, count: int) -> Float:
    """Sum consecutive values by pairs, fours and eights, which Dr.Jit shares between overlapping sums."""
    if count == 1:
        return values[first]
    power = 1 << (count - 1).bit_length() - 1
    return _sum(values, first, power) + _sum(values, first + power, count - power)


def larger(a: Float, b: Float) -> Float:
    """Return the larger number; `dr.maximum` takes three instructions, because it handles NaN."""
    return dr.select(a > b, a, b)


def _add_at_fixed_scale(sums: Sums, log_weight: Float, sample: Float, brightest: Float) -> Sums:
    weight, value, square = sums
    new = dr.select(sample <= brightest, _exp2(larger(log_weight, LOWEST_EXPONENT)), 0.0)
    return weight + new, dr.fma(new, sample, value), dr.fma(new, new, square)


def _add_to_running_maximum(sums: Sums, log_weight: Float, sample: Float, brightest: Float) -> Sums:
    weight, value, square, largest = sums
    bounded = dr.select((log_weight > LOWEST_LOG_WEIGHT) & (sample <= brightest), log_weight, LOWEST_LOG_WEIGHT)
    ahead = bounded - largest
    smaller = _exp2(larger(-dr.abs(ahead), LOWEST_EXPONENT))  # one exponential: of the two weights the larger is 1
    is_larger = ahead > 0.0
    old = dr.select(is_larger, smaller, 1.0)
    new = dr.select(is_larger, 1.0, smaller)
    return (
        dr.fma(weight, old, new),
        dr.fma(value, old, new * sample),
        dr.fma(square, dr.square(old), dr.square(new)),
        dr.select(is_larger, bounded, largest),
    )


def _exp2(exponent: Float) -> Float:
    """Compute 2^exponent for -125 <= exponent < 127 within 8e-5.

    The bits of a float are nearly its logarithm: 2^n (1 + m) is stored as (n + 127 + m) 2^23. Therefore n + 2^f - 1 is
    computed for 0 <= f < 1, scaled, and used as the float's bits (Schraudolph 1999, with a cubic instead of a line).
    """
    real = type(exponent)
    whole = dr.floor(exponent)
    fraction = exponent - whole
    mantissa = dr.fma(dr.fma(real(EXP2[3]), fraction, EXP2[2]), fraction, EXP2[1])
    bits = dr.fma(dr.fma(mantissa, fraction, whole), 2.0**23, (126.0 + EXP2[0]) * 2.0**23)
    return dr.reinterpret_array(real, dr.int32_array_t(real)(bits))
