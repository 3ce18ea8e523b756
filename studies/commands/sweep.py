"""The commands `rodcone sweep` and `rodcone export`."""

import errno
import json as notation
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from isp.processors.catalogue import require_libraries
from rodcone.errors import InputError, require_whole
from rodcone.memory import Memory, require_memory
from rodcone.progress import progress
from studies.budget.model_plan import Plan
from studies.budget.model_plan import as_stated as plan_as_stated
from studies.budget.plan import plan as plan_study
from studies.budget.plan import reference_plan
from studies.commands.estimate import Estimate, as_facts, estimate
from studies.commands.report import FILE as REPORT
from studies.commands.report import write_report
from studies.photograph.clock import Clock
from studies.study.lit_scene import open_all
from studies.study.study import Study
from studies.study.study_file import read_study
from studies.sweep.cluster import on_cluster
from studies.sweep.database import FILE
from studies.sweep.export import read_rows, write_table
from studies.sweep.run_sweep import Runner, Step, Swept, duration
from studies.sweep.run_sweep import sweep as run_sweep
from studies.sweep.workers import InThisProcess, cores, run, run_in_processes

MOST_WORKERS = 1024
INTERRUPTED = 130  # exit code after Ctrl-C: 128 + SIGINT
LINE_EVERY_S = 30.0  # of progress, where stderr is no terminal
PILOTS = "pilots"  # folder of a plan's renders beside the ledger


def sweep(
    study: Path,
    /,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("out/sweep"),
    set: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    workers: int | None = None,
    cluster: str | None = None,
    reference: Annotated[bool, Parameter(negative="")] = False,
    as_stated: Annotated[bool, Parameter(negative="")] = False,
    keep_old: Annotated[bool, Parameter(negative="")] = False,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Make every picture of a study, note each in a ledger and write a report; prints the ledger's path.

    Whatever ends it (Ctrl-C, a kill, a full disk), the same command goes on with the cells that are missing.

    Parameters
    ----------
    study
        Study file (.toml); `rodcone new study` writes one to start from.
    out
        Folder of the ledger, the pictures and the renders.
    set
        KEY=VALUE in place of the file's own, such as render.spp=64; may be given several times.
    workers
        Processes on this machine, one for each core by default; 1 runs all in this one.
    cluster
        Address of a dask scheduler whose workers do it instead, such as tcp://127.0.0.1:8786.
    reference
        Model everything, instead of what the sensor's noise doesn't hide.
    as_stated
        Render and image as study and sensors state, without a plan.
    keep_old
        Keep cells that other versions, another variant or other engines made as rows of their own, which rodcone export
        --all writes; they are removed once they are made anew otherwise.
    dry_run
        Print cells, renders, and an estimate of time and memory; compute nothing.
    force
        Go on where the estimate needs more memory than is free.
    json
        Print one JSON object instead of the path.
    """
    clock = Clock()
    task = read_study(study, set or ())
    if reference and as_stated:
        raise InputError("reference: it can't go with --as-stated; leave one of them out")
    if cluster is not None and workers is not None:
        raise InputError("workers: a cluster has its own; leave --workers or --cluster out")
    if workers is not None:
        require_whole("workers", workers, 1, MOST_WORKERS, "give processes")
    if dry_run:
        found = _estimated(task, out, reference, workers or cores())
        print(notation.dumps(as_facts(found)) if json else _words(found))
        return 0
    for name in task.processors:
        require_libraries(name)
    found = _estimated(task, out, reference, 0 if cluster else workers or cores())
    require_memory(Memory(found.bytes, found.largest_bytes), force)
    out.mkdir(parents=True, exist_ok=True)  # a place that can't be written is told before anything is rendered
    with _kept_told(out), ExitStack() as held:
        runner: Runner = _local(workers) if cluster is None else held.enter_context(on_cluster(cluster))
        step = held.enter_context(_steps())
        with clock.stage("plan"):
            plan = _plan(task, out, reference, as_stated, step)
        swept = run_sweep(task, out, plan, runner, step, keep_old=keep_old, clock=clock)
    for note in swept.notes:
        print(f"rodcone: {note}", file=sys.stderr)
    report = write_report(out, out / REPORT)
    print(f"rodcone: its report is {report}", file=sys.stderr)
    print(notation.dumps(_facts(swept) | {"report": str(report)}) if json else swept.out / FILE)
    return 0


def export(
    folder: Path,
    /,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])],
    everything: Annotated[bool, Parameter(name="--all", negative="")] = False,
) -> None:
    """Write the ledger of a sweep as a table, a row a cell; prints its path.

    Parameters
    ----------
    folder
        Folder of the sweep.
    out
        File to write: .csv, or .parquet with the extra of that name.
    everything
        Also the cells of earlier runs that the last one didn't ask for.
    """
    write_table(read_rows(folder, everything), out)
    print(out)


def _local(workers: int | None) -> Runner:
    count = workers or cores()
    return partial(run, executor=InThisProcess()) if count == 1 else partial(run_in_processes, workers=count)


def _plan(study: Study, out: Path, reference: bool, stated: bool, step: Step) -> Plan:
    if reference:
        return reference_plan(study)
    if stated:
        return plan_as_stated(study)
    return plan_study(study, cache=out / PILOTS, step=lambda what, share: step(f"plan: {what}", 0.0))


def _estimated(study: Study, out: Path, reference: bool, workers: int) -> Estimate:
    """Estimate without a plan's pilot renders: the study as stated is the most that a plan chooses."""
    plan = reference_plan(study) if reference else plan_as_stated(study)
    return estimate(study, plan, open_all(study), workers, len(read_rows(out)) if (out / FILE).is_file() else 0)


def _words(found: Estimate) -> str:
    return (
        f"{found.cells} cells, {found.kept} in the ledger from the last run; {found.renders} renders\n"
        f"about {duration(found.seconds)} with {found.workers} workers, at most {found.bytes / 1e9:.1f} GB of memory; "
        "renders and cells that are there already are not taken off"
    )


def _facts(swept: Swept) -> dict[str, object]:
    return {**vars(swept), "out": str(swept.out), "ledger": str(swept.out / FILE), "notes": list(swept.notes)}


@contextmanager
def _steps() -> Iterator[Step]:
    """Progress on stderr: a bar on a terminal, else a line now and then, for the logs of a batch system."""
    if sys.stderr.isatty():
        with progress(sys.stderr) as step:
            yield step
        return
    told = time.monotonic()

    def line(what: str, share: float) -> None:
        nonlocal told
        if time.monotonic() - told >= LINE_EVERY_S:
            told = time.monotonic()
            print(f"rodcone: {share:.0%}, {what}", file=sys.stderr)

    yield line


@contextmanager
def _kept_told(out: Path) -> Iterator[None]:
    """Say what is kept where Ctrl-C or a full disk ends the sweep."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"rodcone: stopped; {out} keeps what is done, and the same command goes on", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        words = f"{error.filename or out}: {error.strerror}; make room: {out} keeps what is done, and the same command"
        print(f"rodcone: {words} goes on", file=sys.stderr)
        raise SystemExit(1) from None
