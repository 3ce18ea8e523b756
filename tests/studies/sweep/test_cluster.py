"""Sweeps on dask: the same ledger as in one process though a worker dies, and one line where a cluster isn't there."""

import os
import platform
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
import sweep_sample as SAMPLE
from refusal import refusal

from rodcone.errors import InputError
from studies.sweep import cluster as module
from studies.sweep import workers
from studies.sweep.cells import Cell
from studies.sweep.cluster import check_address, on_cluster
from studies.sweep.row import Row
from studies.sweep.workers import InThisProcess, WorkerLostError, run, run_in_processes

TRIM = "MALLOC_TRIM_THRESHOLD_"  # by dask's own NumPy takes twice the time: our settings raise it
SETTINGS = Path(module.__file__).parents[1] / "data" / "dask.yaml"


def free_port() -> int:
    with socket.socket() as place:
        place.bind(("127.0.0.1", 0))
        return int(place.getsockname()[1])


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator["subprocess.Popen[bytes]"]:
    """One of dask's commands, ended with all its children."""
    environment = {key: value for key, value in os.environ.items() if key != TRIM}
    environment["DASK_CONFIG"] = str(SETTINGS)
    with (folder / f"{arguments[0]}.log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            env=environment,
            stdout=log,
            stderr=log,
            cwd=folder,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(20)
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()


@contextmanager
def cluster(folder: Path, *options: str) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Address and process of a scheduler on loopback with workers."""
    address = f"tcp://127.0.0.1:{free_port()}"
    here = ("--host", "127.0.0.1")
    port = address.rpartition(":")[2]
    with (
        running(folder, "scheduler", *here, "--port", port, "--no-dashboard") as scheduler,
        running(folder, "worker", address, *here, "--no-dashboard", *options),
    ):
        for _ in range(100):  # the scheduler's imports take seconds where the machine is busy
            with socket.socket() as place:
                if place.connect_ex(("127.0.0.1", int(port))) == 0:
                    break
            time.sleep(0.2)
        yield address, scheduler


@pytest.mark.slow
def test_two_workers_one_of_them_killed_give_what_one_process_gives(tmp_path: Path) -> None:
    from distributed import Client

    study = SAMPLE.small_study(tmp_path, processors=("bayer", "interleaved"), seeds=(0, 1, 2))
    SAMPLE.swept(study, tmp_path / "serial")
    killed: list[int] = []

    def with_a_death(run: Any, address: str, cells: Sequence[Cell]) -> Iterator[Row]:
        for row in run(cells):
            if not killed:
                with Client(address, set_as_default=False) as client:
                    # in a lambda: `os.environ.get` itself would travel with the environment of this process
                    found = client.run(lambda: (os.environ.get(TRIM), os.environ.get("OMP_NUM_THREADS")))
                    assert set(found.values()) == {("67108864", "1")}
                    killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)
            yield row

    with cluster(tmp_path, "--nworkers", "2", "--nthreads", "1") as (address, _), on_cluster(address, 60.0) as run:
        assert SAMPLE.swept(study, tmp_path / "dask", partial(with_a_death, run, address)).made == 12
    assert killed
    assert SAMPLE.content(tmp_path / "dask") == SAMPLE.content(tmp_path / "serial")


@pytest.mark.slow
def test_workers_with_many_threads_are_refused(tmp_path: Path) -> None:
    with cluster(tmp_path, "--nworkers", "1", "--nthreads", "2") as (address, _):
        with pytest.raises(InputError, match="has 2 threads; allowed: 1") as told, on_cluster(address, 60.0):
            pass
        assert "\n" not in str(told.value)


@pytest.mark.thorough
def test_a_cluster_that_does_not_answer_is_told_in_time() -> None:
    pytest.importorskip("distributed", reason="rodcone[cluster] is not installed")
    began = time.monotonic()
    with (
        pytest.raises(InputError, match=r"doesn't answer within 0\.5 s") as told,
        on_cluster(f"tcp://127.0.0.1:{free_port()}", 0.5),
    ):
        pass
    assert time.monotonic() - began < 30
    assert "\n" not in str(told.value)
    assert "dask scheduler --host 127.0.0.1" in str(told.value)


def test_what_is_no_address_is_refused() -> None:
    for address in ["127.0.0.1:8786", "http://127.0.0.1:80", "tcp://127.0.0.1", "tcp://x:99999", ""]:
        refusal(check_address, address, match="allowed: tcp://HOST:PORT or tls://HOST:PORT")


def test_settings_for_tls_that_do_not_fit_the_address_are_told(tmp_path: Path) -> None:
    dask = pytest.importorskip("dask", reason="rodcone[cluster] is not installed")

    with pytest.raises(InputError, match="needs certificates"), on_cluster("tls://127.0.0.1:8786", 0.5):
        pass
    with dask.config.set({"distributed.comm.require-encryption": True}):  # noqa: SIM117
        with pytest.raises(InputError, match="write tls://"), on_cluster("tcp://127.0.0.1:8786", 0.5):
            pass
    (tmp_path / "ca.pem").write_text("no certificate", "utf-8")
    at = "distributed.comm.tls"
    files = {f"{at}.ca-file": str(tmp_path / "ca.pem"), f"{at}.client.cert": str(tmp_path / "absent.pem")}
    with dask.config.set(files):  # noqa: SIM117
        with (
            pytest.raises(InputError, match=r"correct distributed\.comm\.tls"),
            on_cluster("tls://127.0.0.1:8786", 0.5),
        ):
            pass


def test_an_open_network_in_clear_is_told_of_and_loopback_and_tls_are_not() -> None:
    for address in ("tcp://127.0.0.1:8786", "tcp://localhost:8786", "tcp://[::1]:8786", "tls://10.0.0.5:8786"):
        check_address(address)
    for address in ("tcp://10.0.0.5:8786", "tcp://node7:8786"):
        with pytest.warns(UserWarning, match="can run code as you"):
            check_address(address)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.sweep.cluster.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"rodcone\[cluster\]"), on_cluster("tcp://127.0.0.1:8786"):
        pass


# Running cells: any executor, pools that outlive deaths, threads shared out, no process left behind.


class Deadly:
    """Ends the process that unpickles it."""

    def __reduce__(self) -> Any:
        return os._exit, (9,)


class Breaking(Executor):
    """Executor that gives one result and breaks."""

    def __init__(self) -> None:
        self.calls = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.calls += 1
        future: Future[Any] = Future()
        if self.calls == 1:
            future.set_result(fn(*args, **kwargs))
        else:
            future.set_exception(BrokenExecutor("gone"))
        return future


@pytest.fixture
def cells(tmp_path: Path) -> list[Cell]:
    return SAMPLE.made_cells(tmp_path)


def test_what_was_ready_comes_before_the_error(cells: list[Cell], tmp_path: Path) -> None:
    bad = replace(cells[2], frame=replace(cells[2].frame, truth=tmp_path / "absent.npy"))
    running = run([cells[0], bad, cells[1]], InThisProcess(), at_once=2)
    assert next(running).key == cells[0].key
    refusal(list, running, match="can't be read")


FAULTS = """(lambda np, used: [used(0).ru_minflt, *(
    sum(np.ones((128, 128)).sum() for _ in [[np.ones((128, 128)) for _ in range(8)]]) for _ in range(50)
), used(0).ru_minflt])(__import__("numpy"), __import__("resource").getrusage)"""


@pytest.mark.thorough
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are glibc's")
def test_a_worker_keeps_the_memory_of_small_frames() -> None:
    """Nine arrays of 32 pages, made fifty times: a worker that gave them back would fault 14 400 times."""
    with workers._pool(1, 1) as pool:
        first, *_, last = pool.submit(eval, FAULTS).result()
    assert last - first < 1000


def test_a_broken_executor_tells_which_cells_it_held(cells: list[Cell]) -> None:
    running = run(cells, Breaking(), at_once=3)
    assert next(running).key == cells[0].key
    with pytest.raises(WorkerLostError) as lost:
        next(running)
    assert {cell.key for cell in lost.value.cells} == {cell.key for cell in cells[1:3]}


@pytest.mark.thorough
def test_a_cell_that_ends_its_worker_is_given_up_and_all_others_are_made(cells, monkeypatch):
    monkeypatch.setattr(workers, "MOST_DEATHS", 2)
    deadly = replace(cells[1], colours=Deadly())  # type: ignore[arg-type]
    made = []
    with pytest.raises(InputError, match=r"1 ended their worker 2 times, the first bayer of Condition\(") as told:
        made.extend(row.key for row in run_in_processes([cells[0], deadly, *cells[2:]], 1))
    assert sorted(made) == sorted(cell.key for cell in (cells[0], *cells[2:]))
    assert "\n" not in str(told.value)
    assert active_children() == []


class KilledAtOnce(ProcessPoolExecutor):
    """Pool of which the first one's processes are killed as they start."""

    pools = 0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        type(self).pools += 1
        self.is_first = self.pools == 1

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future = super().submit(fn, *args, **kwargs)
        if self.is_first:
            for process in list(self._processes.values()):
                process.kill()
            assert isinstance(future.exception(), BrokenExecutor)
        return future


@pytest.mark.thorough
def test_a_pool_whose_worker_is_killed_while_it_starts_is_made_anew(cells, monkeypatch):
    monkeypatch.setattr(workers, "ProcessPoolExecutor", KilledAtOnce)
    made = [row.key for row in run_in_processes(cells, 2)]
    assert sorted(made) == sorted(cell.key for cell in cells)
    assert KilledAtOnce.pools == 2


@pytest.mark.thorough
def test_a_worker_that_can_not_leave_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """As one whose neighbour was killed with the queue's lock in its hands, just when all cells were done."""
    monkeypatch.setattr(workers, "LEAVE_S", 0.5)
    began = time.monotonic()
    with workers._pool(2, 1) as pool:
        endless = pool.submit(time.sleep, 600)
        while not endless.running():
            time.sleep(0.05)
    assert isinstance(endless.exception(), BrokenExecutor)
    assert active_children() == []
    assert time.monotonic() - began < 60


ORPHANS = """
import os, signal, held
from studies.sweep import workers
if __name__ == "__main__":
    with workers._pool(2, 1) as pool:
        pids = {pool.submit(os.getpid).result() for _ in range(40)}
        for _ in range(2):
            pool.submit(held.hold)
        print(*pids, flush=True)
        signal.pause()
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="the kernel of Linux ends workers with their parent")
def test_workers_in_native_code_end_with_their_parent(tmp_path: Path) -> None:
    """Native code that holds Python's lock for ten minutes lets no thread of Python notice that the parent is gone."""
    (tmp_path / "held.py").write_text("import ctypes\n\ndef hold():\n    ctypes.PyDLL(None).sleep(600)\n")
    (tmp_path / "main.py").write_text(ORPHANS)
    paths = {"PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])}
    command = [sys.executable, tmp_path / "main.py"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | paths) as parent:
        assert parent.stdout is not None
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        parent.terminate()
    assert pids
    for pid in pids:
        while Path(f"/proc/{pid}/stat").is_file() and Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z":
            time.sleep(0.05)  # the test's own time limit ends this
