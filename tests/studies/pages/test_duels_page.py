"""The page of a camera beside its opponents: tables hold the numbers, losses are all there, names stay text."""

import re
from pathlib import Path
from typing import Any

import pytest
import sweep_sample as ROWS
import sweep_sample as SAMPLE

from isp.processors import catalogue as processors
from isp.processors.catalogue import PROCESSORS, require_libraries
from rodcone.errors import InputError
from studies.commands.cli import main
from studies.pages import duels_page as opponents_page
from studies.pages.duels import contests_of, opponents_of
from studies.pages.duels_page import code, duel_table, figure_of, hardest, lead_table, level_table, page_of, write_page
from studies.pages.plots import BLUE, ORANGE
from studies.pages.report_text import PSNR
from studies.study.study_file import read_study
from studies.sweep.row import Row

LEVELS = {"0.1cd/m2": 0.1, "1cd/m2": 1.0, "10cd/m2": 10.0}
# PSNR [dB] at the three levels: `a` is ahead of all in the dark, `b` by 2 and 3 dB in the light; `c` never.
FIGURES = {"a": (20.0, 21.0, 22.0), "b": (15.0, 23.0, 25.0), "c": (10.0, 11.0, 12.0)}


def made(figures: dict[str, tuple[float, ...]] = FIGURES, **values: Any) -> list[Row]:
    """Two seeds that differ by 0.02 dB for `a` alone: half an interval of 0.13 dB for its leads."""
    return [
        ROWS.row(name, seed, psnr_db=value + 0.02 * seed * (name == "a"), level=level, luminance_cd_m2=light,
                 delta_e_median=5.0, develop_s=1.0 if name == "a" else 0.5, **values)
        for name, line in figures.items()
        for value, (level, light) in zip(line, LEVELS.items(), strict=True)
        for seed in (0, 1)
    ]  # fmt: skip


def test_leads_are_positive_and_losses_bold_in_every_condition() -> None:
    lines = lead_table(PSNR, contests_of(made()), "a").replace("\N{NO-BREAK SPACE}", " ").splitlines()
    assert lines[0] == "| lead in PSNR [dB] | 0.1 cd/m² | 1 cd/m² | 10 cd/m² |"
    assert lines[2:] == ["| `b` | +5.0 | **−2.0** | **−3.0** |", "| `c` | +10.0 | +10.0 | +10.0 |"]
    even = contests_of(made({"a": (9.0, 9.0, 9.0), "b": (9.0, 8.99, 1.0)}))
    assert lead_table(PSNR, even, "a").splitlines()[2] == "| `b` | (+0.0) | (+0.0) | +8.0 |"


def test_the_table_counts_outcomes_and_sets_times_beside_the_cameras() -> None:
    lines = duel_table(contests_of(made()), "a", ["b", "c"]).splitlines()
    even = "0 / 3 / 0 | +0.0 to +0.0 | 0 / 3 / 0 | +0.000 to +0.000"
    assert lines[2:] == [
        f"| `b` | 1 / 0 / 2 | −3.0 to +5.0 | {even} | × 0.5 |",
        f"| `c` | 3 / 0 / 0 | +10.0 to +10.0 | {even} | × 0.5 |",
    ]


def test_a_fair_form_takes_its_processors_place_and_the_plain_one_stands_beneath() -> None:
    figures = {"a": (20.0, 21.0, 22.0), "b": (15.0, 16.0, 17.0), "b_fair": (19.0, 20.0, 23.0), "c": (10.0, 11.0, 12.0)}
    contests = contests_of(made(figures))
    assert opponents_of(contests, "a") == ["b_fair", "c"]
    assert opponents_of(contests, "b_fair") == ["a", "c"]
    page = page_of(contests, {}, Path("out"), Path("p.md"), "a", None)
    ranked, plain = page.split("With the plain colour matrix, as published; the rows above rank `NAME_fair`:")
    assert "| `b_fair` | 2 / 0 / 1 |" in ranked
    assert "| `b` |" not in ranked
    assert "| `b` | 3 / 0 / 0 |" in plain
    assert plain.count("| `b` | 15.0") == 1  # every condition's own figures hold both


