"""Display of values in a notebook: a small picture, made only when it is shown."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import encode_srgb, white_of

LEAST_SHOWN = 384  # pixels that a small picture is as wide as, about: each of its own is several there
SIDE = 512  # most pixels of a shown picture's longer side


def preview_png(linear: NDArray[np.floating]) -> bytes:
    """PNG of a linear picture, (h, w, 3) sRGB or (h, w) grey, scaled by its own white.

    Large pictures are subsampled, small ones shown by whole multiples. For display alone: pictures that are compared
    are adapted and encoded by `rodcone.colour_spaces`.
    """
    from PIL import Image  # only here: most programs never show anything

    step = max(1, -(-max(linear.shape[:2]) // SIDE))
    small = np.nan_to_num(np.asarray(linear[::step, ::step], dtype=np.float64))
    white = white_of(small)
    clipped = np.clip(small / white, 0.0, 1.0) if white > 0 else np.zeros_like(small)
    times = max(1, LEAST_SHOWN // clipped.shape[1])
    pixels = np.rint(encode_srgb(clipped) * 255).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)
    file = BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()
