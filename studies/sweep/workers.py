"""Run cells on any executor, or on a pool of processes that is made anew when one of them dies."""

import multiprocessing
import os
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial
from multiprocessing import active_children
from multiprocessing.connection import wait as wait_for
from multiprocessing.process import BaseProcess
from typing import Any, Protocol

from rodcone.child_process import SAFE_PATH, end_with_parent
from rodcone.errors import InputError, require_whole
from rodcone.jit import backend, dr
from studies.study.cost import cores
from studies.sweep.run_cell import run_cell

MOST_WORKERS = 1024
LEAVE_S = 10.0  # time for an idle worker to end, while libraries release threads and memory
MOST_DEATHS = 3  # a cell is given up after this many workers have died with it, two of them while it ran alone
# Variables that BLAS libraries and OpenMP read when they are imported; they are set before a worker starts.
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
# The settings to which glibc adapts once 32 MB were freed at once. Arrays of a small frame are just larger than its
# initial limits: a new worker would ask the system for memory for each of them, which takes a fifth of its time.
_ALLOCATION = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 26)}
# After a kill, multiprocessing's own process removes the semaphores, and would print a warning about it.
_QUIET_TRACKER = "ignore:resource_tracker:UserWarning"


class Task(Protocol):
    """Work whose result a worker makes: a cell of a sweep, or a shard of a data set.

    What a worker has prepared for one task serves all tasks of the same kind, such as cells that differ only in their
    seed.
    """

    @property
    def key(self) -> str:
        """Return the hash of all that decides the result."""

    @property
    def kind(self) -> tuple[object, ...]:
        """Return the values that all tasks of this kind have in common; messages name the kind by them."""


class WorkerLostError(RuntimeError):
    """Error that is raised when a worker dies; `cells` are those that the executor had then."""

    def __init__(self, cells: Sequence[Task]) -> None:
        super().__init__("a worker died")
        self.cells = tuple(cells)


class InThisProcess(Executor):
    """Executor that runs each call as it is submitted."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run the call; its exception, if any, is the future's."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def run(
    cells: Iterable[Task],
    executor: Executor,
    *,
    at_once: int = 1,
    threads: int | None = None,
    make: Callable[..., Any] = run_cell,
) -> Generator[Any, None, None]:
    """Run cells on an executor, and yield their rows in the order in which they are finished.

    After Ctrl-C no further cell is started. The rows of cells that run are still yielded, then `KeyboardInterrupt` is
    raised.

    Parameters
    ----------
    cells : iterable of Cell
    executor : concurrent.futures.Executor
        Any whose calls may travel as pickles: a pool, `InThisProcess`, `dask.distributed.Client.get_executor()`.
    at_once : int
        Most cells that the executor has at one time. If it is the number of workers, each worker makes the cells of one
        condition one after the other. Twice that number helps if a worker would wait long for its next cell.
    threads : int, optional
        Threads of Dr.Jit in each worker.
    make : callable
        Function that makes the result of a task, such as a cell's row.

    Raises
    ------
    InputError, OSError
        As `studies.sweep.run_cell.run_cell`.
    WorkerLostError
        If the executor broke; rows that were ready have been yielded.
    """
    call = partial(_made, make, threads)
    waiting = dict[Hashable, deque[Task]]()
    for cell in cells:
        waiting.setdefault(cell.kind, deque()).append(cell)
    running: dict[Future[Any], Task] = {}
    try:
        while True:
            while waiting and len(running) < at_once:
                cell = _take(waiting, running.values())
                try:
                    running[executor.submit(call, cell)] = cell
                except BrokenExecutor as error:
                    raise WorkerLostError([*running.values(), cell]) from error
            if not running:
                return
            yield from _finished(running)
    except KeyboardInterrupt:
        for future in [future for future in running if future.cancel()]:
            del running[future]
        while running:
            yield from _finished(running)
        raise
    finally:
        for future in running:
            future.cancel()


def _made(make: Callable[[Any], Any], threads: int | None, task: Task) -> Any:
    """Run a task with `threads` threads of Dr.Jit (None keeps the present number), and return its result."""
    if threads is not None:
        _limit_threads(threads)
    return make(task)


@cache
def _limit_threads(most: int) -> None:
    """Set Dr.Jit's number of threads in this process; only the LLVM backend has any."""
    if backend() == "llvm":
        dr.set_thread_count(most)


def _take(waiting: dict[Hashable, deque[Task]], running: Iterable[Task]) -> Task:
    """Take the next cell, from a kind that no worker computes now, or from the first kind if all are being computed.

    So a worker goes on with the kind that it has just finished, and keeps what it has prepared for it.
    """
    busy = {cell.kind for cell in running}
    kind = next((kind for kind in waiting if kind not in busy), next(iter(waiting)))
    cell = waiting[kind].popleft()
    if not waiting[kind]:
        del waiting[kind]
    return cell


