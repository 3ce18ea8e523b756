"""Speed: who is fastest, what the others' time buys, and what each render cost."""

import re
from dataclasses import replace
from html import unescape

import pytest
import report_sample as SAMPLE

from studies.pages.report import render_report
from studies.pages.report_pictures import ReportPictures
from studies.pages.report_speed import speed_rows
from studies.sweep.row import Row


def twenty_and_23(row: Row) -> Row:
    """PSNR 20 for Bayer in 30 ms, 23 for the interleaved camera in 110 ms, everywhere."""
    return replace(row, psnr_db=23.0 if row.processor == "interleaved" else 20.0)


def test_the_gain_is_the_lead_over_the_fastest_camera() -> None:
    rows = {(row.sensor, row.camera): row for row in speed_rows(SAMPLE.sample_report(twenty_and_23))}
    for sensor in ("table1_output", "low_noise"):
        slow, fast = rows[sensor, "interleaved"], rows[sensor, "bayer"]
        assert (fast.gain_db, slow.gain_db) == (0.0, pytest.approx(3.0))
        assert (fast.develop_s, slow.develop_s) == (pytest.approx(0.03), pytest.approx(0.11))
        assert fast.conditions == slow.conditions == 7


def test_a_condition_unknown_for_one_camera_counts_for_none() -> None:
    def without(row: Row) -> Row | None:
        if row.level != "daylight" or row.sensor != "low_noise":
            return twenty_and_23(row)
        return None if row.processor == "bayer" else replace(row, psnr_db=90.0)

    rows = [row for row in speed_rows(SAMPLE.sample_report(without)) if row.sensor.startswith("low_noise")]
    assert [(row.psnr_db, row.conditions) for row in rows] == [(23.0, 6), (20.0, 6)]


def test_no_mean_is_over_conditions_that_other_engines_captured_or_other_variants_rendered() -> None:
    """The two darkest levels in NumPy, ten times as slow and 5 dB worse; each way has rows and a chart of its own."""

    def in_numpy(row: Row) -> Row:
        row = twenty_and_23(row)
        if row.level not in ("moonlight", "street light"):
            return replace(row, capture_s=0.02)
        return replace(row, readout_engine="numpy", psnr_db=row.psnr_db - 5.0, capture_s=0.2)

    report = SAMPLE.sample_report(in_numpy)
    rows = [row for row in speed_rows(report) if row.camera == "bayer"]
    for row in rows:
        slow = row.sensor.endswith(", render llvm_ad_spectral, capture numpy")
        assert slow or row.sensor.endswith(", capture llvm")
        assert (row.capture_s, row.psnr_db, row.conditions) == pytest.approx(
            (0.2, 15.0, 2) if slow else (0.02, 20.0, 5)
        )
    assert len(rows) == 2 * len(report.sensors)


def test_an_unknown_time_or_psnr_is_unknown() -> None:
    rows = speed_rows(SAMPLE.sample_report(lambda row: row if row.processor == "interleaved" else None))
    assert [row.develop_s for row in rows] == [pytest.approx(0.11), None] * 2
    assert [row.psnr_db for row in rows] == [None] * 4, "no condition is known for both"


def test_each_render_has_its_cost_and_the_worst_share_of_its_pictures() -> None:
    def shared(row: Row) -> Row:
        worst = (row.scene, row.spectrum, row.level, row.processor) == ("still_life", "own", "moonlight", "bayer")
        return replace(row, mc_share=0.5 if worst else 0.01 if row.scene == "still_life" else 0.02)

    scenes = SAMPLE.sample_views().scenes
    report = SAMPLE.sample_report(shared, 2, scenes=scenes, spectra=("own", "A"), truths=(None,) * 4)
    pictures = ReportPictures({cell.picture: b"\x89PNG\r\n\x1a\n" for cell in report.cells if cell.picture}, {})
    page = unescape(render_report(report, pictures)).replace("\N{NO-BREAK SPACE}", " ")
    table = page[page.index('id="renders-h"') : page.index('id="time-h"')]
    found = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)[1:]]
    assert [row[0] for row in found] == ["still_life", "color_checker"]
    for row, share in zip(found, ("50 %", "2 %"), strict=True):
        assert row[1:] == ["path + specfilm", "256", "time", "40", "41.2 s", "3.1 %", share]
