"""The report's parts: numbers as text, sentences, and the charts' geometry."""

import pytest

from studies.pages import report_text as text
from studies.pages.charts import ChartLine, Scale, band_path, line_chart, linear_ticks, spread
from studies.pages.report_data import ReportCell


def cell(
    camera: str, interval: tuple[float, float] | None = None, key: str = "psnr_db", **figures: float
) -> ReportCell:
    """A cell of which nothing else is known."""
    known = {"psnr_db": interval} if interval else {}
    return ReportCell("s", 0, camera, None, None, None, figures, known, None, {}, None)


def test_leads_are_judged_on_printed_numbers() -> None:
    near = [cell("a", psnr_db=20.01), cell("b", psnr_db=20.04)]
    assert text.leader(text.PSNR, near) == (None, 0.0)
    apart = [cell("a", delta_e_median=3.0), cell("b", delta_e_median=2.0)]
    assert text.leader(text.DELTA_E, apart) == (apart[1], 1.0)


def test_no_camera_leads_where_intervals_overlap() -> None:
    ahead = cell("a", (20.4, 21.6), psnr_db=21.0)
    near, apart = cell("b", (19.5, 20.5), psnr_db=20.0), cell("b", (19.7, 20.3), psnr_db=20.0)
    assert text.leader(text.PSNR, [near, ahead]) == (None, 0.0)
    assert text.leader(text.PSNR, [apart, ahead]) == (ahead, 1.0)
    assert text.metric_text(text.PSNR, apart).replace("\N{NO-BREAK SPACE}", " ") == "20.0 ± 0.3 dB"


def test_substitution_of_some_seeds_is_told_apart() -> None:
    assert [text.substitution_text(share) for share in (None, True, 0.25, 0.0)] == [
        "not applicable",
        "on",
        "on for 25\N{NO-BREAK SPACE}% of the seeds",
        "off",
    ]


@pytest.mark.parametrize(("level", "words"), [("0.036cd/m2", "0.036 cd/m²"), ("500lux", "500 lux")])
def test_levels_are_written_as_prose_does(level: str, words: str) -> None:
    assert text.level_text(level).replace("\N{NO-BREAK SPACE}", " ") == words


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (0.036, "0.036"),
        (0.0999, "0.0999"),
        (80, "80"),
        (1234.0, "1 230"),
        (99.96, "100"),
        (0, "0"),
        (None, "—"),
        (-2, "−2"),
    ],
)
def test_significant_digits(value: float | None, written: str) -> None:
    assert text.significant(value).replace("\N{NARROW NO-BREAK SPACE}", " ") == written


def test_times_choose_their_unit() -> None:
    said = [text.duration(seconds).replace("\N{NO-BREAK SPACE}", " ") for seconds in (0.066, 0.00012, 41.23, 0.0)]
    assert said == ["66 ms", "0.12 ms", "41.2 s", "0 s"]


def test_chart_keeps_order_scale_and_gaps() -> None:
    line = ChartLine("a", [3.0, None, 1.0, 2.0], ["", "", "", ""])
    chart = line_chart("t", "d", [1000.0, 100.0, 1.0, 10.0], [line])
    points = chart.series[0].points
    assert [point.x for point in points] == sorted(point.x for point in points)
    # Decades lie at equal distances, and larger values higher up.
    ticks = {tick.text: tick.at for tick in chart.x_ticks}
    assert ticks["10"] - ticks["1"] == pytest.approx(ticks["100"] - ticks["10"], abs=0.02)
    assert points[0].y > points[1].y > points[2].y
    assert chart.series[0].path.count("M") == 2, "the gap is not bridged"
    assert all(chart.top <= point.y <= chart.bottom for point in points)


def test_band_outlines_each_run_of_intervals() -> None:
    scale = Scale(0.0, 10.0, 100.0, 0.0)
    assert band_path([1, 2, 3, 4], [(1, 2), (3, 5), None, (4, 6)], scale) == "M1 80L2 50L2 70L1 90Z M4 40L4 60Z"
    chart = line_chart("t", "d", [1.0, 10.0], [ChartLine("a", [5.0, 5.0], ["", ""], [(-3.0, 13.0), (4.0, 6.0)])])
    ticks = [float(tick.text.replace("\N{MINUS SIGN}", "-")) for tick in chart.y_ticks]
    assert ticks[0] <= -3.0 <= 13.0 <= ticks[-1], "the axis holds the band"
    assert chart.series[0].band.startswith("M")


def test_ticks_enclose_the_values() -> None:
    for low, high in ((7.0, 34.6), (0.18, 0.74), (5.0, 5.0), (-3.0, 2.0), (0.0, 0.0)):
        ticks = linear_ticks(low, high)
        assert ticks[0] <= low <= high <= ticks[-1]
        assert 2 <= len(ticks) <= 8


def test_labels_keep_their_distance() -> None:
    placed = spread([100.0, 101.0, 199.0], 15, 0, 200)
    assert placed == [100.0, 115.0, 199.0]
    assert spread([199.0, 200.0], 15, 0, 200) == [185.0, 200.0]


def test_an_exposure_is_named_with_a_white_balance_that_isnt_gray_worlds() -> None:
    ways = [text.way_name(*way) for way in (("auto", "gray-world"), ("auto:W", "gray-world"), ("2ms", "as-shot"))]
    assert text.group_names(["s"], ways) == [
        "s, exposure automatic",
        "s, exposure automatic for W",
        "s, exposure 2\N{NO-BREAK SPACE}ms, white balance as-shot",
    ]