def _finished(running: dict[Future[Any], Task]) -> Iterator[Any]:
    """Wait for the cells that finish next, and yield their rows; an error of one of them is raised after the rows."""
    ready, _ = wait(running, return_when=FIRST_COMPLETED)
    for future in [future for future in ready if future.exception() is None]:
        del running[future]
        yield future.result()
    for future in [future for future in ready if future in running]:
        if isinstance(future.exception(), BrokenExecutor):
            raise WorkerLostError(tuple(running.values())) from future.exception()
        del running[future]
        future.result()


def run_in_processes(
    cells: Sequence[Task], workers: int, make: Callable[..., Any] = run_cell
) -> Generator[Any, None, None]:
    """Run cells on spawned processes; if one of them dies, make the pool anew.

    The cells that a broken pool had taken are run again, after all others and one by one. If memory was short, each of
    them now has all of it, and it becomes clear which cell kills its worker. Dr.Jit, BLAS and OpenMP get
    cores / workers threads in each process.

    Raises
    ------
    InputError
        For no workers; at the end, where a cell ended its worker `MOST_DEATHS` times; all others are done by then.
    """
    with worker_processes(workers) as run_cells:
        yield from run_cells(cells, make)


@contextmanager
def worker_processes(workers: int) -> Iterator[Callable[..., Generator[Any, None, None]]]:
    """Give a function that runs cells as `run_in_processes` does, on processes that stay from one call to the next.

    They start with the first cell: a process imports and compiles once, whatever the number of scenes.

    Raises
    ------
    InputError
        For no workers.
    """
    require_whole("workers", workers, 1, MOST_WORKERS, "give processes to run at once")
    with ExitStack() as pools:
        yield partial(_run_on_pools, _Pools(pools, workers))


class _Pools:
    """Pool at work, which another one replaces when it breaks."""

    def __init__(self, stack: ExitStack, workers: int) -> None:
        self.workers = workers
        self.threads = max(1, cores() // workers)
        self._stack = stack
        self._pool: ProcessPoolExecutor | None = None

    def whole(self) -> ProcessPoolExecutor:
        """Return a pool that isn't known to be broken."""
        if self._pool is None:
            self._pool = self._stack.enter_context(_pool(self.workers, self.threads))
        return self._pool

    def drop(self) -> None:
        """End the pool, which is broken."""
        self._pool = None
        self._stack.close()


def _run_on_pools(
    pools: _Pools, cells: Sequence[Task], make: Callable[..., Any] = run_cell
) -> Generator[Any, None, None]:
    waiting = {cell.key: cell for cell in cells}
    deaths = Counter[str]()
    given_up: list[Task] = []
    while waiting:
        untried = [cell for cell in waiting.values() if not deaths[cell.key]]
        batch, at_once = (untried, pools.workers) if untried else (list(waiting.values()), 1)
        try:
            for row in run(batch, pools.whole(), at_once=at_once, threads=pools.threads, make=make):
                del waiting[row.key]
                yield row
        except WorkerLostError as lost:
            deaths.update(cell.key for cell in lost.cells)
            given_up += [waiting.pop(cell.key) for cell in lost.cells if deaths[cell.key] >= MOST_DEATHS]
            pools.drop()
    if given_up:
        first = given_up[0]
        raise InputError(
            f"cells: {len(given_up)} ended their worker {MOST_DEATHS} times, the first "
            f"{' of '.join(map(str, first.kind))}; the others are done; the memory may be short: give fewer --workers, "
            "or run again"
        )


@contextmanager
def _pool(workers: int, threads: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of spawned processes, and start all of them.

    Processes that are forked would share the locks of Dr.Jit's and BLAS's threads.
    """
    others = active_children()
    with _inherited(threads):
        pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin)
        with suppress(BrokenExecutor):  # one was killed while it started; the first cell finds the pool broken
            for _ in range(workers):  # each submission starts one process, because none is idle yet
                pool.submit(cores)
    impatience = threading.Timer(LEAVE_S, _end, ([process for process in active_children() if process not in others],))
    try:
        yield pool
    finally:
        impatience.start()
        pool.shutdown(cancel_futures=True)
        impatience.cancel()


def _end(processes: Sequence[BaseProcess]) -> None:
    """End workers that can't end by themselves, because one that was killed has left the queue locked."""
    for process in processes:
        with suppress(ProcessLookupError):  # it has just ended
            process.kill()


@contextmanager
def _inherited(threads: int) -> Iterator[None]:
    """Set the environment and the signal mask that processes started within the block inherit.

    They ignore Ctrl-C, because this process handles it.
    """
    variables = {
        **SAFE_PATH,
        **_ALLOCATION,
        **dict.fromkeys(_THREAD_VARIABLES, str(threads)),
        "PYTHONWARNINGS": ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), _QUIET_TRACKER))),
    }
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _begin() -> None:
    """Make a new worker end when its parent is killed: at once on Linux, else once native code lets Python run."""
    end_with_parent()
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)
