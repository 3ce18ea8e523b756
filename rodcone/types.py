"""Names of arrays that every package uses."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Image: TypeAlias = NDArray[np.float64]  # (h, w) or (h, w, channel)
Planes: TypeAlias = NDArray[np.float32]  # (band, h, w), or (group, band, h, w)
