"""Cameras of `rodcone design --filters` beside Bayer and RGBW by simulation: `docs/make/filters.py HASH`.

Ten scenes are drawn from HASH, a commit's, lit by D65, photographed at seven levels with two seeds of noise, and
developed by `ple`, whose prior is trained anew for the cameras found, docs/filters/. Radiance, priors and rows are
kept in out/filters; the page's table and picture and docs/results/filters.csv are written from them.
"""

import json
import sys
from dataclasses import asdict, replace
from functools import cache, partial
from itertools import product
from math import log10
from pathlib import Path

import numpy as np
from design import PAGE, developed
from numpy.typing import NDArray
from page_parts import RESULTS, csv_text, fill
from PIL import Image

from isp.ple.prior import Prior, load_prior, own_prior, save_prior
from isp.processors.catalogue import NAMED
from isp.processors.piecewise import picture_ple
from render.engine import render
from render.transport import Transport
from rodcone.colour_spaces import luminance_of_srgb
from scenes.catalog import load
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.metrics.appearance import flip, true_picture
from studies.metrics.confidence import half_width
from studies.metrics.quality import measure
from studies.training.train import train_prior

FOUND = {name: Path(__file__).resolve().parents[1] / "filters" / f"{name}.toml" for name in ("strict", "loose")}
FOLDER = Path("out/filters")
SCENES, SEEDS, SIDE, SPP = 10, 2, 96, 256
IN_TABLE = ("moonlight", "street", "classroom", "sunlit day")
PICTURE, SHOWN = PAGE.parent / "pictures" / "filters" / "cameras.webp", ("bayer", "rgbw", "strict")
PICTURED = 1  # of the ten scenes
FIGURES = {"psnr_db": (1, 2), "luminance_db": (1, 2), "delta_e_median": (-1, 2), "flip_mean": (-1, 3)}


@cache
def cameras() -> dict[str, tuple[SensorConfig, Prior]]:
    """Sensors, with the priors that `ple` has for their curves."""
    result = {"bayer": (vary(preset("low_noise"), "bayer"), own_prior()), "rgbw": (preset("low_noise"), own_prior())}
    for camera, file in FOUND.items():
        sensor, trained = preset(file), FOLDER / f"{camera}.npz"
        if not trained.exists():
            save_prior(train_prior(replace(sensor, cfa=("RG", "BW")), file.name, 1), trained)
        result[camera] = (sensor, load_prior(trained))
    return result


def transport_of(name: str) -> Transport:
    """Light of a drawn scene."""
    return render(load(name, light="D65"), (SIDE, SIDE), spp=SPP, cache=FOLDER / "renders")


def pictures(transport: Transport, camera: str, luminance_cd_m2: float, seeds: list[int]) -> list[NDArray[np.float64]]:
    """Picture of a scene by a camera, and the truth, encoded."""
    sensor, prior = cameras()[camera]
    processor = replace(NAMED["ple"], picture=partial(picture_ple, prior=prior))
    rng = np.random.default_rng([seeds[0], list(cameras()).index(camera), seeds[1]])
    return [true_picture(x).encoded for x in developed(transport, luminance_cd_m2, sensor, processor, rng)]


def show(commit: str) -> None:
    """Write the page's picture: a scene by the cameras, the truth last; a row for each level of the table."""
    transport, rows = transport_of(f"generated-{int(commit, 16) + PICTURED:x}"), []
    for level in (x for x in DEMO_LEVELS if x.name in IN_TABLE):
        pairs = [pictures(transport, camera, level.luminance_cd_m2, [PICTURED, 0]) for camera in SHOWN]
        rows.append(np.hstack([*(shown for shown, _ in pairs), pairs[0][1]]))
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((np.clip(np.vstack(rows), 0, 1) * 255).round().astype(np.uint8)).save(PICTURE, quality=85, method=6)


def rows_of(commit: str, number: int) -> list[dict[str, str | float]]:
    """Rows of one scene, kept in a file."""
    name = f"generated-{int(commit, 16) + number:x}"
    path = FOLDER / f"{name}.json"
    if path.exists():
        return json.loads(path.read_text())
    transport, rows = transport_of(name), []
    for camera in cameras():
        for level in DEMO_LEVELS:
            for seed in range(SEEDS):
                shown, truth = pictures(transport, camera, level.luminance_cd_m2, [number, seed])
                rows.append({
                    "scene": name, "camera": camera, "level": level.name, "seed": seed,
                    **asdict(measure(shown, truth)), "flip_mean": float(flip(shown, truth).mean()),
                    "luminance_db": -10 * log10(np.mean(luminance_of_srgb(shown - truth) ** 2)),
                })  # fmt: skip
    path.write_text(json.dumps(rows))
    return rows


def leads(rows: list[dict[str, str | float]]) -> list[list[str]]:
    """Lead of the cameras found by level, and half its 95 % interval over scenes, each the mean of its seeds."""
    scenes, lines = list(dict.fromkeys(row["scene"] for row in rows)), []
    for found, level in product(FOUND, DEMO_LEVELS):
        lines.append([found, level.name])
        for figure, (sign, digits) in FIGURES.items():
            of, *others = (
                np.array([np.mean([row[figure] for row in rows
                                   if (row["scene"], row["camera"], row["level"]) == (scene, camera, level.name)])
                          for scene in scenes])
                for camera in (found, "bayer", "rgbw")
            )  # fmt: skip
            for other in others:
                lead = sign * (of - other)  # better is above 0
                lines[-1] += [f"{lead.mean():+.{digits}f}", f"{half_width(lead):.{digits}f}"]
    return lines


def write(lines: list[list[str]]) -> None:
    """Write the table of all leads, and the page's part."""
    beside = [f"{figure}_over_{camera}" for figure in FIGURES for camera in ("bayer", "rgbw")]
    names = ["camera", "level", *(x for name in beside for x in (name, f"{name}_interval"))]
    (RESULTS / "filters.csv").write_text(csv_text(names, lines))
    text = [
        "| over Bayer | PSNR [dB] | luminance [dB] | ΔE2000 | FLIP | over RGBW: PSNR |",
        "|---|---|---|---|---|---|",
    ]
    for camera, level, *cells in lines:
        if camera == "strict" and level in IN_TABLE:
            ahead = [f"{cells[index]}±{cells[index + 1]}" for index in (0, 4, 8, 12, 2)]
            text.append(f"| {level} | {' | '.join(ahead)} |")
    PAGE.write_text(fill(PAGE.read_text(), {"filters": "\n".join(text)}))
    for found in FOUND:
        ahead = [min(float(line[2]), float(line[4])) for line in lines if line[0] == found]
        print(f"{found}: {np.mean(ahead):+.2f} dB over the better of Bayer and RGBW in the mean of levels")


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    show(sys.argv[1])
    write(leads([row for number in range(SCENES) for row in rows_of(sys.argv[1], number)]))
