"""The pictures of a report: which ones the page holds, in which form, their maps of FLIP, and where to look first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import uniform_filter

from studies.metrics.appearance import flip
from studies.pages.report_compare import Comparison
from studies.sweep.prepare import PICTURES
from studies.sweep.stored import read_whole

AS_MADE, AS_MADE_BYTES = 28, 24e6  # up to so many pictures and bytes, all of them go into the page as they were made
SHOWN_BYTES = 6.5e6  # of pictures and maps otherwise: a page of 300 cells stays under 10 MB
# Pictures stay lossless: WebP with a loss halves the resolution of colours, which is what mosaics are judged by.
LOSSLESS = {"lossless": True, "method": 1, "quality": 20}
OF_MAPS = {"quality": 85, "method": 2}
LOUPE = (16, 32)  # rows and columns that the loupe shows


@dataclass(frozen=True)
class ReportPictures:
    """What a page holds, by the names that cells and truths have for it.

    Attributes
    ----------
    files : mapping of str to bytes
        PNG, or lossless WebP where there are many.
    flip_maps : mapping of str to bytes
        LDR-FLIP of each pixel, 255 times, grey: PNG, or WebP with a loss where there are many.
    """

    files: Mapping[str, bytes]
    flip_maps: Mapping[str, bytes]


def read_pictures(
    folder: Path, pairs: Sequence[tuple[str, str]], truths: Sequence[str], most: int | None
) -> tuple[ReportPictures, str]:
    """Read pictures into a page until it is full.

    Parameters
    ----------
    folder : Path
        Of the sweep.
    pairs : sequence of (str, str)
        Each picture and its truth, by their names; those that the page shows at first come first.
    truths : sequence of str
        All of them are in the page.
    most : int, optional
        Pictures beside the truths; left out, as many as `SHOWN_BYTES` hold.

    Returns
    -------
    ReportPictures, str
        And what the page has to say of those that it leaves out.
    """
    made = {name: read_whole(folder / PICTURES, name) for name in truths}
    shown = pairs if most is None else pairs[:most]
    sizes = [(folder / PICTURES / name).stat().st_size for name, _ in pairs if (folder / PICTURES / name).is_file()]
    as_made = len(pairs) <= AS_MADE and sum(sizes) <= AS_MADE_BYTES
    files = {name: content if as_made else as_webp(opened(content), **LOSSLESS) for name, content in made.items()}
    maps: dict[str, bytes] = {}
    held = sum(map(len, files.values()))
    for name, truth in shown:
        content = read_whole(folder / PICTURES, name)
        errors = flip_map(opened(content), opened(made[truth]))
        if not as_made:
            content, errors = as_webp(opened(content), **LOSSLESS), as_webp(opened(errors), **OF_MAPS)
            if most is None and held + len(content) + len(errors) > SHOWN_BYTES:
                break
        files[name], maps[name] = content, errors
        held += len(content) + len(errors)
    left_out = sum(name not in maps for name, _ in pairs)
    told = (
        f"To keep the page small, {left_out} of {len(pairs)} pictures aren't in it: it shows them from the folder "
        "pictures beside it, and rodcone report --pictures N puts more into it."
    )
    return ReportPictures(files, maps), told if left_out else ""


def view_order(shape: Sequence[int], of: Comparison) -> list[int]:
    """Return the cells, by place, so that those which the page shows at first come first.

    First the two that are compared, all along; then the others that they may be compared with; then the other rows.

    Parameters
    ----------
    shape : sequence of int
        Lengths of the axes, as `studies.pages.report_compare.axes_of` has them.
    of : Comparison
    """

    def rank(cell: int) -> tuple[bool, bool, bool]:
        place = [int(index) for index in np.unravel_index(cell, shape)]
        elsewhere = any(index for axis, index in enumerate(place) if axis not in (of.compared, of.along, of.rows))
        return elsewhere, place[of.rows] > 0, place[of.compared] not in (of.a, of.b)

    return sorted(range(int(np.prod(shape))), key=rank)


def opened(content: bytes) -> NDArray[np.uint8]:
    """Return a picture file's values, (h, w) or (h, w, 3)."""
    with Image.open(BytesIO(content)) as picture:
        return np.asarray(picture if picture.mode == "L" else picture.convert("RGB"))


def as_webp(values: NDArray[np.uint8], **options: Any) -> bytes:
    """Return a picture (h, w) or (h, w, 3) as WebP, with Pillow's options for it."""
    file = BytesIO()
    Image.fromarray(values).convert("RGB").save(file, "WEBP", **options)
    return file.getvalue()


def flip_map(picture: NDArray[np.uint8], truth: NDArray[np.uint8]) -> bytes:
    """Return LDR-FLIP of each pixel between pictures (h, w, 3), 255 times and rounded, as a grey PNG (h, w)."""
    file = BytesIO()
    errors = flip(picture / 255.0, truth / 255.0)
    Image.fromarray(np.rint(255 * np.clip(errors, 0.0, 1.0)).astype(np.uint8)).save(file, "PNG", compress_level=3)
    return file.getvalue()


def busiest(truth: NDArray[np.uint8]) -> tuple[int, int]:
    """Return column and row of the middle of the loupe's rectangle in which a picture (h, w, 3) has the most edges.

    There cameras differ most: a chart's, where the scene has one.
    """
    values = truth.astype(np.float64).mean(axis=2)
    edges = sum(np.abs(np.gradient(values, axis=axis)) for axis in (0, 1) if values.shape[axis] > 1)
    row, column = np.unravel_index(np.argmax(uniform_filter(edges * np.ones_like(values), LOUPE)), values.shape)
    return int(column), int(row)
