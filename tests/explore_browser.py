"""The explorer in headless Chromium: a served page, its controls moved as a user moves them, its pictures read back."""

import threading
import time
from base64 import b64decode
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from random import Random
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.explore.server import listen, make_server
from studies.explore.session import Session
from studies.explore.source import Source

# Waits for the picture of the newest settings (of the last state of the render), or for what was refused.
SETTLED = """new Promise((done, fail) => { const start = Date.now(); (function look() {
  const root = document.querySelector(".explore"), { asked, painted, failed, last, figures } = root?.dataset ?? {};
  if (asked && failed === asked) done("failed");
  else if (asked && painted === asked && (last === "true" || !%s) && (figures === asked || !%s)) done("painted");
  else if (Date.now() - start > 60000) fail(new Error(document.body.innerText.slice(0, 500)));
  else setTimeout(look, 5);
})() })"""
# Moves one control to a random place, as its own events do; says which.
MOVE = """((pick, share) => {
  const all = [...document.querySelectorAll(".explore .controls [data-key]:enabled:not([type=radio])")];
  const control = all[Math.floor(pick * all.length)];
  if (control.tagName === "SELECT") {
    const options = [...control.options].filter(each => each.value !== "file" && !each.text.includes("slow"));
    control.value = options[Math.floor(share * options.length)].value;
    control.dispatchEvent(new Event("change"));
  } else {
    if (control.type === "checkbox") control.checked = share < 0.5;
    control.value = control.type === "range" ? Math.round(share * control.max) : control.value;
    control.dispatchEvent(new Event("input"));
  }
  return `${control.dataset.key} ${control.type === "checkbox" ? control.checked : control.value}`;
})(%r, %r)"""
# Drags a slider between two places of its range and back, an event each 16 ms, for some ms; gives for each picture
# painted meanwhile when that was, and when its values were set [ms].
DRAG = """((key, low, high, ms) => new Promise(done => {
  const root = document.querySelector(".explore"), start = performance.now(), changed = {}, painted = [];
  const paint = () => painted.push([performance.now() - start, changed[root.dataset.painted]]);
  root.addEventListener("painted", paint);
  (function move() {
    const now = performance.now() - start, control = root.querySelector(`[data-key="${key}"]`);
    if (now > ms) {
      root.removeEventListener("painted", paint);
      return done(painted.filter(each => each[1] !== undefined));
    }
    const share = low + (high - low) * (0.5 - 0.5 * Math.cos(now / 300)), box = control.type === "number";
    control.value = Math.round(share * (box ? 1e6 : control.max));
    control.dispatchEvent(new Event("input"));
    changed[root.dataset.asked] = now;
    setTimeout(move, 16 - (performance.now() - start) %% 16);
  })();
}))(%r, %r, %r, %r)"""
PIXELS = """((canvas) => { const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let text = ""; for (let i = 0; i < data.length; i += 8192) text += String.fromCharCode(...data.subarray(i, i + 8192));
  return [canvas.width, canvas.height, btoa(text)]; })(document.querySelectorAll(".explore canvas")[%d])"""
COPY = """new Promise(done => { const root = document.querySelector(".explore"); delete root.dataset.python;
  root.querySelectorAll(".pictures figure")[%d].querySelector("button").click();
  (function look() { if (!root.dataset.python) return setTimeout(look, 5);
    root.querySelectorAll("dialog").forEach(each => each.close()); done(root.dataset.python); })(); })"""


@contextmanager
def served(source: Source, scenes: Mapping[str, Callable[[], Source]] = MappingProxyType({})) -> Iterator[str]:
    """Address of an explorer that runs in this process."""
    session = Session(source, scenes)
    with listen(0) as listener:
        server, address = make_server(session, listener)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        while not server.started:
            time.sleep(0.01)
        try:
            yield address
        finally:
            server.should_exit = True
            thread.join()
            session.close()


def settle(page: Any, *, last: bool = True, figures: bool = False) -> str:
    """Wait for the page's newest picture; "painted", or "failed" where its settings were refused."""
    said: str = page.evaluate(SETTLED % (str(last).lower(), str(figures).lower()))
    return said


def move(page: Any, rng: Random) -> str:
    """Move a control at random."""
    said: str = page.evaluate(MOVE % (rng.random(), rng.random()))
    return said


def picture(page: Any, index: int = 0) -> NDArray[np.uint8]:
    """The pixels of a canvas, (h, w, 3)."""
    width, height, text = page.evaluate(PIXELS % index)
    return np.frombuffer(b64decode(text), np.uint8).reshape(height, width, 4)[..., :3]


def copied_python(page: Any, index: int = 0) -> str:
    """What the button under a picture copies."""
    text: str = page.evaluate(COPY % index)
    return text
