"""The command `rodcone plan`."""

import sys
from pathlib import Path

from rich.console import Console

from rodcone.progress import progress
from studies.budget.plan import plan as plan_study
from studies.budget.plan import reference_plan
from studies.budget.plan_text import plan_json, plan_table, reasons
from studies.commands.console import print_json
from studies.study.study_file import read_study


def plan(
    study: Path,
    /,
    *,
    set: list[str] | None = None,
    cache: Path | None = None,
    trust_code: bool = False,
    json: bool = False,
) -> None:
    """Compute a study's error budget and choose the cheapest model within it.

    Parameters
    ----------
    study
        Study file (.toml), as `rodcone new study` writes one.
    set
        KEY=VALUE that replaces the file's own, such as budget.total=0.05; may be given several times.
    cache
        Folder of renders to use and to fill.
    trust_code
        Run the Python files that the study names as processors (mine.py:develop); they may do all that you may.
    json
        Print one JSON object.
    """
    task = read_study(study, set or (), trust_code=trust_code)
    everything = reference_plan(task)
    with progress(sys.stderr) as step:
        cheapest = plan_study(task, cache=cache, step=step)
    if json:
        print_json(plan_json(task, cheapest, everything))
        return
    Console(width=None if sys.stdout.isatty() else 100).print(plan_table(cheapest))
    print("\n".join(reasons(task, cheapest, everything)))
