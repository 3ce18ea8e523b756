"""The explorer in a notebook: messages over the widget's own connection, and the module that the page runs as well."""

import threading
from typing import Any

import numpy as np
import pytest
from explore_sample import small_transport

import rodcone as public
from studies.explore.chain import photograph
from studies.explore.controls import Controls

pytest.importorskip("anywidget", reason="needs rodcone[explore]")


@pytest.fixture
def widget(monkeypatch: pytest.MonkeyPatch):
    """A widget, what it sent, and an event that says that it sent something."""
    made = public.explore(small_transport())
    sent: list[tuple[dict[str, Any], list[bytes]]] = []
    came = threading.Event()

    def send(header: dict[str, Any], buffers: list[bytes]) -> None:
        sent.append((header, buffers))
        came.set()

    monkeypatch.setattr(made, "send", send)
    yield made, sent, came
    made.session.close()


def answer(widget: Any, content: dict[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
    made, sent, came = widget
    came.clear()
    made._handle_custom_msg(content, [])
    assert came.wait(60)
    return sent[-1]


def test_the_widget_shows_what_python_makes(widget):
    header, _ = answer(widget, {"kind": "hello", "number": 1})
    assert header["groups"] == {"sun": False, "sky": False}
    asked = {"level_cd_m2": 3.0, "seed": 4, "processor": "interleaved"}
    header, (picture,) = answer(widget, {"kind": "show", "number": 2, "cameras": [asked], "views": [[0, "picture"]]})
    assert header["number"] == 2
    shot = photograph(small_transport(), Controls(**asked))
    assert np.array_equal(np.frombuffer(picture, np.uint8).reshape(40, 48, 3), shot.picture)
    assert "transport = ..." in header["python"][0]


def test_the_widget_brings_the_pages_module_and_style(widget):
    made, _, _ = widget
    assert "export default { render }" in made._esm
    assert ".explore" in made._css
    assert "http:" not in made._esm.replace("http://www.w3.org/2000/svg", "")
    assert "https:" not in made._esm
