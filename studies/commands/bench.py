"""The command `rodcone bench`."""

import json as notation
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from rodcone.errors import InputError, require_whole
from rodcone.files import replacing
from rodcone.progress import progress
from scenes.catalog import load
from sensor.presets import preset
from studies.commands.console import print_table
from studies.pages.report_facts import environment
from studies.pages.speed_page import bench_page
from studies.photograph.clock import processor_facts
from studies.speed.points import stage_json
from studies.speed.stages import STAGES, Bench, more, stages
from studies.study.levels import parse_level

HEAD = (" choice", "seconds", "ratio", "processor", "ratio", "error, e-", "share")


def bench(
    *,
    out: Path = Path("out/bench"),
    scene: str = "still_life",
    sensor: str = "low_noise",
    level: str = "25cd/m2",
    size: int = 40,
    picture: int = 128,
    full: bool = False,
    seed: int = 0,
    json: bool = False,
) -> None:
    """Measure each stage's choices as time and error and write bench.html and bench.json.

    Parameters
    ----------
    out
        Folder for the two files.
    scene
        Scene by name.
    sensor
        Sensor preset by name, or a preset file.
    level
        Light level such as 25cd/m2 (mean scene luminance).
    size
        Side of the renders in pixels.
    picture
        Side of the pictures that lens, readout and reconstruction work on.
    full
        More choices and more repeats: some ten times as long.
    seed
        Seed of renders, chip and exposure.
    json
        Print the JSON instead of the tables.
    """
    luminance_cd_m2, unit = parse_level(level)
    if unit != "cd/m2":
        raise InputError(f"level: {level!r} is not allowed; give a mean luminance such as 25cd/m2")
    for name, side in (("size", size), ("picture", picture)):
        require_whole(name, side, 16, 4096, "give pixels")
    task = Bench(scene=scene, sensor=sensor, level_cd_m2=luminance_cd_m2, size=size, picture=picture, seed=seed)
    task = more(task) if full else task
    work = stages(task, load(scene), preset(sensor))
    out.mkdir(parents=True, exist_ok=True)
    results: dict[str, Any] = {
        "rodcone": metadata.version("rodcone"),
        "settings": dict(vars(task)),
        "machine": processor_facts(),
        "environment": environment(),
        "stages": [],
    }
    if not json:
        print("\n".join(f"{name}: {fact}" for name, fact in (results["machine"] | results["environment"]).items()))
    with progress(sys.stderr) as step:
        for stage in map(stage_json, work):
            results["stages"].append(stage)
            step(stage["name"], len(results["stages"]) / STAGES)
            if not json:
                _print_stage(stage)
    content = notation.dumps(results, indent=1, allow_nan=False) + "\n"
    with replacing(out / "bench.json", out / "bench.html") as (data, page):
        data.write_text(content, encoding="utf-8")
        page.write_text(bench_page(results), encoding="utf-8")
    print(content if json else out / "bench.html", end="" if json else "\n")


def _print_stage(stage: dict[str, Any]) -> None:
    """Print a stage as a table; * marks the Pareto front."""
    print(f"\n{stage['name']}: {stage['question']}")
    took = f"{stage['reference_s']:.3g} s, processor {stage['reference_processor_s']:.3g} s"
    print(f"reference: {stage['reference']}, {took}; sensor noise {stage['noise_e']:.3g} e-")
    numbers = ("seconds", "time_over_reference", "processor_s", "processor_over_reference", "error_e")
    rows = [
        (
            f"{'*' if point['on_front'] else ' '}{point['choice']}",
            *(f"{point[name]:.3g}" for name in numbers),
            f"{100 * point['share_of_noise_variance']:.2g}%",
        )
        for point in stage["points"]
    ]
    print_table(HEAD, rows)
