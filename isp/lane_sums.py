"""What lanes give: where it lies, lane by lane, and the picture that is made of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.kernel import Lanes
from isp.lane_shape import PACKET, Shape
from isp.strips import upload
from isp.tiles import Pattern, lane_size, tile_grid
from isp.weighted_sums import HEADROOM
from rodcone.jit import arrays, dr
from sensor.cfa import channels
from sensor.raw import RawImage

Index = NDArray[np.uint32]


@dataclass(frozen=True)
class Sums:
    """What all lanes of a strip give in Dr.Jit arrays, [class, tile down, tile across, pixel], as `Shape.pixels`.

    Attributes
    ----------
    weight, largest : Float
        Sum of the weights in units of 2^largest.
    mean : Float
        Weighted mean of the samples.
    noise_gain : Float or None
        Sum of the squared weights over the squared sum; None where nobody asks for it.
    """

    weight: Any
    mean: Any
    noise_gain: Any
    largest: Any


def empty_sums(raw: RawImage, rows: tuple[int, int], pattern: Pattern, noise: bool) -> Sums:
    """Room for what the lanes of some rows give; a lane that sums quickly leaves its unit as it is."""
    jit = arrays()
    tiles = int(np.prod(tile_grid(raw.shape[1], rows, pattern))) * int(np.prod(pattern.size))
    count = tiles * int(np.prod(lane_size(pattern)))
    weight, mean, noise_gain = (dr.empty(jit.Float, count) for _ in range(3))
    return Sums(weight, mean, noise_gain if noise else None, dr.full(jit.Float, -HEADROOM, count))


def put(pixels: list[tuple[Any, ...]], lanes: Lanes, shape: Shape, sums: Sums) -> list[Any]:
    """Store sums, a packet at once: a lane's lie side by side. What is stored into is returned, not evaluated yet."""
    jit, count = arrays(), len(pixels)
    packet = min(PACKET, count & -count)  # the largest power of two that divides it
    stored = [
        (weight, value / weight, *(square / dr.square(weight) for square in more[: shape.noise]), *more[shape.noise :])
        for weight, value, *more in pixels
    ]
    targets = [sums.weight, sums.mean] + [sums.noise_gain] * shape.noise + [sums.largest] * shape.exact
    for number, target in enumerate(targets):
        for first in range(0, count, packet):
            values = jit.ArrayXf([pixel[number] for pixel in stored[first : first + packet]])
            place = lanes.place // packet + first // packet
            dr.scatter(target, values, place, mode=dr.ReduceMode.NoConflicts)
    return targets


def finish(sums: Sums, raw: RawImage, rows: tuple[int, int], pattern: Pattern, results: list[Any]) -> None:
    """Put f_i(x) of eq. (1) [e-], and sum w^2 / (sum w)^2 where squares were summed, into the whole frame's results.

    Each is a Dr.Jit array, [row, column, channel].
    """
    jit, width, planes = arrays(), raw.shape[1], list[list[Any]]()
    parts = [[upload(place) for place in places] for places in _places(raw, rows, pattern)]
    pixel = dr.arange(jit.UInt, (rows[1] - rows[0]) * width)
    by_row, by_column = (
        [dr.gather(jit.UInt, part, at) for part in of_axis]
        for of_axis, at in zip(parts, _divide(pixel, width), strict=True)
    )
    stored = [sums.weight, sums.largest, sums.mean] + [sums.noise_gain] * (sums.noise_gain is not None)
    gain_e_per_dn = dr.opaque(jit.Float, raw.gain_e_per_dn)
    for letter in channels(raw.cfa):
        cells = np.argwhere(np.array(pattern.cells) == pattern.letters.index(letter)).tolist()
        mean, *noise_gain = _merge(
            [[dr.gather(jit.Float, array, by_row[i] + by_column[j]) for array in stored] for i, j in cells]
        )
        planes.append([mean * gain_e_per_dn, *noise_gain])
    place = pixel + dr.opaque(jit.UInt, rows[0] * width)
    for result, values in zip(results, zip(*planes, strict=True), strict=True):
        dr.scatter(result, jit.ArrayXf([*values]), place, mode=dr.ReduceMode.NoConflicts)
    dr.eval(results)


def _merge(parts: list[list[Any]]) -> list[Any]:
    """Mean[, noise gain] of the samples at several cells, whose weights are in units of their own."""
    if len(parts) == 1:
        return parts[0][2:]
    common = parts[0][1]
    for _, largest, *_ in parts[1:]:
        common = dr.maximum(common, largest)
    weights = [weight * dr.exp2(largest - common) for weight, largest, *_ in parts]
    total = sum(weights[1:], weights[0])
    shares = [weight / total for weight in weights]
    means, *noise_gains = zip(*(part[2:] for part in parts), strict=True)
    result = [sum(share * mean for share, mean in zip(shares, means, strict=True))]
    return result + [
        sum(dr.square(share) * gain for share, gain in zip(shares, gains, strict=True)) for gains in noise_gains
    ]


def _divide(number: Any, divisor: int) -> tuple[Any, Any]:
    """Quotient and rest; exact, for half a step to the next whole number is far above the rounding of 2^32/divisor."""
    jit = arrays()
    inverse, whole = dr.opaque(jit.Float64, 1.0 / divisor), dr.opaque(jit.UInt, divisor)
    quotient = jit.UInt((jit.Float64(number) + 0.5) * inverse)
    return quotient, number - quotient * whole


def _places(raw: RawImage, rows: tuple[int, int], pattern: Pattern) -> tuple[list[Index], list[Index]]:
    """Where `Sums` hold what the samples at each cell of the tile give: a part by its row and one by its column."""
    (down, across), size = pattern.size, lane_size(pattern)
    grid, count = tile_grid(raw.shape[1], rows, pattern), size[0] * size[1]
    by_cell, by_column, by_class = count // (down * across), size[0] // down, grid[0] * grid[1] * count
    places: tuple[list[Index], list[Index]] = [], []
    row, column = np.arange(*rows), np.arange(raw.shape[1])
    for cell in range(down):
        back = (cell - row) % down
        tile, r = np.divmod(row - rows[0] + back, size[0])
        in_tile = r % down * across * by_cell + r // down
        places[0].append((back * across * by_class + tile * grid[1] * count + in_tile).astype(np.uint32))
    for cell in range(across):
        back = (cell - column) % across
        tile, c = np.divmod(column + back, size[1])
        in_tile = c % across * by_cell + c // across * by_column
        places[1].append((back * by_class + tile * count + in_tile).astype(np.uint32))
    return places
