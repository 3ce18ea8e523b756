"""The pictures of a report: which ones the page contains, in which format, their FLIP maps, where to look first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import uniform_filter

from studies.metrics.flip import Seen, flip, seen
from studies.pages.report_compare import Comparison
from studies.sweep.prepare import PICTURES
from studies.sweep.stored import read_whole

SHOWN_BYTES = 6.5e6  # most bytes of pictures and maps; a page of 300 cells then stays below 10 MB
# Pictures stay lossless, because lossy WebP halves the resolution of colours, by which mosaics are judged.
LOSSLESS = {"lossless": True, "method": 1, "quality": 20}
OF_MAPS = {"quality": 85, "method": 2}
LOUPE = (16, 32)  # rows and columns that the loupe shows


@dataclass(frozen=True)
class ReportPictures:
    """Pictures and FLIP maps of a page, by the names in `ReportCell.picture` and `ReportData.truths`.

    Attributes
    ----------
    files : mapping of str to bytes
        Lossless WebP.
    flip_maps : mapping of str to bytes
        LDR-FLIP of each pixel, multiplied by 255, as grey WebP with losses.
    """

    files: Mapping[str, bytes]
    flip_maps: Mapping[str, bytes]


def read_pictures(
    folder: Path, pairs: Sequence[tuple[str, str]], true: Mapping[str, NDArray[np.uint8]], most: int | None
) -> tuple[ReportPictures, str]:
    """Read pictures into a page until it is full.

    Parameters
    ----------
    folder : Path
        Folder of the sweep.
    pairs : sequence of (str, str)
        Each picture and its truth, by their names; those that the page shows at first come first.
    true : mapping of str to (h, w, 3) uint8
        The truths; all of them are in the page.
    most : int, optional
        Most pictures besides the truths; left out, as many as fit into `SHOWN_BYTES`, and at least the first two.

    Returns
    -------
    ReportPictures, str
        The pictures, and a sentence on those that the page leaves out.
    """
    files = {name: as_webp(truth, **LOSSLESS) for name, truth in true.items()}
    halves = {name: seen(truth / 255.0) for name, truth in true.items()}
    maps: dict[str, bytes] = {}
    total_bytes = sum(map(len, files.values()))
    for name, truth in pairs if most is None else pairs[:most]:
        picture = opened(read_whole(folder / PICTURES, name))
        content = as_webp(picture, **LOSSLESS)
        errors = as_webp(flip_map(picture, halves[truth]), **OF_MAPS)
        total_bytes += len(content) + len(errors)
        if most is None and total_bytes > SHOWN_BYTES and len(maps) >= 2:
            break
        files[name], maps[name] = content, errors
    left_out = sum(name not in maps for name, _ in pairs)
    note = (
        f"To keep the page small, {left_out} of {len(pairs)} pictures aren't in it: it shows them from the folder "
        "pictures beside it, and rodcone report --pictures N puts more into it."
    )
    return ReportPictures(files, maps), note if left_out else ""


def view_order(shape: Sequence[int], of: Comparison) -> list[int]:
    """Return the indices of the cells in the order in which their pictures are put into a page.

    First come the two values that are compared, along their whole axis; then the other values of that axis; then the
    other rows.

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


def as_webp(values: NDArray[np.uint8], **options: object) -> bytes:
    """Return a picture (h, w) or (h, w, 3) as WebP, with Pillow's options for it."""
    file = BytesIO()
    Image.fromarray(values).convert("RGB").save(file, "WEBP", **options)
    return file.getvalue()


def flip_map(picture: NDArray[np.uint8], truth: Seen) -> NDArray[np.uint8]:
    """Return LDR-FLIP of each pixel of a picture (h, w, 3) beside the truth, multiplied by 255 and rounded, (h, w)."""
    return np.rint(255 * np.clip(flip(picture / 255.0, truth), 0.0, 1.0)).astype(np.uint8)


def busiest(truth: NDArray[np.uint8]) -> tuple[int, int]:
    """Return the column and row of the middle of that rectangle, as large as the loupe, where the truth has most edges.

    Pictures of cameras differ most there.
    """
    values = truth.astype(np.float64).mean(axis=2)
    edges = sum(np.abs(np.gradient(values, axis=axis)) for axis in (0, 1) if values.shape[axis] > 1)
    row, column = np.unravel_index(np.argmax(uniform_filter(edges * np.ones_like(values), LOUPE)), values.shape)
    return int(column), int(row)
