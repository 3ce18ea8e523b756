"""Progress of one long command on stderr: a bar on a terminal, a line now and then in a log."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

LINE_EVERY_S = 30.0


@contextmanager
def progress(file: TextIO) -> Iterator[Callable[[str, float], None]]:
    """Give a function to call with what is being done and the share of the whole that is done (0..1).

    On a terminal it moves a bar, which vanishes at the end; elsewhere, as in the log of a batch system, it prints a
    line at most every 30 seconds.
    """
    console = Console(file=file)
    if not console.is_terminal:
        printed_s = time.monotonic()

        def line(what: str, share: float) -> None:
            nonlocal printed_s
            if time.monotonic() - printed_s >= LINE_EVERY_S:
                printed_s = time.monotonic()
                print(f"rodcone: {share:.0%}, {what}", file=file)

        yield line
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("start", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)
