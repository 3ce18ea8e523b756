"""What the page asks and what it is answered: messages in, pictures and figures out, on one thread of its own.

Of requests of one kind only the newest is answered: what a slider has left behind is not computed. Every answer has the
number of its request and the controls that it was made with; the page shows none that is older than its last question.
"""

import json
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, TypeAlias

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS, libraries
from render.illuminants import names as illuminants
from rodcone.errors import InputError, require_keys, require_whole, unknown
from sensor.exposure import RULES
from sensor.presets import names as sensors
from sensor.presets import preset
from studies.explore.chain import Exposed, Image, Memo, Shot, expose_scene, job_of, photograph, true_picture_of
from studies.explore.controls import (
    ADJUSTABLE,
    LENS,
    PIXEL,
    SETTINGS,
    TIME,
    Controls,
    Lamp,
    controls_from,
    mosaics_of,
    to_json,
)
from studies.explore.files import dng_of, png_of
from studies.explore.slow import begin, is_slow, stand_in
from studies.explore.source import Rendered, Source
from studies.explore.views import VIEWS, facts, histogram, pixel
from studies.explore.written import python_of, study_of
from studies.study.study import WHITE_BALANCES

Header: TypeAlias = dict[str, Any]
Answer: TypeAlias = tuple[Header, Sequence[bytes]]
Send: TypeAlias = Callable[[Header, Sequence[bytes]], None]

MOST_CHARACTERS = 200_000  # of a message: three tables of spectra fit
REST_S = 0.4  # without a new setting, after which a slow processor begins
# Keys of each kind of message beside `kind` and `number`; in this order they are answered.
KINDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "hello": (),
        "cancel": (),
        "show": ("cameras", "views"),
        "pixel": ("cameras", "row", "column"),
        "histogram": ("cameras",),
        "python": ("cameras", "view"),
        "study": ("cameras",),
        "dng": ("cameras",),
        "png": ("cameras", "view"),
    }
)


