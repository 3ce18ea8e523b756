"""The Markdown page: every lead, interval, mark and count again from the rows."""

from dataclasses import replace

import pytest
import report_sample as SAMPLE

from studies.pages.report_compare import code, markdown
from studies.sweep.row import Row

SEEDS = (0, 1, 2)
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
    page = markdown(report, "rodcone report x -o y.md", 1)
    assert page.startswith(
        "# `What is seen?`\n\n    rodcone report x -o y.md\n\nrodcone 0.1.0, study `sample`, 3 seeds."
    )
    assert "`Bayer, bilinear` beside `Interleaved`:" in page
    head, row = table_of(page, "PSNR [dB]")
    assert head == ["PSNR [dB]", *(f"`{level}`" for level in MORE), "counted"]
    # ahead; behind; less than is seen; undecided, which isn't counted
    assert row == ["`Interleaved`", "+2.0 ± 0.2", "**−1.0 ± 0.2**", "(+0.1 ± 0.2)", "(+9.0 ± 14.9)", "1 / 1 / 1"]
    _, row = table_of(page, "FLIP")
    assert row[1:] == ["+0.050 ± 0.000", "**−0.030 ± 0.000**", "(−0.001 ± 0.000)", "(0.000 ± 0.000)", "1 / 2 / 1"]
    other = table_of(markdown(report, "", 0), "PSNR [dB]")[1]
    assert other[1:] == ["**−2.0 ± 0.2**", "+1.0 ± 0.2", "(−0.1 ± 0.2)", "(−9.0 ± 14.9)", "1 / 1 / 1"]


@pytest.mark.thorough
def test_several_places_have_an_answer_each_and_scenes_a_mean() -> None:
    scenes = tuple(replace(SAMPLE.sample_report(levels=1).scenes[0], name=name) for name in ("one", "two"))

    def twice(row: Row) -> Row:
        made = compared(row)
        return replace(made, psnr_db=made.psnr_db + 2.0 * (row.scene == "two") * (row.processor == "bayer"))

    page = markdown(SAMPLE.sample_report(twice, 2, scenes=scenes, sensors=SAMPLE.SENSORS[:1], seeds=SEEDS), "", 1)
    answers = [line for line in page.replace("\N{NO-BREAK SPACE}", " ").splitlines() if line.startswith("- ")]
    assert [line.split()[1] for line in answers] == ["`one`", "`two`"]
    assert "PSNR +4.0 dB" in answers[1]
    rows = table_of(page, "PSNR [dB]")[1:]
    assert [(row[0], row[1], row[-1]) for row in rows] == [
        ("`Interleaved`, `one`", "+2.0 ± 0.2", "3 / 0 / 1"),
        ("`Interleaved`, `two`", "+4.0 ± 0.2", "3 / 0 / 1"),
        ("`Interleaved`, `mean of 2 named scenes`", "+3.0 ± 0.2", "3 / 0 / 1"),
    ]


def test_a_name_is_code_whatever_is_in_it() -> None:
    assert code("a|b `c`\n d") == "`a\\|b 'c' d`"
