"""The formula of `isp.interleaved.edges` in Dr.Jit: one thread per pixel, whose four channels form a packet."""

from functools import reduce
from itertools import combinations_with_replacement, product
from operator import or_
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.kernel.accumulate import larger
from isp.settings import WhiteReading
from rodcone.device_arrays import divide, divisor, upload
from rodcone.jit import Float, UInt, arrays, dr
from rodcone.types import Floats
from sensor.raw import RawImage

Packet: TypeAlias = Any  # four values of a pixel, one per channel

REACH = 2  # pixels of a window to either side; 3 would gain 0.02 dB
SIDE = 2 * REACH + 1
# a and b of C' = a C + b e m m^T. 2.5 and 0 lose 0.6 dB, 0 and 2.5 lose 0.1; 0.3 and 0.7 lose 0.2; doubling both
# gains 0.1 and makes even surfaces noisier.
SPREAD = 0.75, 1.75
FULL = 0.95  # share of the well from which on there may be more light than was read
# chi^2 of planes that miss a lamp. With 10, windows get a grey ring; with 100, lamps of 5x2 pixels get a red one.
MISSED = 30.0
FAR = 24  # distance [pixels] to either side within which the surroundings' colour is found
STEP = 12  # distance [pixels] between the 5 x 5 places at which it is found
# chi^2 of a colour up to which noise hides it on even surfaces. With 3, coloured clouds remain in the dark.
HIDDEN = 7.0
# Mean chi^2 of the colours of like places that noise alone makes, by three channels, W, and the mean itself. Where
# places differ more, as in a chart, less is hidden.
EVEN = 3.5
APART = 9.0  # squared standard deviations of noise by which a sample has to differ from W's plane to count by itself
# Contrast from which on a light is small. With 1, edges of windows show the tile; with 2, halos of lamps have 15 % more
# false hues.
SMALL = 1.5
# A plane that averages more samples than this is trusted. With 1, lamps get false hues; with more, walls take on the
# colour of a window.
FEW = 4.0
UNKNOWN = 1e12  # noise variance of a full sample [e-^2]
TINY = 1e-9  # least noise variance or light, if there is neither light nor noise
# Correlation exp(-r^2 / 2), r in pixels, between the nine samples around a pixel, row by row. With a length of 0.8
# pixels instead of 1, 0.01 dB is lost; with 1.5, 0.3 dB.
OFFSETS = np.array(list(product((-1.0, 0.0, 1.0), repeat=2)))
CORRELATION = np.exp(-((OFFSETS[:, None] - OFFSETS) ** 2).sum(axis=2) / 2.0)
NEAR = CORRELATION[4] ** 4 / (CORRELATION[4] ** 4).sum()


def channel_noise(raw: RawImage) -> NDArray[np.float64]:
    """Return shot noise's variance per electron k, the dark variance [e-^2] and the full level [e-]: (3, channel)."""
    noises = [raw.noise_of(name) for name in raw.channels]
    return np.array([(x.shot, x.dark_noise_e**2, FULL * x.full_well_e) for x in noises]).T