class Session:
    """One explorer: its render, what it has computed, and the page that asks.

    Parameters
    ----------
    source : Source
    """

    def __init__(self, source: Source) -> None:
        self._source, self._states = source, source.states()
        self._rendered: Rendered | None = None
        self._memo = Memo()
        self._pending: dict[str, Header] = {}
        self._shown: Header | None = None
        self._slow: dict[str, Callable[[], None]] = {}  # what ends each job at work, by its camera
        self._send: Send = lambda header, buffers: None
        self._rest_until: float | None = None
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, daemon=True, name="explorer")
        self._thread.start()

    def connect(self, send: Send) -> None:
        """Answer to another page from now on; the one before is told."""
        self._send({"kind": "taken over"}, ())
        self._send = send

    def take(self, text: str) -> None:
        """Take a message; it is answered from the session's thread. What isn't allowed is told at once."""
        number: Any = None
        try:
            message = _message(text)
            number = message["number"]
        except InputError as error:
            self._send({"kind": "error", "number": number, "message": str(error)}, ())
            return
        with self._changed:
            self._pending[message["kind"]] = message
            if message["kind"] in ("show", "cancel"):
                self._end_slow()
            self._changed.notify()

    def close(self) -> None:
        """End the thread, and what it has begun."""
        with self._changed:
            self._closed = True
            self._end_slow()
            self._changed.notify()
        self._thread.join()

    def _end_slow(self) -> None:
        for end in self._slow.values():
            end()
        self._slow.clear()
        self._rest_until = None

    def _work(self) -> None:
        """Answer what is asked; where nothing is, render the next state."""
        while not self._closed:
            message, rendered_all = None, self._rendered is not None and self._rendered.last
            with self._changed:
                kind = next((kind for kind in KINDS if kind in self._pending), None)
                if kind is not None and (self._rendered is not None or kind == "hello"):
                    message = self._pending.pop(kind)
                elif rendered_all or self._rest_until is not None:
                    rest_s = None if self._rest_until is None else self._rest_until - time.monotonic()
                    if rest_s is None or rest_s > 0:
                        self._changed.wait(rest_s)
                        continue
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                try:
                    if message is not None:
                        header, buffers = self._answer(message)
                        notes = sorted({str(each.message) for each in told})
                        self._send(
                            header | {"kind": message["kind"], "number": message["number"], "notes": notes}, buffers
                        )
                    elif self._rest_until is not None:
                        self._begin_slow()
                    else:
                        self._render_on()
                except InputError as error:
                    self._fail(message, str(error))
                except Exception as error:  # the page goes on; the terminal has the place
                    traceback.print_exc(file=sys.stderr)
                    self._fail(message, f"the program failed: {type(error).__name__}: {error}; see its terminal")

    def _fail(self, message: Header | None, words: str) -> None:
        self._send({"kind": "error", "number": message and message["number"], "message": words}, ())

    def _render_on(self) -> None:
        """Render the next state, and show what is in view again."""
        self._rendered = next(self._states)
        self._memo = Memo()
        with self._changed:
            if self._shown is not None:
                self._pending.setdefault("show", self._shown)

    def _answer(self, message: Header) -> Answer:
        kind = message["kind"]
        if kind in ("hello", "cancel"):
            return (hello(self._source) if kind == "hello" else {}), ()
        rendered = self._rendered
        assert rendered is not None  # `_work` waits for the first state
        cameras = [controls_from(each, self._sensors()) for each in message["cameras"]]
        if kind == "show":
            return self._show(message, cameras, rendered)
        header, buffers = self._written(message, cameras[0], rendered)
        return header | {"cameras": [{"controls": to_json(cameras[0])}]}, buffers

    def _written(self, message: Header, controls: Controls, rendered: Rendered) -> Answer:
        """Figures, text and files of one camera."""
        kind = message["kind"]
        answer: Answer = {}, ()
        if kind == "python":
            return {"text": python_of(rendered.code, controls, _view(message["view"]))}, ()
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
            answer = {"name": "explored.png"}, (png_of(VIEWS[_view(message["view"])](shot)),)
        return answer

    def _show(self, message: Header, cameras: Sequence[Controls], rendered: Rendered) -> Answer:
        """Pictures of each view that is asked for; slow processors are left for later."""
        views = _views(message["views"], len(cameras))
        self._shown = message
        shots, told = [], []
        for controls in cameras:
            exposed = expose_scene(rendered.transport, controls, self._memo)
            shot, shown = self._shot(controls, exposed), controls
            if shot is None:
                quick = stand_in(controls.processor)
                assert quick is not None  # every mosaic of a slow processor has a quick one
                shown = replace(controls, processor=quick, settings={})
                shot = photograph(rendered.transport, shown, self._memo)
                with self._changed:
                    self._rest_until = time.monotonic() + REST_S
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
            "last": rendered.last,
        }
        return header, [picture.tobytes() for picture in pictures]

    def _shot(self, controls: Controls, exposed: Exposed) -> Shot | None:
        """Shot of an exposure; None where its processor is slow and hasn't been at work."""
        if not is_slow(controls.processor):
            job = job_of(exposed, controls, self._memo)
            linear, picture = job.develop()
        else:
            found = self._memo.kept("slow", _key(controls))
            if found is None:
                return None
            if isinstance(found, InputError):
                raise found
            linear, picture = found
        return Shot(exposed, linear, true_picture_of(exposed, controls, self._memo), picture)

    def _begin_slow(self) -> None:
        """Set the slow processors of what is shown to work."""
        shown, rendered = self._shown, self._rendered
        with self._changed:
            self._rest_until = None
        if shown is None or rendered is None:
            return
        for controls in [controls_from(each, self._sensors()) for each in shown["cameras"]]:
            key, memo = _key(controls), self._memo
            if is_slow(controls.processor) and memo.kept("slow", key) is None and key not in self._slow:

                def done(result: tuple[Image, Picture] | InputError, key: str = key, memo: Memo = memo) -> None:
                    with self._changed:
                        self._slow.pop(key, None)
                        memo.of("slow", key, lambda: result)  # kept as an answer is, errors too
                        if self._shown is shown:
                            self._pending.setdefault("show", shown)
                        self._changed.notify()

                end = begin(job_of(expose_scene(rendered.transport, controls, memo), controls, memo), done)
                with self._changed:
                    self._slow[key] = end

    def _sensors(self) -> tuple[str, ...]:
        """Presets, and the file that the command named; a page names no others."""
        return tuple(dict.fromkeys((*sensors(), self._source.controls.sensor)))

    def _study(self, controls: Controls, rendered: Rendered) -> dict[str, str]:
        source = self._source
        if source.scene is None:
            raise InputError("study: a transport has no name that a study could say; allowed: rodcone explore SCENE")
        lamps = {name: controls.lamps.get(name, Lamp()) for name in rendered.transport.groups}
        return study_of(source.scene, source.size, source.band_nm, source.spp, replace(controls, lamps=lamps))


