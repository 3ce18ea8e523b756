"""The command `rodcone design`."""

import json
import re
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from rodcone.errors import InputError, read_errors, require_fields, require_keys, unknown
from rodcone.files import read_bounded, write_files
from rodcone.progress import progress
from rodcone.toml_file import read_toml
from scenes.levels import DEMO_LEVELS
from sensor.cameras.numbers import responses_csv
from sensor.cfa import MOSAICS, channels
from sensor.config import SensorConfig, with_tile
from sensor.presets import preset, preset_file
from sensor.variations import VARIATIONS, vary
from studies.commands.expect import levels_between
from studies.design.expect import ExpectedError, expect
from studies.design.filters import best_filters
from studies.design.search import Goal, Known, best_tile
from studies.pages.design_page import design_page, tile_text

SIDES = {"2x2": 2, "4x4": 4}
_STUDY = Path(__file__).parent.parent / "data" / "design_study.toml"
MOST_BYTES = 1 << 24  # of the file of tiles that were tried


@dataclass(frozen=True, kw_only=True)
class DesignOrder:
    """What a mosaic is sought for, and among which.

    Attributes
    ----------
    tile : str
        Size of the tile: 2x2, all of which are tried, or 4x4, by annealing; or its rows, such as RG/BW.
    letters : str
        Channels to choose from; the sensor has a curve of each.
    filters : bool
        Shape the filters' transmittances too, in front of a pixel of channel W.
    rounds : int
        Rounds of the filters, each at the exposures that its first filters take.
    over : str
        Named levels of light, from one to another.
    weights : tuple of float
        Weight of each level in the mean gain; equal by default.
    never_worse_than : str
        Mosaic that gains are over, by name or by rows.
    behind : float
        Decibels that the design may lose to it at any level, in PSNR, and in a* and b*; below 0: must gain.
    behind_in_luminance : float
        The same in luminance; half a decibel is the least that a person sees.
    light : str
        Illuminant; the camera knows it.
    prior : str
        Prior over patches: drawn or photographs.
    steps : int
        Tiles of 4x4 to look at.
    seed : int
        Seed of the search.
    """

    tile: str = "4x4"
    letters: str = "RGBW"
    filters: bool = False
    rounds: Annotated[int, (1, 100, "give 4 or so")] = 4
    over: str = f"{DEMO_LEVELS[0].name}:{DEMO_LEVELS[-1].name}"
    weights: tuple[float, ...] = ()
    never_worse_than: str = "bayer"
    behind: Annotated[float, (-100.0, 100.0, "give decibels, such as 0.1")] = 0.1
    behind_in_luminance: Annotated[float, (-100.0, 100.0, "give decibels, such as 0.1")] = 0.5
    light: str = "D65"
    prior: str = "drawn"
    steps: Annotated[int, (0, 100_000, "give 500 or so")] = 500
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0

    def __post_init__(self) -> None:
        require_fields(self)
        if not self.letters:
            raise InputError("letters: '' names no channel; allowed: some of the sensor's; give RGBW or so")
        if self.tile not in SIDES and "/" not in self.tile:
            raise unknown("tile", self.tile, SIDES)
        count = len(self.levels)
        if self.weights and (len(self.weights) != count or min(self.weights) < 0 or not sum(self.weights)):
            raise InputError(
                f"weights: {list(self.weights)} for {count} levels; allowed: 0 or more; give --weights once for each"
            )

    @property
    def levels(self) -> dict[str, float]:
        """Luminances [cd m^-2] by the levels' names."""
        return levels_between(self.over)

    def goal(self, base: SensorConfig) -> Goal:
        """Goal of a search with a camera's pixel, lens and responses."""
        reference = vary(base, self.never_worse_than).cfa
        require_keys("letters", self.letters + "".join(reference), base.responses.curves)
        share = np.array(self.weights or [1.0] * len(self.levels))
        return Goal(
            sensor=base,
            levels_cd_m2=np.array(list(self.levels.values())),
            weights=share / share.sum(),
            reference=reference,
            behind_db=np.array([self.behind, self.behind_in_luminance, self.behind]),
            letters=self.letters,
            light=self.light,
            prior=self.prior,
        )


DEFAULT = DesignOrder()


