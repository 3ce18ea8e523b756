"""The command `rodcone plan`."""

import sys
from pathlib import Path

from rich.console import Console

from rodcone.progress import progress
from studies.budget.plan import plan as plan_study
from studies.budget.plan_text import TABLE_LEGEND, plan_json, plan_table
from studies.budget.starting_points import reference_plan
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
    """Show a study's error budget: what its pictures leave out, what that costs and what it saves.

    The model is the cheapest within the budget, or the starting point that the study's `budget.model` names.

    Parameters
    ----------
    study
        Study file (.toml), as `rodcone new study` writes one.
    set
        KEY=VALUE that replaces the file's own, such as budget.total=0.05 or budget.model="fast"; may be given several
        times.
    cache
        Folder of renders to use and to fill.
    trust_code
        Run the Python files that the study names as processors (mine.py:develop); they may do all that you may.
    json
        Print one JSON object.
    """
    task = read_study(study, set or (), trust_code=trust_code)
    with progress(sys.stderr) as step:
        found = plan_study(task, cache=cache, step=step)
    if json:
        print_json(plan_json(task, found, reference_plan(task)))
        return
    console = Console(width=None if sys.stdout.isatty() else 100)
    console.print(plan_table(found))
    for paragraph in (TABLE_LEGEND, *found.summary):
        console.print("\n" + paragraph, markup=False, highlight=False)
