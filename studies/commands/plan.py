"""The command `rodcone plan`."""

import json as notation
import sys
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter


def plan(
    study: Path,
    /,
    *,
    set: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    check: Annotated[bool, Parameter(negative="")] = False,
    cache: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Compute a study's error budget and choose the cheapest model within it.

    Parameters
    ----------
    study
        Study file (.toml), as `rodcone new study` writes one.
    set
        Change of the study such as budget.total=0.05; may be given several times.
    check
        Render both models as well, and compare their expected electrons with what the budget predicts.
    cache
        Folder of renders to use and to fill.
    json
        Print one JSON object.
    """
    from rich.console import Console

    from rodcone.progress import progress
    from studies.budget import plan as budget
    from studies.budget import plan_text as report
    from studies.study.study_file import read_study

    task = read_study(study, set or ())
    everything = budget.reference_plan(task)
    with progress(sys.stderr) as step:
        chosen = budget.plan(task, cache=cache, step=step)
        found = report.plan_json(task, chosen, everything)
        checked = _check(task, chosen, everything, cache, step) if check else None
    if json:
        print(notation.dumps(found | ({"check": checked} if checked else {})))
        return
    Console(width=None if sys.stdout.isatty() else 200).print(report.plan_table(chosen))
    print("\n".join(report.reasons(task, chosen, everything)))
    if checked:
        print(
            "Check: the prediction covers {covered:.1%} of {conditions} conditions, median of predicted over measured "
            "{median_ratio:.2f}; renders took {planned_s:.1f} s planned, {reference_s:.1f} s reference".format(
                **checked
            )
        )


def _check(task: Any, chosen: Any, everything: Any, cache: Path | None, step: Any) -> dict[str, Any]:
    """Measure in a folder of renders of its own where none is given."""
    from tempfile import TemporaryDirectory

    from studies.budget.check import check_json, check_plan

    with TemporaryDirectory() as folder:
        return check_json(check_plan(task, chosen, everything, cache=cache or Path(folder), step=step))
