"""The report in headless Chromium: what the browser refuses, what the controls change, what is on the screen."""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_browser as CHROME
import report_sample as SAMPLE
from PIL import Image

from studies.pages.report import render_report

HOSTILE = "</script><b>x</b><img src=x onerror=document.title='owned'><script>document.title='owned'</script>"


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
    results = SAMPLE.sample_report()
    file: Path = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(render_report(results, SAMPLE.sample_pictures(results)), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def axes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of several exposures and seeds."""
    results = SAMPLE.sample_axes()
    file: Path = tmp_path_factory.mktemp("axes") / "report.html"
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
    before = shown(page)
    page.value("document.getElementById('level').focus()")
    page.press("ArrowRight", 39)
    after = shown(page)
    assert (before["level"], after["level"]) == ("moonlight", "street light")
    psnr_db = SAMPLE.sample_row(1, 0, "interleaved").psnr_db
    assert after["psnr"] == f"{psnr_db:.1f}\N{NO-BREAK SPACE}dB" != before["psnr"]
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
             await document.querySelector("[data-truth] img").decode();  // the page asked first, and draws first
             const canvas = document.querySelector("[data-truth] canvas");
             return [...canvas.getContext("2d").getImageData(0, 0, 1, 1).data].slice(0, 3)})()"""
    )
    truth = np.asarray(Image.open(BytesIO(SAMPLE.sample_pictures(SAMPLE.sample_report())["truth"])).convert("RGB"))
    assert color == truth[180 - 8, 100 - 16].tolist()
    assert page.value("getComputedStyle(document.querySelector('[data-truth] canvas')).imageRendering") == "pixelated"


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
    page.value(
        "document.documentElement.style.scrollBehavior = 'auto'; document.querySelector('.stage').scrollIntoView()"
    )
    box = page.value(
        "(({left, top, width}) => [left, top, width])(document.querySelector('.stage').getBoundingClientRect())"
    )
    page.drag((box[0] + 0.5 * box[2], box[1] + 50), (box[0] + 0.25 * box[2], box[1] + 60))
    assert page.value("document.getElementById('wiper').value") == "25"
    assert "75%" in page.value("getComputedStyle(document.getElementById('over')).clipPath")
    page.value("document.getElementById('wiper').focus()")
    page.press("ArrowRight", 39)
    spoken = page.value("document.getElementById('wiper').getAttribute('aria-valuetext')")
    assert spoken == "26 % Interleaved, 74 % Bayer"


def test_fits_the_window_with_whole_pixels(browser: Any, report: Path) -> None:
    page = Page(browser, report)
    for dark in (False, True):
        for width, factor in ((360, 1), (1000, 1), (1280, 1), (1920, 2), (2560, 2)):
            page.show(width=width, dark=dark)
            assert page.value("document.documentElement.scrollWidth") <= width
            assert page.value("document.querySelector('#side img').getBoundingClientRect().width") == 256 * factor
    assert page.value("document.getElementById('scale').textContent").startswith("Each picture is 256 × 256 pixels")


def test_exposure_slider_changes_picture_and_numbers_and_nothing_scrolls(browser: Any, axes: Path) -> None:
    page = Page(browser, axes)
    page.press("Tab", 9)  # the skip link; from it on by keyboard alone
    page.value("document.getElementById('level').focus()")
    page.press("ArrowRight", 39)
    before = shown(page)
    page.press("Tab", 9)
    assert page.value("document.activeElement.id") == "exposure"
    assert page.value("getComputedStyle(document.activeElement).outlineStyle") == "solid", "the focus can't be seen"
    page.press("ArrowRight", 39)
    after = shown(page)
    mean = SAMPLE.sample_row(1, 0, "interleaved").psnr_db - 3.0
    assert after["psnr"].replace("\N{NO-BREAK SPACE}", " ") == f"{mean:.1f} ± 0.2 dB"
    assert page.value("document.getElementById('exposure').getAttribute('aria-valuetext')").startswith("10")
    assert after["level"] == before["level"] == "street light"
    assert "exposure 10" in after["status"]
    # Six cells an exposure, two a level.
    assert after["picture"] == page.value("document.querySelector('[data-cell=\"8\"] img').src") != before["picture"]
    page.value("document.querySelector('[data-cell=\"5\"]').click()")
    assert page.value("[document.getElementById('exposure').value, document.getElementById('level').value]") == [
        "0",
        "2",
    ]
    for width in (360, 1280, 2560):
        page.show(width=width)
        assert page.value("document.documentElement.scrollWidth") <= width
    assert page.complaints() == []
    assert page.requests() == []


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of two scenes under two spectra, of which one condition's pictures are left out."""
    results = SAMPLE.sample_views()
    file: Path = tmp_path_factory.mktemp("views") / "report.html"
    file.write_text(render_report(results, SAMPLE.sample_pictures(results)), encoding="utf-8")
    return file


