"""Headless Chromium over its debugging pipe, for tests of pages; needs nothing but the standard library."""

import json
import os
import select
import shutil
import subprocess
import sys
import time
from base64 import b64decode
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

CHROMIUM = shutil.which("chromium")
QUIET = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--hide-scrollbars", "--remote-debugging-pipe",
]  # fmt: skip
# Chromium takes commands on descriptor 3 and answers on 4.
PLACE = (
    "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execv(sys.argv[3], sys.argv[3:])"
)
SECONDS = 30


class Browser:
    """A Chromium spoken to over its debugging pipe: JSON messages that end in NUL."""

    def __init__(self, profile: Path) -> None:
        commands, self._out = os.pipe()
        self._in, answers = os.pipe()
        start = [sys.executable, "-c", PLACE, str(commands), str(answers), str(CHROMIUM), *QUIET]
        self._process = subprocess.Popen(
            [*start, f"--user-data-dir={profile}"],
            pass_fds=(commands, answers),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(commands)
        os.close(answers)
        self._buffer = b""
        self._count = 0
        self.events: list[dict[str, Any]] = []

    def _receive(self) -> dict[str, Any]:
        limit = time.monotonic() + SECONDS
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(limit - time.monotonic(), 0))
            chunk = os.read(self._in, 1 << 20) if ready else b""
            assert chunk, "Chromium did not answer"
            self._buffer += chunk
        message, self._buffer = self._buffer.split(b"\0", 1)
        decoded: dict[str, Any] = json.loads(message)
        return decoded

    def send(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """Send one command and return its result; events that come before it are kept."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": params}
        rest = memoryview(json.dumps(message | ({"sessionId": session} if session else {})).encode() + b"\0")
        while rest:
            rest = rest[os.write(self._out, rest) :]
        while True:
            answer = self._receive()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def wait_for(self, method: str) -> None:
        """Take events until `method` has come."""
        while not any(event["method"] == method for event in self.events):
            self.events.append(self._receive())

    def close(self) -> None:
        """End this browser, and wait for it."""
        self.send("Browser.close")
        self._process.wait(SECONDS)
        os.close(self._in)
        os.close(self._out)


class Page:
    """One tab with a loaded file, or an address."""

    def __init__(
        self,
        browser: Browser,
        file: Path | str,
        *,
        width: int = 1280,
        height: int = 900,
        dark: bool = False,
        script: bool = True,
    ) -> None:
        self._browser = browser
        browser.events.clear()
        target = browser.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")
        self.show(width=width, height=height, dark=dark)
        self.send("Emulation.setScriptExecutionDisabled", value=not script)
        self.address = file if isinstance(file, str) else file.resolve().as_uri()
        self.send("Page.navigate", url=self.address)
        browser.wait_for("Page.loadEventFired")

    def send(self, method: str, **params: Any) -> dict[str, Any]:
        """Send one command to this tab."""
        return self._browser.send(method, self._session, **params)

    def show(self, *, width: int, height: int = 900, dark: bool = False, medium: str = "") -> None:
        """Set the window's size, the colour scheme and the medium (``print``, or the window's own), once they hold.

        A page hears of its new size with the next frame, before that frame's own callbacks.
        """
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **size)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.send("Emulation.setEmulatedMedia", media=medium, features=scheme)
        here = f"innerWidth === {width} && innerHeight === {height}"
        self.value(f"new Promise(f => requestAnimationFrame(function now() {{ {here} ? requestAnimationFrame(f)"
                   " : requestAnimationFrame(now) }))")  # fmt: skip

    def value(self, script: str) -> Any:
        """Return what `script` evaluates to in the page."""
        result = self.send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def press(self, key: str, code: int) -> None:
        """Press one key."""
        for kind in ("rawKeyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press the mouse at one place of the window and let go at another."""
        for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def complaints(self) -> list[Any]:
        """Return console messages, exceptions and logged violations so far."""
        wanted = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
        return [event["params"] for event in self._browser.events if event["method"] in wanted]

    def requests(self) -> list[str]:
        """Return every address asked for so far, but the page's own and ``data:``."""
        sent = [event for event in self._browser.events if event["method"] == "Network.requestWillBeSent"]
        addresses = [event["params"]["request"]["url"] for event in sent]
        assert self.address in addresses, "the page's own request was not seen: nothing is being watched"
        return [address for address in addresses if address != self.address and not address.startswith("data:")]

    def screenshot(self, *, full: bool = False) -> np.ndarray:
        """Return the screen, or the whole page, as (height, width, 3)."""
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=full)["data"]
        return np.asarray(Image.open(BytesIO(b64decode(data))).convert("RGB"))
