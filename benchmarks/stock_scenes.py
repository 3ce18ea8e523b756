"""A folder of Mitsuba scenes, each rendered here and by Mitsuba's own integrator: `make verify SCENES=folder`.

    python benchmarks/stock_scenes.py FOLDER [--side 48] [--samples 256] [--define spp=16] [--out table.csv]

Every .xml file under the folder counts. Mitsuba reads it itself and renders it by its `path`, at the depth that the
file states, into the same four bands. Told are the means of the two pictures and of 16 blocks, and each refusal's line.
Two pictures that differ are rendered once more, with 64 times the samples: noise of fireflies goes, an error stays.
A file that isn't opened and that another one includes, or without a camera or light, is no scene but a part of one.
"""

import argparse
import csv
import re
import sys
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from render.engine import render
from render.loader import mitsuba_module, own_mitsuba_variant
from render.scene import Scene, film_size
from render.user_scene.scene_file import load_scene_file
from render.user_scene.scene_paths import search_path
from rodcone.errors import InputError, one_line
from rodcone.types import Floats

NM, WIDTH_NM = np.array([425.0, 500.0, 575.0, 650.0]), 60.0
MOST_MEAN, MOST_BLOCK = 0.03, 0.15  # differences, relative, within which two pictures of this noise agree
BLOCKS = 4  # a side
LONGER = 64  # times the samples, where two pictures differ
NO_SCENE = ("it has no light", "camera 'none'", "its root is")
_INCLUDED = re.compile(r'<include\s[^>]*filename\s*=\s*"([^"]*)"')


@dataclass(frozen=True)
class Compared:
    """One scene: what became of it, its relative differences from stock in the mean and in the worst block."""

    path: str
    outcome: str
    mean: float = np.nan
    block: float = np.nan


def compare(path: Path, side: int, samples: int, define: Mapping[str, str]) -> Compared:
    """Render a scene here and by stock Mitsuba, longer where they differ, or say why not."""
    found = _compared(path, side, samples, define)
    return _compared(path, side, LONGER * samples, define) if found.outcome == "differs" else found


def included(paths: Sequence[Path]) -> set[str]:
    """Names of the files that others of a folder include."""
    texts = [path.read_text("utf-8", errors="replace") for path in paths]
    return {Path(name).name for text in texts for name in _INCLUDED.findall(text)}


def _compared(path: Path, side: int, samples: int, define: Mapping[str, str]) -> Compared:
    try:
        opened = load_scene_file(path, extend="hold", define=define)
        size = film_size(opened.size, side)
        made = render(opened.scene, size, wavelength_nm=NM, width_nm=WIDTH_NM, spp=samples).relight().values
        theirs = _stock(path, opened.scene, size, samples, define)
    except InputError as error:
        return Compared(str(path), "part" if any(words in str(error) for words in NO_SCENE) else f"refused: {error}")
    except RuntimeError as error:
        return Compared(str(path), f"stock Mitsuba fails: {one_line(error)[:200]}")
    ours, stock = _blocks(made), _blocks(theirs)
    if not stock.any():
        return Compared(str(path), "agrees" if not ours.any() else "differs", 0.0, 0.0)
    mean = float(ours.mean() / stock.mean() - 1)
    block = float(np.abs(ours - stock).max() / stock.mean())
    agree = abs(mean) <= MOST_MEAN and block <= MOST_BLOCK
    return Compared(str(path), "agrees" if agree else "differs", mean, block)


@own_mitsuba_variant()
def _stock(path: Path, scene: Scene, size: tuple[int, int], samples: int, define: Mapping[str, str]) -> Floats:
    """Stock Mitsuba's picture of a file that it reads itself, by our camera and depth, (h, w, band)."""
    mi, kept = mitsuba_module(), mitsuba_module().file_resolver()
    film: dict[str, Any] = {"type": "specfilm", "width": size[1], "height": size[0], "component_format": "float32"}
    for index, centre in enumerate(NM):
        ends = {"wavelength_min": centre - WIDTH_NM / 2, "wavelength_max": centre + WIDTH_NM / 2}
        film[f"band{index}"] = {"type": "regular", **ends, "values": "1,1"}
    film["rfilter"] = {"type": "box"}
    sensor = {**scene.geometry["sensor"], "film": film, "sampler": {"type": "multijitter"}}
    integrator = {"type": "path", "max_depth": scene.max_depth, "rr_depth": scene.rr_depth}
    mi.set_file_resolver(search_path(mi, path.parent))
    try:
        loaded = mi.load_file(str(path), **define)
    finally:
        mi.set_file_resolver(kept)
    picture = mi.render(
        loaded, sensor=mi.load_dict(sensor), integrator=mi.load_dict(integrator), spp=4 * samples, seed=1
    )
    return np.asarray(picture, np.float64) / WIDTH_NM


def _blocks(picture: Floats) -> Floats:
    """Means of the picture's blocks, all bands together."""
    rows = np.array_split(picture.mean(axis=-1, dtype=np.float64), BLOCKS)
    return np.array([[block.mean() for block in np.array_split(row, BLOCKS, axis=1)] for row in rows])


def main() -> None:
    """Compare all scenes of a folder and print one table; exit with 1 where one differs."""
    parser = argparse.ArgumentParser(description="Compare a folder of Mitsuba scenes with stock Mitsuba.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--side", type=int, default=48, help="longer side of a picture in pixels")
    parser.add_argument("--samples", type=int, default=256, help="samples per pixel; stock takes four times as many")
    parser.add_argument("--define", action="append", default=[], help="NAME=VALUE of a $parameter")
    parser.add_argument("--out", type=Path, help="table as .csv")
    order = parser.parse_args()
    paths = sorted(order.folder.rglob("*.xml"))
    if not paths:
        sys.exit(f"{order.folder}: it holds no .xml file; give a folder of Mitsuba scenes")
    rows, parts, define = [], included(paths), dict(text.split("=", 1) for text in order.define)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for path in paths:
            row = compare(path, order.side, order.samples, define)
            if row.outcome.startswith("refused") and path.name in parts:
                row = Compared(row.path, "part")
            rows.append(row)
            name, figures = path.relative_to(order.folder), ""
            if np.isfinite(row.mean):
                figures = f" {100 * row.mean:+.2f} % in the mean, {100 * row.block:.1f} % in the worst block"
            print(f"{name}: {row.outcome}{figures}", flush=True)
    if order.out:
        order.out.parent.mkdir(parents=True, exist_ok=True)
        with order.out.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(["scene", "outcome", "mean", "worst_block"])
            table.writerows([Path(r.path).relative_to(order.folder), r.outcome, r.mean, r.block] for r in rows)
    counts = Counter(row.outcome.partition(":")[0] for row in rows)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.most_common()))
    sys.exit(1 if counts["differs"] else 0)


if __name__ == "__main__":
    main()
