"""The page's answer in words, on tables made by hand: won, lost, mixed, level, one seed, one level, two sensors."""

from dataclasses import replace

import numpy as np
import pytest
import report_sample as SAMPLE

from studies.metrics.metric import METRICS
from studies.pages.headline import Pair, answer, in_light
from studies.pages.report_compare import CAMERA, SENSOR, code, comparison_markdown, comparisons
from studies.pages.report_data import ReportData
from studies.sweep.row import Row

LEVELS, LIGHT = ("moonlight", "street", "office", "day"), (0.1, 1.0, 10.0, 100.0)
SEEDS = (0, 1, 2)
PSNR_DB = np.array([10.0, 20.0, 30.0, 30.1])  # of B


def pair(seeds: int = 3, levels: int = 4, scatter: float = 0.001, **gains: list[float]) -> Pair:
    """A pair whose first differs in the figures named, level by level, as the figures themselves do."""
    draw = np.random.default_rng(5).standard_normal((levels, seeds))
    draw = (draw - draw.mean(axis=1, keepdims=True)) / (draw.std(axis=1, keepdims=True) if seeds > 1 else 1)
    theirs = {metric.key: np.full((levels, seeds), np.nan) for metric in METRICS}
    theirs |= {key: np.full((levels, seeds), 0.5) for key in ("ssim", "flip_mean")}
    theirs |= {"psnr_db": PSNR_DB[:levels, None] + np.zeros(seeds), "delta_e_median": np.full((levels, seeds), 5.0)}
    theirs["delta_e_p95"] = np.full((levels, seeds), 15.0)
    ours = {
        key: values + np.array(gains.get(key, [0.0] * levels))[:, None] + scatter * draw * (key == "psnr_db")
        for key, values in theirs.items()
    }
    return Pair(("A", "B"), ours, theirs, LEVELS[:levels], LIGHT[:levels])


CASES = {
    "all won": (pair(psnr_db=[3, 3, 3, 3]), "At every level: clearly better (PSNR +3.0 dB)."),
    "all lost": (pair(psnr_db=[-3, -3, -3, -3]), "At every level: clearly worse (PSNR −3.0 dB)."),
    "level": (pair(psnr_db=[-0.1, 0, 0.1, 0.2]), "At every level: no visible difference (PSNR −0.1 to +0.2 dB)."),
    "fading": (
        pair(psnr_db=[1.5, 0.6, -0.1, -0.1]),
        "Moonlight: clearly better (PSNR +1.5 dB). Street: a little better (PSNR +0.6 dB). "
        "From office on: no visible difference (PSNR −0.1 dB).",
    ),
    "a loss in another metric is said": (
        pair(psnr_db=[1.5, 1.5, 0, 0], flip_mean=[0.05, 0.06, 0.05, 0]),
        "Moonlight to street: better in part (PSNR +1.5 dB), worse in part (FLIP higher by 0.050 to 0.060). "
        "Office: clearly worse (FLIP higher by 0.050). Day: no visible difference (PSNR 0.0 dB).",
    ),
    "errors that fall are gains": (
        pair(delta_e_median=[-1.5] * 4, flip_mean=[-0.03] * 4),
        "At every level: a little better (ΔE2000 median lower by 1.5, FLIP lower by 0.030).",
    ),
    "a metric that no chart shows at first makes no verdict": (
        pair(psnr_db=[0.1] * 4, delta_e_p95=[4] * 4, s_cielab_p95=[5] * 4),
        "At every level: no visible difference (PSNR +0.1 dB).",
    ),
    "a metric that is gained or lost at some of a run's levels is said of these": (
        pair(psnr_db=[0.8] * 4, flip_mean=[-0.03, -0.025, -0.001, 0]),
        "At every level: a little better (PSNR +0.8 dB, FLIP lower by 0.025 to 0.030).",
    ),
    "clearly by one of two": (
        pair(psnr_db=[1.5] * 4, flip_mean=[-0.025] * 4),
        "At every level: clearly better (PSNR +1.5 dB, FLIP lower by 0.025).",
    ),
    "undecided": (pair(scatter=1.0), "At every level: these seeds can't tell (PSNR 0.0 dB)."),
    "one seed": (pair(1, psnr_db=[2, 0, 0, 0]), "One seed can't tell a difference from chance (PSNR 0.0 to +2.0 dB)."),
    "one level": (pair(levels=1, psnr_db=[-0.7]), "A little worse (PSNR −0.7 dB)."),
}  # fmt: skip


def test_the_answer_is_in_words_with_sizes() -> None:
    for made, words in CASES.values():
        assert answer(made).replace("\N{NO-BREAK SPACE}", " ") == words, (made, words)


