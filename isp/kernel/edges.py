"""Strong edges in Dr.Jit: what `isp.colour.edges` says, for some rows of the frame at a time.

The first pass looks at the window around each pixel of these rows, and of one row more above and below; the second
makes the channels from this and the neighbours', everywhere, then once more in rims. A pixel's four channels lie
together and are loaded at once: packet row * width + column.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.kernel.accumulate import larger
from rodcone.device_arrays import Divisor, divide, divisor, tile_cell, upload
from rodcone.jit import arrays, dr
from sensor.cfa import channels
from sensor.raw import RawImage

REACH = 2  # pixels of a window to either side; 1 and 3 leave more error
HALO = REACH + 1  # whose neighbours have windows too
STRIP_PIXELS = 2**21  # that go through the passes together: 100 MB
# From the first number on something counts, from the second on fully.
SIGMAS = 3.0, 10.0  # a channel's contrast, in noise of a sample
TOGETHER = 0.5, 0.8  # rise of the light over the colours' together: 1 where they rise alike
RELATIVE = 0.4, 0.7  # contrast of a pixel's own channel, over the largest
NOISE = 2.0, 4.0  # distance of a sample from its plane, in its noise
OFF = 0.05, 0.15  # distance of the samples around from their planes, over the channel's contrast
FILLS = 0.25, 0.5  # what all pixels of 2 x 2 hold over the dark, of the most: a tent shares one pixel's light to 0.25
OVER_SIGMAS = 2.0  # noise of a lamp, which is no light over the dark around
FULL = 0.9  # of saturation, from which on there may be more light than was read
EVEN = 1e-3  # squared difference of shares that is none
TINY_E = 1e-9  # where nothing differs


@dataclass(frozen=True)
class Pixels:
    """Some pixels, numbered by `target` in the frame: their planes, window and share.

    `together` is how far the colours rise together, `known` how far the share is known and needed.
    """

    target: Any
    plane: Any
    least: Any
    most: Any
    share: Any
    known: Any
    together: Any

    @property
    def step(self) -> Any:
        """Of each channel, least to most."""
        return larger(self.most - self.least, TINY_E)


@dataclass(frozen=True)
class Frame:
    """What the passes read, Dr.Jit arrays.

    Attributes
    ----------
    planes : Float
        Packets of R, G, B and W [e-].
    samples : Float
        [e-].
    rows, columns : UInt
        Of the frame, mirrored at its borders: row r stands at HALO + r.
    cells : UInt
        Channel of each of the tile's cells.
    tile, width : Divisor
        Rows and columns of the tile; of the frame.
    gains : Array4f
        White balance; W's is 0, for it is no colour.
    white_gain, dark_variance, full_e : Float
        W's white balance; variance of the dark noise [e-^2]; from where a channel counts as full [e-].
    """

    planes: Any
    samples: Any
    rows: Any
    columns: Any
    cells: Any
    tile: tuple[Divisor, Divisor]
    width: Divisor
    gains: Any
    white_gain: Any
    dark_variance: Any
    full_e: Any


def even_strips(
    raw: RawImage, planes: NDArray[np.float32], gains: NDArray[np.float64], alpha: NDArray[np.float64]
) -> NDArray[np.float32]:
    """As `isp.colour.edges.even_edges`."""
    jit, names, (height, width) = arrays(), channels(raw.cfa), raw.shape
    mirrored = (np.pad(np.arange(length, dtype=np.uint32), HALO, mode="reflect") for length in raw.shape)
    rows, columns = map(upload, mirrored)
    frame = Frame(
        planes=upload(planes),
        samples=upload((raw.dn.astype(np.float32) - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn)),
        rows=rows,
        columns=columns,
        cells=upload(np.array([[names.index(name) for name in line] for line in raw.cfa], np.uint32)),
        tile=(divisor(len(raw.cfa)), divisor(len(raw.cfa[0]))),
        width=divisor(width),
        # Opaque, W's 0 too: a literal takes the width of what it is multiplied with (Dr.Jit 1.5).
        gains=jit.Array4f([dr.opaque(jit.Float, float(gain)) for gain in (*gains[:3], 0.0)]),
        white_gain=dr.opaque(jit.Float, float(gains[3])),
        dark_variance=dr.opaque(jit.Float, raw.dark_noise_e**2),
        full_e=dr.opaque(jit.Float, FULL * raw.saturation_e),
    )
    result, step = dr.empty(jit.Float, planes.size), max(STRIP_PIXELS // width, 1)
    for start in range(0, height, step):
        count, first = min(step, height - start), dr.opaque(jit.UInt, start)
        windows = _windows(jit, frame, first, (count + 2) * width)
        pixels = _pixels(jit, frame, windows, first, dr.arange(jit.UInt, count * width))
        evened = _held(frame, pixels, pixels.least + pixels.share * pixels.step)
        _store(pixels, pixels.plane + pixels.known * _moves(frame, pixels) * (evened - pixels.plane), result)
        mixed = alpha[start : start + count]
        rims = np.flatnonzero((mixed > 0.0) & (mixed < 1.0)).astype(np.uint32)
        if rims.size:
            pixels = _pixels(jit, frame, windows, first, upload(rims))
            _store(pixels, _rims(jit, frame, pixels), result)
    return np.asarray(result.numpy().reshape(planes.shape))


def _windows(jit: Any, frame: Frame, first: Any, count: int) -> tuple[Any, Any, Any]:
    """Packets of the least and of the most of each channel, and of share, trust, squared distance and rise together.

    Of `count` pixels from the row before `first` on.
    """
    # The window: row r, seen from r - REACH on, begins at HALO - REACH + r, and the first r is `first` - 1.
    line, column = divide(dr.arange(jit.UInt, count), frame.width)
    rows = _window_lines(frame.rows, first + line + (HALO - REACH - 1), frame.width.number)
    columns = _window_lines(frame.columns, column + (HALO - REACH), 1)
    values = [[dr.gather(jit.Array4f, frame.planes, row + column) for column in columns] for row in rows]
    least, most = (reduce(pick, [reduce(pick, line) for line in values]) for pick in (_smaller, larger))
    light = [dr.sum(frame.gains * value) for line in values for value in line]
    rise = reduce(larger, light) - reduce(_smaller, light)

    # By the pixel's own channel; its step is 0 where it is full.
    step, full = larger(most - least, TINY_E), most >= frame.full_e
    largest = reduce(larger, dr.select(full, 0.0, step / larger(most + least, TINY_E)))
    pixel = rows[REACH] + columns[REACH]
    site = dr.gather(jit.UInt, frame.cells, tile_cell(pixel, frame.width, frame.tile))
    value, low, own = (_own(part, site) for part in (values[REACH][REACH], least, dr.select(full, 0.0, step)))
    sample = dr.gather(jit.Float, frame.samples, pixel)
    away = sample - value
    away *= _ramp(dr.abs(away) / dr.sqrt(larger(value, 0.0) + frame.dark_variance), NOISE)
    trust = _ramp(own / dr.sqrt(larger(low + own, 0.0) + frame.dark_variance), SIGMAS)
    trust *= _ramp(own / larger(low + low + own, TINY_E) / larger(largest, TINY_E), RELATIVE)
    share = _smaller(larger((value + away - low) / larger(own, TINY_E), 0.0), 1.0)
    off = dr.select(own > 0.0, _smaller(dr.abs(away) / larger(own, TINY_E), 1.0), 0.0)
    together = _ramp(rise / dr.sum(frame.gains * step), TOGETHER)

    told = jit.Array4f(share, trust, dr.square(off), together)
    windows = tuple(dr.empty(jit.Float, 4 * count) for _ in range(3))
    for target, part in zip(windows, (least, most, told), strict=True):
        dr.scatter(target, part, dr.arange(jit.UInt, count), mode=dr.ReduceMode.NoConflicts)
    dr.eval(windows)
    return windows


def _pixels(jit: Any, frame: Frame, windows: tuple[Any, Any, Any], first: Any, pixel: Any) -> Pixels:
    """Pixels by their numbers from row `first` on."""
    # Share, trust, squared distance and rise together, here and beside; the windows begin a row early.
    line, column = divide(pixel, frame.width)
    beside = [dr.gather(jit.UInt, frame.columns, column + k) for k in (HALO - 1, HALO, HALO + 1)]
    told = [
        [dr.gather(jit.Array4f, windows[2], (line + k) * frame.width.number + at) for at in beside] for k in range(3)
    ]

    # By the neighbours: each axis counts by the other's difference.
    sums, count, trusted = jit.Float(0.0), jit.Float(0.0), jit.Float(0.0)
    across, along = (told[1][0], told[1][2]), (told[0][1], told[2][1])
    for axis, other in ((across, along), (along, across)):
        even = dr.square(other[0][0] - other[1][0]) + EVEN
        for share, trust, *_ in axis:
            sums += even * trust * share
            count += even * trust
            trusted += trust
    share, own, _, together = told[1][1]
    missed = _ramp(dr.sqrt(sum((part[2] for beside in told for part in beside), jit.Float(0.0)) / 9.0), OFF)
    at, target = pixel + frame.width.number, pixel + first * frame.width.number
    return Pixels(
        target=target,
        plane=dr.gather(jit.Array4f, frame.planes, target),
        least=dr.gather(jit.Array4f, windows[0], at),
        most=dr.gather(jit.Array4f, windows[1], at),
        share=own * share + (1.0 - own) * sums / larger(count, TINY_E),
        known=(own + (1.0 - own) * _smaller(trusted, 1.0)) * missed,
        together=together,
    )


def _rims(jit: Any, frame: Frame, pixels: Pixels) -> Any:
    """Channels in rims."""
    plane, least, most, step = pixels.plane, pixels.least, pixels.most, pixels.step
    row, column = divide(pixels.target, frame.width)
    rows = _window_lines(frame.rows, row + (HALO - REACH), frame.width.number)
    columns = _window_lines(frame.columns, column + (HALO - REACH), 1)
    values = [[dr.gather(jit.Array4f, frame.planes, row + column) for column in columns] for row in rows]
    pairs = [[_smaller(a, b) for a, b in pairwise(line)] for line in values]
    squares = [_smaller(a, b) for both in pairwise(pairs) for a, b in zip(*both, strict=True)]
    fills = _ramp(reduce(_smaller, [*((reduce(larger, squares) - least) / step)][:3]), FILLS)

    # An edge where the lamp is large.
    colours = jit.Array4f(1.0, 1.0, 1.0, 0.0)
    contrast = colours * dr.square(step / larger(most + least, TINY_E))
    mean = dr.sum(contrast * (plane - least) / step) / larger(dr.sum(contrast), TINY_E)
    large = dr.select(dr.any(_full_colours(frame, pixels)), 0.0, fills * pixels.known)
    evened = _held(frame, pixels, least + (large * pixels.share + (1.0 - large) * mean) * step)

    moved = plane + fills * _moves(frame, pixels) * (evened - plane)

    # No colour where it is smaller than 2 x 2 pixels.
    noise = OVER_SIGMAS * dr.sqrt(larger(moved, 0.0) + frame.dark_variance)
    over = reduce(larger, [*((moved - least - noise) / larger(moved + least, TINY_E))][:3])
    grey = dr.sum(frame.gains * moved) / 3.0 / (frame.gains + (1.0 - colours) * frame.white_gain)
    colourless = (1.0 - fills) * pixels.together * dr.square(_smaller(larger(over, 0.0), 1.0))
    return moved + colourless * (grey - moved)


def _full_colours(frame: Frame, pixels: Pixels) -> Any:
    full = pixels.most >= frame.full_e
    return full & type(full)(True, True, True, False)


def _held(frame: Frame, pixels: Pixels, evened: Any) -> Any:
    """Lower no colour that is full nearby."""
    return dr.select(_full_colours(frame, pixels), larger(evened, pixels.plane), evened)


def _moves(frame: Frame, pixels: Pixels) -> Any:
    """How far channels move to an edge: as their step is over the noise of a sample, and colours rise together."""
    sigmas = pixels.step / dr.sqrt(larger(pixels.most, 0.0) + frame.dark_variance)
    return _ramp(sigmas, SIGMAS) * pixels.together


def _store(pixels: Pixels, values: Any, result: Any) -> None:
    dr.scatter(result, values, pixels.target, mode=dr.ReduceMode.NoConflicts)
    dr.eval(result)


def _window_lines(mirrored: Any, first: Any, step: Any) -> list[Any]:
    """Rows or columns of the window, in packets."""
    return [dr.gather(type(first), mirrored, first + k) * step for k in range(2 * REACH + 1)]


def _own(values: Any, site: Any) -> Any:
    """That of four values whose number is `site`."""
    *rest, result = values
    for number, value in enumerate(rest):
        result = dr.select(site == number, value, result)
    return result


def _smaller(a: Any, b: Any) -> Any:
    """The smaller one, as `isp.kernel.accumulate.larger`."""
    return dr.select(a < b, a, b)


def _ramp(value: Any, limits: tuple[float, float]) -> Any:
    """0 up to the first limit, 1 from the second on."""
    return _smaller(larger((value - limits[0]) * (1.0 / (limits[1] - limits[0])), 0.0), 1.0)