def choose(page: Any, view: int) -> None:
    page.value(f"var view = document.getElementById('view'); view.value = {view};"
               "view.dispatchEvent(new Event('input'))")  # fmt: skip


def test_choice_of_scene_and_light_changes_pictures_truth_and_numbers(browser: Any, views: Path) -> None:
    page = Page(browser, views)
    truth = "document.querySelector('[data-truth] img').src"
    names = page.value("[...document.getElementById('view').options].map((option) => option.text)")
    assert names == [
        f"{scene}, {light}" for scene in ("still_life", "color_checker") for light in ("own light", "under A")
    ]
    seen = []
    for view in range(4):
        choose(page, view)
        seen.append((shown(page)["psnr"], shown(page)["picture"], page.value(truth)))
        assert names[view] in shown(page)["status"]
    assert [psnr for psnr, _, _ in seen] == [f"{db:.1f}\N{NO-BREAK SPACE}dB" for db in (10, 14, 18, 22)]
    assert len({picture for _, picture, _ in seen}) == len({truth for _, _, truth in seen}) == 4
    # The chart's picture is twice as wide as high, and its figure stands on it alone.
    box = page.value(
        "(({width, height}) => [width, height])(document.querySelector('#side img').getBoundingClientRect())"
    )
    assert box[0] == 2 * box[1]
    target = "document.querySelector('#side [data-row=chart_delta_e_mean]').hidden"
    assert page.value(target) is False
    assert page.value("document.querySelector('#side [data-row=chart_delta_e_mean] dd').textContent") == "3.0"
    choose(page, 0)
    assert page.value(target) is True
    # A picture of another scene in the overview, in a part that is folded until it is opened.
    page.value("document.querySelector('[data-cell=\"9\"]').click()")
    assert page.value("document.getElementById('view').value") == "1"
    assert page.complaints() == []
    assert page.requests() == []


def test_a_picture_left_out_is_said_to_be_and_its_numbers_stand(browser: Any, views: Path) -> None:
    page = Page(browser, views)
    choose(page, 3)
    page.value("document.querySelectorAll('[name=sensor]')[1].click(); document.getElementById('level').focus()")
    gone = "getComputedStyle(document.querySelector('#side .gone')).display"
    assert page.value(gone) == "none"
    page.press("ArrowRight", 39)
    assert page.value(gone) == "grid"
    words = page.value("document.querySelector('#side .gone').textContent")
    assert words == "Not in this page; its numbers are: pictures/color_checker/A/1/1/interleaved"
    assert shown(page)["psnr"] == f"{10 + 8 + 4 + 2 + 1:.1f}\N{NO-BREAK SPACE}dB"
    assert page.value("document.querySelector('#side img').hasAttribute('src')") is False
    page.value("document.querySelector('[name=view][value=wipe]').click()")
    assert page.value("getComputedStyle(document.querySelector('.stage .gone')).display") == "grid"
    page.value("document.getElementById('level').focus()")
    page.press("ArrowLeft", 37)
    assert page.value("getComputedStyle(document.querySelector('.stage .gone')).display") == "none"
    assert page.complaints() == []
    assert page.requests() == []


