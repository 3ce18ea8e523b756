"""A thread that makes a sweep's next scene while workers make the cells of the present one.

It makes one scene at a time, so that memory holds one render, whatever the number of scenes. While it works, this
process uses Dr.Jit in this thread alone; so the cells must be made in other processes.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import AbstractContextManager
from threading import Event, Thread
from typing import Generic, TypeVar

from rodcone.types import Progress
from studies.photograph.clock import noting_times

Result = TypeVar("Result")
LOOK_S = 0.2  # seconds between two reports of progress while a caller waits


class Spans:
    """Stages of a thread's work, with the times at which they began and ended."""

    def __init__(self) -> None:
        self._spans: list[tuple[str, float, float]] = []

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Note the ``with`` block as a stage, also if it ends in an error."""
        return noting_times(lambda start, end: self._spans.append((name, start, end)))

    def within(self, start: float, end: float) -> dict[str, float]:
        """Return how many seconds each stage took between two times of `time.perf_counter`."""
        seconds: dict[str, float] = {}
        for name, first, last in self._spans:
            seconds[name] = seconds.get(name, 0.0) + max(0.0, min(last, end) - max(first, start))
        return seconds


class Ahead(Generic[Result]):
    """Call of a function in a thread of its own, which begins at once.

    Parameters
    ----------
    call : callable
        Function that is called with `Spans`, in which it notes its stages, and with a function to which it reports its
        progress. After `stop` that function raises `KeyboardInterrupt`, so that a render keeps what it has and ends.

    Attributes
    ----------
    share : float
        Share of the work that is done, from 0 to 1, as the call reported it last.
    """

    def __init__(self, call: Callable[[Spans, Progress], Result]) -> None:
        self._spans, self._stopped = Spans(), Event()
        self.share = 0.0
        self._error = float("inf")
        self._future: Future[Result] = Future()
        # Python waits for a pool's threads before it exits, but not for a daemon: a second Ctrl-C ends the program.
        Thread(target=self._make, args=(call,), daemon=True).start()

    def _make(self, call: Callable[[Spans, Progress], Result]) -> None:
        try:
            self._future.set_result(call(self._spans, self._show))
        except BaseException as error:
            self._future.set_exception(error)

    def _show(self, share: float, error: float) -> None:
        if self._stopped.is_set():
            raise KeyboardInterrupt
        self.share, self._error = share, error

    def result(self, progress: Progress) -> tuple[Result, dict[str, float]]:
        """Wait for the result, and return it with the seconds of each stage that passed while waiting.

        Progress is called from the caller's own thread.

        Raises
        ------
        BaseException
            The error that the call raised.
        """
        start = time.perf_counter()
        while not wait([self._future], LOOK_S).done:
            progress(self.share, self._error)
        return self._future.result(), self._spans.within(start, time.perf_counter())

    def stop(self) -> None:
        """End the call at its next progress, and wait for that; its result or error is dropped."""
        self._stopped.set()
        wait([self._future])
