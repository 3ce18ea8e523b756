"""What the white pixel brings, as a page: a study with photographs beside the scenes, and the page of its sweep.

The page has the commands: ``white_pixel.py study WHEELS`` and ``white_pixel.py page SWEEP``.
"""

import io
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from page_parts import RESULTS, Parts, csv_text, run, write_swept
from PIL import Image

from rodcone.errors import InputError
from studies.metrics.confidence import half_width
from studies.metrics.metric import DELTA_E, FLIP, PSNR, Metric
from studies.pages.headline import WHITE_PIXEL
from studies.pages.plots import light_charts, svg_text
from studies.pages.report_compare import DRAWN
from studies.pages.report_text import fixed, lead_text, level_text, markdown_table, significant
from studies.sweep.row import Row

PAGE = RESULTS.parent / "white_pixel.md"
STUDY = PAGE.parents[1] / "studies" / "configs" / "white_pixel.toml"
METRICS = (PSNR, DELTA_E, FLIP)
Pair = tuple[str, str]  # a camera of RGBW and one of Bayer
LEARNED: Pair = ("ple_rgbw_net", "ple_bayer_net")  # one network for both mosaics
BEST: Pair = ("RGBW", "RGB")  # in place of a pair: the best camera of each place by its channels
# No training picture is among them (studies/training/pictures.py); by the wheel and the folder in it that holds them.
PHOTOGRAPHS = {
    "china.jpg": "sklearn/datasets/images",
    "flower.jpg": "sklearn/datasets/images",
    "grace_hopper.jpg": "matplotlib/mpl-data/sample_data",
    "hubble_deep_field.jpg": "skimage/data",
    "motorcycle_left.png": "skimage/data",
    "retina.jpg": "skimage/data",
    "ihc.png": "skimage/data",
}
SIDE = 128  # pixels of a photograph's longer side, means of its own
Places = Mapping[tuple[str, str, str], Mapping[str, Row]]  # by balance, scene and level, then by camera


def write_study(folder: Path) -> None:
    """Write the study with photographs and the strongest Bayer cameras into a folder that holds the two wheels."""
    net, sklearn = (next(folder.glob(f"{name}-*.whl"), None) for name in ("demosaicnet", "scikit_learn"))
    if net is None or sklearn is None:
        raise InputError(f"{folder}: it lacks a wheel; run pip download --no-deps -d {folder} scikit-learn demosaicnet")
    for name, inside in PHOTOGRAPHS.items():
        package = find_spec(inside.split("/")[0])
        if package is None:
            content = ZipFile(sklearn).read(f"{inside}/{name}")
        else:
            content = Path(str(package.origin)).parents[1].joinpath(inside, name).read_bytes()
        photograph = Image.open(io.BytesIO(content)).convert("RGB")
        photograph.thumbnail((SIDE, SIDE), Image.Resampling.BOX)
        photograph.save(folder / f"{name.partition('.')[0]}.png")
    cameras = [*WHITE_PIXEL, *LEARNED, f"{net.name}:bayer_net", f"{net.name}:bayer_net_bm3d", "bayer_residual_bm3d"]
    names = [f"{name.partition('.')[0]}.png" for name in PHOTOGRAPHS]
    text = STUDY.read_text("utf-8").replace("scenes = [", f"scenes = [\n  {json.dumps(names)[1:-1]},", 1)
    (folder / "study.toml").write_text(re.sub(r"processors = .*", f"processors = {json.dumps(cameras)}", text), "utf-8")


def parts(rows: Iterable[Row], version: str) -> Parts:
    """Return the page's generated parts, its figure as SVG, and every figure as CSV."""
    places: dict[tuple[str, str, str], dict[str, Row]] = {}
    for row in rows:
        places.setdefault((row.white_balance, row.scene, row.level), {})[row.processor] = row
    needed = (*WHITE_PIXEL, *LEARNED)
    missing = [camera for camera in needed if any(camera not in cameras for cameras in places.values())]
    if missing or not places:
        raise InputError(f"study: it lacks {' and '.join(missing) or 'rows'}; allowed: the study white_pixel, one seed")
    balances, scenes, levels = (list(dict.fromkeys(axis)) for axis in zip(*places, strict=True))
    head = [level_text(level) for level in levels]
    content = {
        "set-up": f"rodcone {version}, {len(scenes)} scenes, each once a balance and level. Exposure times, by "
        f"`auto:information`, in the median over scenes, RGBW and Bayer: {exposures(places, balances[0], levels)}.",
        **{
            f"leads {balance}": markdown_table(["", *head], lead_rows(places, balance, scenes, levels))
            for balance in balances
        },
        "learned": markdown_table(["", *head], mean_rows(places, balances[0], scenes, levels, LEARNED)),
        "best": markdown_table(["", *head], best_rows(places, balances[0], scenes, levels)),
    }
    lines = [(balance, balance, WHITE_PIXEL) for balance in balances]
    lines += [(f"{balances[0]}, learned", balances[0], LEARNED), (f"{balances[0]}, best", balances[0], BEST)]
    charts = {
        f"PSNR, dB: lead, {kind}": {
            name: np.array([leads(places, PSNR, balance, kept, level, pair).mean() for level in levels])
            for name, balance, pair in lines
        }
        for kind, kept in kinds(scenes).items()
    }
    light = [next(iter(places[balances[0], scenes[0], level].values())).luminance_cd_m2 for level in levels]
    cells = [
        [*place, camera, *(f"{getattr(row, metric.key):.4g}" for metric in METRICS), f"{row.exposure_s * 1e3:.4g}"]
        for place, cameras in places.items()
        for camera, row in cameras.items()
    ]
    columns = ["balance", "scene", "level", "camera", *(metric.key for metric in METRICS), "exposure_ms"]
    return content, svg_text(light_charts(light, charts)), csv_text(columns, cells)


