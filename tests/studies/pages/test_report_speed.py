"""Speed against error: who is fastest, what the others' time buys, and an axis with ticks for less than a decade."""

from typing import Any

import pytest
import report_sample as SAMPLE

from studies.pages.charts import log_ticks
from studies.pages.report_cells import ordered_cells
from studies.pages.report_charts import speed_charts, speed_rows
from studies.pages.report_view import render_rows


def made() -> dict[str, Any]:
    """PSNR 20 for Bayer in 30 ms, 23 for the interleaved camera in 110 ms, everywhere."""
    of: dict[str, Any] = SAMPLE.sample_results()
    for cell in of["cells"]:
        cell["psnr_db"] = 23.0 if cell["camera"] == "interleaved" else 20.0
    return of


def test_the_gain_is_the_lead_over_the_fastest_camera() -> None:
    of = made()
    rows = {(row["sensor"], row["camera"]): row for row in speed_rows(of, ordered_cells(of))}
    for sensor in ("table1_output", "low_noise"):
        slow, fast = rows[sensor, "interleaved"], rows[sensor, "bayer"]
        assert (fast["gain_db"], slow["gain_db"]) == (0.0, pytest.approx(3.0))
        assert (fast["develop"], slow["develop"]) == (pytest.approx(0.03), pytest.approx(0.11))
        assert fast["judged"] == slow["judged"] == 7


def test_a_condition_unknown_for_one_camera_counts_for_none() -> None:
    of = made()
    for cell in of["cells"]:
        if cell["level"] == 6 and cell["sensor"] == "low_noise":
            cell["psnr_db"] = None if cell["camera"] == "bayer" else 90.0
    rows = [row for row in speed_rows(of, ordered_cells(of)) if row["sensor"] == "low_noise"]
    assert [(row["psnr_db"], row["judged"]) for row in rows] == [(23.0, 6), (20.0, 6)]


def test_no_mean_is_over_conditions_that_other_engines_captured_or_other_variants_rendered() -> None:
    """The two darkest levels in NumPy, ten times as slow and 5 dB worse; each way has rows and a chart of its own."""
    of = made()
    for cell in of["cells"]:
        slow = cell["level"] < 2
        cell["engines"] = {"render": "llvm_ad_spectral", "capture": "numpy" if slow else "llvm", "develop": "llvm"}
        cell["psnr_db"] -= 5.0 * slow
        cell["seconds"] = {**cell["seconds"], "capture": 0.2 if slow else 0.02}
    rows = [row for row in speed_rows(of, ordered_cells(of)) if row["camera"] == "bayer"]
    for row in rows:
        slow = row["sensor"].endswith(", render llvm_ad_spectral, capture numpy")
        assert slow or row["sensor"].endswith(", capture llvm")
        assert (row["capture"], row["psnr_db"], row["judged"]) == pytest.approx(
            (0.2, 15.0, 2) if slow else (0.02, 20.0, 5)
        )
    assert len(rows) == 2 * len(of["sensors"])
    assert len(speed_charts(speed_rows(of, ordered_cells(of)))) == 2 * len(of["sensors"])


def test_the_chart_has_a_mark_a_camera_slower_ones_to_the_right_and_better_ones_above() -> None:
    of = made()
    chart = speed_charts(speed_rows(of, ordered_cells(of)))[0]
    assert [len(line.points) for line in chart.series] == [1, 1]
    slow, fast = (line.points[0] for line in chart.series)
    assert slow.x > fast.x
    assert slow.y < fast.y  # SVG counts downwards
    assert len(chart.x_ticks) > 1
    assert chart.x_label == "seconds to develop a picture"


def test_an_unknown_time_or_psnr_has_no_mark() -> None:
    of = made()
    for cell in of["cells"]:
        if cell["camera"] == "bayer":
            cell["seconds"] = None
    rows = speed_rows(of, ordered_cells(of))
    assert [row["develop"] for row in rows] == [pytest.approx(0.11), None] * 2
    assert [len(chart.series) for chart in speed_charts(rows)] == [1, 1]
    for cell in of["cells"]:
        cell["psnr_db"] = None
    assert speed_charts(speed_rows(of, ordered_cells(of))) == []


def test_ticks_of_less_than_two_decades_are_1_2_and_5() -> None:
    assert log_ticks(0.5, 2000.0) == [1.0, 10.0, 100.0, 1000.0]
    assert log_ticks(0.018, 0.16) == pytest.approx([0.02, 0.05, 0.1])
    assert log_ticks(18.0, 35.0) == pytest.approx([20.0])


def test_each_render_has_its_cost_and_the_worst_share_of_its_pictures() -> None:
    of = SAMPLE.sample_views()
    of["renders"] = [
        {"scene": name, "spp": 64, "bands": 20, "seconds": 2.5} for name in ("still_life", "color_checker")
    ]
    for cell in of["cells"]:
        cell["mc_share"] = 0.01 if cell["scene"] == "still_life" else 0.02
    of["cells"][0]["mc_share"] = 0.5
    found = [
        (row["scene"], row["seconds"].split()[0], row["share"].split()[0]) for row in render_rows(of, ordered_cells(of))
    ]
    assert found == [("still_life", "2.5", "50"), ("color_checker", "2.5", "2")]
