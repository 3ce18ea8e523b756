"""The brightness at which a raw image is shown: one rule for development and for a negative's BaselineExposure."""

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import luminance_of_srgb, white_of
from rodcone.errors import InputError
from sensor.cfa import mask
from sensor.raw import RawImage, channel_variance

MOST_NOISE = 0.1  # cells are enlarged until the noise of their means is below this share of the level shown as white
LEAST_CELLS = 256  # least number of cells for a percentile


def stops_to_white(raw: RawImage) -> float:
    """Return the stops of gain that show the 99th percentile of a raw image's luminance at 90 % of white.

    The luminance is that of means over cells, which are a tile of the mosaic, or more where noise would raise the
    percentile. It therefore depends on the exposure only, and is the same for every way to develop the image. The
    result is 0 for a frame without light.

    Raises
    ------
    InputError
        For a raw image without colours.
    """
    if raw.colour is None:
        raise InputError("raw: it holds no colour calibration; allowed: one beside it; give calibrate(sensor, light)")
    names = raw.channels[:3]
    balance = 1 / raw.colour.neutral[: len(names)]
    weights = np.asarray(luminance_of_srgb(raw.colour.to_srgb.T)) * balance  # luminance of each channel's electrons
    electrons = raw.electrons
    sites = [sum(row.count(name) for row in raw.cfa) for name in names]  # number of sites in a tile
    tile = np.array([len(raw.cfa), len(raw.cfa[0])])
    tiles = 1
    while True:
        planes = np.stack([_cell_means(electrons, mask(raw.cfa, x, raw.shape), tile * tiles) for x in names], axis=-1)
        white_e = white_of(planes @ weights)
        sample_e2 = channel_variance(raw, max(white_e, 0.0) * raw.colour.neutral)[: len(names)]
        noise_e = float(np.sqrt(weights**2 @ (sample_e2 / sites))) / tiles
        if noise_e <= MOST_NOISE * white_e or np.prod(np.array(raw.shape) // (2 * tile * tiles)) < LEAST_CELLS:
            return -float(np.log2(white_e / raw.full_well_e)) if white_e > 0 else 0.0
        tiles *= 2


def _cell_means(electrons: NDArray[np.float64], at: NDArray[np.bool_], cell: NDArray[np.intp]) -> NDArray[np.float64]:
    """Average a channel's samples over each whole cell of the mosaic, or over a frame smaller than a cell."""
    height, width = (min(n, size) for n, size in zip(cell, electrons.shape, strict=True))
    rows, columns = electrons.shape[0] // height, electrons.shape[1] // width
    inside = slice(rows * height), slice(columns * width)
    parts = (x[inside].reshape(rows, height, columns, width).sum(axis=(1, 3)) for x in (electrons * at, at))
    total, count = parts
    return np.asarray(total / np.maximum(count, 1))