def test_in_light_the_better_one_needs_less() -> None:
    """10 dB a decade: 3 dB are a factor of 2.0."""
    words = in_light(pair(psnr_db=[3, 0, 0, 0], scatter=0.01))
    alike = "From street on: nobody sees a difference in it."
    assert words == f"For the same PSNR A needs half the light at moonlight. {alike}"
    # a deviation of 0.5 sqrt(3/2) dB: half the interval is 4.303 x 0.612 / sqrt(3) = 1.52 dB, a factor of 1.42
    assert "half the light (0.35 to 0.71) at moonlight" in in_light(pair(psnr_db=[3, 3, 0, 0], scatter=0.5))
    # half within a twentieth, said in a word; further off, as a number
    assert "half the light (0.35 to 0.7" in in_light(pair(psnr_db=[3.1, 3.1, 0, 0], scatter=0.5))
    assert "0.45 times the light (" in in_light(pair(psnr_db=[3.5, 3.5, 0, 0], scatter=0.5))
    # A's curve is 5, 15, 30: it has 10 dB after half a decade, and 20 after a third
    lost = in_light(pair(psnr_db=[-5, -5, 0, 0], scatter=0.001))
    assert lost == (
        "For the same PSNR B needs 0.32 times the light at moonlight, 0.46 times the light at street. "
        "From office on: nobody sees a difference in it."
    )
    turned = in_light(pair(psnr_db=[3, 0, -2, 0], scatter=0.01))
    assert turned.startswith("For the same PSNR A needs half the light at moonlight. For the same PSNR B needs ")
    assert turned.endswith("Street, day: nobody sees a difference in it.")
    unknown = replace(pair(psnr_db=[3, 0, 0, 0]), light_cd_m2=(0.1, None, 1.0, 2.0))
    for silent in (pair(1, psnr_db=[3, 0, 0, 0]), pair(levels=1), pair(psnr_db=[0.4, 0, 0, 0]), unknown):
        assert in_light(silent) == ""


def led(row: Row) -> Row:
    """In the first sensor's dark RGBW gains 2 dB, in the second's light it loses 1, and Bayer is exposed for longer."""
    gain = {("table1_output", "moonlight"): 2.0, ("low_noise", "street light"): -1.0}.get((row.sensor, row.level), 0.0)
    return replace(
        row,
        psnr_db=20.0 + gain * (row.processor == "ple_rgbw"),
        **dict.fromkeys(("ssim", "flip_mean"), 0.5),
        **dict.fromkeys(("delta_e_median", "delta_e_p95", "s_cielab_median", "s_cielab_p95"), 5.0),
        pu21_psnr_db=40.0,
        exposure_s=0.02
        if (row.sensor, row.processor, row.level) == ("low_noise", "ple_bayer", "street light")
        else 0.01 * (1.005 if row.processor == "ple_bayer" else 1),  # half a per cent is no other time
    )


def two_sensors(**axes: object) -> ReportData:
    return SAMPLE.sample_report(led, levels=2, seeds=SEEDS, cameras=("ple_rgbw", "ple_bayer"), **axes)


def test_every_place_has_its_answer_and_a_loss_elsewhere_is_told() -> None:
    report = two_sensors()
    found = comparisons(report)[CAMERA]
    first, second = (one | {"said": one["said"].replace("\N{NO-BREAK SPACE}", " ")} for one in found["answers"]["0 1"])
    assert (
        first["said"] == "Moonlight: clearly better (PSNR +2.0 dB). Street light: no visible difference (PSNR 0.0 dB)."
    )
    assert (
        second["said"] == "Moonlight: no visible difference (PSNR 0.0 dB). Street light: clearly worse (PSNR −1.0 dB)."
    )
    assert found["counts"]["0 1"]["psnr_db"] == [1, 2, 1]


def test_the_best_bayer_of_each_level_is_named_with_the_lead_over_it() -> None:
    figures = {"ple_rgbw": (20.0, 30.0, 30.0), "ple_bayer": (19.0, 30.5, 30.0), "mine.whl:net": (18.0, 31.0, 31.5)}

    def change(made: Row) -> Row:
        level = [name for name, *_ in SAMPLE.LEVELS].index(made.level)
        return replace(made, psnr_db=figures[made.processor][level])

    def times(*cameras: str) -> str:
        report = SAMPLE.sample_report(change, levels=3, sensors=SAMPLE.SENSORS[:1], cameras=cameras)
        (answer,) = comparisons(report)[CAMERA]["answers"][f"{cameras.index('ple_rgbw')} {cameras.index('ple_bayer')}"]
        return str(answer["times"]).replace("\N{NO-BREAK SPACE}", " ")

    assert times("mine.whl:net", "ple_bayer", "ple_rgbw").endswith(
        "Beside the best Bayer: Bayer (PLE) moonlight (PSNR +1.0 dB); "
        "mine (net) from street light on (PSNR −1.5 to −1.0 dB)."
    )
    assert "best Bayer" not in times("ple_bayer", "ple_rgbw")


