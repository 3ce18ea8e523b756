"""The documentation: names on its pages exist, its code runs, it builds without a warning and fetches nothing."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from pkgutil import resolve_name
from urllib.parse import unquote

import browser as CHROME
import pytest
from ask_site import first_hits

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
# Pages that name modules and functions in backticks, `sensor.readout.noise_variance`, all of which have to exist.
PAGES = sorted(
    [
        DOCS / "index.md",
        DOCS / "model.md",
        *DOCS.glob("tutorial/*.md"),
        *DOCS.glob("how_to/*.md"),
        *DOCS.glob("understand/*.md"),
    ]
)
RUN = [page for page in PAGES if page.parent != DOCS]
NAME = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`")
LEAST_TERMS = 70  # of the paper, its Table 1, EMVA 1288, radiometry and photometry
SMALL = ["DEMO=--size 32 --spp 16 --level 0.05cd/m2 --level 25cd/m2", "PAPER=--size 48 --spp 16 --seeds 2"]
# What readers type, and the page that answers it. The first seven are those of a trial by three new users.
QUESTIONS = {
    "ISO": "how_to/gain",
    "crosstalk": "isp",
    "DNG": "how_to/dng_from_numpy",
    "how many photons": "understand/light",
    "dark current": "understand/noise",
    "own sensor": "how_to/own_sensor",
    "lux": "understand/light",
    "sensor": "how_to/own_sensor",
    "model": "model",
    "exposure": "understand/exposure",
    "read noise": "understand/noise",
    "install": "how_to/install",
    "white balance": "isp",
    "Lightroom": "how_to/which_program",
    "pandas": "formats",
}
LEAST_ANSWERED = 12  # by the first hit
VIEWS = [(360, False), (360, True), (1280, False), (1280, True)]


def name_of(page: Path) -> str:
    return page.relative_to(DOCS).with_suffix("").as_posix()


def there(name: str) -> bool:
    """Whether a dotted name is a module, its function, class or constant, or a class's method or field."""
    try:
        return resolve_name(name) is not None
    except AttributeError:
        holder, _, field = name.rpartition(".")
        return field in getattr(resolve_name(holder), "__dataclass_fields__", {})


def test_every_name_of_the_code_on_a_page_exists() -> None:
    told = {(name_of(page), name) for page in PAGES for name in NAME.findall(page.read_text("utf-8"))}
    assert len(told) > 20
    assert [place for place in sorted(told) if not there(place[1])] == []


def test_every_term_of_where_has_one_row_a_meaning_and_public_names_that_exist() -> None:
    lines = (line for line in (DOCS / "where.md").read_text("utf-8").splitlines() if line[:1] == "|")
    rows = [
        [cell.strip() for cell in line.strip("| ").split("|")]
        for line in lines
        if not line.startswith(("| term", "|-", "| -"))
    ]
    assert len({row[0] for row in rows}) == len(rows) >= LEAST_TERMS, "give each term one row"
    for term, meaning, where, *_ in rows:
        names = re.findall(r"`([\w.]+)`", where)
        assert meaning, term
        assert names, f"{term}: name the function that holds it, in backticks"
        assert [name for name in names if "._" in name or not there(name)] == [], term


def test_the_model_page_comes_to_every_module_of_its_table_in_the_order_of_the_chain() -> None:
    table, text = (DOCS / "model.md").read_text("utf-8").split("## Light", 1)
    told = NAME.findall(text)
    listed = NAME.findall(table)
    assert [name for name in listed if not any(f"{one}.".startswith(f"{name}.") for one in told)] == []
    order = [name.split(".")[0] for name in listed]
    assert order == sorted(order, key=["render", "sensor", "isp", "studies"].index)
    assert len(listed) > 20


def test_pages_name_no_command_that_is_not_there() -> None:
    told = "\n".join(path.read_text("utf-8") for path in DOCS.rglob("*.md"))
    blocks = "\n".join(re.findall(r"^```\w+[^\n]*\n(.*?)^```$", told, re.MULTILINE | re.DOTALL))
    commands = set(re.findall(r"(?:^ {4,}|`)rodcone ([a-z]+)\b", told, re.MULTILINE))
    commands |= set(re.findall(r"^rodcone ([a-z]+)\b", blocks, re.MULTILINE))
    source = (ROOT / "studies" / "commands" / "cli.py").read_text("utf-8")
    known = set(re.findall(r'name="(\w+)"', source)) | set(re.findall(r"@app\.command\ndef (\w+)", source))
    assert {"demo", "sweep", "doctor"} <= commands <= known


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("make") is None:
        pytest.skip("make is not installed: docs/figures.mk can't run")
    return tmp_path_factory.mktemp("figures")


