"""The command `rodcone dataset`."""

import sys
from dataclasses import replace
from pathlib import Path
from shlex import join
from typing import Annotated

from cyclopts import Parameter

from rodcone.progress import progress
from studies.commands.console import announce_cost, print_result
from studies.commands.sweep import WORKERS, Workers, require_enough, saying_what_is_kept
from studies.dataset.make_set import make_set
from studies.dataset.order import SetOrder
from studies.study.cost import cores
from studies.study.study_file import read_study
from studies.sweep.cost import estimated

ORDER = SetOrder()


def dataset(
    study: Path,
    /,
    order: Annotated[SetOrder, Parameter(name="*")] = ORDER,
    workforce: Annotated[Workers, Parameter(name="*")] = WORKERS,
    *,
    out: Path = Path("out/dataset"),
    set: tuple[str, ...] = (),
    dry_run: bool = False,
    json: bool = False,
) -> int:
    """Make raw frames of every scene, light, sensor and seed of a study, and the truth behind them; print the folder.

    Tar shards in WebDataset's layout, a manifest and a card. Whatever ends it, the same command goes on.

    Parameters
    ----------
    study
        Study file (.toml); its processors stand for the mosaics that they take.
    out
        Folder of renders and frames; the set is its folder "set".
    set
        KEY=VALUE that replaces the file's own, such as render.spp=64; may be given several times.
    dry_run
        Print frames, renders, and an estimate of time and memory; compute nothing.
    json
        Print one JSON object instead of the folder.
    """
    task = read_study(study, set)
    task = replace(task, scenes=(*task.scenes, *order.drawn_scenes))
    sizes = estimated(task, out, workforce.processes or cores(), frames=True)
    if not announce_cost(sizes, dry_run=dry_run, json=json):
        return 0
    require_enough(task, sizes, force=workforce.force)
    options = [*(("set", change) for change in set), *vars(order).items()]
    words = [word for name, value in options if value is not None for word in (f"--{name}", str(value))]
    command = join(["rodcone", "dataset", study.name, *words])
    with workforce.runner() as runner, saying_what_is_kept(out), progress(sys.stderr) as step:
        made = make_set(task, out, order, command, runner, step)
    print_result(made["folder"], made, json=json)
    return 0
