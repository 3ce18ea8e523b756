"""Headless Chromium by Playwright, for tests of pages."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

CHROMIUM = shutil.which("chromium")
NEEDED = pytest.mark.skipif(
    CHROMIUM is None or find_spec("playwright") is None,
    reason="needs `chromium` on PATH (Debian: apt install chromium) and Playwright (in rodcone[dev])",
)


@contextmanager
def chromium() -> Iterator[Any]:
    """Start a Chromium; Playwright's loop runs in this thread until it ends."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        switches = ["--disable-gpu", "--disable-dev-shm-usage"]
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=switches)
        yield started
        started.close()


def open_page(
    browser: Any, file: Path | str, *, width: int = 1280, height: int = 900, dark: bool = False, script: bool = True
) -> Any:
    """Open a file or an address in a profile of its own."""
    page = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme="dark" if dark else "light",
        java_script_enabled=script,
    ).new_page()
    page.goto(file if isinstance(file, str) else file.resolve().as_uri())
    return page


def show(page: Any, *, width: int, height: int = 900, dark: bool = False, medium: str = "screen") -> None:
    """Set the window's size, the colour scheme and the medium, once the frame after next has them."""
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(color_scheme="dark" if dark else "light", media=medium)
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def drag(page: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Press the mouse at one place of the window and let go at another."""
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end)
    page.mouse.up()


def complaints(page: Any) -> list[str]:
    """Return console messages, exceptions and logged violations so far."""
    return [str(each.text) for each in page.console_messages()] + [str(each) for each in page.page_errors()]


def requests(page: Any) -> list[str]:
    """Return every address asked for so far, but the page's own and ``data:``."""
    addresses = [each.url for each in page.requests()]
    assert page.url.partition("#")[0] in addresses, "the page's own request was not seen: nothing is being watched"
    return [each for each in addresses if each != page.url.partition("#")[0] and not each.startswith("data:")]


def screenshot(page: Any) -> np.ndarray:
    """Return the screen as (height, width, 3)."""
    return np.asarray(Image.open(BytesIO(page.screenshot())).convert("RGB"))