def test_by_the_mosaic_alone_is_said_only_where_the_times_agree() -> None:
    first, second = (one["times"] for one in comparisons(two_sensors())[CAMERA]["answers"]["0 1"])
    assert first.endswith("and the same exposure times: they differ by the mosaic alone.")
    assert "mosaic alone" not in second
    assert second.replace("\N{NO-BREAK SPACE}", " ").endswith(
        "Exposure times differ: street light 10 ms against 20 ms."
    )
    others = SAMPLE.sample_report(levels=1, seeds=SEEDS, cameras=("interleaved", "bayer"))
    assert comparisons(others)[CAMERA]["answers"]["0 1"][0]["times"] == ""


MISS = "Gray World misses this scene's light by ΔE"


@pytest.mark.parametrize(
    ("misses", "lead", "words"),
    [
        (
            (4.1, 3.9),
            0.4,
            f"{MISS} 4.1 (Bayer (bilinear), moonlight); the lead is 0.4. It misses by more than the lead at 2",
        ),
        ((0.1, 3.0), -2.9, f"{MISS} 3.0 (Bayer (PLE), moonlight)"),
        ((4.1, 3.9), 4.2, ""),
        ((4.1, 3.9), -4.2, ""),
        ((0.9, 0.9), 0.0, ""),  # nobody sees it
        ((None, None), 0.0, ""),  # a processor that tells no balance
    ],
)
def test_a_balance_that_misses_the_light_by_more_than_the_lead_is_told(misses, lead, words) -> None:
    of = dict(zip(("bayer", "ple_bayer"), misses, strict=True))

    def balanced(row: Row) -> Row:
        better = lead * (row.processor == "bayer")
        return replace(row, delta_e_median=9.0 - better, balance_delta_e=of[row.processor])

    def said(balance: str) -> str:
        report = SAMPLE.sample_report(
            balanced, levels=2, seeds=SEEDS, cameras=tuple(of), sensors=SAMPLE.SENSORS[:1], balances=(balance,)
        )
        return str(comparisons(report)[CAMERA]["answers"]["0 1"][0]["balance"])

    assert said("gray-world").startswith(words)
    assert bool(said("gray-world")) == bool(words)
    assert said("as-shot") == "", "as shot knows the light"


def test_only_levels_whose_lead_is_less_than_the_miss_are_counted() -> None:
    def balanced(row: Row) -> Row:
        better = (4.5 if row.level == "moonlight" else 0.4) * (row.processor == "bayer")
        return replace(row, delta_e_median=9.0 - better, balance_delta_e=4.0)

    report = SAMPLE.sample_report(
        balanced, levels=2, seeds=SEEDS, cameras=("bayer", "ple_bayer"), sensors=SAMPLE.SENSORS[:1],
        balances=("gray-world",),
    )  # fmt: skip
    said = comparisons(report)[CAMERA]["answers"]["0 1"][0]["balance"]
    assert said.endswith("the lead is 0.4. It misses by more than the lead at 1 of 2 light levels.")


def test_a_missed_balance_is_told_where_sensors_are_compared() -> None:
    missed = SAMPLE.sample_report(
        lambda row: replace(row, delta_e_median=9.0, balance_delta_e=4.0),
        levels=2, seeds=SEEDS, cameras=("bayer",), balances=("gray-world",),
    )  # fmt: skip
    assert comparisons(missed)[SENSOR]["answers"]["0 1"][0]["balance"].startswith(MISS)


def test_the_papers_reference_is_named_where_it_is_bilinear_and_gray_world() -> None:
    both = SAMPLE.sample_report(levels=1, seeds=SEEDS, balances=("as-shot", "gray-world"), sensors=SAMPLE.SENSORS[:1])
    found = [one["times"] for one in comparisons(both)[CAMERA]["answers"]["0 1"]]
    assert found == ["", "Bayer (bilinear) with Gray World is the paper's reference."]


def test_sensors_are_answered_too_and_conditions_are_not() -> None:
    found = comparisons(two_sensors())
    said = found[SENSOR]["answers"]["0 1"][0]["said"].replace("\N{NO-BREAK SPACE}", " ")
    assert said == "At every level: clearly better (PSNR +1.0 to +2.0 dB)."
    assert [bool(one["answers"]) for one in found] == [False, False, True, False, False, False, True]


# The Markdown page: every lead, interval, mark and count again from the rows.


