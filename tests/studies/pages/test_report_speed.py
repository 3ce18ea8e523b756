"""Speed: what cameras and renders cost."""

import re
from dataclasses import replace
from html import unescape
from math import isnan

import pytest
import report_sample as SAMPLE

from studies.pages.report import render_report, speed_rows
from studies.pages.report_pictures import ReportPictures
from studies.sweep.row import Row


def test_seconds_are_means_over_the_pictures_of_a_camera_and_a_sensor() -> None:
    def slower(row: Row) -> Row | None:
        """Seven levels of 0.11 s, of the second sensor one of 0.81 s; and Bayer's first picture isn't made yet."""
        if (row.processor, row.level) == ("bayer", "moonlight"):
            return None
        long = (row.processor, row.sensor, row.level) == ("interleaved", "low_noise", "office")
        return replace(row, develop_s=row.develop_s + 0.7 * long)

    rows = speed_rows(SAMPLE.sample_report(slower, seeds=(0, 1)))
    assert [row[:2] for row in rows] == [
        (camera, sensor) for sensor in ("table1_output", "low_noise") for camera in ("Interleaved", "Bayer, bilinear")
    ]
    assert [row[3] for row in rows[::2]] == pytest.approx([0.11, 0.21])
    assert rows[0][2] == pytest.approx(0.021)
    assert isnan(rows[1][3])


@pytest.mark.thorough
def test_each_render_has_its_cost_and_the_worst_share_of_its_pictures() -> None:
    def shared(row: Row) -> Row:
        worst = (row.scene, row.spectrum, row.level, row.processor) == ("still_life", "own", "moonlight", "bayer")
        return replace(row, mc_share=0.5 if worst else 0.01 if row.scene == "still_life" else 0.02)

    scenes = SAMPLE.sample_views().scenes
    report = SAMPLE.sample_report(shared, 2, scenes=scenes, spectra=("own", "A"), truths=(None,) * 4)
    pictures = ReportPictures({cell.picture: b"RIFF" for cell in report.cells if cell.picture}, {})
    page = unescape(render_report(report, pictures)).replace("\N{NO-BREAK SPACE}", " ")
    table = page[page.index('id="renders-h"') : page.index('id="time-h"')]
    found = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)[1:]]
    assert [row[0] for row in found] == ["still_life", "color_checker"]
    for row, share in zip(found, ("50 %", "2 %"), strict=True):
        assert row[1:] == ["path + specfilm", "256", "time", "40", "41.2 s", "3.1 %", share]