def test_choice_of_metrics_shows_their_charts_in_every_group(browser: Any, views: Path) -> None:
    page = Page(browser, views)
    page.value("for (const fold of document.querySelectorAll('details')) fold.open = true")
    drawn = "[...document.querySelectorAll('[data-metric=%s]')].filter((one) => one.getClientRects().length).length"
    assert [page.value(drawn % key) for key in ("psnr_db", "flip_mean", "chart_delta_e_mean")] == [8, 0, 0]
    for key in ("psnr_db", "flip_mean"):
        page.value(f"document.querySelector('[name=metric][value={key}]').click()")
    assert [page.value(drawn % key) for key in ("psnr_db", "flip_mean", "chart_delta_e_mean")] == [0, 8, 0]
    assert page.value("document.querySelectorAll('[name=metric]').length") == 9, (
        "the eight of every scene, and the chart's"
    )
    for width in (360, 1280, 2560):
        page.show(width=width)
        assert page.value("document.documentElement.scrollWidth") <= width
    page.show(width=720, medium="print")
    assert page.value(drawn % "flip_mean") == 8
    assert page.complaints() == []


def test_folded_parts_are_printed(browser: Any, views: Path) -> None:
    page = Page(browser, views, width=720)
    held = "[...document.querySelectorAll('.sheet img')].filter((one) => one.checkVisibility()).length"
    assert page.value(held) == 8, "the first scene's, under its own light"
    page.show(width=720, medium="print")
    assert page.value(held) == 4 * 8 - 2


def test_every_control_has_a_name_for_a_screen_reader(browser: Any, axes: Path) -> None:
    page = Page(browser, axes)
    page.value("document.querySelector('[name=view][value=wipe]').click()")
    nodes = page.send("Accessibility.getFullAXTree")["nodes"]
    # Level, exposure, wipe; one sensor, two views; left, right; the metrics.
    wanted = {"slider": 3, "radio": 3, "combobox": 2, "checkbox": 8}
    for role, count in wanted.items():
        names = [node["name"]["value"] for node in nodes if node.get("role", {}).get("value") == role]
        assert len(names) == count, (role, names)
        assert all(names), (role, names)
    pictures = [node for node in nodes if node.get("role", {}).get("value") == "image" and not node["ignored"]]
    assert len(pictures) > 12
    assert all(node["name"]["value"] for node in pictures)


def test_print_holds_every_level_and_no_control(browser: Any, axes: Path) -> None:
    page = Page(browser, axes, width=720)
    page.value("document.querySelector('[name=view][value=wipe]').click()")
    page.show(width=720, medium="print")
    visible = "[...document.querySelectorAll('%s')].filter((one) => one.getClientRects().length).length"
    assert page.value(visible % "input, select, button, canvas, nav, .stage") == 0
    assert page.value(visible % ".sheet img") == 12
    assert page.value(visible % "#side img") == 3
    tops = page.value("[...document.querySelectorAll('.sheet')].map((sheet) => new Set([...sheet.children].map("
                      "(item) => item.getBoundingClientRect().top)).size)")  # fmt: skip
    assert tops == [1, 1], "the levels of a contact sheet stand in one row"
    wide = "Math.max(...[...document.querySelectorAll('main > section:not(#table)')].map((one) => one.scrollWidth))"
    assert page.value(wide) <= 720
    # A4 across, less 10 mm to each side, at CSS's 96 pixels an inch.
    assert page.value("document.querySelector('#table table').scrollWidth") <= (297 - 2 * 10) / 25.4 * 96


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
    colours = page.screenshot().astype(np.int64) @ (1 << 16, 1 << 8, 1)
    assert np.unique(colours).size > 5000, "noise pictures hold many colours"


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
    reachable = (
        "[...document.querySelectorAll('.sheet img')].filter((one) => one.getClientRects().length && one.naturalWidth)"
    )
    assert page.value(f"new Set({reachable}.map((one) => one.src)).size") == 28, "every picture can be seen"
    page.value("document.querySelector('noscript a').click()")
    assert page.value("location.hash") == "#overview"


def test_hostile_names_stay_text(browser: Any, tmp_path: Path) -> None:
    results = SAMPLE.sample_report()
    pictures = SAMPLE.sample_pictures(results)
    results = replace(
        results,
        name=HOSTILE,
        scenes=(replace(results.scenes[0], name=HOSTILE),),
        levels=(replace(results.levels[0], name=HOSTILE), *results.levels[1:]),
        notes=(HOSTILE,),
        exposure_rule=HOSTILE,
        configuration={HOSTILE: HOSTILE},
    )
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
