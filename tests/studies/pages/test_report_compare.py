"""What a report compares, and its verdicts: counted another way, by Student's test of pairs and by hand."""

from collections import Counter
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
import report_sample as SAMPLE
from scipy.stats import binom, ttest_rel

from studies.pages import report_text as text
from studies.pages.report_compare import (
    AHEAD,
    BEHIND,
    CAMERA,
    EXPOSURE,
    LEVEL,
    SENSOR,
    UNKNOWN,
    Comparison,
    best,
    counts,
    first_comparison,
    student_t,
    verdict,
    verdicts,
)
from studies.pages.report_data import ReportCell, ReportData
from studies.pages.report_sweep import over_seeds
from studies.sweep.row import Row

SEEDS = (0, 1, 2)


def noisy(**axes: object) -> ReportData:
    """A report of three seeds whose figures scatter, by a generator of their own for each row, as their leads do."""

    def moved(made: Row) -> Row:
        at = [ord(letter) for letter in f"{made.sensor}{made.level}{made.exposure}{made.processor}"]
        draw = np.random.default_rng([*at, made.seed]).standard_normal
        return replace(
            made, **{metric.key: 20 + draw() for metric in text.METRICS if getattr(made, metric.key) is not None}
        )

    return SAMPLE.sample_report(moved, **({"seeds": SEEDS} | axes))


def cell(values: list[float], key: str = "psnr_db") -> ReportCell:
    rows = [SAMPLE.sample_row(0, 0, "bayer", seed, **{key: value}) for seed, value in enumerate(values)]
    return over_seeds(rows, "s", 0, "bayer", (1.0, None))


def test_ahead_is_a_lead_whose_interval_is_clear_of_0() -> None:
    # Two seeds that differ by d in their leads: half the interval is 12.7062 d / 2 (Student, one degree of freedom).
    other = cell([20.0, 20.0])
    found = {gap: verdict(text.PSNR, cell([21.0 - gap / 2, 21.0 + gap / 2]), other) for gap in (0.157, 0.158)}
    assert found[0.157].half == pytest.approx(12.7062 * 0.157 / 2, abs=1e-5)
    assert [found[gap].outcome for gap in (0.157, 0.158)] == [AHEAD, LEVEL]
    assert [one.lead for one in found.values()] == pytest.approx([1.0, 1.0])


def test_a_metric_that_is_better_when_lower_leads_by_less() -> None:
    low, high = (cell([value, value + 0.01], "flip_mean") for value in (0.1, 0.3))
    assert verdict(text.FLIP, low, high).outcome == AHEAD
    assert verdict(text.FLIP, high, low).outcome == BEHIND
    assert verdict(text.FLIP, low, high).lead == pytest.approx(0.2)


def test_seeds_are_compared_as_pairs() -> None:
    """Chips scatter by 2 dB, but each seed's two pictures differ by 0.1: that is a lead."""
    chips = [18.0, 20.0, 22.0]
    near = verdict(text.PSNR, cell([chip + 0.1 + 0.001 * seed for seed, chip in enumerate(chips)]), cell(chips))
    assert near.outcome == AHEAD


def test_one_seed_and_unknown_figures_have_no_verdict() -> None:
    one = verdict(text.PSNR, cell([21.0]), cell([20.0]))
    assert (one.outcome, one.lead, one.half) == (UNKNOWN, 1.0, None)
    for values in ([21.0, float("inf")], [21.0, float("nan")]):
        assert verdict(text.PSNR, cell(values), cell([20.0, 20.0])).outcome == UNKNOWN
    assert student_t(1) is None


