"""The command `rodcone capture`: a scene as raw files."""

import sys
from typing import Annotated

from cyclopts import Parameter

from rodcone.progress import progress
from studies.commands.console import announce_cost, print_result, say
from studies.photograph.shot import Order, carry_out, check


def capture(order: Annotated[Order, Parameter(name="*")], *, dry_run: bool = False, json: bool = False) -> None:
    """Photograph a scene, write raw files that raw converters open, and print their paths.

    Parameters
    ----------
    dry_run
        Print what it would cost in time, memory and samples; compute nothing.
    json
        Print one JSON object with the paths and facts of the exposure instead of the paths.
    """
    checked = check(order)
    if not announce_cost(checked.cost, dry_run=dry_run, json=json):
        return
    with progress(sys.stderr) as step:
        result = carry_out(checked, step)
    say(*result.notes)
    print_result("\n".join(map(str, result.paths)), result.facts, json=json)
