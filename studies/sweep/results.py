"""The last run of a sweep as files: its rows as JSON, and an overview of its pictures."""

import json
from importlib import metadata
from io import BytesIO
from pathlib import Path

from PIL import Image

from rodcone.files import finite
from studies.sweep.database import last_run
from studies.sweep.prepare import PICTURES
from studies.sweep.stored import read_whole

GAP = 4  # pixels between the pictures of a sheet
_ONE_OF = ("scene", "spectrum", "exposure", "white_balance", "frames", "seed")  # axes that a sheet doesn't show
_JSON_COLUMNS = ("render", "lens", "balance", "mean_electrons", "versions")


def results_json(folder: Path) -> bytes:
    """Study, seconds by stage and rows of a sweep's last run, as a JSON file.

    A row has the columns of `studies.sweep.row.Row`, those in JSON as objects; a number that isn't finite is null.
    """
    run, cells = last_run(folder), []
    for row in run.rows:
        values = finite(vars(row))
        cells.append(values | {name: json.loads(values[name]) for name in _JSON_COLUMNS})
    results = {"rodcone": metadata.version("rodcone"), "study": run.study, "stages": run.stages, "rows": cells}
    return (json.dumps(results, indent=1, allow_nan=False) + "\n").encode()


def overview(folder: Path) -> bytes:
    """PNG of the pictures of a sweep's first scene, spectrum, exposure, white balance, burst and seed.

    A column for each level, a row for each sensor and processor; what isn't made yet is left white.
    """
    run = last_run(folder)
    first = run.rows[0]
    pictures = {
        (row.sensor, row.processor, row.level): row.picture
        for row in run.rows
        if all(getattr(row, axis) == getattr(first, axis) for axis in _ONE_OF)
    }
    lines = list(dict.fromkeys((sensor, processor) for sensor, processor, _ in pictures))
    with Image.open(BytesIO(read_whole(folder / PICTURES, first.picture))) as picture:
        width, height = picture.width + GAP, picture.height + GAP
    sheet = Image.new("RGB", (len(run.study["levels"]) * width - GAP, len(lines) * height - GAP), "white")
    for (sensor, processor, level), name in pictures.items():
        with Image.open(BytesIO(read_whole(folder / PICTURES, name))) as picture:
            sheet.paste(picture, (run.study["levels"].index(level) * width, lines.index((sensor, processor)) * height))
    file = BytesIO()
    sheet.save(file, "PNG")
    return file.getvalue()
