"""Cameras of `benchmarks/design_mosaic.py --filters` beside Bayer and RGBW by simulation: `docs/make/filters.py HASH`.

Ten scenes are drawn from HASH, a commit's, lit by D65, photographed at seven levels, in each by chips of their own, and
developed by `ple`, whose prior is trained anew for the cameras found, docs/filters/. Radiance, priors and rows are
kept in out/filters; the page's table and picture and docs/results/filters.csv are written from them. Ten minutes.
"""

import json
import sys
from dataclasses import asdict
from functools import cache
from itertools import product
from math import log10
from pathlib import Path
from typing import Any

import numpy as np
from design import LEVELS, PAGE, SCENES, developed, trained, transport_of, with_prior
from numpy.typing import NDArray
from page_parts import RESULTS, csv_text, fill, run
from PIL import Image

from isp.processors.catalogue import NAMED, Processor
from render.transport import Transport
from rodcone.colour_spaces import luminance_of_srgb
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.presets import preset, vary
from studies.metrics.appearance import picture_quality, true_picture
from studies.metrics.confidence import half_width
from studies.metrics.flip import flip

FOUND = {name: Path(__file__).resolve().parents[1] / "filters" / f"{name}.toml" for name in ("strict", "loose")}
FOLDER = Path("out/filters")
IN_TABLE = ("moonlight", "street", "classroom", "sunlit day")
PICTURE, SHOWN = PAGE.parent / "pictures" / "filters" / "cameras.webp", ("bayer", "rgbw", "strict")
PICTURED = 1  # of the ten scenes
FIGURES = {"psnr_db": (1, 2), "luminance_db": (1, 2), "delta_e_median": (-1, 2), "flip_mean": (-1, 3)}


@cache
def cameras() -> dict[str, tuple[SensorConfig, Processor]]:
    """Sensors, with `ple` for their curves."""
    own = {"bayer": vary(preset("low_noise"), "bayer"), "rgbw": preset("low_noise")}
    result = {camera: (sensor, NAMED["ple"]) for camera, sensor in own.items()}
    for camera, file in FOUND.items():
        sensor = preset(file)
        result[camera] = (sensor, with_prior(trained(sensor, file.name, FOLDER / f"{camera}.npz")))
    return result


def pictures(transport: Transport, camera: str, luminance_cd_m2: float, scene: int) -> list[NDArray[np.float64]]:
    """Picture of a scene by a camera, and the truth, encoded."""
    rng = np.random.default_rng([scene, list(cameras()).index(camera)])
    return [true_picture(x).encoded for x in developed(transport, luminance_cd_m2, *cameras()[camera], rng)]


def show(commit: str) -> None:
    """Write the page's picture: a scene by the cameras, the truth last; a row for each level of the table."""
    transport, rows = transport_of(f"generated-{int(commit, 16) + PICTURED:x}", FOLDER), []
    for level in (x for x in DEMO_LEVELS if x.name in IN_TABLE):
        pairs = [pictures(transport, camera, level.luminance_cd_m2, PICTURED) for camera in SHOWN]
        rows.append(np.hstack([*(shown for shown, _ in pairs), pairs[0][1]]))
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((np.clip(np.vstack(rows), 0, 1) * 255).round().astype(np.uint8)).save(PICTURE, quality=85, method=6)


def rows_of(commit: str, number: int) -> list[dict[str, Any]]:
    """Rows of one scene, kept in a file."""
    name = f"generated-{int(commit, 16) + number:x}"
    path = FOLDER / f"{name}.json"
    if path.exists():
        return json.loads(path.read_text())
    transport, rows = transport_of(name, FOLDER), []
    for camera, level in product(cameras(), DEMO_LEVELS):
        row = {"scene": name, "camera": camera, "level": level.name}
        if level.name in LEVELS:  # brighter ones have the electrons of the last
            shown, truth = pictures(transport, camera, level.luminance_cd_m2, number)
            figures = {
                **asdict(picture_quality(shown, truth)), "flip_mean": float(flip(shown, truth).mean()),
                "luminance_db": -10 * log10(np.mean(luminance_of_srgb(shown - truth) ** 2)),
            }  # fmt: skip
        rows.append({**row, **figures})
    path.write_text(json.dumps(rows))
    return rows


def by_scene(rows: list[dict[str, Any]], camera: str, level: str, figure: str) -> NDArray[np.float64]:
    """A camera's figure at a level in each scene."""
    return np.array([row[figure] for row in rows if (row["camera"], row["level"]) == (camera, level)])


def leads(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Lead of the cameras found by level, and half its 95 % interval over scenes."""
    lines = []
    for found, level in product(FOUND, DEMO_LEVELS):
        lines.append([found, level.name])
        for figure, (sign, digits) in FIGURES.items():
            of, *others = (by_scene(rows, camera, level.name, figure) for camera in (found, "bayer", "rgbw"))
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


def ahead_db(rows: list[dict[str, Any]], found: str) -> NDArray[np.float64]:
    """Lead in PSNR over the better of Bayer and RGBW at each level, in the mean over levels, by scene."""
    leads_db = []
    for level in DEMO_LEVELS:
        of, *others = (by_scene(rows, camera, level.name, "psnr_db") for camera in (found, "bayer", "rgbw"))
        leads_db.append(of - max(others, key=np.mean))
    return np.mean(leads_db, axis=0)


def main(commit: str) -> None:
    """Write all, and print the leads over the better of Bayer and RGBW."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    show(commit)
    rows = [row for number in range(SCENES) for row in rows_of(commit, number)]
    write(leads(rows))
    for found in FOUND:
        ahead = ahead_db(rows, found)
        print(f"{found}: {ahead.mean():+.2f}±{half_width(ahead):.2f} dB over the better of Bayer and RGBW")


if __name__ == "__main__":
    run(main, sys.argv[1:], len(sys.argv) == 2, "give a commit's hash")
