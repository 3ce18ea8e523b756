"""Verdicts by hand, by Student's test of pairs from the rows, by chance; equal light; a lead's worth in light."""

from collections import Counter
from dataclasses import replace
from itertools import combinations
from math import exp, log, sqrt

import numpy as np
import pytest
import report_sample as SAMPLE
from scipy.stats import ttest_rel

from studies.metrics import metric as figures
from studies.pages.report_compare import (
    BRIGHTNESS,
    CAMERA,
    EXPOSURE,
    SCENE,
    SENSOR,
    Comparison,
    comparisons,
    first_comparison,
    groups_of,
    means_over_scenes,
)
from studies.pages.report_data import ReportData, ReportScene
from studies.pages.verdict import AHEAD, BEHIND, LEVEL, UNKNOWN, counts, leads, light_ratio, same_light
from studies.sweep.row import Row

SEEDS = (0, 1, 2)
# Which way each figure is better, and what is seen of it, said once more by hand.
LOWER = {"delta_e_median", "delta_e_p95", "s_cielab_median", "s_cielab_p95", "flip_mean", "chart_delta_e_mean"}
SEEN = {
    "psnr_db": 0.5, "ssim": 0.02, "delta_e_median": 1, "delta_e_p95": 1, "s_cielab_median": 1, "s_cielab_p95": 1,
    "flip_mean": 0.02, "pu21_psnr_db": 0.5, "mtf50_cy_per_px": 0.02, "chart_delta_e_mean": 1, "patch_snr_db": 0.5,
}  # fmt: skip


def noisy(**axes: object) -> ReportData:
    """A report of three seeds whose figures scatter, by a generator of their own for each row, as their leads do."""

    def moved(made: Row) -> Row:
        at = [ord(letter) for letter in f"{made.scene}{made.sensor}{made.level}{made.exposure}{made.processor}"]
        draw = np.random.default_rng([*at, made.seed]).standard_normal
        size = np.random.default_rng(at).choice([0.03, 1.0])  # leads clear of 0, and others that aren't
        offset = np.random.default_rng(at).standard_normal()
        known = {key: 20 + SEEN[key] * (offset + size * draw()) for key in SEEN if getattr(made, key) is not None}
        return replace(made, **known)

    return SAMPLE.sample_report(moved, **({"seeds": SEEDS} | axes))


def recount(ours: list[float], theirs: list[float], key: str) -> str:
    """Outcome from p-values and means, with the direction by hand."""
    gain = (np.mean(theirs) - np.mean(ours)) if key in LOWER else (np.mean(ours) - np.mean(theirs))
    clear = ttest_rel(ours, theirs).pvalue < 0.05
    if clear:
        return LEVEL if abs(gain) < SEEN[key] else AHEAD if gain > 0 else BEHIND
    interval = ttest_rel(ours, theirs).confidence_interval(0.95)
    return LEVEL if max(abs(interval.low), abs(interval.high)) < SEEN[key] else UNKNOWN


@pytest.mark.parametrize("metric", figures.METRICS, ids=lambda metric: metric.key)
def test_direction_and_size_are_those_said_by_hand(metric: figures.Metric) -> None:
    assert metric.threshold == SEEN[metric.key]
    better, worse = (
        np.full(3, 10.0 + 1.1 * sign * SEEN[metric.key] * (-1 if metric.key in LOWER else 1)) for sign in (1, 0)
    )
    found = leads(metric, better, worse), leads(metric, worse, better)
    assert [str(one.outcome) for one in found] == [AHEAD, BEHIND]
    assert [float(one.mean) for one in found] == pytest.approx([1.1 * SEEN[metric.key], -1.1 * SEEN[metric.key]])


