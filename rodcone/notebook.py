"""Display of values in a notebook: a small picture and a table of facts, made only when they are shown."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from rodcone.colour_spaces import encode_srgb, white_of

LEAST_SHOWN = 384  # pixels of the screen that a small picture is as wide as, about: each of its own is several there
SIDE = 512  # most pixels of a shown picture's longer side


def preview_png(linear: NDArray[np.floating]) -> bytes:
    """PNG of a linear picture, (h, w, 3) sRGB or (h, w) grey, scaled by its own white; large ones are subsampled.

    For display alone: pictures that are compared are adapted and encoded by `rodcone.colour_spaces`.
    """
    from PIL import Image  # only here: most programs never show anything

    step = max(1, -(-max(linear.shape[:2]) // SIDE))
    small = np.nan_to_num(np.asarray(linear[::step, ::step], dtype=np.float64))
    white = white_of(small)
    shown = np.clip(small / white, 0.0, 1.0) if white > 0 else np.zeros_like(small)
    file = BytesIO()
    Image.fromarray(np.rint(encode_srgb(shown) * 255).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def html_of(title: str, facts: Mapping[str, str | Sequence[str]], png: bytes | None) -> str:
    """A picture, where there is one, with facts under it, each of one value or several; without script."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        + "".join(f"<td>{escape(x)}</td>" for x in ([value] if isinstance(value, str) else value))
        + "</tr>"
        for name, value in facts.items()
    )
    picture = ""
    if png is not None:
        times = max(1, LEAST_SHOWN // int.from_bytes(png[16:20]))  # PNG's header: the picture's width
        style = f"width:{times * int.from_bytes(png[16:20])}px;image-rendering:pixelated" if times > 1 else ""
        picture = (
            f"<img alt='{escape(title)}' style='{style}' src='data:image/png;base64,{b64encode(png).decode('ascii')}'>"
        )
    return f"<div><b>{escape(title)}</b><br>{picture}<table>{rows}</table></div>"
