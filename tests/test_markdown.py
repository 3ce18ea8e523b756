"""The Markdown: whole links, a README for strangers, programs on `rodcone` alone, an example of every public name."""

import ast
import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from badges import addressed, badges
from PIL import Image

from rodcone import __all__ as PUBLIC

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import pictures  # noqa: E402

README = (ROOT / "README.md").read_text("utf-8")
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
CODE = re.compile(r"^```.*?^```|`[^`\n]*`|^ {4}.*?$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\]\(([^)\s#]*)(?:#([\w-]*))?\)")
PYTHON = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as forges and MkDocs make them."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    plain = (re.sub(r"[^\w\s-]", "", heading.lower()) for heading in headings)
    return {re.sub(r"\s+", "-", heading.strip()) for heading in plain}


def test_every_link_and_picture_of_a_page_leads_somewhere() -> None:
    for page in PAGES:
        for target, anchor in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
            if re.match(r"https?:|mailto:", target):
                continue
            place = (page.parent / target).resolve() if target else page
            assert place.is_file(), f"{page.name}: {target}"
            assert not anchor or anchor in anchors(place.read_text("utf-8")), f"{page.name}: {target}#{anchor}"


def test_a_test_that_a_page_names_is_there() -> None:
    named = re.compile(r"\btests/([\w/]+\.py)(?:::(\w+))?")
    for page in PAGES:
        for file, test in named.findall(page.read_text("utf-8")):
            path = ROOT / "tests" / file
            assert path.is_file(), f"{page.name}: {file}"
            assert f"def {test}" in path.read_text("utf-8"), f"{page.name}: {file}::{test}"


def test_the_first_screen_of_the_readme_answers_a_stranger_in_this_order() -> None:
    marks = ("rodcone is for people who", "**What does a white pixel bring?**", "images/dim_light.webp", "pip install",
             "import rodcone\n", "## Questions", "images/chain.svg", "## Held against", "## Install")  # fmt: skip
    places = [README.index(mark) for mark in marks]
    assert places == sorted(places)


def test_the_readme_has_no_long_table_and_no_cell_of_many_links() -> None:
    rows = [line for line in README.splitlines() if line.startswith("|")]
    assert len(rows) < 10
    assert all(cell.count("](") < 5 for row in rows for cell in row.split("|"))


def test_the_readmes_result_quotes_what_was_measured_and_says_of_how_many_photographs() -> None:
    answer = README.split("**What does a white pixel bring?**")[1].split("![")[0]
    quoted = [f"{lead}.psnr.{level}" for level in ("0.05", "100") for lead in ("mosaic", "learned")]
    assert re.findall(r"<!-- =headline\.([\w.]+) -->", answer) == quoted
    page = (DOCS / "white_pixel.md").read_text("utf-8")
    (count,) = re.findall(r"the mean over\s+(\d+) photographs", answer)
    assert f"{count} photographs, 8 more held out" in page
    assert re.search(r"\d ± \d", answer), "a lead without its interval"


def test_the_readmes_badges_are_those_of_the_project() -> None:
    for file, content in badges().items():
        assert (DOCS / "images" / file).read_text("utf-8") == content, f"{file}: run docs/make/badges.py"
        assert file in README


def test_pages_install_from_the_projects_one_address_and_the_citation_has_its_version() -> None:
    for path, text in addressed().items():
        assert path.read_text("utf-8") == text, f"{path.name}: run docs/make/badges.py"
        assert path.suffix == ".cff" or "git+https://" in text, f"{path.name} doesn't say how to install"


def test_every_link_of_the_packages_description_is_absolute() -> None:
    package_readme = pytest.importorskip("package_readme", reason="needs hatchling, which builds the package")
    text = package_readme.with_absolute_links(README, "https://host/rodcone")
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    assert len(links) > 20
    assert [link for link in links if not link.startswith("https://")] == []
    assert "![version](https://host/rodcone/raw/main/docs/images/badge_version.svg)" in text
    assert "(https://host/rodcone/blob/main/docs/index.md#the-commands)" in text


