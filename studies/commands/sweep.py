"""The command `rodcone sweep`, and the estimate of a run's cost before anything is computed."""

import errno
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from isp.processors.catalogue import require_libraries
from rodcone.errors import require_absent, require_fields
from rodcone.memory import Memory, require_memory
from rodcone.progress import Step, progress
from studies.budget.ledger import Plan
from studies.budget.starting_points import plan_from_settings, reference_plan
from studies.commands.console import INTERRUPTED, announce_cost, print_result, say
from studies.commands.report_mark import REPORT, is_current
from studies.photograph.clock import Clock
from studies.study.cost import cores
from studies.study.study import AUTOMATIC, Study
from studies.study.study_file import read_study
from studies.sweep.cluster import on_cluster
from studies.sweep.cost import Estimate, estimated
from studies.sweep.database import FILE
from studies.sweep.kept_plan import kept_plan
from studies.sweep.prepare import PILOTS
from studies.sweep.run_sweep import Runner, SweepResult, locked_folder
from studies.sweep.run_sweep import sweep as run_sweep
from studies.sweep.workers import InThisProcess, run, worker_processes


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Processes or cluster that make what a study asks for.

    Attributes
    ----------
    workers : int, optional
        Processes on this machine, one for each core by default; 1 runs everything in this process.
    cluster : str, optional
        Address of a dask scheduler whose workers do it instead, such as tcp://127.0.0.1:8786.
    force : bool
        Run even where the estimate needs more memory than is free.
    """

    workers: Annotated[int | None, (1, 1024, "give processes")] = None
    cluster: str | None = None
    force: bool = False

    def __post_init__(self) -> None:
        require_fields(self)
        if self.cluster is not None:
            require_absent("beside --cluster, which has workers of its own", workers=self.workers)

    @property
    def processes(self) -> int:
        """Return the number of processes on this machine; 0 where a cluster works instead."""
        return 0 if self.cluster else self.workers or cores()

    def runner(self) -> AbstractContextManager[Callable[..., Generator[Any, None, None]]]:
        """Return a context whose function runs tasks: in this process, in a pool of processes or on a cluster."""
        if self.cluster is not None:
            return on_cluster(self.cluster)
        if self.processes == 1:
            return nullcontext(partial(run, executor=InThisProcess()))
        return worker_processes(self.processes)


@dataclass(frozen=True, kw_only=True)
class SweepOrder:
    """Settings of a sweep, and the folder that it goes to.

    Attributes
    ----------
    out : Path
        Folder of the results database, the pictures and the renders.
    set : tuple of str
        KEY=VALUE that replaces the file's own, such as render.spp=64; may be given several times.
    reference : bool
        Model everything, also what the sensor's noise hides.
    as_stated : bool
        Use bands, samples and lenses as the study and its sensors state them; make no plan.
    dry_run : bool
        Print cells, renders, and an estimate of time and memory; compute nothing.
    trust_code : bool
        Run the Python files that the study names as processors (mine.py:develop); they may do all that you may.
    """

    out: Path = Path("out/sweep")
    set: tuple[str, ...] = ()
    reference: bool = False
    as_stated: bool = False
    dry_run: bool = False
    trust_code: bool = False

    def __post_init__(self) -> None:
        if self.reference:
            require_absent("beside --reference", as_stated=self.as_stated)

    def plan(self, study: Study, step: Step) -> Plan:
        """Return the study's plan: from pilot renders, from the study's own settings, or with everything modelled."""
        if self.reference:
            return reference_plan(study)
        if self.as_stated:
            return plan_from_settings(study)
        return kept_plan(study, self.out / PILOTS, lambda what, share: step(f"plan: {what}", 0.0))


ORDER = SweepOrder()
WORKERS = Workers()


def sweep(
    study: Path,
    /,
    order: Annotated[SweepOrder, Parameter(name="*")] = ORDER,
    workforce: Annotated[Workers, Parameter(name="*")] = WORKERS,
    *,
    json: bool = False,
) -> int:
    """Make every picture of a study, note its figures in a results database, write a report and print its path.

    Whatever ends it (Ctrl-C, a kill, a full disk), the same command goes on with the cells that are missing.

    Parameters
    ----------
    study
        Study file (.toml); `rodcone new study` writes one to start from.
    json
        Print one JSON object instead of the path.
    """
    clock = Clock()
    task = read_study(study, order.set, trust_code=order.trust_code)
    planned = task.budget.model == AUTOMATIC and not (order.as_stated or order.reference)
    sizes = estimated(task, order.out, workforce.processes or cores(), reference=order.reference, planned=planned)
    if not announce_cost(sizes, dry_run=order.dry_run, json=json):
        return 0
    require_enough(task, sizes, force=workforce.force)
    runner = workforce.runner()
    ahead = workforce.processes != 1
    swept, report = make_all(task, order.out, partial(order.plan, task), runner, clock, ahead=ahead)
    say(f"its report is {report}")
    ledger = swept.out / FILE
    paths = {"out": str(swept.out), "ledger": str(ledger), "report": str(report)}
    print_result(ledger, {**vars(swept), **paths}, json=json)
    return 0


def require_enough(study: Study, sizes: Estimate, *, force: bool) -> None:
    """Raise `InputError` if a study's processors lack a library, or if more memory is needed than is free."""
    for name in study.processors:
        require_libraries(name)
    require_memory(Memory(sizes.bytes, sizes.largest_bytes), force)


def make_all(
    study: Study,
    out: Path,
    planned: Callable[[Step], Plan],
    runner: AbstractContextManager[Runner],
    clock: Clock,
    *,
    ahead: bool = True,
) -> tuple[SweepResult, Path]:
    """Sweep a study into a folder and write its report there; print progress and assumptions on stderr.

    Parameters
    ----------
    planned : callable
        Makes the plan and reports its progress to the function that it is given.
    runner : context manager of callable
        Is open while cells are made, and closed before the report is drawn.
    clock : Clock
        Started when the run was.
    ahead : bool
        As in `studies.sweep.run_sweep.sweep`.

    Returns
    -------
    SweepResult, Path
        What was made, and the report.
    """
    with ExitStack() as at_work:
        run_cells = at_work.enter_context(runner)
        # The folder is made before the plan, so that one that can't be written fails before anything is rendered.
        with locked_folder(out), saying_what_is_kept(out), progress(sys.stderr) as step:
            with clock.stage("plan"):
                plan = planned(step)
            swept = run_sweep(study, out, plan, run_cells, step, clock=clock, ahead=ahead)
            at_work.close()
            report = out / REPORT
            if swept.made or not is_current(out):
                from studies.commands.report import write_results  # slow: it imports what draws a page

                report = write_results(out)
    say(*swept.notes)
    return swept, report


@contextmanager
def saying_what_is_kept(out: Path) -> Iterator[None]:
    """If Ctrl-C or a full disk ends the ``with`` block, say that the folder keeps what is done, and exit."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"stopped; {out} keeps what is done, and the same command goes on")
        raise SystemExit(INTERRUPTED) from None
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        full = f"{error.filename or out}: {error.strerror}"
        say(f"{full}; make room: {out} keeps what is done, and the same command goes on")
        raise SystemExit(1) from None
