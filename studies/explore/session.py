"""What the page asks and what it is answered: messages in, pictures and figures out, on one thread of its own.

Of requests of one kind only the newest is answered: what a slider has left behind is not computed. Every answer has the
number of its request and the controls that it was made with; the page shows none that is older than its last question.
"""

import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

from isp.picture import Picture
from rodcone.errors import InputError, one_line
from studies.explore.chain import Exposed, Image, Shot, development_of, expose_scene, photograph, true_picture_of
from studies.explore.controls import Controls, Lamp, controls_from, to_json
from studies.explore.files import dng_of, png_of
from studies.explore.memo import Memo, give_memory_back
from studies.explore.messages import KINDS, Header, hello, read_message, read_view, read_views, unsent
from studies.explore.slow import begin, is_slow, stand_in
from studies.explore.source import Rendered, Source
from studies.explore.views import VIEWS, Bytes, facts, histogram, pixel
from studies.explore.warm import WARM
from studies.explore.written import python_of, study_of

Answer: TypeAlias = tuple[Header, Sequence[bytes]]
Send: TypeAlias = Callable[[Header, Sequence[bytes]], None]

REST_S = 0.4  # without a new setting, after which a slow processor begins
TRIM_AFTER = 100  # turns of its thread


class Session:
    """One explorer: its render, what it has computed, and the page that asks.

    Parameters
    ----------
    source : Source
    """

    def __init__(self, source: Source) -> None:
        self._source, self._states = source, source.states()
        self._rendered: Rendered | None = None
        self._rendering, self._failure = True, ""  # whether a finer state follows, and why none does
        self._memo = Memo()
        self._cold = list(WARM)
        self._pending: dict[str, Header] = {}
        self._shown: Header | None = None
        self._page = ""  # that asks
        self._sent: list[Bytes] = []  # pictures that it has
        self._slow: dict[str, Callable[[], None]] = {}  # what ends each job at work, by its camera
        self._send: Send = lambda header, buffers: None
        self._slow_wanted = False
        self._asked_s = -REST_S  # when the last picture was asked for
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, daemon=True, name="explorer")
        self._thread.start()

    def connect(self, send: Send) -> None:
        """Answer to another connection from now on; the one before is told."""
        with self._changed:
            self._send({"kind": "taken over"}, ())
            self._send = send
            self._begin_page("")

    def take(self, text: str, send: Send) -> None:
        """Take a message of the connection that `send` belongs to; one that was taken over is not listened to.

        It is answered from the session's thread. What isn't allowed is told at once.
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
            if page != self._page:  # a notebook shows one widget as often as it is asked, over one connection
                send({"kind": "taken over", "page": page}, ())
                self._begin_page(page)
            self._pending[message["kind"]] = message
            if message["kind"] in ("show", "cancel"):
                self._asked_s = time.monotonic()
                self._end_slow()
            self._changed.notify()

    def close(self) -> None:
        """End the thread, and what it has begun."""
        with self._changed:
            self._closed = True
            self._end_slow()
            self._changed.notify()
        self._thread.join()

    def _begin_page(self, page: str) -> None:
        """Forget what another page asked."""
        self._page, self._shown, self._sent = page, None, []
        self._pending.clear()
        self._end_slow()

    def _end_slow(self) -> None:
        for end in self._slow.values():
            end()
        self._slow.clear()
        self._slow_wanted = False

    def _work(self) -> None:
        """Answer what is asked; where nothing is, do what is left to do."""
        turns = 0
        while not self._closed:
            message, act = self._next()
            if (turns := turns + 1) % TRIM_AFTER == 0:
                give_memory_back()
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                try:
                    if message is not None:
                        header, buffers = self._answer(message)
                        notes = sorted({str(each.message) for each in told}) + [self._failure] * bool(self._failure)
                        self._send(header | _whose(message) | {"notes": notes}, buffers)
                    else:
                        act()
                except InputError as error:
                    self._fail(message, str(error))
                except Exception as error:  # the page goes on; the terminal has the place
                    traceback.print_exc(file=sys.stderr)
                    self._fail(message, f"the program failed: {type(error).__name__}: {error}; see its terminal")

    def _next(self) -> tuple[Header | None, Callable[[], None]]:
        """Take the message to answer, or what to do while nothing is asked; waits for one of them."""
        with self._changed:
            while not self._closed:
                kind = next((kind for kind in KINDS if kind in self._pending), None)
                if kind is not None and (self._rendered is not None or not self._rendering or kind == "hello"):
                    return self._pending.pop(kind), _nothing
                act, left_s = self._left_to_do(), self._asked_s + REST_S - time.monotonic()
                if act is not None and (left_s <= 0 or self._rendered is None):
                    return None, act
                self._changed.wait(None if act is None else left_s)
        return None, _nothing

    def _left_to_do(self) -> Callable[[], None] | None:
        """What waits for the sliders to rest: a finer render, slow processors, kernels to compile."""
        if self._rendering:
            return self._render_on
        if self._slow_wanted:
            return self._begin_slow
        return self._warm_up if self._cold and self._rendered is not None else None

    def _fail(self, message: Header | None, words: str) -> None:
        whose = {"number": None} if message is None else _whose(message)
        self._send(whose | {"kind": "error", "message": words}, ())

    def _render_on(self) -> None:
        """Render the next state, and show what is in view again."""
        self._rendering = False  # where this fails, none follows: a generator that raised is at its end
        try:
            self._rendered = next(self._states)
        except Exception as error:
            self._failure = f"the render ended with {type(error).__name__}: {one_line(error)}"
            raise
        self._rendering = not self._rendered.last
        self._memo = Memo()
        with self._changed:
            if self._shown is not None:
                self._pending.setdefault("show", self._shown)

    def _warm_up(self) -> None:
        """Compile the kernels of one of `WARM`."""
        assert self._rendered is not None
        photograph(self._rendered.transport, self._cold.pop(), Memo())

    def _answer(self, message: Header) -> Answer:
        kind = message["kind"]
        if kind in ("hello", "cancel"):
            return (hello(self._source) if kind == "hello" else {}), ()
        rendered = self._rendered
        if rendered is None:
            raise InputError(f"scene: {self._failure}; nothing can be shown; mend the scene and start again")
        cameras = [controls_from(each, self._source.controls) for each in message["cameras"]]
        if kind == "show":
            return self._show(message, cameras, rendered)
        header, buffers = self._written(message, cameras[0], rendered)
        return header | {"cameras": [{"controls": to_json(cameras[0])}]}, buffers

    def _written(self, message: Header, controls: Controls, rendered: Rendered) -> Answer:
        """Figures, text and files of one camera."""
        kind = message["kind"]
        answer: Answer = {}, ()
        if kind == "python":
            return {"text": python_of(rendered.code, controls, read_view(message["view"]))}, ()
        if kind == "study":
            return {"files": self._study(controls, rendered)}, ()
        exposed = expose_scene(rendered.transport, controls, self._memo)
        if kind == "pixel":
            answer = {"pixel": pixel(exposed, message["row"], message["column"])}, ()
        elif kind == "histogram":
            answer = {"histogram": histogram(exposed.raw)}, ()
        elif kind == "dng":
            answer = {"name": "explored.dng"}, (dng_of(exposed, controls),)
        elif kind == "png":
            shot = self._shot(controls, exposed) or photograph(rendered.transport, controls, self._memo)
            answer = {"name": "explored.png"}, (png_of(VIEWS[read_view(message["view"])](shot)),)
        return answer

    def _show(self, message: Header, cameras: Sequence[Controls], rendered: Rendered) -> Answer:
        """Pictures of each view that is asked for; slow processors are left for later."""
        views = read_views(message["views"], len(cameras))
        with self._changed:
            sent: list[Bytes] = []
            if message.get("page", "") == self._page:
                self._shown, sent = message, self._sent
        shots, told = [], []
        for controls in cameras:
            exposed = expose_scene(rendered.transport, controls, self._memo)
            shot, shown = self._shot(controls, exposed), controls
            if shot is None:
                quick = stand_in(controls.processor)
                assert quick is not None  # every mosaic of a slow processor has a quick one
                shown = replace(controls, processor=quick, settings={})
                shot = photograph(rendered.transport, shown, self._memo)
                self._slow_wanted = True
            shots.append(shot)
            told.append({"controls": to_json(shown), "waiting_for": controls.processor if shown != controls else None})
        pictures = [VIEWS[view](shots[camera]) for camera, view in views]
        height, width = pictures[0].shape[:2]
        header = {
            "cameras": told,
            "views": [list(view) for view in views],
            "facts": [facts(shot) for shot in shots],
            "size": [height, width],
            "spp": rendered.transport.spp,
            "last": not self._rendering,
        }
        return header, unsent(pictures, sent)

    def _shot(self, controls: Controls, exposed: Exposed) -> Shot | None:
        """Shot of an exposure; None where its processor is slow and hasn't been at work."""
        if not is_slow(controls.processor):
            development = development_of(exposed, controls, self._memo)
            linear, picture = development.develop()
        else:
            found = self._memo.kept("slow", repr(controls))
            if found is None:
                return None
            if isinstance(found, InputError):
                raise found
            linear, picture = found
        return Shot(exposed, linear, *true_picture_of(exposed, controls, self._memo), picture)

    def _begin_slow(self) -> None:
        """Set the slow processors of what is shown to work."""
        self._slow_wanted, shown, rendered = False, self._shown, self._rendered
        if shown is None or rendered is None:
            return
        for controls in [controls_from(each, self._source.controls) for each in shown["cameras"]]:
            key, memo = repr(controls), self._memo
            if is_slow(controls.processor) and memo.kept("slow", key) is None and key not in self._slow:

                def done(result: tuple[Image, Picture] | InputError, key: str = key, memo: Memo = memo) -> None:
                    with self._changed:
                        self._slow.pop(key, None)
                        memo.of("slow", key, lambda: result)  # kept as an answer is, errors too
                        if self._shown is shown:
                            self._pending.setdefault("show", shown)
                        self._changed.notify()

                end = begin(development_of(expose_scene(rendered.transport, controls, memo), controls, memo), done)
                with self._changed:
                    self._slow[key] = end

    def _study(self, controls: Controls, rendered: Rendered) -> dict[str, str]:
        source = self._source
        if source.scene is None:
            raise InputError("study: a transport has no name that a study could say; allowed: rodcone explore SCENE")
        judged = next(iter(rendered.transport.groups.values())).coloured
        lamps = {name: controls.lamps.get(name, Lamp()) for name in rendered.transport.groups}
        return study_of(source.scene, source.render, replace(controls, lamps=lamps), judged)


def _whose(message: Header) -> Header:
    """What tells the page that it is an answer of its own."""
    return {key: message[key] for key in ("kind", "number", "page") if key in message}


def _nothing() -> None:
    """Nothing to do."""