@pytest.mark.parametrize(
    ("ours", "outcome", "half"),
    [
        # Two seeds that differ by d: half the interval is 12.7062 d / 2 (Student, one degree of freedom).
        ([20.9215, 21.0785], AHEAD, 12.7062 * 0.157 / 2),  # 1 - 0.997
        ([20.921, 21.079], UNKNOWN, 12.7062 * 0.158 / 2),  # 1 - 1.004
        ([20.4, 20.4], LEVEL, 0.0),  # clear, and less than is seen
        ([20.01, 20.03], LEVEL, 12.7062 * 0.02 / 2),  # the whole interval is less than is seen
        ([21.0, float("nan")], UNKNOWN, float("nan")),
        ([21.0], UNKNOWN, float("nan")),
    ],
)
def test_a_verdict_takes_the_interval_and_a_size_that_is_seen(ours: list[float], outcome: str, half: float) -> None:
    found = leads(figures.PSNR, np.array(ours), np.full(len(ours), 20.0))
    assert str(found.outcome) == outcome
    assert float(found.half) == pytest.approx(half, abs=1e-4, nan_ok=True)
    levels = leads(figures.PSNR, np.array([ours, ours]), np.full((2, len(ours)), 20.0))
    assert (levels.outcome.tolist(), levels.half.shape) == ([outcome] * 2, (2,))


def test_every_verdict_of_the_page_is_recounted_from_the_rows() -> None:
    """Of each two values of each axis, in each place: outcomes by p-values, leads by hand."""
    report = noisy(exposures=("auto", "10ms"), levels=3)
    lengths = [1, 1, 2, 2, 1, 3, 2]
    places = np.array(report.cells, dtype=object).reshape(lengths)
    found, outcomes = comparisons(report), Counter[str]()
    for axis, length in enumerate(lengths):
        sides = np.moveaxis(places, axis, 0).reshape(length, -1)
        assert list(found[axis]["leads"]) == [f"{i} {j}" for i, j in combinations(range(length), 2)]
        for i, j in combinations(range(length), 2):
            for key, (letters, means, _) in found[axis]["leads"][f"{i} {j}"].items():
                for place, (a, b) in enumerate(zip(sides[i], sides[j], strict=True)):
                    values = a.samples(key).tolist(), b.samples(key).tolist()
                    wanted = recount(*values, key)
                    outcomes[wanted] += 1
                    assert letters[place] == wanted[0]
                    gain = (np.mean(values[0]) - np.mean(values[1])) * (-1 if key in LOWER else 1)
                    assert means[place] == pytest.approx(gain, rel=1e-5, abs=1e-6)
    assert min(outcomes[outcome] for outcome in (AHEAD, LEVEL, BEHIND, UNKNOWN)) > 30


def test_levels_that_give_one_picture_count_once_by_the_mean_of_their_leads() -> None:
    base = {metric.key: np.full((5, 2), 10.0) for metric in figures.METRICS}
    theirs = base | {"psnr_db": np.array([[10.0], [20.0], [29.5], [29.6], [29.9]]) + np.zeros(2)}
    gains = np.array([[1.0], [0.1], [-0.7], [-0.6], [-0.8]])
    ours = theirs | {"psnr_db": theirs["psnr_db"] + gains}
    assert same_light(theirs, theirs) == same_light(ours, theirs) == [[0], [1], [2, 3, 4]]
    assert counts(ours, theirs)["psnr_db"] == {AHEAD: 1, LEVEL: 1, BEHIND: 1, UNKNOWN: 0}
    # steps of 0.4 dB, each unseen, don't make one picture of 0.8 dB; one camera's change parts them too
    steps = {**base, "psnr_db": np.array([[0.0], [0.4], [0.8], [1.2], [1.6]]) + np.zeros(2)}
    assert same_light(steps, base) == same_light(base, steps) == [[0, 1], [2, 3], [4]]
    unknown = base | {"ssim": np.full((5, 2), np.nan)}
    assert same_light(unknown, unknown) == [[0], [1], [2], [3], [4]]


def test_a_lead_is_worth_the_light_that_the_other_needs() -> None:
    """Shot noise: 10 dB a decade. A lead of g dB is worth 10 ** (g / 10) times the light."""
    light = [0.1, 1.0, 10.0, 100.0]
    worse = np.array([[0.0], [10.0], [20.0], [20.3]]) + np.zeros(2)
    gains = np.array([2.0, 2.2])
    found = light_ratio(light, worse + gains, worse)
    for mean, low, high in found[:2]:
        assert mean == pytest.approx(exp((gains / 10 * log(10)).mean()))
        assert high / mean == pytest.approx(exp(12.7062 * 0.02 / 2 * log(10)), rel=1e-4)
        assert low * high == pytest.approx(mean**2)
    # at 10 cd/m2 no level gives 22 dB; from there on light no longer improves the picture
    assert np.isnan(found[2:]).all()
    assert np.isnan(light_ratio(light, worse[:, :1] + 2, worse[:, :1])).all(), "one seed has no interval"
    assert light_ratio(light, worse, worse)[0].tolist() == [1.0, 1.0, 1.0]
    assert np.isnan(light_ratio(light, worse + np.array([0.1, 0.12]), worse)[2]).all(), "0.3 dB in a decade are unseen"


