"""A session of the explorer: a thread that receives the page's messages, and answers with pictures and figures.

Of several waiting requests of one kind only the newest is answered. A new request ends the work on an older one of its
kind, between two stages. Kinds earlier in `KINDS` are answered first: other requests wait for them, and a render waits
between two runs. When the page is closed, all work ends. Every answer holds the number of its request, the controls
with which it was made, and the Python that makes it again.
"""

import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, TypeAlias

from isp.picture import Picture
from rodcone.errors import InputError, cut, one_line, require_name
from rodcone.jit import release_memory
from rodcone.types import Image
from studies.explore.answers import Answer, shown, take_sensor, written
from studies.explore.chain import development_of, expose_scene
from studies.explore.controls import Controls, controls_from
from studies.explore.memo import Memo, Overtaken, never_cancel
from studies.explore.messages import KINDS, Header, first_message, is_superseded_by, read_message, read_views, unsent
from studies.explore.slow import begin, stand_in
from studies.explore.source import RenderState, Source
from studies.explore.views import Bytes

Send: TypeAlias = Callable[[Header, Sequence[bytes]], None]

SOON = ("hello", "scene", "sensor")  # kinds of message that don't wait for a render
REST_S = 0.4  # seconds without a new setting, after which a slow processor begins
TRIM_AFTER = 100  # answered messages after which unused memory is returned
MOST_NOTES = 8  # most notes in an answer