def make(figures: Path, *targets: str) -> None:
    """Make figures as `make docs` does, the large ones small."""
    command = [
        "make",
        "-f",
        "docs/figures.mk",
        f"BIN={Path(sys.executable).parent}",
        f"FIGURES={figures}",
        f"PICTURES={figures}/kept",
        *SMALL,
    ]
    done = subprocess.run([*command, *targets], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_the_code_of_a_page_runs(page: Path, figures: Path) -> None:
    if page.stem == "cluster":
        pytest.importorskip("distributed", reason="needs dask.distributed (extra cluster)")
    make(figures, f"{figures}/{name_of(page)}/ran")


@pytest.fixture(scope="module")
def site(figures: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built strictly: a warning, such as a missing figure or a dead link, ends the build."""
    make(figures)
    folder = tmp_path_factory.mktemp("site")
    assert "WARNING" not in built(folder, figures, "--strict")
    return folder


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_site_has_a_page_for_every_module_and_command_and_formulas_that_browsers_know(site: Path) -> None:
    sources = {name: [path.relative_to(ROOT / name) for path in (ROOT / name).rglob("*.py")] for name in PACKAGES}
    expected = {f"{name}/index" for name in PACKAGES} | {
        f"{name}/{'.'.join(path.with_suffix('').parts)}"
        for name, paths in sources.items()
        for path in paths
        if not path.stem.startswith("__")
    }
    built = {path.relative_to(site / "api").with_suffix("").as_posix() for path in (site / "api").rglob("*/*.html")}
    assert built == expected
    model = (site / "model.html").read_text("utf-8")
    assert model.count("<math") > 50
    assert "arithmatex" not in model
    assert not re.findall(r"<m\w+>[^<]*\\[^<]*<", model), "a command that the converter doesn't know stays as it is"
    assert 'href="api/sensor/readout.html#sensor.readout.noise_variance"' in model
    assert 'id="sensor.readout.noise_variance"' in (site / "api" / "sensor" / "readout.html").read_text("utf-8")
    coming = (site / "how_to" / "coming_from.html").read_text("utf-8")
    assert 'href="../api/render/engine.html#render.engine.render"' in coming, "a public name leads to its module"
    assert 'id="rodcone-sweep"' in (site / "api" / "commands.html").read_text("utf-8")


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_finished_pages_ask_no_host_for_anything(site: Path) -> None:
    fetched = re.compile(r"""<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=["']?(?:https?:)?//[^"'\s>]+""")
    wrong = {
        page.relative_to(site).as_posix(): found
        for page in site.rglob("*.html")
        if (found := [tag for tag in fetched.findall(page.read_text("utf-8")) if 'rel="canonical"' not in tag])
    }
    assert not wrong


@pytest.mark.slow
@pytest.mark.timeout(1800)
@CHROME.NEEDED
def test_a_browser_shows_the_pages_at_two_widths_in_light_and_dark_without_a_complaint(site, browser):
    for width, dark in VIEWS:
        for name in (
            "index",
            "model",
            "tutorial/first_picture",
            "gallery/scenes",
            "api/commands",
            "api/sensor/readout",
        ):
            page = CHROME.open_page(browser, site / f"{name}.html", width=width, dark=dark)
            assert CHROME.complaints(page) == []
            assert all(address.startswith("file:") for address in CHROME.requests(page)), CHROME.requests(page)
            assert page.evaluate("document.documentElement.scrollWidth") == width, f"{name} scrolls sideways at {width}"
            assert page.evaluate("[...document.images].filter(x => x.complete && !x.naturalWidth).length") == 0
            assert page.evaluate("document.body.dataset.mdColorScheme") == ("slate" if dark else "default")
            ground = CHROME.screenshot(page)[300:, :8, :].mean()  # the margin: what is beside it may be a picture
            assert (ground < 100) if dark else (ground > 155), f"{name}: mean {ground:.0f}, dark: {dark}"


def built(folder: Path, figures: Path, *options: str) -> str:
    """Build the site into a folder, and return what the build said."""
    for library in ("mkdocs", "material", "mkdocstrings", "latex2mathml"):
        pytest.importorskip(library, reason="needs MkDocs (extra docs)")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", *options, "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"FIGURES": str(figures), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stderr


@pytest.fixture(scope="module")
def bare_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site without the figures that take minutes: its pages, links and search are the same."""
    folder = tmp_path_factory.mktemp("bare")
    built(folder, folder / "no_figures", "--no-strict")
    return folder


@pytest.mark.slow
@pytest.mark.timeout(900)
@CHROME.NEEDED
def test_the_search_answers_what_readers_type_by_its_first_hit(bare_site: Path, browser) -> None:
    hits = first_hits(browser, bare_site, QUESTIONS, count=1)
    wrong = {question: hits[question] for question, page in QUESTIONS.items() if hits[question] != [f"{page}.html"]}
    assert len(QUESTIONS) - len(wrong) >= LEAST_ANSWERED, wrong


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_link_of_the_site_has_its_file_and_its_anchor(bare_site: Path) -> None:
    texts = {page.resolve(): page.read_text("utf-8") for page in bare_site.rglob("*.html")}
    anchors = {page: set(re.findall(r'\bid="?([^"\s>]+)', text)) for page, text in texts.items()}
    wrong = []
    for page, text in texts.items():
        for link in set(re.findall(r'<a\b[^>]*\bhref="?([^"\s>]+)', text)):
            place, _, anchor = link.partition("#")
            target = (page.parent / place).resolve() if place else page
            if re.match(r"\w+:", link) or place.startswith("/") or "figures/" in place:
                continue
            if not target.is_file() or (anchor and target in anchors and unquote(anchor) not in anchors[target]):
                wrong.append(f"{page.relative_to(bare_site.resolve())}: {link}")
    assert len(texts) > 300
    assert wrong == []