@pytest.mark.thorough
def test_what_the_readme_says_its_lines_print_is_what_they_print(capsys: pytest.CaptureFixture[str], tmp_path: Path,
                                                                monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (block,) = PYTHON.findall(README)
    exec(block, {})
    stated = README.split("```text\n")[1].split("```")[0].split()
    for printed, said in zip(capsys.readouterr().out.split(), stated, strict=True):
        number = said.replace(".", "").isdigit()
        # another chip and another noise are drawn each time, and shown to 0.1 dB
        assert (float(printed) == pytest.approx(float(said), abs=0.35)) if number else printed == said


def test_animation_and_pictures_are_small() -> None:
    assert (DOCS / "images" / "dim_light.webp").stat().st_size < 100_000
    animation = DOCS / "images" / "light_rising.webp"
    assert animation.stat().st_size < 1_000_000
    with Image.open(animation) as frames:
        assert frames.n_frames > 10  # type: ignore[attr-defined]
    assert sum(path.stat().st_size for path in (DOCS / "pictures").rglob("*") if path.is_file()) < 1_500_000


def test_kept_pictures_are_those_of_their_pages_commands() -> None:
    pages = [page for page in PAGES if pictures.shown(page.read_text("utf-8"))]
    assert len(pages) > 7
    for page in pages:
        made = DOCS / "pictures" / page.stem / pictures.MADE
        assert made.read_text("utf-8").strip() == pictures.digest(page.read_text("utf-8")), (
            f"{page.stem}: see figures.mk"
        )


def test_a_build_of_the_site_changes_no_kept_picture(tmp_path: Path) -> None:
    page = DOCS / "how_to" / "burst.md"
    kept = tmp_path / "burst"
    shutil.copytree(DOCS / "pictures" / "burst", kept)
    (ran := tmp_path / "ran").mkdir()
    for name in pictures.shown(page.read_text("utf-8")):
        Image.new("RGB", (8, 8), "red").save((ran / name).with_suffix(".png"))
    before = {path.name: path.read_bytes() for path in kept.iterdir()}
    pictures.keep(page, ran, kept)
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == before
    (kept / pictures.MADE).write_text("another page's\n", "utf-8")
    pictures.keep(page, ran, kept)
    assert (kept / "one.webp").read_bytes() != before["one.webp"]


def programs() -> Iterator[tuple[str, str]]:
    """Name and text of each piece of Python that a reader is shown: pages, notebooks, numbered scripts."""
    for page in PAGES:
        for number, block in enumerate(PYTHON.findall(page.read_text("utf-8"))):
            yield f"{page.name}:{number}", block
    for path in sorted(DOCS.glob("notebooks/*.ipynb")):
        cells = [cell for cell in json.loads(path.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
        yield path.name, "\n".join("".join(cell["source"]) for cell in cells)
    for path in sorted((ROOT / "examples").glob("*.py")):
        yield path.name, path.read_text("utf-8")


PROGRAMS = dict(programs())
# What runs in tests: scripts, notebooks, and the pages that docs/run_page.py runs.
RUN = {path.name for folder in ("tutorial", "how_to", "understand") for path in DOCS.glob(f"{folder}/*.md")}
EXTRA = {"explore": "explore.md", "relight_denoised": "render.md"}
INSIDE = {"render", "scenes", "sensor", "isp", "studies"}


def test_programs_that_a_reader_is_shown_import_rodcone_alone() -> None:
    inside = []
    for name, text in PROGRAMS.items():
        for node in ast.walk(ast.parse(re.sub(r"^%.*$", "", text, flags=re.MULTILINE))):
            modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            inside += [
                f"{name}: {module}"
                for module in modules
                if module.split(".")[0] in INSIDE or module.startswith("rodcone.")
            ]
    assert inside == []


def test_a_public_name_has_an_example_that_runs() -> None:
    pages = {place: place.partition(":")[0] for place in PROGRAMS}
    texts = [text for place, text in PROGRAMS.items() if not pages[place].endswith(".md") or pages[place] in RUN]
    shown = set(re.findall(r"\brodcone\.(\w+)\b", "\n".join(texts)))
    # what needs an extra that tests go without
    shown |= {name for name, page in EXTRA.items() if f"rodcone.{name}(" in (DOCS / page).read_text("utf-8")}
    assert set(PUBLIC) - shown == set(), "show each in examples/ or on a page, or take it out of the public names"
