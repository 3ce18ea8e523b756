"""The command `rodcone capture`."""

import sys
from typing import Annotated

from cyclopts import Parameter

from rodcone.progress import progress
from studies.commands.console import print_result, say
from studies.photograph.shot import Order, take


def capture(order: Annotated[Order, Parameter(name="*")], *, json: bool = False) -> None:
    """Photograph a scene and write raw files that raw converters open; prints their paths.

    Parameters
    ----------
    json
        Print one JSON object with the paths and facts of the exposure instead of the paths.
    """
    with progress(sys.stderr) as step:
        taken = take(order, step)
    say(*taken.notes)
    print_result("\n".join(map(str, taken.paths)), taken.facts, json=json)
