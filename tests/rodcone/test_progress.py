"""Progress on stderr: a bar that moves on a terminal, a line now and then elsewhere, and the time left on both."""

import math
import re
import threading
import time
from io import StringIO

import pytest

from rodcone import progress as module
from rodcone.errors import InputError
from rodcone.progress import progress, render_words


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LINE_EVERY_S", 0.05)


def test_lines_come_without_a_call_and_end_with_the_work(often: None) -> None:
    file, before = StringIO(), threading.active_count()
    with progress(file) as step:
        step(render_words(math.inf), 0.0)
        time.sleep(0.3)
    lines = file.getvalue().splitlines()
    assert lines == ["rodcone: 0%, render, compiling"]  # once, however long it takes
    time.sleep(0.1)
    assert len(file.getvalue().splitlines()) == len(lines)
    assert threading.active_count() == before


def test_the_share_only_grows(often: None) -> None:
    file = StringIO()
    with progress(file) as step:
        for share in (0.2, 0.45, 0.27, 0.5):
            step("render", share)
            time.sleep(0.12)
    shares = [int(line.split()[1].rstrip("%,")) for line in file.getvalue().splitlines()]
    assert shares == sorted(shares)
    assert 27 not in shares


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
        time.sleep(0.1)
        step("render", 0.2)
        time.sleep(0.2)
    assert re.fullmatch(
        "rodcone: 20%, render, [123] s left", file.getvalue().splitlines()[-1]
    )  # a busy machine's 0.1 s


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
    assert render_words(0.0314) == "render, relative error 0.031"
