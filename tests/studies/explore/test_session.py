"""One explorer's thread: a render that fails, pages that take over from one another."""

import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from explore_sample import small_transport

from rodcone.errors import InputError
from studies.explore.session import Session
from studies.explore.source import Rendered, of_transport


class Page:
    """What one page is sent."""

    def __init__(self) -> None:
        self.headers: list[dict[str, Any]] = []
        self.buffers: list[Any] = []
        self.came = threading.Condition()

    def send(self, header: dict[str, Any], buffers: Any) -> None:
        with self.came:
            self.headers.append(header)
            self.buffers.append(buffers)
            self.came.notify_all()

    def wait(self, kind: str, number: int | None) -> dict[str, Any]:
        """The answer of that kind and number, once it is there."""

        def found() -> list[dict[str, Any]]:
            return [each for each in self.headers if (each["kind"], each.get("number")) == (kind, number)]

        with self.came:
            assert self.came.wait_for(found, 30), self.headers
            return found()[-1]


def message(kind: str, number: int, **more: Any) -> str:
    shown = {"cameras": [{}], "views": [[0, "picture"]]} if kind == "show" else {}
    return json.dumps({"kind": kind, "number": number} | shown | more)


@pytest.mark.parametrize("good_states", [0, 1])
def test_a_render_that_fails_is_told_and_asked_for_once(good_states):
    failed, once = 0, threading.Event()

    class Failing(Iterator[Rendered]):
        def __init__(self) -> None:
            self.left = good_states

        def __next__(self) -> Rendered:
            nonlocal failed
            if self.left:
                self.left -= 1
                return Rendered(small_transport(), "", False)
            failed += 1
            once.set()
            raise InputError("wall: it has no material") if failed == 1 else StopIteration

    page = Page()
    session = Session(replace(of_transport(small_transport()), states=Failing))
    send = page.send  # one value: a method is another at each look
    session.connect(send)
    session.take(message("hello", 1), send)
    page.wait("hello", 1)
    assert once.wait(20)
    for number in (2, 3):
        session.take(message("show", number), send)
        if good_states:
            assert "it has no material" in page.wait("show", number)["notes"][-1]
        else:
            assert "it has no material" in page.wait("error", number)["message"]
    session.close()
    assert failed == 1


@pytest.fixture
def session() -> Iterator[Session]:
    made = Session(of_transport(small_transport()))
    yield made
    made.close()


def test_a_connection_that_was_taken_over_is_not_listened_to(session):
    old, new = Page(), Page()
    send_old, send_new = old.send, new.send
    session.connect(send_old)
    session.take(message("show", 1), send_old)
    old.wait("show", 1)
    session.connect(send_new)
    old.wait("taken over", None)
    session.take(message("show", 2), send_old)
    session.take(message("hello", 3), send_old)
    session.take(message("show", 1), send_new)
    new.wait("show", 1)
    assert [each["number"] for each in new.headers] == [1]
    assert [each.get("number") for each in old.headers] == [1, None]


def test_a_picture_that_stays_as_it_is_is_sent_to_a_page_once(session):
    """The truth of another exposure is the same; a page that comes later is sent it anew."""
    first, second = Page(), Page()
    views: list[Any] = [[0, "picture"], [0, "truth"]]
    for page in (first, second):
        send = page.send
        session.connect(send)
        for number in (1, 2):
            session.take(message("show", number, cameras=[{"exposure_number": number}], views=views), send)
            page.wait("show", number)
        lengths = [[len(each) for each in buffers] for buffers in page.buffers if buffers]
        assert lengths == [[40 * 48 * 3] * 2, [40 * 48 * 3, 0]]
    session.take(message("show", 3, cameras=[{"exposure_number": 2}], views=views[::-1]), send)
    second.wait("show", 3)
    assert [len(each) for each in second.buffers[-1]] == [40 * 48 * 3] * 2
    assert second.buffers[-1][1] == second.buffers[-2][0]


def test_another_view_of_one_connection_takes_over(session):
    """As a notebook's widget that is shown twice: both count their requests from 1."""
    page = Page()
    send = page.send
    session.connect(send)
    for view in ("first", "second"):
        session.take(message("hello", 1, page=view), send)
        session.take(message("show", 2, page=view), send)
        assert page.wait("show", 2)["page"] == view
        page.headers = [each for each in page.headers if each["kind"] != "show"]
    assert [each["page"] for each in page.headers if each["kind"] == "taken over"] == ["first", "second"]
    session.take(message("show", 3, page="first"), send)
    session.take(message("show", 3, page="second"), send)
    assert page.wait("show", 3)["page"] == "second"
    assert [each["page"] for each in page.headers if each["kind"] == "show"] == ["second"]


def test_what_another_page_asked_is_not_answered_to_the_new_one():
    """Neither what waits for the first picture nor, at the next state of the render, what was shown."""
    go = [threading.Event(), threading.Event()]

    def states() -> Iterator[Rendered]:
        for number, event in enumerate(go):
            assert event.wait(30)
            yield Rendered(small_transport(), "", number == 1)

    old, new = Page(), Page()
    send_old, send_new = old.send, new.send
    session = Session(replace(of_transport(small_transport()), states=states))
    session.connect(send_old)
    session.take(message("show", 1), send_old)
    session.connect(send_new)
    for event in go:
        event.set()
    session.take(message("histogram", 2, cameras=[{}]), send_new)
    new.wait("histogram", 2)
    session.close()
    assert [each["kind"] for each in new.headers] == ["histogram"]
