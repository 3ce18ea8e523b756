"""A progress bar for one long command."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def progress(file: TextIO) -> Iterator[Callable[[str, float], None]]:
    """Show a bar on a terminal that vanishes at the end; gives what to call with what is done and a share (0..1)."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    console = Console(file=file)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        line = bar.add_task("start", total=1.0)
        yield lambda what, share: bar.update(line, description=what, completed=share)