def design(sensor: str, /, order: Annotated[DesignOrder, Parameter(name="*")] = DEFAULT, *, out: Path) -> None:
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
    """
    base, levels = preset(sensor), order.levels
    goal = order.goal(base)
    tile = () if order.tile in SIDES else vary(base, order.tile).cfa

    def errors(camera: SensorConfig) -> list[ExpectedError]:
        return expect(camera, goal.levels_cd_m2, order.light, prior=order.prior)

    by_camera = {order.never_worse_than: errors(vary(base, order.never_worse_than))}
    out.mkdir(parents=True, exist_ok=True)
    # Tiles that were tried count for the same question alone.
    tried = out / "tried.json"
    question = [repr(base), list(goal.reference), order.light, order.prior, levels]
    tried_gains_db = _known(tried, question)

    with progress(sys.stderr) as step:
        if not tile:
            try:
                tile = best_tile(goal, SIDES[order.tile], order.steps, order.seed, tried_gains_db, step)
            finally:
                write_files({tried: json.dumps({"question": question, "gains_db": tried_gains_db})})
        camera = with_tile(base, tile, base.responses)
        if order.filters:
            camera = best_filters(goal, tile, order.rounds, step)
    # Beside the design: mosaics of three channels or more that the sensor can have, Bayer's in one phase.
    tiles = {**MOSAICS, **{name: rows for name, (rows, _) in VARIATIONS.items()}}
    curves = set(base.responses.curves)
    names = [
        name
        for name, rows in tiles.items()
        if len(channels(rows)) > 2
        and not name.startswith("bayer_")
        and (curves >= set("RGBW") or curves >= {*"".join(rows)})
    ]
    by_camera["design"] = errors(camera)
    by_camera |= {name: errors(vary(base, name)) for name in names if name != order.never_worse_than}
    _write(out, sensor, camera, order.filters)
    write_files({out / "design.html": design_page(goal, camera, levels, by_camera, len(tried_gains_db))})
    print(f"{tile_text(tile)}\n{out}")


def _known(tried: Path, question: list[Any]) -> Known:
    """Gains of tiles that an earlier run tried for the same question."""
    if not tried.exists():
        return {}
    damage = (ValueError, LookupError, TypeError, AttributeError)
    fix = "allowed: that, or no such file; move it away"
    with read_errors(f"out: {str(tried)!r} isn't what rodcone design wrote", fix, damage):
        held = json.loads(read_bounded(tried, MOST_BYTES))
        tried_gains_db: Known = held["gains_db"] if held["question"] == json.loads(json.dumps(question)) else {}
        if any(np.shape(gains) != (3, len(question[-1])) for gains in tried_gains_db.values()):
            raise ValueError("gains of another shape")
    return tried_gains_db


def _write(out: Path, sensor: str, camera: SensorConfig, filters: bool) -> None:
    """Write the preset file of the camera found, its curves where the file names some, and the study that checks it."""
    source = Path(sensor) if sensor.endswith(".toml") else preset_file(sensor)
    content = read_toml(source)
    text = source.read_text("utf-8")
    # Keys stand before the first table; a table ends where the next one begins.
    head, *tables = re.split(r"^(?=\[)", text, flags=re.MULTILINE)
    head = re.sub(r"^cfa\s*=\s*(\[[^\]]*\]|[^\n]*)\n?", "", head, flags=re.MULTILINE)
    parts = [f"cfa = {json.dumps(list(camera.cfa))}\n{head}"]
    for table in tables:  # but those of channels that the new mosaic lacks
        keys = tomllib.loads(table)
        if "responses" not in keys and all(x["channel"] in camera.channels for x in keys.get("channels", ())):
            parts.append(table)
    if filters or "responses" in content:
        curves = camera.responses.curves
        nm = next(iter(curves.values())).wavelength_nm
        kind = "relative" if camera.responses.relative else "included"
        parts.append(
            f'\n[responses]\ncsv = "curves.csv"\nrange_nm = [{nm[0]}, {nm[-1]}]\nquantum_efficiency = "{kind}"\n'
        )
        write_files({out / "curves.csv": responses_csv(curves)})
    study = _STUDY.read_text("utf-8")
    if "W" not in camera.responses.curves:
        study = study.replace(', "ple_rgbw"', "")
    write_files({out / "sensor.toml": "".join(parts), out / "study.toml": study})