def test_each_exposure_and_white_balance_has_a_table_of_its_own() -> None:
    other = made({"a": (20.0, 21.0, 22.0), "b": (30.0, 31.0, 32.0)}, white_balance="as-shot")
    first = made({"a": (20.0, 21.0, 22.0), "b": (1.0, 2.0, 3.0)})
    page = page_of(contests_of([*first, *other]), {}, Path("out"), Path("p.md"), "a", None)
    tables = page.split("### exposure `auto`, white balance ")
    assert [part.splitlines()[0] for part in tables[1:]] == ["`gray-world`", "`as-shot`"]
    assert "| `b` | 3 / 0 / 0 |" in tables[1]
    assert "| `b` | 0 / 0 / 3 |" in tables[2]
    assert "### `desk, balance as-shot`" in page


def test_the_best_of_each_column_is_bold_and_a_tie_twice() -> None:
    page = page_of(contests_of(made()), {}, Path("out"), Path("p.md"), "a", None)
    assert "| `a` | **20.0**, **5.0** | 21.0, **5.0** | 22.0, **5.0** |" in page
    assert "| `b` | 15.0, **5.0** | **23.0**, **5.0** | **25.0**, **5.0** |" in page


def test_a_camera_that_never_loses_has_no_hardest_opponent() -> None:
    contests = contests_of(made({"a": (9.0, 9.0, 9.0), "b": (1.0, 2.0, 3.0)}))
    assert hardest(contests, "a") is None
    assert hardest(contests, "b") == "a"


def test_the_snr_of_green_stands_beneath_the_figures() -> None:
    electrons = {20.0: '{"G": 20.3, "W": 99.0}', 21.0: '{"G": 400.0, "W": 999.0}', 22.0: '{"G": 4000.0, "W": 9999.0}'}
    figures = {"interleaved": (20.0, 21.0, 22.0), "bayer": (15.0, 22.0, 23.0)}
    rows = [
        ROWS.row(name, seed, psnr_db=x + 0.02 * seed, level=level, luminance_cd_m2=light, sensor="table1_output",
                 mean_electrons=electrons[ours])
        for name, line in figures.items()
        for x, ours, (level, light) in zip(line, electrons, LEVELS.items(), strict=True)
        for seed in (0, 1)
    ]  # fmt: skip
    # Dark noise of 31.6 e-: 20.3 e- give -3.9 dB, 400 give 20.6, 4000 give 35.05.
    lines = level_table(contests_of(rows), "interleaved").splitlines()
    assert lines[-2] == "| *SNR of mean green [dB]* | −4 | 21 | 35 |"


def test_where_nothing_is_ranked_the_page_says_so() -> None:
    dark = {"sensor": "low_noise", "mean_electrons": '{"W": 0.01}'}
    figures = {"interleaved": (5.0, 5.0, 5.0), "bayer": (4.0, 4.0, 4.0)}
    page = page_of(contests_of(made(figures, **dark)), {}, Path("out"), Path("p.md"), "interleaved", None)
    assert "0 of 3 conditions are ranked: those in which W's SNR under `interleaved` is 1 or more" in page
    assert "| `bayer` | — | — | — |" in page
    assert "| `bayer` | 4.0" in page  # reported all the same


@pytest.mark.parametrize("name", ["`a` | <b>", "</script><b>", "a\n# head"])
def test_names_stay_text_and_tables_keep_their_columns(name: str) -> None:
    rows = [*made(scene=name), *made(scene="other")]
    page = page_of(contests_of(rows), {"name": name}, Path("out"), Path("p.md"), "a", None)
    assert re.sub(r"`[^`]*`", "", page).count("<b>") == 0
    assert "\n# head" not in page
    tables = [block.splitlines() for block in page.split("\n\n") if block.startswith("|")]
    for table in tables:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table}) == 1, table
    assert code("a`b|c") == "`a'b\\|c`"


