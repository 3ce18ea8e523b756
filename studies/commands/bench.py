"""The command `rodcone bench`."""

import json as notation
import sys
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from rodcone.errors import InputError
from rodcone.files import write_files
from rodcone.progress import progress
from scenes.catalogue import load
from sensor.presets import preset
from studies.commands.console import print_table
from studies.pages.report_sweep import environment
from studies.pages.speed_page import bench_page
from studies.photograph.clock import processor_facts
from studies.speed.stages import STAGES, Bench, stages
from studies.study.levels import parse_level

DEFAULT = Bench()
HEAD = (" choice", "seconds", "ratio", "processor", "ratio", "error, e-", "share")


def bench(
    task: Annotated[Bench, Parameter(name="*")] = DEFAULT, *, out: Path = Path("out/bench"), json: bool = False
) -> None:
    """Measure each stage's choices as time and error, and write bench.html and bench.json.

    Parameters
    ----------
    out
        Folder for the two files.
    json
        Print the JSON instead of the tables.
    """
    if parse_level(task.level)[1] != "cd/m2":
        raise InputError(f"level: {task.level!r} is not allowed; give a mean luminance such as 25cd/m2")
    work = stages(task, load(task.scene), preset(task.sensor))
    out.mkdir(parents=True, exist_ok=True)
    results: dict[str, Any] = {
        "rodcone": metadata.version("rodcone"),
        "settings": vars(task),
        "machine": processor_facts(),
        "environment": environment(),
        "stages": [],
    }
    if not json:
        print("\n".join(f"{name}: {fact}" for name, fact in (results["machine"] | results["environment"]).items()))
    with progress(sys.stderr) as step:
        for stage in work:
            results["stages"].append(stage)
            step(stage["name"], len(results["stages"]) / STAGES)
            if not json:
                _print_stage(stage)
    content = notation.dumps(results, indent=1, allow_nan=False) + "\n"
    write_files({out / "bench.json": content, out / "bench.html": bench_page(results)})
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
