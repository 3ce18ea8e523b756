"""Leads of one camera over the others in a ledger: closed forms, who is ranked, and what is refused."""

import json
from dataclasses import fields
from math import sqrt
from typing import Any

import pytest
from sweep_sample import row

from rodcone.errors import InputError
from sensor.presets import preset
from studies.pages.duels import (
    AHEAD,
    BEHIND,
    LEVEL,
    METRICS,
    contests_of,
    duels,
    is_ranked,
    lead_over,
    no_worse,
    opponents_of,
    snr_db,
)
from studies.pages.report_text import DELTA_E, PSNR
from studies.sweep.row import Row

T_1 = 12.706205  # Student's t, two-sided 95 %, 1 degree of freedom
T_2 = 4.302653  # Student's t, two-sided 95 %, 2 degrees of freedom


def rows_of(figures: dict[str, list[float]], metric: str = "psnr_db", **values: Any) -> list[Row]:
    return [row(name, seed, **{metric: x}, **values) for name, line in figures.items() for seed, x in enumerate(line)]


@pytest.mark.parametrize(
    ("ours", "theirs", "outcome"),
    [([20, 21, 22], [18, 19, 20.1], AHEAD), ([18, 19, 20.1], [20, 21, 22], BEHIND), ([1, 2, 3], [0, 0, 0], LEVEL)],
)
def test_a_lead_is_clear_where_its_whole_interval_is_on_one_side_of_0(
    ours: list[float], theirs: list[float], outcome: str
) -> None:
    (duel,) = duels(contests_of(rows_of({"a": ours, "b": theirs})), "a", "b", PSNR)
    assert duel.outcome == outcome
    assert duel.lead.mean == pytest.approx(sum(x - y for x, y in zip(ours, theirs, strict=True)) / 3)
    if outcome == LEVEL:  # 1, 2 and 3: a deviation of 1
        assert duel.lead.high - duel.lead.mean == pytest.approx(T_2 / sqrt(3), rel=1e-5)


def test_no_worse_is_an_interval_above_minus_the_margin_beside_every_opponent() -> None:
    def rows(least: float) -> list[Row]:  # leads of 0 and 2 m, so that the interval's low end is m - t m
        m = least / (1 - T_1)
        return rows_of({"a": [30.0, 30.0 + 2 * m], "b": [30.0, 30.0], "c": [0.0, 0.0]})

    for least, count in ((-0.099, 1), (-0.101, 0)):
        contests = contests_of(rows(least))
        assert no_worse(contests, "a", ["b"], PSNR) == count
        assert no_worse(contests, "a", ["c"], PSNR) == 1
        assert no_worse(contests, "a", ["c", "b"], PSNR) == count


def test_seeds_are_paired_by_their_number_not_by_their_place() -> None:
    rows = rows_of({"a": [10.0, 30.0]}) + rows_of({"b": [9.0, 29.0]})[::-1]
    lead = lead_over(contests_of(rows)[0], "a", "b", PSNR)
    assert (lead.low, lead.high) == (1.0, 1.0)


def test_of_a_colour_difference_less_is_better() -> None:
    contest = contests_of(rows_of({"a": [2.0, 2.0], "b": [5.0, 5.0]}, "delta_e_median"))[0]
    assert lead_over(contest, "a", "b", DELTA_E).mean == 3.0


def test_every_metric_is_a_column_of_the_ledger() -> None:
    assert {metric.key for metric in METRICS} <= {field.name for field in fields(Row)}


def test_conditions_come_group_by_group_from_dark_to_bright() -> None:
    rows = [
        one
        for sensor in ("z", "a")
        for level, light in (("25cd/m2", 25.0), ("100lux", 5.7), ("3cd/m2", 3.0))
        for one in rows_of({"a": [1.0, 1.0], "b": [0.0, 0.0]}, sensor=sensor, level=level, luminance_cd_m2=light)
    ]
    found = [(contest.group.sensor, contest.level) for contest in contests_of(rows)]
    assert found == [(sensor, level) for sensor in "za" for level in ("3cd/m2", "100lux", "25cd/m2")]


@pytest.mark.parametrize(("share", "ranked"), [(0.99, False), (1.01, True)])
def test_a_camera_is_ranked_where_ws_snr_is_1_or_more(share: float, ranked: bool) -> None:
    sensor = preset("table1_output")
    dark2 = sensor.pixel.read_noise_e**2 + sensor.pixel.fixed_dark_e**2 + sensor.gain_e_per_dn**2 / 12
    one = (1 + sqrt(1 + 4 * dark2)) / 2  # electrons x of an SNR of 1: x = sqrt(x + dark^2)
    values = {"sensor": "table1_output", "mean_electrons": json.dumps({"W": one * share, "G": 1.0})}
    contest = contests_of(rows_of({"interleaved": [1, 1], "bayer": [0, 0]}, **values))[0]
    assert is_ranked(contest, "interleaved") is ranked
    assert abs(snr_db(contest, "interleaved", "W")) < 0.2
    assert len(duels([contest], "interleaved", "bayer", PSNR)) == ranked


def test_a_camera_without_w_or_of_unknown_noise_is_ranked() -> None:
    dark = {"mean_electrons": json.dumps({"W": 1e-6, "G": 1e-6})}
    for values in ({"sensor": "table1_output"}, dark):
        contest = contests_of(rows_of({"bayer": [1, 1], "bayer_nlm": [0, 0]}, **values))[0]
        assert is_ranked(contest, "bayer")


def test_what_no_interval_or_comparison_can_be_made_of_is_refused() -> None:
    whole = rows_of({"a": [1.0, 1.0], "b": [0.0, 0.0]})
    with pytest.raises(InputError, match=r"cells: b on desk at 1cd/m2 lacks seeds"):
        contests_of(whole[:-1])
    with pytest.raises(InputError, match=r"seeds: \[0\] is not allowed; give two or more"):
        contests_of([one for one in whole if one.seed == 0])
    with pytest.raises(InputError, match=r"camera: 'c' is unknown; allowed: a, b"):
        opponents_of(contests_of(whole), "c")
    with pytest.raises(InputError, match="give the camera and an opponent"):
        opponents_of(contests_of(whole[:2]), "a")
    with pytest.raises(InputError, match="seeds: "):
        contests_of([])
