"""Bilinear demosaicking by normalised convolution: the conventional camera's."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from isp.planes import Plane, fill
from sensor.cfa import Tile, channels
from sensor.raw import RawImage


def bilinear(raw: RawImage) -> NDArray[np.float64]:
    """Every channel at every pixel by bilinear interpolation, shape (h, w, channel) [e-].

    A sampled pixel keeps its sample; the frame's border is normalised by the samples that exist, so a flat field stays
    flat up to it.
    """
    return fill_channels(raw.electrons, raw.cfa, channels(raw.cfa))


def fill_channels(mosaic: Plane, tile: Tile, names: Sequence[str]) -> NDArray[np.float64]:
    """As `bilinear`, of a mosaic's channels `names`."""
    return np.stack([fill(mosaic, tile, name) for name in names], axis=-1)
