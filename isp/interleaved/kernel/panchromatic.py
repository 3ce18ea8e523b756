"""The formulas of `isp.interleaved.panchromatic` in Dr.Jit, by bands of rows, so that memory stays bounded.

One thread per tile computes shares, which change more slowly than light; one thread per pixel computes the guide.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from isp.anscombe import stabilise_channel
from isp.interleaved.kernel.accumulate import larger
from isp.interleaved.kernel.edges import TINY, at_site, channel_noise
from isp.interleaved.kernel.layout import packet_width
from isp.planes import tent
from rodcone.device_arrays import divide, divisor, upload
from rodcone.jit import Float, UInt, arrays, dr
from rodcone.types import Floats
from sensor.cfa import Tile
from sensor.raw import RawImage

WINDOW_PX = 6  # side of the window over which a channel's share is averaged, at least three tiles
APART_PX = 6  # distance between the 5 x 5 windows of the surroundings
DETAIL_PX = 5  # side of the window over which detail is distinguished from noise
FAINT = 12.0  # light, in units of W's dark noise, below which samples say nothing about colour
LEAST_LIGHT = 0.3  # value of m_W, which is about 1 in good light, below which colours approach a neutral
LEAST_SHARE = 0.02  # least share of a channel in W, as a fraction of a neutral's share
# Contrasts b / A of lines two pixels apart from which on they begin to count, and count fully. A wall beside a window
# that is 50 times as bright shows 0.28. From 0.05 on, leaves lose their green: infrared makes W and G alike there.
LINE_CONTRAST = 0.3, 0.45
LINE_ERRORS = 5.0  # standard errors of the means, by noise alone, that lines have to exceed
# Squares of the other two patterns, over that of lines, at which lines no longer count. A surface in sodium light among
# grey ones shows 0.33. At most 1, so that only upright or only lying lines count.
OTHER_PATTERNS = 0.3
# Squared standard deviations of a sample that count as noise below the means around it. With 9, dark lines two pixels
# apart in good light get half as bright again.
BELOW = 4.0
# Squared ratio of light to a sample's noise from which on such a sample isn't taken for noise. With 30, a star at 0.5
# cd/m^2 loses 0.5 dB.
DIM = 3.0
BAND_PIXELS = 2_000_000  # pixels that are processed together, with 60 bytes each

Numbers = list[Float]  # Dr.Jit arrays, such as one per channel
EIGHT = [0.0625, 0.125, 0.0625, 0.125, 0.125, 0.0625, 0.125, 0.0625]  # [1 2 1] / 4 down and across, without the middle


def window_steps(tile: int) -> range:
    """Return the steps in tiles from the middle of a share's window along one axis, for tiles of `tile` pixels."""
    half = max(WINDOW_PX // tile // 2, 1)
    return range(-half, half + 1)


def surroundings_steps(tile: int) -> range:
    """Return the steps in tiles from a tile to the middles of the surroundings' windows along one axis."""
    step = max(round(APART_PX / tile), 1)
    return range(-2 * step, 2 * step + 1, step)


def tent_radii(tile: Tile) -> tuple[int, int]:
    """Return the radii [pixels], down and across, of the smallest tent that weights all cells of a tile equally."""
    return max(len(tile) - 1, 1), max(len(tile[0]) - 1, 1)


def line_signs(raw: RawImage) -> Floats | None:
    """Return signs of the channels in upright lines, lying lines and a checkerboard, two pixels apart, (3, channel).

    Lines look like a colour only if the tile is 2 x 2 pixels of four channels. For any other tile, return None.
    """
    if len(raw.channels) != 4 or (len(raw.cfa), len(raw.cfa[0])) != (2, 2):
        return None
    cells = [divmod([*raw.cfa[0], *raw.cfa[1]].index(name), 2) for name in raw.channels]
    return np.array([[(-1.0) ** j, (-1.0) ** i, (-1.0) ** (i + j)] for i, j in cells]).T


@dataclass(frozen=True)
class Grid:
    """A grid of threads, one per pixel or per tile, and the addresses of their neighbours, mirrored at the borders.

    Attributes
    ----------
    row, column : UInt
        Position of each thread.
    row_starts, columns : UInt
        Address of each row and each column, from `margin` lines before the first one on.
    margin, size : int
        Lines of mirrored neighbours on each side, and number of threads.
    """

    row: UInt
    column: UInt
    row_starts: UInt
    columns: UInt
    margin: int
    size: int

    def around(self, rows: Iterable[int], columns: Iterable[int]) -> list[UInt]:
        """Return the addresses of neighbours at given steps in rows and columns, row by row."""
        number = type(self.row)
        of_rows = [dr.gather(number, self.row_starts, self.row + (self.margin + step)) for step in rows]
        of_columns = [dr.gather(number, self.columns, self.column + (self.margin + step)) for step in columns]
        return [r + c for r in of_rows for c in of_columns]

    def store(self, *values: Float) -> Float:
        """Evaluate some values of each thread and store them together."""
        real = type(values[0])
        width = packet_width(len(values))
        target = dr.empty(real, width * self.size)
        index = dr.arange(type(self.row), self.size)
        packet = dr.array_t(arrays().ArrayXf)([*values, *values[:1] * (width - len(values))])
        dr.scatter(target, packet, index, mode=dr.ReduceMode.NoConflicts)
        dr.eval(target)
        return target

    def load(self, source: Float, places: Sequence[UInt], values: int) -> list[Numbers]:
        """Load the values that were stored together at some addresses."""
        width = packet_width(values)
        kind = arrays().ArrayXf
        return [[*dr.gather(kind, source, place, shape=(width, self.size))][:values] for place in places]


def _grid(height: int, width: int, margin: int) -> Grid:
    jit = arrays()
    lines, columns = (np.pad(np.arange(size, dtype=np.uint32), margin, mode="reflect") for size in (height, width))
    row, column = divide(dr.arange(jit.UInt, height * width), divisor(width))
    return Grid(row, column, upload(lines * np.uint32(width)), upload(columns), margin, height * width)


@dataclass(frozen=True)
class Frame:
    """A frame and the numbers from which its guide is computed.

    Attributes
    ----------
    raw : RawImage
    cells : list of int
        Number of the channel at each cell of the tile, row by row.
    white : int
        Number of the channel that is used as W.
    ratios : (channel,) float64
        A neutral's electrons per electron of W.
    """

    raw: RawImage
    cells: list[int]
    white: int
    ratios: Floats


def guide_frame(raw: RawImage, ratios: Floats, white: int) -> tuple[NDArray[np.float32], ...]:
    """Compute the surroundings' shares, the guide [units of W's noise], the weight of lines, and the windows' shares.

    The shapes are (tile row, tile column, channel), (h, w), (tile row, tile column), and that of the first again. The
    formulas are those of `isp.interleaved.panchromatic.read_as_white`.
    """
    height, width = raw.shape
    down, across = len(raw.cfa), len(raw.cfa[0])
    frame = Frame(raw, [raw.channels.index(name) for line in raw.cfa for name in line], white, ratios)
    shares = np.empty((-(-height // down), -(-width // across), len(ratios)), np.float32)
    guide = np.empty((height, width), np.float32)
    weights, of_windows = np.empty(shares.shape[:2], np.float32), np.empty_like(shares)
    # Rows on which a pixel depends: windows of the surroundings, in tiles, tents, and the window of detail.
    reach = (window_steps(down)[-1] + surroundings_steps(down)[-1] + 6) * down
    step = max(BAND_PIXELS // width // down, 1) * down
    for first in range(0, height, step):
        last = min(first + step, height)
        start, end = max(first - reach, 0), min(last + reach, height)
        of_band, lines, windows, guide_e = _guide_band(frame, (start, end), slice(first - start, last - start))
        guide[first:last] = stabilise_channel(guide_e, raw, raw.channels[white])
        inside = slice((first - start) // down, -(-(last - start) // down))
        shares[first // down : -(-last // down)] = of_band[inside, :, : len(ratios)]
        weights[first // down : -(-last // down)] = lines[inside]
        of_windows[first // down : -(-last // down)] = windows[inside, :, : len(ratios)]
    return shares, guide, weights, of_windows


def _guide_band(frame: Frame, rows: tuple[int, int], inside: slice) -> tuple[NDArray[np.float32], ...]:
    """Compute a band of rows: surroundings' shares, weight of lines, windows' shares, and the guide g of `inside`.

    The guide is in electrons of W. x, v, N, t, T, D and g are those of `isp.interleaved.panchromatic.read_as_white`.
    """
    jit = arrays()
    raw = frame.raw
    shot, dark, _ = channel_noise(frame.raw)
    height, width = rows[1] - rows[0], raw.shape[1]
    down, across = len(raw.cfa), len(raw.cfa[0])
    pixels = _grid(height, width, max(DETAIL_PX // 2, *tent_radii(raw.cfa)))
    near = range(-1, 2)

    def opaque(values: Iterable[float]) -> Numbers:
        """Make numbers data of the kernel, so that other numbers don't compile it again."""
        return [dr.opaque(jit.Float, float(x)) for x in values]

    dn = raw.dn[rows[0] : rows[1]].astype(np.float32)
    electrons = upload((dn - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn))
    tile_row, tile_column = (
        divide(line, divisor(size)) for line, size in ((pixels.row, down), (pixels.column, across))
    )
    cells = upload(np.array(frame.cells, np.uint32))
    site = dr.gather(jit.UInt, cells, tile_row[1] * np.uint32(across) + tile_column[1])

    # Compute samples as if light were neutral (divided by n_o), and samples relative to the light around.
    neutral = opaque(frame.ratios)
    plain = electrons / at_site(neutral, site)
    dr.eval(plain, site)
    wide = [range(-radius, radius + 1) for radius in tent_radii(raw.cfa)]
    tents = np.outer(*(tent(radius) / tent(radius).sum() for radius in tent_radii(raw.cfa))).ravel()
    light = _weighted([dr.gather(jit.Float, plain, place) for place in pixels.around(*wide)], tents.tolist())
    faint = dr.opaque(jit.Float, float(FAINT * np.sqrt(dark[frame.white]) + TINY))
    dr.eval(light)
    samples = pixels.store(plain, electrons / larger(light, faint))
    tiles = _grid(-(-height // down), -(-width // across), max(*surroundings_steps(down), *surroundings_steps(across)))
    shares, around, lines_weight = _shares(frame, tiles, (height, width), samples, float(dark[frame.white]))

    # v: what W would read by this sample alone; its weight is 1 / N.
    of_tile = tile_row[0] * dr.opaque(jit.UInt, -(-width // across)) + tile_column[0]
    own = at_site(pixels.load(shares, [of_tile], len(frame.ratios))[0], site)
    shots, darks = at_site(opaque(shot), site), at_site(opaque(dark), site)

    def variance(light: Float) -> Float:
        """Return the variance of a sample that is read as W [e-^2], at some light."""
        return larger((shots * larger(light, 0.0) + darks / own) / own, TINY)

    weighed = pixels.store(electrons / own, 1.0 / variance(light))

    # Compute t, the weighted mean of v over the eight samples around.
    eight = pixels.load(weighed, pixels.around(near, near), 2)
    value, _ = eight.pop(4)
    total = _weighted([w for _, w in eight], EIGHT)
    mean = _weighted([w * v for v, w in eight], EIGHT) / total
    mean_variance = _weighted([w for _, w in eight], [t * t for t in EIGHT]) / dr.square(total)
    own_variance = variance(mean)
    difference = value - mean
    inverse = 1.0 / (own_variance + mean_variance)
    spread = pixels.store(dr.square(difference) * inverse, inverse)
    parts = pixels.store(mean, difference, mean_variance, own_variance)

    # Estimate the variance of detail that t misses.
    steps = range(-(DETAIL_PX // 2), DETAIL_PX // 2 + 1)
    lines = pixels.store(*_sums(pixels.load(spread, pixels.around([0], steps), 2)))
    squares, inverse = _sums(pixels.load(lines, pixels.around(steps, [0]), 2))
    nine = pixels.load(parts, pixels.around(near, near), 4)
    mean, difference, mean_variance, own_variance = nine[4]
    trusted = larger(squares - float(DETAIL_PX**2), 0.0) / inverse + mean_variance
    guide = mean + trusted / (trusted + own_variance) * difference

    # In the dark, what lies below all means around counts as far as it isn't noise.
    least = reduce(dr.minimum, [values[0] for values in nine])
    below, least_variance = larger(least - guide, 0.0), variance(least)
    dim = larger(1.0 - dr.square(larger(least, 0.0)) / (DIM * least_variance), 0.0)
    guide += dim * dr.minimum(BELOW * least_variance / larger(dr.square(below), TINY), 1.0) * below
    dr.eval(guide)
    by_tile = -(-height // down), -(-width // across)
    surroundings, of_windows = (values.numpy().reshape(*by_tile, -1) for values in (around, shares))
    weights = lines_weight.numpy().reshape(by_tile)
    return surroundings, weights, of_windows, guide.numpy().reshape(height, width)[inside]


def _shares(frame: Frame, tiles: Grid, shape: tuple[int, int], samples: Float, dark: float) -> tuple[Float, ...]:
    """Compute shares per tile, those of the window and those of the surroundings, and the weight of lines.

    `samples` holds each pixel's sample as if light were neutral, and relative to the light around. `shape` is the size
    of the band [pixels], and `dark` the variance of W's dark noise [e-^2].
    """
    jit = arrays()
    count = len(frame.ratios)
    down, across = len(frame.raw.cfa), len(frame.raw.cfa[0])
    height, width = (dr.opaque(jit.UInt, size) for size in shape)
    level, *neutral = (dr.opaque(jit.Float, float(x)) for x in (np.sqrt(dark) + TINY, *frame.ratios))
    sums, squares, counts = ([jit.Float(0.0)] * count for _ in range(3))
    light, light_squares = jit.Float(0.0), jit.Float(0.0)
    for (i, j), channel in zip(np.ndindex(down, across), frame.cells, strict=True):
        row, column = tiles.row * np.uint32(down) + np.uint32(i), tiles.column * np.uint32(across) + np.uint32(j)
        inside = (row < height) & (column < width)
        place = dr.select(inside, row * width + column, 0)
        plain, beside = (dr.select(inside, value, 0.0) for value in tiles.load(samples, [place], 2)[0])
        sums[channel] = sums[channel] + beside
        squares[channel] = squares[channel] + dr.square(beside)
        counts[channel] = counts[channel] + dr.select(inside, jit.Float(1.0), 0.0)
        light = light + plain
        light_squares = light_squares + dr.square(plain)
    stored = [tiles.store(*values) for values in (sums, squares, counts, [light, light_squares])]

    # Average over each channel's samples, and estimate the error of the mean.
    places = tiles.around(window_steps(down), window_steps(across))
    sums, squares, counts = (_sums(tiles.load(source, places, count)) for source in stored[:3])
    light, light_squares = _sums(tiles.load(stored[3], places, 2))
    means = [total / n for total, n in zip(sums, counts, strict=True)]
    samples_all = sum(counts[1:], counts[0])
    contrast = larger(light_squares / samples_all / dr.square(larger(light / samples_all, level)) - 1.0, 0.0)
    alias = contrast * dr.square(contrast)
    error = [
        larger(s / n - dr.square(m), 0.0) / n + alias / n * dr.square(m)
        for s, n, m in zip(squares, counts, means, strict=True)
    ]
    white = frame.white
    mean_planes, error_planes = tiles.store(*means), tiles.store(*error, larger(light / samples_all, level))

    # Use the window's shares as far as its samples are certain, and for the rest those of the surroundings.
    rows, columns = surroundings_steps(down), surroundings_steps(across)
    lines = tiles.store(*_sums(tiles.load(mean_planes, tiles.around([0], columns), count)))
    far = _sums(tiles.load(lines, tiles.around(rows, [0]), count))
    far = [larger(total / (len(rows) * len(columns)), 0.0) for total in far]
    here = tiles.around([0], [0])
    means, (*error, light) = tiles.load(mean_planes, here, count)[0], tiles.load(error_planes, here, count + 1)[0]
    far = _lifted(far, neutral, white)
    ratio = [f / far[white] for f in far]
    around = [larger(r, LEAST_SHARE * n) for r, n in zip(ratio, neutral, strict=True)]
    means, weight = _without_lines(means, error, around, light, frame.raw)
    away = [m - r * means[white] for m, r in zip(means, ratio, strict=True)]
    errors = [larger(e + dr.square(r) * error[white], TINY) for e, r in zip(error, ratio, strict=True)]
    chi_squared = sum((dr.square(a) / e for a, e in zip(away, errors, strict=True)), 0.0)
    hidden = dr.minimum(1.0 / larger(chi_squared, TINY), 1.0)
    means = _lifted([larger(m - hidden * a, 0.0) for m, a in zip(means, away, strict=True)], neutral, white)
    of_window = [larger(m / means[white], LEAST_SHARE * n) for m, n in zip(means, neutral, strict=True)]
    return tiles.store(*of_window), tiles.store(*around), tiles.store(weight)


def _without_lines(
    means: Numbers, error: Numbers, around: Numbers, light: Float, raw: RawImage
) -> tuple[Numbers, Float]:
    """Subtract from the channels' means what grey lines two pixels apart would show, and return their weight too."""
    signs = line_signs(raw)
    if signs is None:
        return means, dr.zeros(type(means[0]), dr.width(means[0]))
    as_white = [m / share for m, share in zip(means, around, strict=True)]
    level = larger(sum(as_white[1:], as_white[0]) / 4.0, TINY)
    shot, dark, _ = channel_noise(raw)
    samples = len(window_steps(2)) ** 2
    noise = [
        (dr.opaque(type(light), float(k)) * larger(m, 0.0) + dr.opaque(type(light), float(d)) / light) / light / samples
        for k, d, m in zip(shot, dark, means, strict=True)
    ]
    scatter, noise_variance = (
        sum((s / dr.square(share) for s, share in zip(of_means, around, strict=True)), 0.0) / 16.0
        for of_means in (error, noise)
    )
    variance = larger(scatter, LINE_ERRORS**2 * noise_variance)
    patterns = [_weighted(as_white, (of_pattern / 4.0).tolist()) for of_pattern in signs]
    all_squares = sum((dr.square(b) for b in patterns), 0.0)
    least, full = LINE_CONTRAST
    weights = list[Float]()
    for b in patterns[:2]:
        square = larger(dr.square(b), TINY)
        alone = 1.0 - (all_squares - square) / (OTHER_PATTERNS * square)
        clear = dr.minimum((dr.abs(b) / level - least) / (full - least), 1.0)
        weights.append(larger(alone, 0.0) * larger(clear, 0.0) * larger(1.0 - variance / square, 0.0))
    upright, lying = (weight * b for weight, b in zip(weights, patterns[:2], strict=True))
    means = [
        m - share * (float(s) * upright + float(t) * lying)
        for m, share, s, t in zip(means, around, signs[0], signs[1], strict=True)
    ]
    return means, larger(*weights)


def _lifted(means: Numbers, neutral: Numbers, white: int) -> Numbers:
    """Add so much of a neutral to the channels' means that W's mean is at least `LEAST_LIGHT`."""
    missing = larger(LEAST_LIGHT - means[white], 0.0)
    return [mean + missing * n for mean, n in zip(means, neutral, strict=True)]


def _weighted(values: Numbers, weights: Sequence[float]) -> Float:
    return sum((float(w) * value for w, value in zip(weights, values, strict=True)), 0.0)


def _sums(values: list[Numbers]) -> Numbers:
    return [sum(parts[1:], parts[0]) for parts in zip(*values, strict=True)]
