"""The report in headless Chromium: what the browser refuses, what the controls change, what is on the screen."""

import json
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from studies.report import render_report

HOSTILE = "</script><b>x</b><img src=x onerror=document.title='owned'><script>document.title='owned'</script>"


def beside(name: str) -> Any:
    """Return the helper module `name` beside this file; pytest's importlib mode puts no folder on the path."""
    spec = spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SAMPLE = beside("report_sample")
CHROME = beside("report_browser")
Browser = CHROME.Browser
Page = CHROME.Page
pytestmark = pytest.mark.skipif(
    CHROME.CHROMIUM is None or sys.platform == "win32",
    reason="needs `chromium` on PATH (Debian: apt install chromium) and POSIX file descriptors",
)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """One Chromium for this module's tests."""
    started = Browser(tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of made-up results."""
    results = SAMPLE.sample_results()
    file: Path = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(render_report(results, SAMPLE.sample_pictures(results)), encoding="utf-8")
    return file


def shown(page: Any) -> dict[str, Any]:
    """Return what the viewer shows of its first camera and its level."""
    value: dict[str, Any] = page.value(
        """({level: document.getElementById("level-name").textContent,
             picture: document.querySelector("#side img").src,
             psnr: document.querySelector("#side [data-row=psnr_db] dd").textContent,
             spoken: document.getElementById("level").getAttribute("aria-valuetext"),
             status: document.getElementById("status").textContent})"""
    )
    return value


def test_page_is_quiet_and_asks_for_nothing(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    page.value("Promise.all([...document.images].map((image) => image.decode()))")
    assert page.requests() == []
    assert page.complaints() == []


def test_slider_by_keyboard_changes_picture_and_numbers(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    results = SAMPLE.sample_results()
    before = shown(page)
    page.value("document.getElementById('level').focus()")
    page.press("ArrowRight", 39)
    after = shown(page)
    assert (before["level"], after["level"]) == ("moonlight", "street light")
    cell = next(cell for cell in results["cells"] if cell["level"] == 1 and cell["sensor"] == "table1_output")
    assert after["psnr"] == f"{cell['psnr_db']:.1f}\N{NO-BREAK SPACE}dB" != before["psnr"]
    assert after["spoken"].startswith("street light, 0.5")
    assert "street light" in after["status"]
    overview = page.value("document.querySelector('[data-cell=\"2\"] img').src")
    assert after["picture"] == overview != before["picture"]
    assert page.complaints() == []


def test_sensor_and_overview_change_what_is_shown(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    before = shown(page)
    page.value("document.querySelectorAll('[name=sensor]')[1].click()")
    other = shown(page)
    assert page.value("document.getElementById('sensor-name').textContent") == "low_noise"
    assert other["level"] == before["level"]
    assert other["picture"] == page.value("document.querySelector('[data-cell=\"14\"] img').src") != before["picture"]
    page.value("document.querySelector('[data-cell=\"27\"]').click()")
    assert shown(page)["level"] == "daylight"
    assert page.value("document.querySelector('[name=sensor]:checked').value") == "1"


def test_detail_holds_the_pixels_it_names(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    # The canvas's top left pixel against the truth's own pixel there, decoded outside the browser.
    color = page.value(
        """(async () => {
             document.getElementById("column").value = 100; document.getElementById("row").value = 180;
             document.getElementById("row").dispatchEvent(new Event("input"));
             await new Promise((done) => setTimeout(done, 200));
             const canvas = document.querySelector("[data-truth] canvas");
             return [...canvas.getContext("2d").getImageData(0, 0, 1, 1).data].slice(0, 3)})()"""
    )
    truth = np.asarray(Image.open(BytesIO(SAMPLE.sample_pictures(SAMPLE.sample_results())["truth"])).convert("RGB"))
    assert color == truth[180 - 8, 100 - 16].tolist()


def test_wipe_shows_two_pictures(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    page.value("document.querySelector('[name=view][value=wipe]').click()")
    shown_pair = page.value("[document.getElementById('over').src, document.getElementById('under').src]")
    cameras = page.value("[...document.querySelectorAll('#side figure[data-camera] img')].map((image) => image.src)")
    assert shown_pair == cameras
    assert page.value("getComputedStyle(document.getElementById('side')).display") == "none"
    page.value(
        "const wiper = document.getElementById('wiper'); wiper.value = 20; wiper.dispatchEvent(new Event('input'))"
    )
    assert "80%" in page.value("getComputedStyle(document.getElementById('over')).clipPath")


@pytest.mark.parametrize(("width", "factor"), [(360, 1), (1000, 1), (1280, 1), (1920, 2), (2560, 2)])
def test_fits_the_window_with_whole_pixels(browser: Any, report: Path, width: int, factor: int) -> None:
    page = Page(browser, report, width=width)
    assert page.value("document.documentElement.scrollWidth") <= width
    assert page.value("document.querySelector('#side img').getBoundingClientRect().width") == 256 * factor
    assert page.value("document.getElementById('scale').textContent").startswith("Each picture is 256 × 256 pixels")


@pytest.mark.parametrize("dark", [False, True])
def test_screen_is_not_blank(browser: Any, report: Path, dark: bool) -> None:
    page = Page(browser, report, dark=dark)
    top = page.screenshot()
    paper = top[5, 5].mean()
    assert paper < 60 if dark else paper > 200
    assert 0.02 < (np.abs(top.astype(int) - top[5, 5]).max(axis=2) > 60).mean() < 0.6
    page.value(
        "document.documentElement.style.scrollBehavior = 'auto'; document.getElementById('pictures').scrollIntoView()"
    )
    assert np.unique(page.screenshot().reshape(-1, 3), axis=0).shape[0] > 5000, "noise pictures hold many colours"


def test_without_script_the_first_level_stands(browser: Any, report: Path) -> None:
    page = Page(browser, report, script=False)
    assert shown(page)["level"] == "moonlight"
    assert shown(page)["status"] == "", "the script ran"
    visible = (
        "[...document.querySelectorAll('#pictures input, #pictures canvas')].filter((one) => one.offsetParent).length"
    )
    assert page.value(visible) == 0, "controls that can do nothing are shown"
    assert page.value("document.querySelector('noscript').innerText").startswith("Without JavaScript")
    assert page.value("document.querySelector('#side img').getBoundingClientRect().width") == 256


def test_hostile_names_stay_text(browser: Any, tmp_path: Path) -> None:
    results = SAMPLE.sample_results()
    pictures = SAMPLE.sample_pictures(results)
    results["scene"] = results["levels"][0]["name"] = results["notes"][0] = results["exposure_rule"] = HOSTILE
    file = tmp_path / "hostile.html"
    file.write_text(render_report(results, pictures), encoding="utf-8")
    page = Page(browser, file)
    assert page.value("document.title").startswith(HOSTILE)
    assert page.value("document.querySelectorAll('img[src=x]').length") == 0
    assert shown(page)["level"] == HOSTILE
    assert page.requests() == []
    assert page.complaints() == []


def test_policy_refuses_injected_script_and_fetch(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    page.value(
        """(async () => {
             const script = document.createElement("script");
             script.textContent = "document.title = 'owned'";
             document.body.append(script);
             const image = document.createElement("img");
             image.src = "https://example.invalid/x.png";
             document.body.append(image);
             await fetch("https://example.invalid/").catch(() => {});
           })()"""
    )
    assert page.value("document.title") != "owned"
    violations = json.dumps(page.complaints())
    for directive in ("script-src", "img-src", "default-src"):
        assert directive in violations
