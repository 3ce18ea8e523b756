"""The conventional camera's demosaicking: bilinear, by normalised convolution."""

import numpy as np
from numpy.typing import NDArray

from isp.planes import fill
from sensor.cfa import channels
from sensor.raw import RawImage


def bilinear(raw: RawImage) -> NDArray[np.float64]:
    """Every channel at every pixel by bilinear interpolation, shape (h, w, channel) [e-].

    A sampled pixel keeps its sample; the frame's border is normalised by the samples that exist, so a flat field stays
    flat up to it.
    """
    electrons = raw.electrons
    return np.stack([fill(electrons, raw.cfa, letter) for letter in channels(raw.cfa)], axis=-1)
