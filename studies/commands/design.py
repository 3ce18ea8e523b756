"""The command `rodcone design`."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from rodcone.errors import InputError, require_range, unknown
from rodcone.files import check_place, read_bounded, replacing
from rodcone.progress import progress
from scenes.levels import DEMO_LEVELS
from sensor.cfa import MOSAICS, tile_of
from sensor.config import SensorConfig
from sensor.presets import preset, preset_file
from studies.commands.expect import levels_between
from studies.design.expect import expect
from studies.design.filters import best_filters
from studies.design.search import Goal, Known, best_tile, search_for
from studies.pages.design_page import design_page, tile_text

SIDES = {"2x2": 2, "4x4": 4}
MOST_BYTES = 1 << 24  # of the file of tiles that were tried


def design(
    sensor: str,
    /,
    *,
    out: Path,
    tile: str = "4x4",
    letters: str = "RGBW",
    filters: bool = False,
    over: str = f"{DEMO_LEVELS[0].name}:{DEMO_LEVELS[-1].name}",
    weights: Annotated[list[float] | None, Parameter(negative_iterable=())] = None,
    never_worse_than: str = "bayer",
    behind: float = 0.1,
    behind_in_luminance: float = 0.5,
    light: str = "D65",
    prior: str = "drawn",
    steps: int = 500,
    seed: int = 0,
) -> None:
    """Search for the mosaic whose pictures have the least expected error over several levels of light.

    Writes the camera found (sensor.toml, a preset file like any other), a page with its gain over light beside
    published mosaics (design.html), and a study that checks it by simulation (study.toml). Tiles that were tried stay
    in tried.json: the command given again goes on where it ended.

    Parameters
    ----------
    sensor
        Sensor preset by name, or a preset file: its pixel, lens and responses.
    out
        Folder to write to.
    tile
        Size of the tile: 2x2, all of which are tried, or 4x4, by annealing.
    letters
        Channels to choose from; the sensor has a curve of each.
    filters
        Then shape the transmittances of the filters too, in front of the pixel of channel W.
    over
        Named levels of light, from one to another.
    weights
        Of the levels in the mean gain; equal by default.
    never_worse_than
        Mosaic that gains are over, by name or by rows.
    behind
        Decibels by which the design may fall behind it at any level, in PSNR, and in a* and b*.
    behind_in_luminance
        The same in luminance; half a decibel is the least that a person sees.
    light
        Illuminant; the camera knows it.
    prior
        Prior over patches: drawn or photographs.
    steps
        Tiles of 4x4 to look at.
    seed
        Of the search.
    """
    if tile not in SIDES:
        raise unknown("tile", tile, SIDES)
    levels = levels_between(over)
    if weights is not None and (len(weights) != len(levels) or min(weights) < 0 or not sum(weights)):
        raise InputError(
            f"weights: {weights} for {len(levels)} levels; allowed: a number for each, 0 or more; see over"
        )
    for name, bound in (("behind", behind), ("behind_in_luminance", behind_in_luminance)):
        require_range(name, bound, 0.0, 100.0, "give decibels, such as 0.1")
    base = preset(sensor)
    reference = tile_of(never_worse_than.split("/") if "/" in never_worse_than else never_worse_than)
    for letter in letters + "".join(reference):
        if letter not in base.responses.curves:
            raise unknown("letters", letter, base.responses.curves)
    share = np.array(weights or [1.0] * len(levels))
    goal = Goal(
        sensor=base, levels_cd_m2=np.array(list(levels.values())), weights=share / share.sum(), reference=reference,
        behind_db=np.array([behind, behind_in_luminance, behind]), letters=letters, light=light, prior=prior,
    )  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    # Tiles that were tried count for the same question alone.
    tried, question = out / "tried.json", {"sensor": repr(base), "reference": reference, "light": light,
                                           "prior": prior, "levels": levels}  # fmt: skip
    question = json.loads(json.dumps(question))
    known: Known = {}
    if tried.exists():
        check_place(tried)
        held = json.loads(read_bounded(tried, MOST_BYTES))
        known = held["gains_db"] if held.get("question") == question else {}

    def keep() -> None:
        with replacing(tried) as (place,):
            place.write_text(json.dumps({"question": question, "gains_db": known}), "utf-8")

    search = search_for(goal)
    with progress(sys.stderr) as step:
        try:
            found = best_tile(search, SIDES[tile], steps, seed, known, step)
        finally:
            keep()
        camera = replace(base, cfa=found)
        if filters:
            camera = best_filters(goal, found, 4, step)
    # Beside the design: mosaics by name that the sensor has the curves for.
    mosaics = {name: rows for name, rows in MOSAICS.items() if set("".join(rows)) <= set(base.responses.curves)}
    mosaics = {name: rows for name, rows in mosaics.items() if not name.startswith("bayer_")}
    cameras = {never_worse_than: replace(base, cfa=reference), "design": camera}
    cameras |= {name: replace(base, cfa=rows) for name, rows in mosaics.items() if name != never_worse_than}
    by_camera = {name: expect(one, list(levels.values()), light, prior=prior) for name, one in cameras.items()}
    _write(out, sensor, camera, filters)
    (out / "design.html").write_text(design_page(goal, camera, levels, by_camera, len(known)), "utf-8")
    print(f"{tile_text(found)}\n{out}")


def _write(out: Path, sensor: str, camera: SensorConfig, filters: bool) -> None:
    """Write the preset file of the camera found, its curves, and the study that checks it."""
    source = Path(sensor) if sensor.endswith(".toml") else preset_file(sensor)
    lines = source.read_text("utf-8").splitlines()
    rows = f"cfa = [{', '.join(json.dumps(row) for row in camera.cfa)}]"
    lines = [line for line in lines if not line.startswith("cfa")]
    first = next((index for index, line in enumerate(lines) if line.startswith("[")), len(lines))
    lines.insert(first, rows)
    if filters:
        start = next((index for index, line in enumerate(lines) if line.startswith("[responses]")), None)
        if start is not None:
            end = next((i for i in range(start + 1, len(lines)) if lines[i].startswith("[")), len(lines))
            del lines[start:end]
        names = list(camera.responses.curves)
        nm = camera.responses.curves[names[-1]].wavelength_nm
        lines += ["", "[responses]", 'csv = "curves.csv"', f"range_nm = [{nm[0]}, {nm[-1]}]",
                  'quantum_efficiency = "included"']  # fmt: skip
        table = [",".join(["wavelength_nm", *names])]
        for wavelength in nm:
            values = [np.interp(wavelength, c.wavelength_nm, c.values) for c in camera.responses.curves.values()]
            table.append(",".join([f"{wavelength:g}", *(f"{value:.6f}" for value in values)]))
        (out / "curves.csv").write_text("\n".join(table) + "\n", "utf-8")
    (out / "sensor.toml").write_text("\n".join(lines) + "\n", "utf-8")
    (out / "study.toml").write_text(_STUDY, "utf-8")


_STUDY = """# The design beside Bayer by simulation: rodcone sweep study.toml -o out, then rodcone report out
name = "design"
scenes = ["generated-d1", "generated-d2", "generated-d3", "still_life"]
levels = ["0.036cd/m2", "0.57cd/m2", "5.7cd/m2", "25cd/m2", "100cd/m2", "5700cd/m2"]
exposures = ["auto:information"]
sensors = ["sensor.toml"]
white_balances = ["as-shot"]
processors = ["ple", "ple_bayer", "ple_rgbw"]  # ple takes the sensor's own mosaic
seeds = [0, 1]

[render]
size = 128
spp = 256
"""
