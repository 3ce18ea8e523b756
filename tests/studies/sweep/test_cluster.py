"""Sweeps on dask: the same ledger as in one process though a worker dies, and one line where a cluster isn't there."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import sweep_sample as SAMPLE
from refusal import refusal

from rodcone.errors import InputError
from studies.sweep import cluster as module
from studies.sweep.cells import Cell
from studies.sweep.cluster import check_address, on_cluster
from studies.sweep.row import Row

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
