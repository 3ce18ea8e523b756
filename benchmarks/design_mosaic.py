"""Search for the mosaic of the least expected error over several levels of light: `python benchmarks/design_mosaic.py`.

It is a study of this project rather than a command of the package, because no tile alone was found to be 0.3 dB ahead
of the better of Bayer and RGBW (docs/design.md). It writes the camera found (sensor.toml, a preset file like any
other, with curves.csv where filters were sought) and a study that checks it by simulation (study.toml), and prints the
expected gains of the camera found and of published mosaics. Tiles that were tried stay in tried.json: the command
given again goes on where it ended. `--help` lists the options.
"""

import json
import re
import sys
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import App, Parameter
from design_filters import best_filters
from design_search import SIDES, Goal, Known, best_tile, expected

from render.illuminants import illuminant
from rodcone.digests import digest_inputs
from rodcone.errors import InputError, read_errors, require_keys
from rodcone.files import read_bounded, write_files
from rodcone.progress import progress
from sensor.cameras.numbers import responses_csv
from sensor.cfa import MOSAICS
from sensor.config import SensorConfig, with_tile
from sensor.presets import VARIATIONS, preset, preset_file, vary
from studies.sweep.provenance import code_version

_STUDY = Path(__file__).parent / "design_study.toml"
MOST_BYTES = 1 << 24  # of the file of tiles that were tried
DEFAULT = Goal()
app = App(help_format="plaintext")


@app.default
def design(sensor: str, /, goal: Annotated[Goal, Parameter(name="*")] = DEFAULT, *, out: Path) -> None:
    """Search for a mosaic, and write it with a study that checks it.

    Parameters
    ----------
    sensor
        Sensor preset by name, or a preset file: its pixel, lens and responses.
    goal
        What the mosaic is sought for.
    out
        Folder to write to.
    """
    base = preset(sensor)
    tile = () if goal.tile in SIDES else vary(base, goal.tile).cfa
    reference = vary(base, goal.never_worse_than)
    for name, letters in (("letters", goal.letters), ("never_worse_than", "".join(reference.cfa))):
        require_keys(name, letters, base.responses.curves)
    if goal.filters and "W" not in base.responses.curves:
        raise InputError("curves: the sensor has no W, the response without a filter; add W to its responses")
    by_camera = {goal.never_worse_than: expected(goal, reference)}
    if tile:  # one that is refused leaves no folder
        by_camera["design"] = expected(goal, with_tile(base, tile, base.responses))
    out.mkdir(parents=True, exist_ok=True)
    # Tiles that were tried count for the same question alone.
    tried = out / "tried.json"
    code = code_version(names=["studies.design.expect"])
    lit = illuminant(goal.light), goal.exposure, goal.prior, goal.levels
    question = digest_inputs([code, base, reference, *lit])
    tried_gains_db = _known(tried, question, len(goal.levels))

    with progress(sys.stderr) as step:
        if not tile:
            try:
                tile = best_tile(goal, base, tried_gains_db, step)
            finally:
                write_files({tried: json.dumps({"question": question, "gains_db": tried_gains_db})})
        camera = with_tile(base, tile, base.responses)
        if goal.filters:
            camera = best_filters(goal, base, tile, step)
    if goal.filters or "design" not in by_camera:
        by_camera["design"] = expected(goal, camera)
    # Beside the design: published mosaics of three channels or more that the sensor can have, Bayer's in one phase.
    for name in (*MOSAICS, *VARIATIONS):
        other = None
        with suppress(InputError):  # of a curve that it lacks, or of a quad where it bins
            other = vary(base, name)
        if other and len(other.channels) > 2 and not name.startswith("bayer_") and name not in by_camera:
            by_camera[name] = expected(goal, other)
    write_files(_camera_files(out, sensor, camera, goal.filters))
    print(f"{'/'.join(tile)}\n{out}")
    reference_errors, *_ = by_camera.values()
    print(f"expected gain in PSNR over {goal.never_worse_than} [dB]: {', '.join(goal.levels)}")
    for name, errors in list(by_camera.items())[1:]:
        gains_db = [x.psnr_db - y.psnr_db for x, y in zip(errors, reference_errors, strict=True)]
        print(f"{name:>16} {' '.join(f'{gain:+6.2f}' for gain in gains_db)}")


def _known(tried: Path, question: str, levels: int) -> Known:
    """Gains of tiles that an earlier run tried for the same question."""
    if not tried.exists():
        return {}
    fix = "allowed: that, or no such file; move it away"
    damage = (ValueError, LookupError, TypeError, AttributeError)
    with read_errors(f"out: {str(tried)!r} isn't what this program wrote", fix, damage):
        held = json.loads(read_bounded(tried, MOST_BYTES))
        tried_gains_db: Known = held["gains_db"] if held["question"] == question else {}
        if any(np.shape(gains) != (3, levels) for gains in tried_gains_db.values()):
            raise ValueError("gains of another shape")
    return tried_gains_db


def _camera_files(out: Path, sensor: str, camera: SensorConfig, filters: bool) -> dict[Path, str]:
    """Preset file of the camera found, its curves where the preset names some, and the study that checks it."""
    source = Path(sensor) if sensor.endswith(".toml") else preset_file(sensor)
    # Keys stand before the first table; a table ends where the next one begins.
    head, *tables = re.split(r"^(?=\[)", source.read_text("utf-8"), flags=re.MULTILINE)
    head = re.sub(r"^cfa\s*=\s*(\[[^\]]*\]|[^\n]*)\n?", "", head, flags=re.MULTILINE)
    by_text = {table: tomllib.loads(table) for table in tables}
    parts = [f"cfa = {json.dumps(camera.cfa)}\n{head}"]
    parts += [  # but those of channels that the new mosaic lacks
        table for table, keys in by_text.items()
        if "responses" not in keys and all(x["channel"] in camera.channels for x in keys.get("channels", ()))
    ]  # fmt: skip
    files, study = {}, _STUDY.read_text("utf-8")
    if filters or any("responses" in keys for keys in by_text.values()):
        curves = camera.responses.curves
        nm = next(iter(curves.values())).wavelength_nm
        kind = "relative" if camera.responses.relative else "included"
        parts.append(
            f'\n[responses]\ncsv = "curves.csv"\nrange_nm = [{nm[0]}, {nm[-1]}]\nquantum_efficiency = "{kind}"\n'
        )
        files[out / "curves.csv"] = responses_csv(curves)
    if "W" not in camera.responses.curves:
        study = study.replace(', "ple_rgbw"', "")
    return {**files, out / "sensor.toml": "".join(parts), out / "study.toml": study}


if __name__ == "__main__":
    try:
        app()
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
