"""Bars that a notebook shows by itself: its own kernel's display is played by a recorder."""

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from render.engine import render
from rodcone import progress as module
from rodcone.progress import progress_bar
from scenes.catalog import load


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