def test_the_figure_has_a_line_for_each_processor_and_the_camera_in_its_colour() -> None:
    drawing = figure_of(contests_of([*made(), *made(sensor="other")]), "a")
    assert drawing is not None
    assert [axes.get_title(loc="left") for axes in drawing.axes] == [
        f"PSNR [dB], desk, {x}" for x in ("mine.toml", "other")
    ]
    for axes in drawing.axes:
        lines = {line.get_label(): line for line in axes.lines}
        assert {name: list(line.get_ydata()) for name, line in lines.items()} == {
            name: pytest.approx([value + 0.01 * (name == "a") for value in values]) for name, values in FIGURES.items()
        }
        assert list(lines["a"].get_xdata()) == list(LEVELS.values())
        assert (lines["a"].get_color(), lines["b"].get_color()) == (BLUE, ORANGE)
        assert {text.get_text() for text in axes.texts} == set(FIGURES)
    one_level = [row for row in made() if row.level == "1cd/m2"]
    assert figure_of(contests_of(one_level), "a") is None


def test_page_and_figure_are_written_both_or_neither(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_page(made(), {}, tmp_path, tmp_path / "p.md", "a")
    assert "](p.svg)" in (tmp_path / "p.md").read_text("utf-8")
    assert (tmp_path / "p.svg").read_text("utf-8").startswith("<svg")
    with pytest.raises(InputError):
        write_page(made()[1:], {}, tmp_path, tmp_path / "q.md", "a")
    with pytest.raises(OSError, match="absent"):
        write_page(made(), {}, tmp_path, tmp_path / "absent" / "p.md", "a")
    monkeypatch.setattr(opponents_page, "svg_text", lambda drawing: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_page(made(), {}, tmp_path, tmp_path / "r.md", "a")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.md", "p.svg"]


def call(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    captured = capsys.readouterr()
    return int(stopped.value.code or 0), captured.out, captured.err


def test_the_command_makes_the_page_of_a_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page = tmp_path / "out", tmp_path / "docs" / "page.md"
    SAMPLE.swept(SAMPLE.small_study(tmp_path, processors=("interleaved", "bayer")), out)
    assert call(["opponents", str(out), "-o", str(page)], capsys) == (0, f"{page}\n", "")
    text = page.read_text("utf-8")
    assert text.startswith("# `interleaved` beside its opponents\n")
    assert all(line in text for line in ("| scene | `scene.exr` |", "| sensor | `low_noise` |", "| seeds | `0`, `1` |"))
    assert "SNR of mean green" in text
    assert page.with_suffix(".svg").exists()


@pytest.mark.parametrize(
    ("arguments", "words"), [(["absent"], "holds no ledger.sqlite"), (["absent", "-o", "page.html"], "write page.md")]
)
def test_bad_input_is_one_line_and_writes_nothing(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = call(["opponents", *arguments], capsys)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err
    assert list(tmp_path.iterdir()) == []


def test_the_example_asks_for_every_processor_and_seeds_for_an_interval(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["new", "study", "opponents", "-o", str(tmp_path / "o.toml")], capsys)[0] == 0
    study = read_study(tmp_path / "o.toml")
    # mosaics other than RGBW, CMYW and Bayer are for studies of their own
    assert sorted(study.processors) == sorted(name for name in PROCESSORS if PROCESSORS[name].colours)
    assert len(study.scenes) == 2
    assert len(study.seeds) >= 2


def test_a_missing_extra_is_named_before_anything_is_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(processors, "find_spec", lambda name: None if name == "bm3d" else object())
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "bayer_bm3d"))
    told = r"'bayer_bm3d' needs bm3d, which is not installed.*pip install 'rodcone\[bm3d\]'"
    with pytest.raises(InputError, match=told):
        SAMPLE.swept(study, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    require_libraries("bayer_menon")
    require_libraries("bayer")
    path = tmp_path / "o.toml"
    path.write_text('scenes = ["still_life"]\nlevels = ["1cd/m2"]\nprocessors = ["bayer_bm3d"]\n', "utf-8")
    code, _, err = call(["sweep", str(path), "-o", str(tmp_path / "out")], capsys)
    assert (code, err.count("\n")) == (2, 1)
    assert re.search(told, err)
    assert not (tmp_path / "out").exists()
