"""Pictures as files: encoding, and the overview sheet."""

from collections.abc import Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def to_bytes(encoded: NDArray[np.float64], kind: str = "WEBP") -> bytes:
    """8-bit picture file of encoded sRGB (h, w, 3) in [0, 1]; lossless, so that noise is shown as it is."""
    pixels = Image.fromarray(np.rint(encoded * 255).astype(np.uint8))
    buffer = BytesIO()
    if kind == "WEBP":
        pixels.save(buffer, kind, lossless=True, quality=80, method=4)
    else:
        pixels.save(buffer, kind, optimize=True)
    return buffer.getvalue()


def contact_sheet(rows: Sequence[Sequence[NDArray[np.float64]]], gap: int = 4) -> NDArray[np.float64]:
    """Pictures of one size side by side on white, shape (h', w', 3)."""
    padded = [[np.pad(tile, ((0, gap), (0, gap), (0, 0)), constant_values=1.0) for tile in row] for row in rows]
    return np.concatenate([np.concatenate(row, axis=1) for row in padded], axis=0)[:-gap, :-gap]