def sharpen_frame(
    white: WhiteReading, planes: NDArray[Any], noise_gain: NDArray[Any], scales: Floats
) -> NDArray[np.float32]:
    """Sharpen a frame like `isp.interleaved.edges.sharpen`; `scales` (2, 4) holds g and nu of its formulas."""
    jit = arrays()
    raw = white.raw
    names, (height, width) = raw.channels, raw.shape
    down, across = (np.uint32(length) for length in (len(raw.cfa), len(raw.cfa[0])))
    # Rows and columns are mirrored at the borders; row r stands at FAR + r.
    rows, columns = (np.pad(np.arange(length, dtype=np.uint32), FAR, mode="reflect") for length in raw.shape)
    frame, noise_gains, share_planes, certain = (upload(x) for x in (planes, noise_gain, white.shares, white.lines))
    electrons = upload((raw.dn.astype(np.float32) - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn))
    cells = upload(np.array([[names.index(name) for name in line] for line in raw.cfa], np.uint32))
    row_starts, row_cells = upload(rows * np.uint32(width)), upload(rows % down * across)
    column_starts, column_cells = upload(columns), upload(columns % across)
    tables = (*channel_noise(raw), *scales)
    shot, dark, full_e, balance, nu = (jit.Array4f([dr.opaque(jit.Float, float(x)) for x in row]) for row in tables)

    def lines(table: UInt, first: UInt, steps: range) -> list[UInt]:
        return [dr.gather(jit.UInt, table, first + step) for step in steps]

    pixel = dr.arange(jit.UInt, height * width)
    row, column = divide(pixel, divisor(width))

    def places(steps: range) -> list[list[UInt]]:
        return [[r + c for c in lines(column_starts, column, steps)] for r in lines(row_starts, row, steps)]

    starts = places(range(FAR - REACH, FAR + REACH + 1))
    window = [dr.gather(jit.Array4f, frame, start) for line in starts for start in line]
    far = [dr.gather(jit.Array4f, frame, start) for line in places(range(0, 2 * FAR + 1, STEP)) for start in line]
    near = range(REACH - 1, REACH + 2)
    plane = window[len(window) // 2]
    sample = [dr.gather(jit.Float, electrons, starts[i][j]) for i in near for j in near]
    beside = range(FAR - 1, FAR + 2)
    row_cell, column_cell = lines(row_cells, row, beside), lines(column_cells, column, beside)
    site = [dr.gather(jit.UInt, cells, r + c) for r in row_cell for c in column_cell]

    # What the window holds: m, C, N, e (contrast), r (tint), <D^2> (apart), and the share that noise hides.
    mean, covariance = _moments(window)
    light, variance = larger(mean, 0.0), jit.Array4f([larger(covariance[c][c], 0.0) for c in range(4)])
    noise = larger(shot * light + dark, TINY)
    contrast = dr.sum(variance / noise) / (1.0 + dr.sum(dr.square(light) / noise))
    faint = dr.sqrt(nu[3] * noise[3])
    tint, differences = _colour_of_like_places(mean, far, shot, dark, faint)
    apart = variance + tint * (tint * variance[3] - 2.0 * covariance[3]) + dr.square(mean - tint * mean[3])
    coloured = larger(dr.sum(differences / (nu * noise)) / EVEN, 1.0)
    hidden = HIDDEN / larger(coloured * dr.sum(apart / (nu * noise)), HIDDEN)
    covariance = [SPREAD[0] * covariance[c] + SPREAD[1] * contrast * light[c] * light for c in range(4)]

    # The best linear estimate.
    to_samples = [at_site(covariance, s) for s in site]
    among_samples = [
        [float(CORRELATION[y, z]) * at_site([*to_samples[y]], site[z]) for z in range(y + 1)] for y in range(9)
    ]
    value = [at_site([*window[SIDE * i + j]], s) for (i, j), s in zip(product(near, near), site, strict=True)]
    noises = [(at_site([*shot], s), at_site([*dark], s)) for s in site]
    sample_noise = [larger(k * larger(v, 0.0) + d, TINY) for v, (k, d) in zip(value, noises, strict=True)]
    is_full = [e >= at_site([*full_e], s) for e, s in zip(sample, site, strict=True)]
    counted = [dr.select(f, UNKNOWN, n) for f, n in zip(is_full, sample_noise, strict=True)]
    residual = [e - at_site([*mean], s) for e, s in zip(sample, site, strict=True)]
    weights = _solve(among_samples, counted, residual)
    terms = [float(CORRELATION[4, y]) * weights[y] * to_samples[y] for y in range(9)]
    estimate = mean + sum(terms[1:], terms[0])

    # If W's estimate is brighter or darker than all its planes in the window, keep this only as far as it isn't noise.
    squares = [dr.square(e - v) / n for e, v, n in zip(sample, value, sample_noise, strict=True)]
    chi_squared = sum(squares[1:], squares[0]) / 9.0
    of_white = [values[3] for values in window]
    within = larger(dr.minimum(estimate[3], reduce(larger, of_white)), reduce(dr.minimum, of_white))
    estimate += (within - estimate[3]) / larger(chi_squared, 1.0) * light / larger(light[3], faint)

    # The estimate counts less if contrast is that of a lamp and the samples lie on their planes.
    chi_squared_near = sum((float(w) * x for w, x in zip(NEAR, squares, strict=True)), 0.0)
    sharp = plane + larger(1.0 - dr.square(dr.square(contrast)) / (1.0 + chi_squared_near), 0.0) * (estimate - plane)

    # A colour that noise hides is replaced by that of the surroundings.
    even = plane + larger(1.0 - contrast, 0.0) * (sharp - plane)
    sharp -= hidden * (even - tint * even[3])

    # Light of unknown colour: q (hue) and q_c. W is channel 3.
    channels_full = [dr.select(f, jit.UInt(1) << s, 0) for f, s in zip(is_full, site, strict=True)]
    full = reduce(or_, channels_full)  # one bit per channel
    lamp = _lamp(of_white, light[3], contrast, chi_squared)
    black = dr.minimum(contrast, 1.0)
    hue = dr.select((full & 0b111) > 0, black, dr.select(full > 0, dr.square(dr.square(black)), lamp))
    unknown = jit.Array4f([dr.select((full & 1 << c) > 0, 1.0, hue) for c in range(4)])
    sharp += unknown * (reduce(larger, [*(sharp * balance)]) / balance - sharp)

    # Light that fills less than two fifths of the window is taken from the pixel's own sample, in the colour around.
    no_hue = is_full[4] & ((full & 0b111) > 0)
    tile_row, tile_column = (divide(line, divisor(int(size)))[0] for line, size in ((row, down), (column, across)))
    of_tile = tile_row * dr.opaque(jit.UInt, white.shares.shape[1]) + tile_column
    shares = dr.select(no_hue, balance[3] / balance, dr.gather(jit.Array4f, share_planes, of_tile))
    small = _own_light(sample[4], at_site([*shares], site[4]), plane[3], noises[4]) * shares
    few = dr.minimum(FEW * reduce(larger, [*dr.gather(jit.Array4f, noise_gains, pixel)]), 1.0)
    sharp += few * (1.0 - 1.0 / (1.0 + dr.square(dr.square(contrast / SMALL)))) * (small - sharp)
    sharp += dr.gather(jit.Float, certain, of_tile) * (small - sharp)
    result = dr.empty(jit.Float, planes.size)
    dr.scatter(result, sharp, pixel, mode=dr.ReduceMode.NoConflicts)
    dr.eval(result)
    return np.asarray(result.numpy().reshape(planes.shape))


def _moments(window: list[Packet]) -> tuple[Packet, list[Packet]]:
    """Compute m and the rows of C of a window, relative to its middle pixel, because squares of light lose digits."""
    middle = window[len(window) // 2]
    away = [value - middle for value in window]
    offset = sum(away[1:], away[0]) / SIDE**2
    products = {
        (c, d): sum((a[c] * a[d] for a in away), 0.0) / SIDE**2 - offset[c] * offset[d]
        for c, d in combinations_with_replacement(range(4), 2)
    }
    return middle + offset, [arrays().Array4f([products[min(c, d), max(c, d)] for d in range(4)]) for c in range(4)]


def _colour_of_like_places(
    mean: Packet, far: list[Packet], shot: Packet, dark: Packet, faint: Float
) -> tuple[Packet, Packet]:
    """Compute r, the colour of those places `far` whose light resembles a window's, and D'^2, how far they differ.

    `faint` is the noise of W.
    """

    def in_noise(values: Packet) -> Packet:
        return 2.0 / shot * dr.sqrt(shot * larger(values, 0.0) + dark)

    own = in_noise(mean)
    alike = [dr.exp(-0.5 * dr.sum(dr.square(in_noise(values) - own))) for values in far]
    first, *others = [w * values for w, values in zip(alike, far, strict=True)]
    around, count = sum(others, first), sum(alike, 0.0)
    tint = larger(around, 0.0) / larger(around[3], larger(count * faint, TINY))
    tint = arrays().Array4f(tint[0], tint[1], tint[2], 1.0)
    first, *others = [w * dr.square(values - tint * values[3]) for w, values in zip(alike, far, strict=True)]
    return tint, sum(others, first) / larger(count, TINY)


def _lamp(white: list[Float], light: Float, contrast: Float, chi_squared: Float) -> Float:
    """Estimate to which degree the colour of a lamp is unknown, 0 to 1, from W's plane in the window and its mean."""
    lines = [[larger(value, 0.0) for value in white[i : i + SIDE]] for i in range(0, SIDE**2, SIDE)]
    lattices = [[w for line in lines[i::2] for w in line[j::2]] for i, j in product((0, 1), repeat=2)]
    least = reduce(dr.minimum, [sum(x[1:], x[0]) / len(x) for x in lattices])
    near = [lines[i][j] for i, j in product(range(REACH - 1, REACH + 2), repeat=2)]
    # With a factor of 1 instead of 1.5, the dark beside corners of windows turns grey; with 3, more hues remain around
    # lamps.
    between = (sum(near[1:], near[0]) / 9.0 - 1.5 * least) / larger(light, TINY)
    missed = dr.minimum(larger(chi_squared / MISSED, between), 1.0)
    return (1.0 - 1.0 / dr.square(larger(contrast, 1.0))) * missed


def _own_light(sample: Float, share: Float, of_white: Float, noise: tuple[Float, Float]) -> Float:
    """Estimate W at a pixel from the pixel's own sample, in the colour around it.

    A sample of another channel becomes W when it is divided by `share`, that channel's electrons per electron of W. The
    result lies between W's plane (`of_white`) and this value: the clearer the two differ beside noise, the nearer to
    the sample.
    """
    shot, dark = noise
    as_white_noise = larger((shot * larger(of_white, 0.0) + dark / share) / share, TINY)
    difference = sample / share - of_white
    seen = larger(1.0 - APART * as_white_noise / larger(dr.square(difference), TINY), 0.0)
    return of_white + seen * difference


def at_site(values: list[Float], site: UInt) -> Float:
    """Return the value whose index is `site`, thread by thread."""
    *rest, result = values
    for number, value in enumerate(rest):
        result = dr.select(site == number, value, result)
    return result


def _solve(lower: list[list[Float]], noise: list[Float], residual: list[Float]) -> list[Float]:
    """Solve (A + diag(noise)) z = residual by L D L^T, for a symmetric positive A that is given by its lower half.

    Rounding can't make a pivot smaller than its noise.
    """
    factors, inverses, forward = list[list[Float]](), list[Float](), list[Float]()  # L, 1 / D, L^-1 residual
    for i, line in enumerate(lower):
        scaled = list[Float]()  # L_ij D_j
        for j in range(i):
            scaled.append(line[j] - sum((scaled[k] * factors[j][k] for k in range(j)), 0.0))
        factors.append([value * inverse for value, inverse in zip(scaled, inverses, strict=True)])
        rest = line[i] - sum((scaled[k] * factors[i][k] for k in range(i)), 0.0)
        inverses.append(1.0 / (larger(rest, 0.0) + noise[i]))
        forward.append(residual[i] - sum((factors[i][k] * forward[k] for k in range(i)), 0.0))
    solution = [value * inverse for value, inverse in zip(forward, inverses, strict=True)]
    for i in reversed(range(len(lower))):
        for k in range(i):
            solution[k] = solution[k] - factors[i][k] * solution[i]
    return solution