def test_of_several_places_of_a_value_the_nearest_to_the_level_counts() -> None:
    """The curve passes 15 dB at 10^0.5 and, after a loss, at 10^2.5 cd/m2; the level is 100: a factor of 10^0.5."""
    worse = np.array([[10.0], [20.0], [10.0], [20.0]]) + np.zeros(2)
    better = np.array([[10.0], [20.0], [15.0], [20.0]]) + np.zeros(2)
    assert light_ratio([1.0, 10.0, 100.0, 1000.0], better, worse)[2] == pytest.approx([10**0.5] * 3)


def test_the_same_method_on_both_mosaics_is_compared_first_else_what_varies() -> None:
    four = noisy(cameras=("interleaved", "bayer", "ple_rgbw", "ple_bayer"), levels=1)
    assert (first_comparison(four).compared, first_comparison(four).a, first_comparison(four).b) == (CAMERA, 2, 3)
    assert first_comparison(noisy()) == Comparison(CAMERA, BRIGHTNESS, SENSOR, 0, 1)
    three = noisy(cameras=("interleaved", "bayer", "ple_bayer"), levels=1)
    assert (first_comparison(three).a, first_comparison(three).b) == (0, 1)
    sensors = noisy(cameras=("interleaved",), exposures=("auto", "10ms"))
    assert first_comparison(sensors) == Comparison(SENSOR, BRIGHTNESS, EXPOSURE, 0, 1)
    times = noisy(cameras=("bayer",), sensors=SAMPLE.SENSORS[:1], exposures=("auto", "10ms"), levels=1)
    assert first_comparison(times).compared == EXPOSURE
    alone = first_comparison(noisy(cameras=("bayer",), sensors=SAMPLE.SENSORS[:1], levels=1))
    assert alone == Comparison(CAMERA, BRIGHTNESS, SENSOR, 0, 0)
    over_light = noisy(cameras=("bayer",), sensors=SAMPLE.SENSORS[:1], scenes=tuple(ReportScene(n, 8, 8) for n in "ab"))
    assert first_comparison(over_light) == Comparison(CAMERA, BRIGHTNESS, SCENE, 0, 0), "scenes and light compete not"


def test_means_over_scenes_are_of_named_and_of_drawn_ones_and_paired_by_seed() -> None:
    names = "desk", "street", "generated-1", "generated-2"
    kinds = ("named", names[:2]), ("drawn", names[2:])
    report = noisy(scenes=tuple(ReportScene(name, 8, 8) for name in names), levels=2)
    means = means_over_scenes(report, groups_of(report, CAMERA, 0, 1))
    parts = [(words, scenes, one.name) for words, scenes in kinds for one in SAMPLE.SENSORS]
    assert [mean.title for mean in means] == [f"mean of 2 {words} scenes, {sensor}" for words, _, sensor in parts]
    for mean, (_, scenes, sensor) in zip(means, parts, strict=True):
        for level in range(2):
            rows = {
                (cell.first.scene, cell.camera): cell.samples("flip_mean")
                for cell in report.cells
                if cell.first and (cell.first.sensor, cell.level) == (sensor, level) and cell.first.scene in scenes
            }
            gains = [
                np.mean([rows[scene, "bayer"][seed] - rows[scene, "interleaved"][seed] for scene in scenes])
                for seed in SEEDS
            ]
            lead = mean.pair.leads["flip_mean"]
            assert lead.mean[level] == pytest.approx(np.mean(gains))
            assert lead.half[level] == pytest.approx(4.30265 * np.std(gains, ddof=1) / sqrt(3), rel=1e-5)
