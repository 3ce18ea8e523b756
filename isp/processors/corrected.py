"""Piecewise linear estimation, corrected by a small network that was trained for RGBW and Bayer alike.

The network sees the picture of `isp.processors.piecewise`, the mosaic and its noise, and adds a residual to the
picture's encoded sRGB. It is a U-net (O. Ronneberger, P. Fischer, T. Brox, MICCAI 2015) over tiles of 2x2 pixels.
Everything is relative to the picture's white and in standard deviations of the noise, so that one set of weights serves
any sensor and light. It is trained to give what exact planes of R, G and B become by the camera's own matrix: it
changes what the mosaic and the noise hid, and leaves the choice of colours to the matrix
(docs/decisions/0068). `benchmarks/train_net.py` wrote the weights; `card` says what they were trained on.
"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from os import cpu_count
from pathlib import Path
from types import MappingProxyType

import numpy as np

from isp.blas import one_thread
from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.ple.prior import own_prior
from isp.processors.convolution import convolve
from isp.processors.demosaic import require_bayer
from isp.processors.piecewise import PiecewisePicture, develop_planes
from isp.strips import strips
from rodcone.colour_spaces import decode_srgb, encode_srgb, white_of
from rodcone.errors import InputError
from rodcone.types import Image, Singles
from sensor.cfa import RGBW, Tile, is_rgbw, mask
from sensor.raw import RawImage, noise_at_sites

WHITE_FOR_GREEN: Tile = ("RG", "WB")  # Bayer's tile with W in place of one of its G
LEAK = 0.1  # slope of a feature under 0: without it all of the first ones died
INPUTS = 9  # numbers a pixel that the network sees
TILES = 8  # pixels: the network takes frames whose sides are a multiple of it
MOST_MISFIT = 5.0  # standard deviations by which a sample may lie beside the picture
MISFIT_UNIT = 3.0  # standard deviations that are a misfit of 1
LEAST_NOISE_E = 1e-3
OWN = Path(__file__).with_name("corrected.npz")  # weights for both mosaics, in half precision
CARD = "card"  # name of the text in that file
# Two views of a frame that has one row and one column more than whole tiles: as it is, without the first, and turned,
# without the last. Both begin with R.
REVERSALS = (slice(1, None), slice(-2, None, -1))
STRIP_ROWS = 512  # rows that are corrected together, so that features of a whole frame never fill the memory
REACH = 64  # rows beyond a strip on which its pixels depend: 56, and what halves of tiles round up
# Names of the layers, with what each takes from the one before: a step of 2 goes to half the size.
STEPS = MappingProxyType(
    {
        "first": 1,
        **dict.fromkeys(("fine1", "fine2"), 1),
        "half1": 2,
        "half2": 1,
        "quarter1": 2,
        "quarter2": 1,
        "quarter3": 1,
        "quarter4": 1,
        **dict.fromkeys(("up1", "up2", "up3", "last1", "last2", "residual"), 1),
    }
)
Weights = Mapping[str, Singles]


def picture_corrected_rgbw(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop an RGBW raw image whose tile has R and G side by side, as `picture_ple_rgbw` does, and correct it.

    Raises
    ------
    InputError
        For another tile.
    """
    if not is_rgbw(raw.cfa) or _green_diagonal(raw.cfa):
        raise InputError(
            f"raw: mosaic {raw.cfa} is not R, G, B and W in 2x2 with G beside R; allowed here: {RGBW} and "
            f"{WHITE_FOR_GREEN}, shifted or transposed; use ple, which develops any mosaic of R, G, B and W"
        )
    return corrected(raw, develop_planes(raw, colours, balance, own_prior()), own_weights())


