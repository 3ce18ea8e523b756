"""`make results`: parts and tables fit, a part goes on and isn't made twice, and pages quote what was made."""

import shlex
from dataclasses import replace
from pathlib import Path

import make_results
import page_parts
import pytest
from make_results import PARTS, ROOT, Part, announcement, make, read_parts
from page_parts import QUOTE, RESULTS, csv_text, quoted_pages, read_quoted, stamped, unstamped, with_quotes

from rodcone.errors import InputError

ALL = read_parts(PARTS.read_text("utf-8"))
# Written by commands that measure this machine or run for hours, which docs/render.md and docs/outside_files.md name.
BY_HAND = {"render_growth", "render_share", "fuzzed_readers"}


def test_every_table_is_made_by_exactly_one_part() -> None:
    made = [table for part in ALL for table in part.tables]
    assert sorted(made) == sorted({path.stem for path in RESULTS.glob("*.csv")} - BY_HAND - {"quoted"})


def test_every_program_and_study_that_a_part_names_is_there() -> None:
    for part in ALL:
        for command in part.commands:
            for word in shlex.split(command.format(work="out/results/x")):
                if word.endswith((".py", ".toml")) and not word.startswith("out/"):
                    assert (ROOT / word).is_file(), (part.name, word)


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Part:
    """A part of two commands in a repository of its own; each writes down that it ran."""
    (tmp_path / "results").mkdir()
    for module, name, value in (
        (make_results, "RESULTS", tmp_path / "results"),
        (make_results, "ROOT", tmp_path),
        (make_results, "WORK", tmp_path / "out"),
    ):
        monkeypatch.setattr(module, name, value)
    (tmp_path / "first.py").write_text("import sys; open(sys.argv[1], 'a').write('x')", "utf-8")
    (tmp_path / "table.py").write_text("open('results/light.csv', 'w').write('a,b\\n1,2\\n')", "utf-8")
    return Part("light", 3, ("python first.py {work}/ran", "python table.py"), ("light",))


def test_a_part_is_made_once_and_says_where_its_table_comes_from(part: Part, tmp_path: Path) -> None:
    make(part, "0.3.0+abc")
    origin, table = (tmp_path / "results" / "light.csv").read_text("utf-8").split("\n", 1)
    assert table == "a,b\n1,2\n"
    assert origin.startswith("# 0.3.0+abc, ")
    assert origin.endswith("make results PART=light")
    assert part.is_made("0.3.0+abc")
    assert not part.is_made("0.3.0+abd")  # other code
    assert not replace(part, commands=("python table.py",)).is_made("0.3.0+abc")  # other commands
    assert announcement([part], "0.3.0+abc").startswith("light              made")
    assert "about 3 minutes" in announcement([part], "0.3.0+abd")


def test_a_command_that_fails_ends_the_part_and_its_table_is_not_stamped(part: Part, tmp_path: Path) -> None:
    (tmp_path / "table.py").write_text("raise SystemExit(3)", "utf-8")
    with pytest.raises(InputError, match=r"light: 'python table.py' ended with 3; call `make results` again"):
        make(part, "0.3.0+abc")
    assert not part.is_made("0.3.0+abc")
    (tmp_path / "table.py").write_text("", "utf-8")
    with pytest.raises(InputError, match="its commands don't write light"):
        make(part, "0.3.0+abc")


def test_a_table_keeps_one_line_of_origin() -> None:
    assert stamped(stamped("a\n1\n", "old"), "new") == "# new\na\n1\n"
    assert unstamped("# new\na\n1\n") == unstamped("a\n1\n") == "a\n1\n"


def test_sentences_quote_what_was_made() -> None:
    figures = {"light.lead_db": "1.5 ± 0.4"}
    page = "RGBW leads by <!-- =light.lead_db -->1.7<!-- / --> dB."
    assert with_quotes(page, figures) == "RGBW leads by <!-- =light.lead_db -->1.5 ± 0.4<!-- / --> dB."
    with pytest.raises(InputError, match=r"light\.lead: no part of `make results` makes it"):
        with_quotes("<!-- =light.lead --><!-- / -->", figures)


def test_sentences_quote_cells_of_the_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_parts, "RESULTS", tmp_path)
    (tmp_path / "t.csv").write_text("# 0.3.0, a day\nlamp,place,snr,snr ±\nA,near,3.5,0.4\nA,far,2.5,\n", "utf-8")
    page = "<!-- =t[lamp=A;place=near].snr -->0<!-- / --> and <!-- =t[place=far].snr -->0<!-- / --> dB"
    told = "<!-- =t[lamp=A;place=near].snr -->3.5 ± 0.4<!-- / --> and <!-- =t[place=far].snr -->2.5<!-- / --> dB"
    assert with_quotes(page, {}) == told
    for wrong in ("t[lamp=A].snr", "t[lamp=B].snr", "t[place=far].psnr", "u[lamp=A].snr"):
        with pytest.raises(InputError, match="allowed: a column of one row"):
            with_quotes(f"<!-- ={wrong} --><!-- / -->", {})


def test_a_part_renews_its_own_figures_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_parts, "QUOTED", tmp_path / "quoted.csv")
    page_parts.QUOTED.write_text(csv_text(["name", "text"], [["light.old", "1"], ["paper.kept", "2"]]), "utf-8")
    page_parts.write_quoted("light", {"lead_db": "1.5"})
    assert read_quoted() == {"light.lead_db": "1.5", "paper.kept": "2"}


def test_every_quoted_figure_of_a_page_is_the_one_that_was_made() -> None:
    figures = read_quoted()
    for page in quoted_pages():
        text = page.read_text("utf-8")
        assert with_quotes(text, figures) == text, page
        assert text.count("<!-- =") == len(QUOTE.findall(text)), f"{page}: a quote has no end"