class Session:
    """One explorer: its render, what it has computed, and the page that asks.

    Parameters
    ----------
    source : Source
    scenes : mapping of str to callable
        Other scenes that the page may choose, each as a function that opens its source.
    """

    def __init__(self, source: Source, scenes: Mapping[str, Callable[[], Source]] = MappingProxyType({})) -> None:
        self._scenes = scenes
        self._folder = TemporaryDirectory(prefix="rodcone-")
        self._drops = Path(self._folder.name)  # folder of sensors' files that were dropped on the page
        self._dropped: list[str] = []  # the sensors among them
        self._pending: dict[str, Header] = {}
        self._message: Header | None = None  # the message that is being answered
        self._slow: dict[str, Callable[[], None]] = {}  # by camera, the functions that end running jobs
        self._send: Send = lambda header, buffers: None
        self._begin_page("")
        self._begin_source(source)
        self._asked_s = -REST_S  # when the last picture was asked for
        self._turns = 0
        self._alone = False
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, daemon=True, name="explorer")
        self._thread.start()

    def connect(self, send: Send) -> None:
        """Answer a new connection from now on, and tell the earlier one that it was replaced."""
        with self._changed:
            self._send({"kind": "taken over"}, ())
            self._send = send
            self._alone = False
            self._begin_page("")
            self._changed.notify()

    def disconnect(self, send: Send) -> None:
        """Stop work until a page is opened, because the page of this connection was closed."""
        with self._changed:
            if send is self._send:
                self._alone = True
                self._begin_page("")

    def take(self, text: str, send: Send) -> None:
        """Receive a message from the connection to which `send` answers; the session's thread answers it later.

        A message that isn't allowed is refused at once. One from a connection that was replaced is dropped.
        """
        try:
            message = read_message(text)
        except InputError as error:
            send({"kind": "error", "number": None, "message": str(error)}, ())
            return
        with self._changed:
            page = message.get("page", "")
            if send is not self._send or (page != self._page and message["kind"] != "hello"):
                return
            if page != self._page:  # because a notebook may show one widget several times over one connection
                send({"kind": "taken over", "page": page}, ())
                self._begin_page(page)
            self._pending[message["kind"]] = message
            if message["kind"] in ("show", "cancel"):
                self._asked_s = time.monotonic()
                self._end_slow()
            self._changed.notify()

    def close(self) -> None:
        """End the thread and the work that it has begun."""
        with self._changed:
            self._closed = True
            self._end_slow()
            self._changed.notify()
        self._thread.join()
        self._folder.cleanup()

    def _begin_source(self, source: Source) -> None:
        self._source = source
        self._states = source.states(self._between_runs)
        self._memo = Memo(self._check)
        self._rendered: RenderState | None = None
        self._rendering, self._failure = True, ""  # whether a finer state follows, and if not, why

    def _begin_page(self, page: str) -> None:
        """Forget the requests and pictures of the earlier page, and note the page that sends messages now."""
        self._page = page  # the page that asks now
        self._shown: Header | None = None
        self._sent: list[Bytes] = []  # pictures that the page already has
        self._pending.clear()
        self._end_slow()

    def _end_slow(self) -> None:
        for end in self._slow.values():
            end()
        self._slow.clear()
        self._slow_wanted = False

    def _work(self) -> None:
        """Answer messages; while none waits, do background tasks."""
        while not self._closed:
            self._turn(*self._next(self._left_to_do))

    def _turn(self, message: Header | None, act: Callable[[], None]) -> None:
        """Answer a message or do a task; an error becomes one line on the page, and the session goes on."""
        self._turns = self._turns + 1
        self._message = message
        if self._turns % TRIM_AFTER == 0:
            release_memory()
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                if message is None:
                    act()
                else:
                    header, buffers = self._answer(message)
                    notes = sorted({cut(str(warning.message)) for warning in warned})[:MOST_NOTES]
                    self._send(header | _whose(message) | {"notes": [*notes, *filter(None, [self._failure])]}, buffers)
            except Overtaken:
                pass
            except InputError as error:
                self._fail(message, str(error))
            except Exception as error:  # shown on the page as one line; the traceback is printed
                traceback.print_exc(file=sys.stderr)
                words = f"the program failed: {type(error).__name__}: {error}; see its terminal"
                self._fail(message, str(InputError(words)))
        self._message = None

    def _next(self, left_to_do: Callable[[], Callable[[], None] | None]) -> tuple[Header | None, Callable[[], None]]:
        """Wait for the next message; while idle, return the next background task."""
        with self._changed:
            while not self._closed:
                if kind := self._first_pending():
                    return self._pending.pop(kind), never_cancel
                act = left_to_do()
                left_s = self._asked_s + REST_S - time.monotonic()
                if act is not None and not self._alone and (left_s <= 0 or self._rendered is None):
                    return None, act
                self._changed.wait(None if act is None or self._alone else left_s)
        return None, never_cancel

    def _first_pending(self) -> str | None:
        """Return the kind of message to answer next; None while it has to wait for the first render."""
        kind = next((kind for kind in KINDS if kind in self._pending), None)
        return kind if self._rendered is not None or not self._rendering or kind in SOON else None

    def _check(self) -> None:
        """Raise `Overtaken` if nobody waits for the work under way any more, or if another message has to go first.

        A message that has to wait for one of another kind is kept, and answered from the start after that.
        """
        with self._changed:
            message = self._message
            pending = self._first_pending()
            abandoned = self._closed or self._alone or (message and message.get("page", "") != self._page)
            if abandoned or (pending and not message):
                raise Overtaken
            if message and pending and is_superseded_by(message, self._pending[pending]):
                if pending != message["kind"]:
                    self._pending.setdefault(message["kind"], message)
                raise Overtaken

    def _left_to_do(self) -> Callable[[], None] | None:
        """Return the task to do while no message waits: a finer render, or a slow processor; None if there is none."""
        if self._rendering:
            return self._render_on
        return self._begin_slow if self._slow_wanted else None

    def _fail(self, message: Header | None, words: str) -> None:
        whose = {"number": None} if message is None else _whose(message) | {"of": message["kind"]}
        self._send(whose | {"kind": "error", "message": words}, ())

    def _render_on(self) -> None:
        """Render the next, finer state, and answer the page's last request once more, from that state."""
        try:
            rendered = next(self._states)
        except Exception as error:  # the error ends the generator, and only another scene gives new states
            self._rendering = isinstance(error, Overtaken)
            words = cut(f"the render ended with {type(error).__name__}: {one_line(error)}")
            self._failure = "" if self._rendering else words
            raise
        self._rendered = rendered
        self._rendering = not rendered.last
        self._memo = Memo(self._check)
        with self._changed:
            if self._shown is not None:
                self._pending.setdefault("show", self._shown)

    def _between_runs(self) -> None:
        """Answer the page's messages between two runs of a render until none waits; then the render goes on."""
        source = self._source
        while self._source is source and (message := self._next(lambda: never_cancel)[0]):
            self._turn(message, never_cancel)
        if self._closed or self._source is not source:
            raise Overtaken

    def _answer(self, message: Header) -> Answer:
        kind = message["kind"]
        rendered = self._rendered
        if kind == "scene":
            self._choose_scene(message["name"])
        if kind in ("hello", "scene"):
            return first_message(self._source, self._scenes, self._dropped), ()
        if kind == "sensor":
            header = take_sensor(message["files"], self._drops)
            self._dropped.append(header["sensor"])
            return header, ()
        if kind == "cancel":
            return {}, ()
        if rendered is None:
            raise InputError(f"scene: {self._failure}; nothing can be shown; mend the scene and start again")
        if kind == "show":
            return self._show(message, self._cameras(message), rendered)
        return written(message, self._cameras(message)[0], rendered, self._memo, self._drops)

    def _cameras(self, message: Header) -> list[Controls]:
        return [controls_from(content, self._dropped) for content in message["cameras"]]

    def _choose_scene(self, name: Any) -> None:
        require_name("scene", name, tuple(self._scenes))
        source = self._scenes[name]()
        with self._changed:
            self._begin_page(self._page)
            self._begin_source(source)

    def _show(self, message: Header, cameras: Sequence[Controls], rendered: RenderState) -> Answer:
        """Answer with pictures of the requested views; slow processors are left for later."""
        views = read_views(message["views"], len(cameras))
        with self._changed:
            sent: list[Bytes] = []
            if message.get("page", "") == self._page:
                self._shown = message
                sent = self._sent
        header, pictures, waiting = shown(cameras, views, rendered, self._memo, self._drops)
        self._slow_wanted |= waiting
        return header | {"last": not self._rendering}, unsent(pictures, sent)

    def _begin_slow(self) -> None:
        """Start the slow processors of the shown views."""
        self._slow_wanted = False
        message = self._shown
        rendered = self._rendered
        if message is None or rendered is None:
            return
        for controls in self._cameras(message):
            key = repr(controls)
            memo = self._memo
            quick = stand_in(controls, rendered.transport.coverage.mean.size) == controls
            if not quick and memo.kept("slow", key) is None and key not in self._slow:

                def done(result: tuple[Image, Picture] | InputError, key: str = key, memo: Memo = memo) -> None:
                    with self._changed:
                        self._slow.pop(key, None)
                        memo.keep("slow", key, result)  # errors are kept too, and are shown
                        if self._shown is message:
                            self._pending.setdefault("show", message)
                        self._changed.notify()

                try:
                    development = development_of(expose_scene(rendered.transport, controls, memo), controls, memo)
                except Overtaken:
                    self._slow_wanted = True
                    raise
                end = begin(controls.processor, development, done)
                with self._changed:
                    self._slow[key] = end


def _whose(message: Header) -> Header:
    """Return the kind, number and page of a message, by which a page recognises the answer to its own request."""
    return {key: message[key] for key in ("kind", "number", "page") if key in message}
