"""Progress on stderr: a bar that moves on a terminal, a line now and then elsewhere, and the time left on both."""

import math
import re
import sys
import threading
import time
from io import StringIO
from types import SimpleNamespace
from typing import Any

import pytest

from render.engine import render
from rodcone import progress as module
from rodcone.errors import InputError
from rodcone.progress import compile_note, progress, progress_bar, render_words
from scenes.catalogue import load


@pytest.fixture
def often(no_progress_lines: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LINE_EVERY_S", 0.05)


def wait_for(file: StringIO, words: str) -> None:
    """Wait until a line holds the words, however slow the machine is; a minute says that none will come."""
    for _ in range(6000):
        if words in file.getvalue():
            return
        time.sleep(0.01)
    pytest.fail(f"no line with {words!r}: {file.getvalue()!r}")


def test_lines_come_without_a_call_and_end_with_the_work(often: None) -> None:
    file, before = StringIO(), threading.active_count()
    with progress(file) as step:
        step(render_words(math.inf), 0.0)
        wait_for(file, "compiling\n")
        time.sleep(0.2)
    assert file.getvalue().splitlines() == ["rodcone: 0%, render, compiling"]  # once, however long it takes
    assert threading.active_count() == before


def test_the_share_only_grows(often: None) -> None:
    file = StringIO()
    with progress(file) as step:
        for share, line in ((0.2, "20%"), (0.45, "45%"), (0.27, "45%"), (0.5, "50%")):
            step("render", share)
            wait_for(file, line)
    shares = [int(line.split()[1].rstrip("%,")) for line in file.getvalue().splitlines()]
    assert shares == [20, 45, 50]


def test_a_short_command_prints_nothing() -> None:
    file = StringIO()
    with progress(file) as step:
        step("render", 1.0)
    assert file.getvalue() == ""


@pytest.mark.thorough
def test_the_time_left_is_by_the_pace_since_the_first_share(often: None) -> None:
    """A second of compilation before it, a tenth of the work in 0.1 s: 0.8 s for the eight tenths left, not 4.4 s."""
    file = StringIO()
    with progress(file) as step:
        step("compiling", 0.0)
        time.sleep(1.0)
        step("render", 0.1)
        begun = time.monotonic()
        time.sleep(0.1)
        step("render", 0.2)
        took_s = time.monotonic() - begun  # 0.1 s, or what a busy machine made of it
        wait_for(file, "20%, render")
    told = re.fullmatch("rodcone: 20%, render, ([0-9]+) s left", file.getvalue().splitlines()[-1])
    assert told
    assert float(told[1]) <= 8 * took_s + 1.0


def test_what_is_refused_before_its_first_step_gets_no_line(often: None) -> None:
    file = StringIO()

    def refuse_late() -> None:
        time.sleep(0.3)  # as a loaded machine, which takes its time to check the arguments
        raise InputError("size: 0 is not allowed")

    with pytest.raises(InputError), progress(file):
        refuse_late()
    assert file.getvalue() == ""


def test_a_render_compiles_until_its_error_is_known() -> None:
    assert render_words(math.inf) == "render, compiling"
    assert render_words(math.inf, 0.05) == "render"
    assert render_words(0.0314) == "render, relative error 0.031"


# Bars that a notebook shows by itself: its own kernel's display is played by a recorder.


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, str]]:
    """What a notebook's cell shows, one after the other."""
    cell: list[dict[str, str]] = []

    def display(data: dict[str, str], **_: Any) -> SimpleNamespace:
        cell.append(data)
        return SimpleNamespace(update=lambda data, raw: cell.append(data))

    ipython = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=None))
    monkeypatch.setitem(sys.modules, "IPython", ipython)  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))  # type: ignore[arg-type]
    monkeypatch.setattr(module, "SHOW_EVERY_S", 0.0)
    return cell


def test_a_bar_moves_and_vanishes(shown: list[dict[str, str]]) -> None:
    with progress_bar(None) as step:
        step("a < b", 0.0)
        step("half", 0.5)
    pages = [data.get("text/html", "") for data in shown]
    assert pages == ["", "<progress ></progress> a &lt; b 0%", "<progress value='0.5000'></progress> half 50%", ""]


def test_the_callers_own_step_is_called_in_its_place(shown: list[dict[str, str]]) -> None:
    called = []
    with progress_bar(lambda what, share: called.append((what, share))) as step:
        step("half", 0.5)
    assert (called, shown) == ([("half", 0.5)], [])


@pytest.mark.parametrize("shell", [None, SimpleNamespace()])  # no IPython at work, and one in a terminal
def test_elsewhere_nothing_is_shown(shell: object, shown: list[dict[str, str]]) -> None:
    sys.modules["IPython"].get_ipython = lambda: shell  # type: ignore[attr-defined]
    with progress_bar(None) as step:
        step("half", 0.5)
    assert shown == []


def test_a_render_shows_a_bar_by_itself(shown: list[dict[str, str]]) -> None:
    render(load("flat_field"), (8, 8), spp=4)
    assert any("render, " in data.get("text/html", "") for data in shown)
    count = len(shown)
    render(load("flat_field"), (8, 8), spp=4, progress=lambda share, error: None)
    assert len(shown) == count


def test_a_first_render_says_how_long_it_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LEAST_COMPILE_S", 1.0)
    assert compile_note(13.5) == "render: compiling took 14 s, once for these surfaces and so many bands"
    assert compile_note(0.9) is None
