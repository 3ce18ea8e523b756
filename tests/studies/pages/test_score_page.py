"""The sheet of figures of merit: its numbers, and one printed page."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import browser as CHROME
import pytest

from studies.pages.score_page import half_text, number_text, score_page
from studies.score.figure import Merit
from studies.score.over_light import AtLight

LIGHT = [AtLight(lux, snr, snr + 0.1, share, share) for lux, snr, share in ((0.1, -20.0, 0.01), (10.0, 12.0, 0.4))]
# As many as a plain camera has, with conditions as long as the longest.
MERITS = [
    Merit(
        f"group{number // 6}.figure_{number}",
        f"a figure of merit with a long name, {number}",
        "cycles/px",
        "ISO 12233:2017, annex D (e-SFR)",
        "G at every pixel, raw, edge of 4:1 at 5 degrees, D65, f/2.8, diffraction 1, defocus 0 um, crosstalk 0",
        12345.6,
        measured=0.0123456,
        low=0.0121,
        high=0.0125,
    )
    for number in range(50)
]


def sheet(*cameras: str) -> str:
    return score_page(dict.fromkeys(cameras, MERITS), dict.fromkeys(cameras, LIGHT), "Under D65.", "0.0")


def test_numbers_have_four_digits_and_no_exponent_where_they_are_large() -> None:
    texts = [number_text(x) for x in (51.5678, 0.0123456, 12345.6, -15000.4, float("nan"), float("inf"))]
    assert texts == ["51.57", "0.01235", "12346", "-15000", "—", "—"]


def test_a_figure_that_a_camera_lacks_is_a_dash_and_one_without_an_interval_has_none() -> None:
    alone = replace(MERITS[0], low=float("nan"), high=float("nan"))
    text = score_page({"<one>": [alone], "other": []}, {"<one>": LIGHT, "other": LIGHT}, "", "0.0")
    row = re.search(r"<tr><th scope=\"row\">a figure.*?</tr>", text, re.DOTALL)
    assert row is not None
    assert row[0].count("—") == 2  # computed and measured of the other camera
    assert " to " not in row[0]
    assert "<one>" not in text
    assert "&lt;one&gt;" in text


def test_half_of_an_interval_has_two_digits_and_no_exponent_where_it_is_large() -> None:
    widths = (0.0004, 0.1234, 25.0, 246.8)
    halves = [half_text(replace(MERITS[0], low=5.0 - width / 2, high=5.0 + width / 2)) for width in widths]
    assert halves == ["0.0002", "0.062", "12", "123"]


def test_rows_keep_their_order_where_the_first_camera_lacks_one() -> None:
    lacking = [replace(MERITS[0], missing="no light reaches it"), *MERITS[1:]]
    text = score_page({"one": lacking, "other": MERITS}, {"one": LIGHT, "other": LIGHT}, "", "0.0")
    titles = re.findall(r'<th scope="row">(.*?)</th>', text)
    assert titles == [merit.title for merit in MERITS]


@CHROME.NEEDED
@pytest.mark.thorough
@pytest.mark.parametrize("cameras", [("low_noise",), ("low_noise", "a_camera_whose_name_is_longer_than_its_columns")])
def test_a_sheet_of_one_or_two_cameras_is_one_page(cameras: tuple[str, ...], tmp_path: Path, browser: Any) -> None:
    """Pages as the PDF's own page tree counts them, not shrunk because a table is too wide; 8 points or more."""
    path = tmp_path / "sheet.html"
    path.write_text(sheet(*cameras), "utf-8")
    page = CHROME.open_page(browser, path, width=int((210 - 2 * 7) / 25.4 * 96))
    (count,) = re.findall(rb"/Type /Pages\s[^>]*?/Count (\d+)", page.pdf(prefer_css_page_size=True))
    assert int(count) == 1
    page.emulate_media(media="print")
    sizes = "[...document.querySelectorAll('td, th, td small, p')].map(x => parseFloat(getComputedStyle(x).fontSize))"
    assert min(page.evaluate(sizes)) >= 8 * 96 / 72 - 0.01
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    notes = "[...document.querySelectorAll('td.print')].filter(x => x.offsetParent).map(x => x.innerText)"
    assert page.evaluate(notes) == ["1"] * len(MERITS)  # what defines each figure, once
    assert "1 ISO 12233:2017, annex D (e-SFR)." in page.evaluate("document.body.innerText")


@CHROME.NEEDED
@pytest.mark.thorough
def test_a_sheet_of_three_cameras_prints_each_rows_conditions(tmp_path: Path, browser: Any) -> None:
    path = tmp_path / "sheet.html"
    path.write_text(sheet("low_noise", "table1_pixel", "dual_gain"), "utf-8")
    page = CHROME.open_page(browser, path)
    page.emulate_media(media="print")
    shown = "[...document.querySelectorAll('tr.print')].filter(x => x.offsetParent).length"
    assert page.evaluate(shown) == len(MERITS)