# By level, what Bayer's figures are more than the first camera's, and what its PSNR scatters by over three seeds.
MORE = {
    "moonlight": {"psnr_db": 2.0, "flip_mean": -0.05},
    "street light": {"psnr_db": -1.0, "flip_mean": 0.03},
    "living room": {"psnr_db": 0.1, "flip_mean": 0.001},
    "paper's figure 6": {"psnr_db": 9.0},
}
SCATTER_DB = {"paper's figure 6": 6.0}


def compared(row: Row) -> Row:
    """Figures that differ by hand, from level to level too, so that each is a light of its own."""
    level = [name for name, *_ in SAMPLE.LEVELS].index(row.level)
    figures = {"psnr_db": 20.0 + 3 * level, "flip_mean": 0.5, "ssim": 0.5, "delta_e_median": 5.0}
    if row.processor == "bayer":
        figures = {key: value + MORE[row.level].get(key, 0.0) for key, value in figures.items()}
        figures["psnr_db"] += SCATTER_DB.get(row.level, 0.1) * (row.seed - 1)
    return replace(row, **figures)


def table_of(page: str, metric: str) -> list[list[str]]:
    """Rows of a metric's table, head first."""
    (part,) = [part for part in page.split("\n\n") if part.startswith(f"| {metric}")]
    lines = [line.strip("| ").split(" | ") for line in part.splitlines()]
    return [lines[0], *lines[2:]]


def test_the_table_has_leads_with_their_sign_interval_mark_and_count() -> None:
    """Student's t of three seeds is 4.303: a scatter of 0.1 dB is 0.25 dB of interval, of 6 dB 14.9."""
    report = SAMPLE.sample_report(compared, 4, sensors=SAMPLE.SENSORS[:1], seeds=SEEDS)
    page = comparison_markdown(report, "rodcone report x -o y.md", 1)
    assert page.startswith(
        "# `What is seen?`\n\n    rodcone report x -o y.md\n\nrodcone 0.1.0, study `sample`, 3 seeds."
    )
    assert "`Bayer (bilinear)` beside `RGBW (interleaved)`:" in page
    head, row = table_of(page, "PSNR [dB]")
    assert head == ["PSNR [dB]", *(f"`{level}`" for level in MORE), "counted"]
    # ahead; behind; less than is seen; undecided, which isn't counted
    assert row == ["`RGBW (interleaved)`", "+2.0 ± 0.2", "**−1.0 ± 0.2**", "(+0.1 ± 0.2)", "(+9.0 ± 14.9)", "1 / 1 / 1"]
    _, row = table_of(page, "FLIP")
    assert row[1:] == ["+0.050 ± 0.000", "**−0.030 ± 0.000**", "(−0.001 ± 0.000)", "(0.000 ± 0.000)", "1 / 2 / 1"]
    alone = SAMPLE.sample_report(compared, 4, sensors=SAMPLE.SENSORS[:1], seeds=SEEDS[:1])
    assert "study `sample`, 1 seed." in comparison_markdown(alone, "", 1)
    other = table_of(comparison_markdown(report, "", 0), "PSNR [dB]")[1]
    assert other[1:] == ["**−2.0 ± 0.2**", "+1.0 ± 0.2", "(−0.1 ± 0.2)", "(−9.0 ± 14.9)", "1 / 1 / 1"]


@pytest.mark.thorough
def test_several_places_have_an_answer_each_and_scenes_a_mean() -> None:
    scenes = tuple(replace(SAMPLE.sample_report(levels=1).scenes[0], name=name) for name in ("one", "two"))

    def twice(row: Row) -> Row:
        made = compared(row)
        return replace(made, psnr_db=made.psnr_db + 2.0 * (row.scene == "two") * (row.processor == "bayer"))

    page = comparison_markdown(
        SAMPLE.sample_report(twice, 2, scenes=scenes, sensors=SAMPLE.SENSORS[:1], seeds=SEEDS), "", 1
    )
    answers = [line for line in page.replace("\N{NO-BREAK SPACE}", " ").splitlines() if line.startswith("- ")]
    assert [line.split()[1] for line in answers] == ["`one`", "`two`"]
    assert "PSNR +4.0 dB" in answers[1]
    rows = table_of(page, "PSNR [dB]")[1:]
    assert [(row[0], row[1], row[-1]) for row in rows] == [
        ("`RGBW (interleaved)`, `one`", "+2.0 ± 0.2", "3 / 0 / 1"),
        ("`RGBW (interleaved)`, `two`", "+4.0 ± 0.2", "3 / 0 / 1"),
        ("`RGBW (interleaved)`, `mean of 2 named scenes`", "+3.0 ± 0.2", "3 / 0 / 1"),
    ]


def test_a_name_is_code_whatever_is_in_it() -> None:
    assert code("a|b `c`\n d") == "`a\\|b 'c' d`"
