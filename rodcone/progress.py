"""Progress of one long command on stderr: a bar on a terminal, a line every few seconds in a log."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, Task, TextColumn, TimeElapsedColumn, TimeRemainingColumn

LINE_EVERY_S = 5.0
PACE_OVER_S = 300.0  # of the latest work, by which the time left is told: its parts differ


@contextmanager
def progress(file: TextIO) -> Iterator[Callable[[str, float], None]]:
    """Give a function to call with what is being done and the share of the whole that is done (0..1).

    On a terminal it moves a bar, which vanishes at the end; elsewhere, as in the log of a batch system, a line is
    printed every five seconds. Both show the time left, by the pace since the first share above 0: what comes before,
    such as compilation, isn't repeated. Until then the bar swings to and fro.
    """
    console = Console(file=file)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    bar = Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal, speed_estimate_period=math.inf
    )
    number = bar.add_task("start", total=None)
    ended = Event()
    printer = Thread(target=_print_lines, args=(bar.tasks[number], file, ended), daemon=True)

    def step(what: str, share: float) -> None:
        bar.update(number, description=what, completed=share, total=1.0 if share else None)

    with bar:
        if not console.is_terminal:
            printer.start()
        try:
            yield step
        finally:
            ended.set()
            if printer.is_alive():
                printer.join()


def _print_lines(task: Task, file: TextIO, ended: Event) -> None:
    """Print a line now and then; by a thread of its own, since a call of Mitsuba may take long."""
    while not ended.wait(LINE_EVERY_S):
        left = "" if task.time_remaining is None else f", {duration(task.time_remaining)} left"
        print(f"rodcone: {task.completed:.0%}, {task.description}{left}", file=file, flush=True)


def render_words(error: float) -> str:
    """What a render is at: its first passes compile, and only after them is its relative error known."""
    return f"render, relative error {error:.3f}" if math.isfinite(error) else "render, compiling"


def duration(seconds: float) -> str:
    """Time in words, to the precision that an estimate has: ``40 s``, ``3 min``, ``2.5 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
