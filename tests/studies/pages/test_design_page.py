"""Numbers of the design's and the judge's page, recounted from what they were made of."""

import re
from html import unescape
from typing import Any

import numpy as np
import pytest

from sensor.presets import low_noise
from studies.dataset.judge import MEASURED, Score, judge_page, psnr_chart
from studies.design.expect import ExpectedError
from studies.design.search import Goal
from studies.pages import design_page

LIGHT = (0.1, 10.0)


def errors(psnr_db: tuple[float, float], luminance_db: float, colour: tuple[float, float]) -> list[ExpectedError]:
    made = zip(LIGHT, psnr_db, colour, strict=True)
    return [ExpectedError(light, 0.01, decibels, 0.0, luminance_db, 3.0, x) for light, decibels, x in made]


BY_CAMERA = {
    "bayer": errors((20.0, 30.0), 25.0, (9.0, 5.0)),
    "W/R": errors((21.5, 29.75), 24.5, (8.0, 5.25)),  # ahead in the dark, behind by day, and behind in luminance
    "rgbw": errors((20.5, 29.0), 25.5, (9.5, 5.0)),
}


def cells(html: str) -> list[list[str]]:
    """Text of each table row's cells."""
    rows = re.findall(r"<tr>(.*?)</tr>", html, re.DOTALL)
    return [[unescape(re.sub("<.*?>", "", x)) for x in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in rows]


def test_a_design_is_ahead_behind_and_gives_up_as_its_rows_say(monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Any] = []
    monkeypatch.setattr(design_page, "svg_text", lambda figure: figures.append(figure) or "<svg/>")
    page = design_page.design_page(Goal(over="moonlight:street"), low_noise("rgbw"), BY_CAMERA, 7)
    decibels, colours = [["Mosaic", "moonlight", "street"]] * 2
    assert cells(page) == [
        decibels,
        ["W/R", "+1.50", "-0.25"],
        ["rgbw", "+0.50", "-1.00"],
        colours,  # less error is a gain
        ["W/R", "+1.00", "-0.25"],
        ["rgbw", "-0.50", "+0.00"],
    ]
    lost = "PSNR 0.25 dB; at street: luminance 0.50 dB; at street: a*, b* 0.25 in Lab."
    assert f"Behind bayer at moonlight: luminance 0.50 dB; at street: {lost}" in " ".join(unescape(page).split())
    assert "The best of 7 tiles" in page
    tables = cells(page)[1:3], cells(page)[4:6]
    for axes, rows in zip(figures[-1].axes, tables, strict=True):
        for line, row in zip(axes.lines[:2], rows, strict=True):
            np.testing.assert_allclose(line.get_xdata(), LIGHT)
            np.testing.assert_allclose(line.get_ydata(), [float(value) for value in row[1:]], atol=1e-9)


def test_every_score_stands_in_table_and_chart_with_its_interval() -> None:
    keys = [metric.key for metric in MEASURED]
    scores = [
        Score("pixel", f"{light}cd/m2", name, light, scenes, dict.fromkeys(keys, mean), dict.fromkeys(keys, half))
        for name, scenes, mean, half in (("mine", 4, 20.25, 0.5), ("expect", 0, 23.5, np.nan))
        for light in LIGHT
    ]
    scores[1].means["psnr_db"] = 30.75
    rows = cells(judge_page({"rodcone": "1", "identity": "2", "name": "mine"}, scores))
    assert rows[0][3:] == [metric.name for metric in MEASURED]
    for row, score in zip(rows[1:], scores, strict=True):
        assert row[1:3] == [score.developer, str(score.scenes or "—")]
        for text, metric in zip(row[3:], MEASURED, strict=True):
            mean, *half = (float(x.replace("−", "-")) for x in text.split(" ± "))
            unit = 0.51 * 10.0**-metric.digits
            assert mean == pytest.approx(score.means[metric.key], abs=unit)
            assert len(half) == (score.scenes > 0)
            assert half == pytest.approx([0.5] * len(half), abs=unit)
    lines = [line for line in psnr_chart(scores).axes[0].lines if len(line.get_xdata()) == len(LIGHT)]
    drawn = {tuple(line.get_ydata()) for line in lines}
    assert {(20.25, 30.75), (23.5, 23.5), (19.75, 30.25), (20.75, 31.25)} <= drawn  # means, and the interval's caps