@pytest.mark.parametrize("metric", text.METRICS[:8], ids=lambda metric: metric.key)
def test_counts_are_those_of_students_test_of_pairs(metric: text.Metric) -> None:
    """From the rows themselves, by p-values: a lead counts where p is under 5 %."""
    report = noisy(exposures=("auto", "10ms"))
    rows = {}

    def kept(row: Row) -> Row:
        rows[row.sensor, row.exposure, row.level, row.processor, row.seed] = getattr(row, metric.key)
        return row

    for one in report.cells:
        for seed, value in enumerate(one.by_seed[metric.key]):
            assert one.first is not None
            kept(replace(one.first, seed=seed, **{metric.key: value}))
    expected: Counter[str] = Counter()
    for sensor, exposure, level in {key[:3] for key in rows}:
        ours, theirs = (
            [rows[sensor, exposure, level, name, seed] for seed in SEEDS] for name in ("interleaved", "bayer")
        )
        better = (np.mean(ours) > np.mean(theirs)) == metric.higher
        clear = ttest_rel(ours, theirs).pvalue < 0.05
        expected[(AHEAD if better else BEHIND) if clear else LEVEL] += 1
    found = counts(report, first_comparison(report), metric)
    assert found == {AHEAD: 0, LEVEL: 0, BEHIND: 0, UNKNOWN: 0} | expected
    assert sum(found.values()) == 2 * 2 * 7


def test_cameras_that_do_not_differ_are_ahead_or_behind_once_in_20() -> None:
    """1500 comparisons of pure noise: the count lies within what 5 % gives but for 1 run in 10 000."""
    draws = np.random.default_rng(1).standard_normal((1500, 2, 3))
    said = Counter(verdict(text.PSNR, cell(list(a)), cell(list(b))).outcome for a, b in draws)
    low, high = binom.ppf([0.5e-4, 1 - 0.5e-4], 1500, 0.05)
    assert low <= said[AHEAD] + said[BEHIND] <= high
    assert abs(said[AHEAD] - said[BEHIND]) < 4 * sqrt(75)


def test_the_same_method_on_both_mosaics_is_compared_first() -> None:
    report = noisy(cameras=("interleaved", "bayer", "ple_rgbw", "ple_bayer"))
    assert first_comparison(report) == Comparison(CAMERA, 4, SENSOR, 2, 3)
    assert first_comparison(noisy()) == Comparison(CAMERA, 4, SENSOR, 0, 1)


def test_sensors_are_compared_where_the_processor_is_one() -> None:
    report = noisy(cameras=("interleaved",), exposures=("auto", "10ms"))
    of = first_comparison(report)
    assert of == Comparison(SENSOR, 4, EXPOSURE, 0, 1)
    for row, exposure in enumerate(("auto", "10ms")):
        for level, found in enumerate(verdicts(report, of, text.PSNR, row)):
            two = [
                one
                for one in report.cells
                if one.first and (one.level, one.first.exposure) == (level, exposure)
            ]  # fmt: skip
            assert [one.first.sensor for one in two if one.first] == ["table1_output", "low_noise"]
            assert found == verdict(text.PSNR, *two)


def test_exposures_are_compared_where_nothing_else_varies() -> None:
    report = noisy(cameras=("bayer",), sensors=SAMPLE.SENSORS[:1], exposures=("auto", "10ms"), levels=1)
    assert first_comparison(report).compared == EXPOSURE
    alone = noisy(cameras=("bayer",), sensors=SAMPLE.SENSORS[:1], levels=1)
    assert (first_comparison(alone).a, first_comparison(alone).b) == (0, 0)


def test_best_is_ahead_of_every_other_camera() -> None:
    gaps = {"interleaved": 1.0, "bayer": 0.0, "ple_rgbw": 0.0}

    def led(row: Row) -> Row:
        return replace(row, psnr_db=20 + gaps[row.processor] + 0.01 * row.seed * (row.processor == "bayer"))

    report = SAMPLE.sample_report(led, cameras=tuple(gaps), seeds=SEEDS, levels=2)
    assert best(report, text.PSNR) == {0, 3, 6, 9}
    assert best(SAMPLE.sample_report(led, cameras=tuple(gaps), levels=2), text.PSNR) == set(), "one seed tells nothing"
    gaps["ple_rgbw"] = 1.0
    level = SAMPLE.sample_report(led, cameras=tuple(gaps), seeds=SEEDS, levels=2)
    assert best(level, text.PSNR) == set(), "ahead of one, level with the other"
