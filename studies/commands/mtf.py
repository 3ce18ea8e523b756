"""The command `rodcone mtf`: the sharpness of a slanted edge in a picture of one's own."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from render.radiance_files.photo import read_pixels
from rodcone.colour_spaces import decode_srgb, luminance_of_srgb
from rodcone.csv_file import csv_text
from rodcone.errors import InputError
from rodcone.files import write_files
from rodcone.types import Plane
from studies.commands.console import print_json, print_table, require_place
from studies.metrics.mtf import EdgeResponse, edge_response

AT = (0.125, 0.25, 0.5)  # frequencies at which the response is printed [cycles per pixel]


def mtf(
    picture: Path,
    /,
    *,
    roi: Annotated[tuple[int, int, int, int] | None, Parameter(consume_multiple=True)] = None,
    linear: bool = False,
    out: Path | None = None,
    json: bool = False,
) -> None:
    """Measure the sharpness of a slanted edge in a picture: MTF50 and the response, by ISO 12233's e-SFR.

    Parameters
    ----------
    picture
        PNG or JPEG, taken as sRGB; its luminance is measured. One straight edge between two even fields runs through
        the region, 3 to 10 degrees off its rows or columns, 8 pixels or more from the other two sides.
    roi
        Region: left, top, width and height in pixels; the whole picture by default.
    linear
        The file's numbers are in proportion to light already.
    out
        File with the response over frequency (.csv).
    json
        Print one JSON object, which holds the whole response.
    """
    require_place(out, ".csv")
    found = edge_response(_region(_luminance(picture, linear=linear), roi, picture))
    if out is not None:
        rows = zip(found.frequency_cycles_per_px.tolist(), found.mtf.tolist(), strict=True)
        write_files({out: csv_text(("cycles_per_px", "mtf"), rows)})
    if json:
        print_json({key: np.asarray(value).tolist() for key, value in asdict(found).items()})
        return
    print_table(("figure", "unit", "value"), _rows(found), words=2)


def _rows(found: EdgeResponse) -> list[tuple[str, str, str]]:
    at = [(x, float(np.interp(x, found.frequency_cycles_per_px, found.mtf))) for x in AT]
    return [
        ("MTF50", "cycles/px", f"{found.mtf50_cycles_per_px:.4f}"),
        *((f"MTF at {x:g} cycles/px", "1", f"{value:.4f}") for x, value in at),
        ("angle of the edge", "degrees", f"{found.angle_deg:.2f}"),
    ]


def _luminance(path: Path, *, linear: bool) -> Plane:
    pixels = read_pixels(path)
    return luminance_of_srgb(pixels if linear else decode_srgb(pixels))


def _region(luminance: Plane, roi: tuple[int, int, int, int] | None, path: Path) -> Plane:
    if roi is None:
        return luminance
    left, top, width, height = roi
    rows, columns = luminance.shape
    if not (left >= 0 and top >= 0 and 0 < width <= columns - left and 0 < height <= rows - top):
        raise InputError(
            f"roi: {left} {top} {width} {height} isn't inside {path}, {columns} x {rows} pixels; give left, top, width "
            "and height within it"
        )
    return luminance[top : top + height, left : left + width]
