"""The command `rodcone bench`."""

import json as notation
import os
import platform
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter


def bench(
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("out/bench"),
    scene: str = "still_life",
    sensor: str = "low_noise",
    level: str = "25cd/m2",
    size: int = 40,
    picture: int = 128,
    full: Annotated[bool, Parameter(negative="")] = False,
    seed: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
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
    from rodcone.errors import InputError, require_whole
    from rodcone.files import replacing
    from studies.pages.speed_page import bench_page
    from studies.speed.setup import Bench, checked, more
    from studies.study.levels import parse_level

    value, unit = parse_level(level)
    if unit != "cd/m2":
        raise InputError(f"level: {level!r} is not allowed; give a mean luminance such as 25cd/m2")
    for name, side in (("size", size), ("picture", picture)):
        require_whole(name, side, 16, 4096, "give pixels")
    task = checked(Bench(scene, sensor, value, size, picture, seed=seed))
    out.mkdir(parents=True, exist_ok=True)
    results = _measured(more(task) if full else task, quiet=json)
    content = notation.dumps(results, indent=1, allow_nan=False) + "\n"
    with replacing(out / "bench.json", out / "bench.html") as (data, page):
        data.write_text(content, encoding="utf-8")
        page.write_text(bench_page(results), encoding="utf-8")
    print(content if json else out / "bench.html", end="" if json else "\n")


def _measured(task: Any, quiet: bool) -> dict[str, Any]:
    """Measure all stages; unless `quiet`, print the machine and each stage as it is done."""
    from importlib import metadata

    from rodcone.progress import progress
    from studies.pages.environment import environment
    from studies.speed.points import stage_json
    from studies.speed.stages import STAGES, stages

    facts, versions, made = machine(), environment(), []
    if not quiet:
        print("\n".join(f"{name}: {fact}" for name, fact in (facts | versions).items()))
    with progress(sys.stderr) as step:
        for stage in stages(task):
            made.append(stage_json(stage))
            step(stage.name, len(made) / STAGES)
            if not quiet:
                print("\n".join(lines(made[-1])), flush=True)
    return {
        "rodcone": metadata.version("rodcone"),
        "settings": dict(vars(task)),
        "machine": facts,
        "environment": versions,
        "stages": made,
    }


def machine() -> dict[str, Any]:
    """Processor, cores, and how busy they are."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    facts: dict[str, Any] = {"processor": processor, "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load before the run"] = round(os.getloadavg()[0], 1)
    return facts


def lines(stage: dict[str, Any]) -> list[str]:
    """A stage as a table; * marks the Pareto front."""
    took = f"{stage['reference_s']:.3g} s, processor {stage['reference_processor_s']:.3g} s"
    made = [
        f"\n{stage['name']}: {stage['question']}",
        f"  reference: {stage['reference']}, {took}; sensor noise {stage['noise_e']:.3g} e-",
        f"  {'choice':27}{'seconds':>8}{'ratio':>8}{'processor':>10}{'ratio':>8}{'error, e-':>10}{'share':>9}",
    ]
    for point in stage["points"]:
        made.append(
            f"{'*' if point['on_front'] else ' ':>2}{point['choice']:27}{point['seconds']:8.3g}"
            f"{point['time_over_reference']:8.3g}{point['processor_s']:10.3g}{point['processor_over_reference']:8.3g}"
            f"{point['error_e']:10.3g}{100 * point['share_of_noise_variance']:8.2g}%"
        )
    return made