def hello(source: Source) -> Header:
    """What the page builds its controls from."""
    named = tuple(dict.fromkeys((*sensors(), source.controls.sensor)))
    own = {name: preset(name) for name in named}
    return {
        "title": source.title,
        "controls": to_json(source.controls),
        "defaults": to_json(Controls()),
        "groups": source.groups,
        "illuminants": list(illuminants()),
        "rules": [*RULES, TIME],
        "white_balances": list(WHITE_BALANCES),
        "sensors": {
            name: {
                "lens": {term: getattr(each.lens, term) for term in LENS},
                "pixel": {term: getattr(each.pixel, term) for term in PIXEL},
                "bits": each.bits,
            }
            for name, each in own.items()
        },
        "processors": {
            name: {
                "mosaics": list(mosaics_of(each)),
                "slow": is_slow(name),
                "source": each.source,
                "settings": {key: getattr(ADJUSTABLE[name], key) for key in SETTINGS} if name in ADJUSTABLE else {},
            }
            for name, each in PROCESSORS.items()
            if not _missing(name)
        },
        "views": list(VIEWS),
        "assumed": list(source.notes),
        "saves": {"study": source.scene is not None},
    }


def _missing(processor: str) -> bool:
    """Whether a processor needs a library that isn't installed."""
    from importlib.util import find_spec

    return any(find_spec(library) is None for library in libraries(processor))


def _key(controls: Controls) -> str:
    return json.dumps(to_json(controls), sort_keys=True)


def _message(text: str) -> Header:
    """Check a message's frame: its kind, its keys, its number."""
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"message: {len(text)} characters; allowed: {MOST_CHARACTERS}; send a shorter table")
    try:
        message = json.loads(text, parse_constant=_refuse)
    except (ValueError, RecursionError):
        raise InputError("message: it is no JSON; allowed: an object; send one") from None
    if not isinstance(message, dict) or not isinstance(message.get("kind"), str):
        raise InputError("message: it has no kind; allowed: an object with a kind; send one")
    if message["kind"] not in KINDS:
        raise unknown("message: kind", message["kind"], KINDS)
    keys = ("kind", "number", *KINDS[message["kind"]])
    require_keys("message", message, keys)
    if set(keys) - message.keys():
        raise InputError(f"message: {sorted(set(keys) - message.keys())[0]!r} is missing; add it")
    require_whole("number", message["number"], 0, 2**53, "count requests")
    cameras = message.get("cameras", [{}])
    if not isinstance(cameras, list) or not 1 <= len(cameras) <= 2:
        raise InputError("cameras: they are no list of one or two; send one or two")
    return message


def _refuse(constant: str) -> None:
    raise ValueError(constant)


def _view(value: Any) -> str:
    """Name of a view, or of a figure that Python can make."""
    if isinstance(value, str) and value in VIEWS:
        return value
    words = value.split(" ") if isinstance(value, str) else []
    if words == ["histogram"] or (len(words) == 3 and words[0] == "pixel" and all(x.isdecimal() for x in words[1:])):
        return " ".join(words)
    raise unknown("view", value, (*VIEWS, "histogram", "pixel ROW COLUMN"))


def _views(value: Any, cameras: int) -> list[tuple[int, str]]:
    """Camera and name of each view."""
    pairs = value if isinstance(value, list) and 1 <= len(value) <= 4 else [None]
    found = []
    for pair in pairs:
        if not isinstance(pair, list) or len(pair) != 2 or pair[0] not in range(cameras) or pair[1] not in VIEWS:
            raise InputError(f"views: {pair!r} is not allowed; give up to four of [camera, view], cameras from 0")
        found.append((int(pair[0]), str(pair[1])))
    return found
