"""Write what a sweep has measured: its rows as CSV or JSON, and its figures as a Markdown table.

A table holds means over the seeds, one line per combination of the axes.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from html import escape
from importlib import metadata
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from rodcone.colour_spaces import decode_srgb
from rodcone.csv_file import write_table
from rodcone.curve_file import is_curve_file
from rodcone.errors import InputError, require_keys, unknown
from rodcone.files import finite, replacing, require_ending
from scenes.catalogue import load
from scenes.metamers import TWINS_UNDER
from studies.metrics.confidence import half_width
from studies.metrics.target_figures import daylight_delta_e, pair_delta_e, patch_masks, true_pair_delta_e
from studies.study.study import OWN
from studies.sweep.database import COLUMNS, LastRun, read_results, rows
from studies.sweep.prepare import PICTURES
from studies.sweep.provenance import require_alike
from studies.sweep.row import AXES, Row
from studies.sweep.stored import read_whole

_JSON_COLUMNS = ("render", "lens", "balance", "mean_electrons", "versions")
# A text that begins with one of these is run as a formula by spreadsheets (OWASP, CSV injection).
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def stream_rows(folder: Path, everything: bool = False) -> Iterator[Row]:
    """Yield the rows that `read_rows` returns, so that memory holds one at a time."""
    with read_results(folder) as base:
        yield from rows(base, everything)


def read_rows(folder: str | Path, everything: bool = False) -> list[Row]:
    """Return the rows of a sweep's folder: those of its last run, or with `everything` all of them.

    Raises
    ------
    InputError
        Where there is no results database, or one of another version.
    """
    return list(stream_rows(Path(folder), everything))


def axis_values(texts: Sequence[str]) -> dict[str, str]:
    """Parse texts such as ``level=10lux`` into the values to keep, by axis."""
    values = {}
    for text in texts:
        axis, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"where: {text!r} is not allowed; write AXIS=VALUE, such as level=10lux")
        values[axis] = value
    return values


def write_csv(table: Iterable[Row], path: Path) -> None:
    """Write rows to a ``.csv`` file (RFC 4180, with a header) as they come; after an error the file is as it was.

    A text that a spreadsheet would run as a formula gets a quote in front.

    Raises
    ------
    InputError
        For a file name with another ending.
    OSError
        Where the file can't be written.
    """
    require_ending(path, ".csv")
    with replacing(path) as (place,), place.open("w", encoding="utf-8", newline="") as file:
        write_table(file, COLUMNS, ([_harmless(value) for value in vars(row).values()] for row in table))


def results_json(run: LastRun) -> bytes:
    """Return the study, the seconds by stage and the rows of a sweep's last run as the content of a JSON file.

    A row has the columns of `studies.sweep.row.Row`. Columns that hold JSON become objects, and a number that isn't
    finite becomes null.
    """
    cells = []
    for row in run.rows:
        values = finite(vars(row))
        cells.append(values | {name: json.loads(values[name]) for name in _JSON_COLUMNS})
    results = {"rodcone": metadata.version("rodcone"), "study": run.study, "stages": run.stages, "rows": cells}
    return (json.dumps(results, indent=1, allow_nan=False) + "\n").encode()


def _harmless(value: object) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(_FORMULA) else value


# A mean smaller than this counts as 0. So does an interval's half width smaller than this share of its mean, because
# the seeds' figures then differ by rounding alone.
SAME = 1e-6
ELECTRONS = "electrons_"  # prefix of a channel's name, for the mean electrons of its pixels
MOST_ROWS = 10_000  # rows in results.json, 2.5 kB each; a larger sweep is exported as CSV
CHARTS = {"pair_delta_e": ("metamers", pair_delta_e), "daylight_delta_e": ("color_checker", daylight_delta_e)}
TRUE_PAIRS = "true_pair_delta_e"  # a figure that depends on the light alone, not on the camera
FIGURES = tuple(field.name for field in fields(Row) if "float" in str(field.type) or field.name == "substitution")


@dataclass(frozen=True)
class TableLine:
    """A line of a table: its values of the axes, and over the seeds each figure's mean and half of its 95 % interval.

    Both are None for a figure that a cell lacks; with one seed the half interval alone is None.
    """

    at: tuple[str, ...]
    means: tuple[float | None, ...]
    halves: tuple[float | None, ...]


def lines(
    rows: Sequence[Row], folder: Path, by: Sequence[str], show: Sequence[str], where: Mapping[str, str]
) -> list[TableLine]:
    """Average a sweep's figures over its seeds, one line per combination of the axes' values, in the study's order.

    Parameters
    ----------
    rows : sequence of Row
    folder : Path
        The sweep's folder, whose pictures some figures are measured in.
    by : sequence of str
        Axes, some of `AXES`.
    show : sequence of str
        Figures: numeric columns of `Row`, or one of these. ``electrons_W``, and so for the other channels, is the mean
        number of electrons in the channel's pixels. ``pair_delta_e`` is the mean CIEDE2000 within the pairs of the
        scene `metamers`, and ``daylight_delta_e`` the mean between the ColorChecker's patches and their colours under
        D65, both measured in the 8-bit pictures. ``true_pair_delta_e`` is what the CIE observer sees within the pairs.
    where : mapping of str to str
        Value that an axis must have for a row to count, by axis.

    Raises
    ------
    InputError
        For an unknown axis or figure, for a figure that the scene doesn't have, or if cells of one line differ in more
        than their seeds, because a mean over lights, cameras or versions says nothing.
    """
    require_keys("axis", (*by, *where), AXES)
    for name in show:
        if name not in (*FIGURES, *CHARTS, TRUE_PAIRS) and not name.startswith(ELECTRONS):
            raise unknown("show", name, (*FIGURES, *CHARTS, TRUE_PAIRS, f"{ELECTRONS}W"))
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if all(str(getattr(row, axis)) == value for axis, value in where.items()):
            groups.setdefault(tuple(str(getattr(row, axis)) for axis in by), []).append(row)
    require_alike([row for group in groups.values() for row in group])
    if not groups and not where:
        raise InputError("table: the sweep has made no cell yet; run rodcone sweep, which goes on")
    if not groups:
        raise InputError(f"where: no cell has {dict(where)}; allowed: values of the study's axes; see rodcone export")
    for at, group in groups.items():
        for axis in AXES:
            values = list(dict.fromkeys(str(getattr(row, axis)) for row in group))
            if len(values) > 1:
                raise InputError(
                    f"by: a line of {'/'.join(at) or 'all'} would be a mean over {axis} {', '.join(values)}; allowed: "
                    f"over seeds alone; add {axis} to --by, or give --where {axis}={values[0]}"
                )
    return [_line(at, group, folder, show) for at, group in groups.items()]


def markdown(table: Sequence[TableLine], by: Sequence[str], show: Sequence[str]) -> str:
    """Return the table in Markdown, with figures as ``mean ± half width``, to three digits.

    The half width is left out where the seeds don't differ.
    """
    cells = [[*by, *map(_plain, show)], ["---"] * len(by) + ["---:"] * len(show)]
    for line in table:
        figures = [mean_text(mean, half) for mean, half in zip(line.means, line.halves, strict=True)]
        cells.append([*map(_plain, line.at), *figures])
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def _plain(text: str) -> str:
    """Escape a text so that Markdown shows it as it is, because names of files and of figures come from outside."""
    return re.sub(r"([|\[\]`*\\])", r"\\\1", escape(" ".join(text.split()), quote=False))


def _line(at: tuple[str, ...], group: Sequence[Row], folder: Path, show: Sequence[str]) -> TableLine:
    means: list[float | None] = []
    halves: list[float | None] = []
    for name in show:
        figures = [_figure(row, name, folder) for row in group]
        values = [value for value in figures if value is not None]
        whole = len(values) == len(figures)  # because a mean over only some of the seeds would be biased
        means.append(float(np.mean(values)) if whole else None)
        halves.append(float(half_width(np.array(values))) if whole and len(values) > 1 else None)
    return TableLine(at, tuple(means), tuple(halves))


def _figure(row: Row, name: str, folder: Path) -> float | None:
    if name.startswith(ELECTRONS):
        electrons: dict[str, float] = json.loads(row.mean_electrons)
        return electrons.get(name.removeprefix(ELECTRONS))
    if name in FIGURES:
        value = getattr(row, name)
        return None if value is None else float(value)
    scene, measure = CHARTS.get(name, ("metamers", pair_delta_e))
    if row.scene != scene:
        raise InputError(f"show: {name} is known of scene {scene}, not of {row.scene}; leave it out, or give --where")
    if name == TRUE_PAIRS and is_curve_file(row.spectrum):
        raise InputError(
            f"show: {name} under {row.spectrum}, whose file isn't in the database; allowed: lights by name; "
            "leave it out, or give --where"
        )
    if name == TRUE_PAIRS:
        return float(true_pair_delta_e(TWINS_UNDER if row.spectrum == OWN else row.spectrum).mean())
    with Image.open(BytesIO(read_whole(folder / PICTURES, row.picture))) as file:
        picture = decode_srgb(np.asarray(file.convert("RGB"), dtype=np.float64) / 255)
    return float(measure(picture, patch_masks(load(scene), (picture.shape[0], picture.shape[1]))).mean())


def mean_text(mean: float | None, half: float | None) -> str:
    """Return a mean to three digits, followed by `` ± `` and the half width unless the seeds agree; ``-`` for None."""
    if mean is None:
        return "-"
    if abs(mean) < SAME:
        return "0"
    places = max(0, 2 - int(np.floor(np.log10(max(abs(mean), 1e-3)))))
    return f"{mean:.{places}f}" if half is None or half < SAME * abs(mean) else f"{mean:.{places}f} ± {half:.{places}f}"