def picture_corrected_bayer(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a Bayer raw image as `picture_ple_bayer` does, and correct it."""
    require_bayer(raw.cfa)
    return corrected(raw, develop_planes(raw, colours, balance, own_prior()), own_weights())


@cache
def own_weights() -> Weights:
    """Return the project's own weights, by layer."""
    with np.load(OWN) as file:
        return MappingProxyType({name: file[name].astype(np.float32) for name in file.files if name != CARD})


def card() -> str:
    """Return what the project's own weights were trained on, for how long, and by which seed."""
    with np.load(OWN) as file:
        return str(file[CARD])


def corrected(raw: RawImage, developed: PiecewisePicture, weights: Weights) -> Picture:
    """Add the network's residual to a picture; as it is where nothing is lit.

    The residual is the mean of two: that of the frame as it is, and that of the frame turned by half a turn. The
    network's errors, such as a pattern of the tile, differ in part between them, so that the mean has less of them.
    """
    picture = developed.picture
    white = white_of(picture.rgb)
    if white <= 0:
        return picture
    # The network's tile begins with R, and G follows it in the row.
    transposed = _green_below(raw.cfa)
    seen = correction_inputs(raw, developed, white)
    phase = divmod("".join(raw.cfa).index("R"), 2)
    if transposed:
        seen, phase = seen.swapaxes(0, 1), phase[::-1]
    shape = seen.shape[:2]
    # Reflection keeps the mosaic. One row and column more than whole tiles let the turned frame begin with R too.
    sides = [(offset + 1, TILES - (length + offset) % TILES) for length, offset in zip(shape, phase, strict=True)]
    wide = np.pad(seen, [*sides, (0, 0)], mode="reflect")
    change = np.zeros((*wide.shape[:2], 3), np.float32)
    for way in REVERSALS:
        change[way, way] += _residual_of_strips(wide[way, way], weights) / len(REVERSALS)
    change = change[phase[0] + 1 :, phase[1] + 1 :][: shape[0], : shape[1]]
    change = change.swapaxes(0, 1) if transposed else change
    return Picture(added(picture.rgb, change.astype(np.float64), white), picture.balance)


def _residual_of_strips(seen: Singles, weights: Weights) -> Singles:
    """Return the residual (h, w, 3) for what is seen (h, w, INPUTS), strip by strip."""
    found = np.empty((*seen.shape[:2], 3), np.float32)
    for rows in strips(len(seen), STRIP_ROWS):
        top = max(rows.start - REACH, 0)
        part = unpack(residual(pack(seen[top : rows.stop + REACH]), weights))
        found[rows] = part[rows.start - top :][: rows.stop - rows.start]
    return found


def correction_inputs(raw: RawImage, developed: PiecewisePicture, white: float) -> Singles:
    """Return what the network sees of a frame, shape (h, w, INPUTS), relative to the picture's white [e-].

    Encoded sRGB of the picture; the mosaic's own sample, encoded likewise; its noise in encoded units; how many
    standard deviations it lies over the picture's planes, over `MISFIT_UNIT`; whether it is full; the plane of W, or of
    green; and whether the site is W's.
    """
    planes, names = developed.planes, raw.channels
    expected_e, gain = np.empty(raw.shape), np.empty(raw.shape)
    for index, name in enumerate(names):
        at = mask(raw.cfa, name, raw.shape)
        expected_e[at], gain[at] = planes[..., index][at], developed.gains[index] / white
    noise_e = np.maximum(np.sqrt(noise_at_sites(raw, expected_e)), LEAST_NOISE_E)
    read_e = raw.electrons
    misfit = np.clip((read_e - expected_e) / noise_e, -MOST_MISFIT, MOST_MISFIT) / MISFIT_UNIT
    noise = np.minimum(noise_e * gain * _encoding_slope(expected_e * gain), 1.0)
    broad = names.index("W") if "W" in names else names.index(raw.unit_channel)
    layers = (
        *np.moveaxis(encode_srgb(developed.picture.rgb / white), -1, 0),
        encode_srgb(read_e * gain),
        noise,
        misfit,
        raw.saturated,
        encode_srgb(planes[..., broad] * (developed.gains[broad] / white)),
        mask(raw.cfa, "W", raw.shape),
    )
    return np.stack([np.asarray(layer, np.float32) for layer in layers], axis=-1)


def added(rgb: Image, change: Image, white: float) -> Image:
    """Add a change of encoded sRGB to linear sRGB whose white is `white`; without a change, the picture to the bit.

    What is brighter than white keeps its excess; what is under black rises from black.
    """
    encoded = encode_srgb(rgb / white)
    step = white * (decode_srgb(np.clip(encoded + change, 0.0, 1.0)) - decode_srgb(encoded))
    return np.where((rgb < 0) & (change > 0), 0.0, rgb) + step


def pack(pixels: Singles) -> Singles:
    """Put the four pixels of each tile (h, w, n) side by side, (h/2, w/2, 4 n)."""
    high, wide, count = pixels.shape
    tiles = pixels.reshape(high // 2, 2, wide // 2, 2, count).transpose(0, 2, 4, 1, 3)
    return np.ascontiguousarray(tiles.reshape(high // 2, wide // 2, 4 * count))


def unpack(tiles: Singles) -> Singles:
    """Invert `pack`."""
    high, wide, count = tiles.shape
    return tiles.reshape(high, wide, count // 4, 2, 2).transpose(0, 3, 1, 4, 2).reshape(2 * high, 2 * wide, count // 4)


def residual(packed: Singles, weights: Weights) -> Singles:
    """Return the network's residual (h, w, 12) for tiles (h, w, 4 INPUTS); both sides are a multiple of 4."""
    with one_thread(), ThreadPoolExecutor(cpu_count()) as threads:

        def layer(name: str, values: Singles) -> Singles:
            filters = weights[f"{name}.weight"]
            edge = filters.shape[-1] // 2
            wide = np.pad(values, [(edge, edge), (edge, edge), (0, 0)])
            return convolve(wide, filters, weights[f"{name}.bias"], STEPS[name], threads.map)

        def through(values: Singles, *names: str) -> Singles:
            for name in names:
                values = layer(name, np.maximum(values, np.float32(LEAK) * values))
            return values

        fine = layer("first", packed)
        fine += through(fine, "fine1", "fine2")
        half = through(fine, "half1", "half2")
        half += _doubled(through(half, "quarter1", "quarter2", "quarter3", "quarter4"))
        fine += _doubled(through(half, "up1", "up2", "up3"))
        fine += through(fine, "last1", "last2")
        return through(fine, "residual")


def _doubled(values: Singles) -> Singles:
    return values.repeat(2, axis=0).repeat(2, axis=1)


def _encoding_slope(linear: Image) -> Image:
    """Slope of sRGB's encoding at linear values; under black as at black."""
    return np.where(linear <= 0.0031308, 12.92, 1.055 / 2.4 * np.maximum(linear, 0.0031308) ** (1 / 2.4 - 1))


def _green_diagonal(tile: Tile) -> bool:
    """Whether G lies diagonal to R in a tile of 2x2."""
    red, green = ("".join(tile).index(name) for name in "RG")
    return red + green == 3


def _green_below(tile: Tile) -> bool:
    """Whether G follows R in the column and not in the row."""
    return not any(set(row) == {"R", "G"} for row in tile)
