"""Run cells on a cluster of `dask.distributed` (extra ``cluster``), with the same rows as on one machine."""

import logging
import os
import sys
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import closing, contextmanager
from functools import partial
from importlib.util import find_spec
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from rodcone.errors import InputError, one_line, read_errors
from rodcone.jit import backend
from studies.study.cost import cores
from studies.sweep.provenance import versions
from studies.sweep.run_cell import run_cell
from studies.sweep.workers import Task, run

PATIENCE_S = 30.0  # time for scheduler and workers to answer


@contextmanager
def on_cluster(address: str, patience_s: float = PATIENCE_S) -> Iterator[Callable[..., Generator[Any, None, None]]]:
    """Connect to a scheduler and yield a function that runs cells on its workers; dask replaces a worker that dies.

    Parameters
    ----------
    address : str
        Address of the scheduler: ``tcp://127.0.0.1:8786``, or ``tls://...`` with dask's own settings for TLS.
    patience_s : float
        Time to wait for the scheduler [s], because a batch job may start it only a moment before its sweep.

    Raises
    ------
    InputError
        For a cluster that doesn't answer, or has no workers, workers with other code, or workers with several threads.
        While cells run: for a cluster that goes away, or a cell whose workers died too often.
    """
    check_address(address)
    if find_spec("distributed") is None:
        raise InputError("cluster: dask.distributed is not installed; install it: pip install 'rodcone[cluster]'")
    with _quiet(), closing(_client(address, patience_s)) as client:
        slots, threads = _survey(client, address, patience_s)
        yield partial(_run, client, address, slots, threads)


def _run(
    client: Any, address: str, slots: int, threads: int, cells: Sequence[Task], make: Callable[..., Any] = run_cell
) -> Generator[Any, None, None]:
    """Run cells; each worker is given two at a time, so that it never waits for the next one."""
    from distributed import KilledWorker

    executor = client.get_executor(pure=False)
    try:
        yield from run(cells, executor, at_once=2 * slots, threads=threads, make=make)
    except KilledWorker as error:
        raise InputError(f"cluster: {one_line(error)}; what is done is kept; give workers more memory") from error
    except CancelledError as error:
        raise InputError(f"cluster: {address} went away; what is done is kept; start it and run again") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep dask's tracebacks off stderr: `on_cluster` raises one line in their place."""
    import distributed  # noqa: F401 - before the levels below, because the import sets them too

    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def check_address(address: str) -> None:
    """Raise `InputError` unless a text is a scheduler's address; warn if cells would cross a network unencrypted."""
    parts = urlsplit(address)
    try:
        complete = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:  # the port is not a number, or beyond 65535
        complete = False
    if not complete:
        raise InputError(
            f"cluster: {address!r} is not an address; allowed: tcp://HOST:PORT or tls://HOST:PORT of a dask scheduler"
        )
    if parts.scheme == "tcp" and not _is_loopback(str(parts.hostname)):
        warnings.warn(
            f"{address} is no loopback address: whoever reaches it can run code as you; see docs/studies.md for tls://",
            stacklevel=2,
        )


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _client(address: str, patience_s: float) -> Any:
    from distributed import Client

    _check_encryption(address)
    silence = f"cluster: {address} doesn't answer within {patience_s:g} s"
    with read_errors(silence, "start it: dask scheduler --host 127.0.0.1", OSError):
        return Client(address, timeout=patience_s, set_as_default=False)


def _check_encryption(address: str) -> None:
    """Raise `InputError` if dask's settings for TLS don't fit the address; dask's own error would be a traceback."""
    from distributed.security import Security

    try:
        security = Security()
        certified = security.get_connection_args("client").get("ssl_context") is not None
    except OSError as error:  # a certificate that can't be read, or isn't one
        raise InputError(
            f"cluster: dask's settings for TLS: {one_line(error)}; correct distributed.comm.tls"
        ) from error
    if address.startswith("tls:") and not certified:
        raise InputError(
            f"cluster: {address} needs certificates; allowed: ca-file and client under distributed.comm.tls in the "
            "file that DASK_CONFIG names; start from: rodcone new cluster -o dask.yaml"
        )
    if address.startswith("tcp:") and security.require_encryption:
        raise InputError(f"cluster: {address} is unencrypted, and dask's settings require encryption; write tls://")


def _survey(client: Any, address: str, patience_s: float) -> tuple[int, int]:
    """Check the workers; return their number, and how many threads Dr.Jit may use in each.

    The threads are a machine's cores divided by the number of its workers.
    """
    try:
        client.wait_for_workers(1, timeout=patience_s)
    except TimeoutError as error:
        raise InputError(
            f"cluster: {address} has no worker after {patience_s:g} s; start some: dask worker {address} --nthreads 1"
        ) from error
    for worker, count in client.nthreads().items():
        if count != 1:
            raise InputError(f"cluster: {worker} has {count} threads; allowed: 1; start dask worker with --nthreads 1")
    with read_errors("cluster: a worker lacks rodcone", "install it there", ImportError):
        workers = client.run(_facts)
    local = _facts()[0]
    remote, cores_of, safe_paths = zip(*workers.values(), strict=True)
    for worker, its in zip(workers, remote, strict=True):
        other = [name for name, version in local.items() if its.get(name) != version]
        if other:
            raise InputError(
                f"cluster: {worker} runs {other[0]} {its.get(other[0])}, this is {local[other[0]]}; "
                "install the same, start it again"
            )
    if not all(safe_paths):
        warnings.warn(
            f"{list(workers)[safe_paths.index(False)]} imports Python files of the folder in which it started; start "
            "dask worker with PYTHONSAFEPATH=1",
            stacklevel=2,
        )
    hosts = [urlsplit(worker).hostname for worker in workers]
    return len(hosts), max(1, min(count // hosts.count(host) for host, count in zip(hosts, cores_of, strict=True)))


def _facts() -> tuple[dict[str, str], int, bool]:
    """Return this process's versions and cores, and whether Python imports nothing from its working directory."""
    safe = sys.flags.safe_path or bool(os.environ.get("PYTHONSAFEPATH"))
    return {**versions(), "engine": backend()}, cores(), safe
