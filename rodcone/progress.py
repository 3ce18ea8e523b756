"""Progress of one long command on stderr: a bar on a terminal, a line every few seconds in a log."""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from threading import Event, Thread
from time import monotonic
from typing import Any, TextIO, TypeAlias

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, Task, TimeElapsedColumn

Step: TypeAlias = Callable[[str, float], None]  # function of a text, what is being done, and the share done (0..1)
LINE_EVERY_S = 5.0  # time from line to line in a log
SHOW_EVERY_S = 0.2  # least time between two updates in a notebook
LEAST_COMPILE_S = 1.0  # shortest compilation that is reported
START = "start"  # text of a task before its first step


@contextmanager
def progress(file: TextIO) -> Iterator[Step]:
    """Yield a function that shows progress: it is called with what is being done, and the share done (0..1).

    On a terminal it moves a bar, which vanishes at the end. Elsewhere, as in the log of a batch system, a line is
    printed every five seconds if there is something new. The share only grows. Bar and line show the time left,
    by the pace since the first share above 0, because what comes before, such as compilation, isn't repeated. Until
    then the bar swings to and fro.
    """
    console = Console(file=file)
    *columns, time_left = Progress.get_default_columns()
    columns = [SpinnerColumn(), *columns, TimeElapsedColumn(), time_left]
    bar = Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal, speed_estimate_period=math.inf
    )
    number = bar.add_task(START, total=None)
    ended = Event()
    most = 0.0
    printer = Thread(target=_print_lines, args=(bar.tasks[number], file, ended), daemon=True)

    def step(what: str, share: float) -> None:
        nonlocal most
        most = max(most, share)  # what is left may turn out to be more than was thought; what is done stays done
        bar.update(number, description=what, completed=most, total=1.0 if most else None)

    with bar:
        if not console.is_terminal:
            printer.start()
        try:
            yield step
        finally:
            ended.set()
            if printer.is_alive():
                printer.join()


@contextmanager
def progress_bar(step: Step | None) -> Iterator[Step]:
    """Yield the caller's own step or, if there is none, a bar under a notebook's cell; elsewhere nothing is shown.

    The bar is a few lines of HTML, which every notebook shows; it vanishes at the end.
    """
    display = None if step else _notebook_display()
    if step is not None or display is None:
        yield step or (lambda what, share: None)
        return
    handle = display({"text/plain": ""}, raw=True, display_id=True)
    shown_at = -math.inf

    def show(what: str, share: float) -> None:
        nonlocal shown_at
        if monotonic() - shown_at >= SHOW_EVERY_S:
            shown_at = monotonic()
            state = f"value='{share:.4f}'" if share else ""  # without a value it swings to and fro
            handle.update({"text/html": f"<progress {state}></progress> {escape(what)} {share:.0%}"}, raw=True)

    try:
        yield show
    finally:
        handle.update({"text/plain": ""}, raw=True)


def _notebook_display() -> Callable[..., Any] | None:
    """Return IPython's display function if a notebook's kernel runs this; don't load IPython to find out."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import display

    shown: Callable[..., Any] = display
    return shown


def _print_lines(task: Task, file: TextIO, ended: Event) -> None:
    """Print a line now and then if there is something new; run in a thread, because a call of Mitsuba may take long.

    Nothing is printed before the first step: an input that is refused until then gets its own line only.
    """
    printed = f"0%, {START}"
    while not ended.wait(LINE_EVERY_S):
        state = f"{task.completed:.0%}, {task.description}"
        if state == printed:
            continue
        printed = state
        left = "" if task.time_remaining is None else f", {duration(task.time_remaining)} left"
        print(f"rodcone: {state}{left}", file=file, flush=True)


def render_words(error: float, share: float = 0.0) -> str:
    """Return what a render is doing.

    It may be compiling until its first share is done, and its error is known some samples later.
    """
    if math.isfinite(error):
        return f"render, relative error {error:.3f}"
    return "render" if share else "render, compiling"


def compile_note(seconds: float) -> str | None:
    """Return a sentence on how long a first render compiled; None if that is short."""
    if seconds < LEAST_COMPILE_S:
        return None
    return f"render: compiling took {duration(seconds)}, once for these surfaces and so many bands"


def duration(seconds: float) -> str:
    """Return a time in words, as precise as an estimate is: ``40 s``, ``3 min``, ``2.5 h``, ``3 days``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 36 * 3600 else f"{seconds / 86400:.0f} days"