def kinds(scenes: Sequence[str]) -> dict[str, list[str]]:
    """Return the scenes by kind: photographs, drawn from a number, and named."""
    kind_of = {
        scene: "photographs" if scene.endswith(".png") else "drawn" if scene.startswith(DRAWN) else "named"
        for scene in scenes
    }
    return {kind: [scene for scene in scenes if kind_of[scene] == kind] for kind in dict.fromkeys(kind_of.values())}


def best_camera(cameras: Mapping[str, Row], metric: Metric, channels: str) -> Row:
    """Return the row of the camera that is best by a metric, of those that count electrons in these channels alone."""
    those = [row for row in cameras.values() if set(json.loads(row.mean_electrons)) == set(channels)]
    return max(those, key=lambda row: getattr(row, metric.key) * (1 if metric.higher else -1))


def leads(
    places: Places, metric: Metric, balance: str, scenes: Sequence[str], level: str, pair: Pair = WHITE_PIXEL
) -> np.ndarray:
    """Return by scene how much better a pair's RGBW camera is than its Bayer camera; `BEST` is the best of each."""
    found = []
    for scene in scenes:
        cameras = places[balance, scene, level]
        ours, theirs = (best_camera(cameras, metric, name) if pair is BEST else cameras[name] for name in pair)
        lead = getattr(ours, metric.key) - getattr(theirs, metric.key)
        found.append(lead if metric.higher else -lead)
    return np.array(found)


def lead_rows(places: Places, balance: str, scenes: Sequence[str], levels: Sequence[str]) -> list[list[str]]:
    """Return a row for each scene, and means over each kind with half the 95 % interval over its scenes."""
    rows = []
    for kind, kept in kinds(scenes).items():
        for scene in kept:
            cells = [[float(leads(places, m, balance, [scene], level)[0]) for m in METRICS] for level in levels]
            short = f"drawn {scene[-2:]}" if kind == "drawn" else scene.partition(".")[0]
            rows.append([f"`{short}`", *("/".join(map(written, METRICS, cell)) for cell in cells)])
        rows.append([f"{len(kept)} {kind}", *(mean_cell(places, balance, kept, level) for level in levels)])
    return rows


def mean_rows(
    places: Places, balance: str, scenes: Sequence[str], levels: Sequence[str], pair: Pair
) -> list[list[str]]:
    """Return a pair's mean leads over each kind of scene."""
    return [
        [f"{len(kept)} {kind}", *(mean_cell(places, balance, kept, level, pair) for level in levels)]
        for kind, kept in kinds(scenes).items()
    ]


def best_rows(places: Places, balance: str, scenes: Sequence[str], levels: Sequence[str]) -> list[list[str]]:
    """Return mean leads of each place's best RGBW camera over its best Bayer camera, and how often which were these."""
    rows = mean_rows(places, balance, scenes, levels, BEST)
    for metric, channels in product(METRICS, BEST):
        cells = []
        for level in levels:
            best = Counter(best_camera(places[balance, scene, level], metric, channels).processor for scene in scenes)
            cells.append(", ".join(f"`{name.rpartition(':')[2]}` {count}" for name, count in best.most_common()))
        mosaic = "RGBW" if "W" in channels else "Bayer"
        rows.append([f"best {mosaic} by {metric.name.partition(',')[0]}", *cells])
    return rows


def written(metric: Metric, lead: float) -> str:
    """Write a lead, in bold where a person sees that RGBW is behind."""
    return f"**{lead_text(metric, lead)}**" if lead <= -metric.threshold else lead_text(metric, lead)


def mean_cell(places: Places, balance: str, scenes: Sequence[str], level: str, pair: Pair = WHITE_PIXEL) -> str:
    """Write means of leads over scenes by metric, each with half its 95 % interval."""
    of_scenes = {metric: leads(places, metric, balance, scenes, level, pair) for metric in METRICS}
    return "/".join(
        f"{written(metric, float(x.mean()))}±{fixed(float(half_width(x)), metric.digits)}"
        for metric, x in of_scenes.items()
    )


def exposures(places: Places, balance: str, levels: Sequence[str]) -> str:
    """Say the two cameras' exposure times at each level, in the median over scenes [ms]."""
    said = []
    for level in levels:
        here = [cameras for (of, _, at), cameras in places.items() if (of, at) == (balance, level)]
        times = [np.median([cameras[name].exposure_s * 1e3 for cameras in here]) for name in WHITE_PIXEL]
        said.append(f"{significant(times[0])} and {significant(times[1], 'ms')} at {level_text(level)}")
    return ", ".join(said)


def write(what: str, folder: str) -> None:
    """Write the study, or the page's parts, its figure and its table."""
    if what == "study":
        write_study(Path(folder))
    else:
        write_swept(PAGE, parts, folder)


def main(arguments: Sequence[str]) -> None:
    """Write what is asked for."""
    allowed = len(arguments) == 2 and arguments[0] in ("study", "page")
    run(write, arguments, allowed, "give study and a folder, or page and one")


if __name__ == "__main__":
    main(sys.argv[1:])
