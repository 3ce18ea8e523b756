"""Hooks of the documentation's build (mkdocs.yml): pages of modules and results, formulas as MathML, names as links."""

import ast
import csv
import json
import re
import tomllib
from html import escape, unescape
from itertools import count
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from mkdocs.utils import get_relative_url
from PIL import Image
from run_page import FENCE

from rodcone import _PUBLIC
from studies.commands.cli import app

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("rodcone", "render", "scenes", "sensor", "isp", "studies")
RESULTS = sorted((ROOT / "docs" / "results").glob("*.csv"))
FIGURES = ("*", "demo/*", "paper/*", "tutorial/*/*", "how_to/*/*", "understand/*/*")  # what docs/figures.mk makes
SMALL_PX, WIDE_PX = 96, 512  # height up to which a picture is shown four times as large, width from which as it is
SHOWN = (".html", ".png", ".svg")
# How much a word of a page counts in the search, by its folder; elsewhere 1. Who searches wants to do or to understand
# something: these pages come first, then what can be named; records of decisions and the functions within come last.
BOOSTS = {
    "how_to": 3.0,
    "tutorial": 3.0,
    "understand": 3.0,
    "gallery": 1.5,
    "decisions": 0.1,
    "results": 0.1,
    "api": 0.1,
}
# By page the words under which readers look for it, beside those of its own text.
WORDS = tomllib.loads((ROOT / "docs" / "search.toml").read_text("utf-8"))
# Links to files of the repository outside docs: on the site they lead to copies.
OUTSIDE = re.compile(
    r"\]\(((?:(?:\.\./)+(?=[A-Z]|studies/|examples/|sensor/|benchmarks/))|(?=make/))([\w./-]+\.(?:md|cff|toml|csv|py))\)"
)
LINK = re.compile(r'href="([^":#]*\.html|)#([^"]+)"')
PICTURE = re.compile(r'<img ([^>]*?)src="((?:\.\./)*(?:pictures|images/understand)/[^"]+\.(webp|svg))"')
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
MADE = re.compile(r"`out/(demo/report|paper/paper)\.html`")  # in words where no figures are, a link on the site
CSV_LINK = re.compile(r"\(results/(\w+)\.csv\)")  # a file in the repository, a page of the site
NAME = re.compile(rf"(<a\b[^>]*>)?<code>((?:{'|'.join(PACKAGES)})(?:\.\w+)+)</code>")  # a link in front: left alone


def on_config(config: Any) -> Any:
    """Add to the navigation what its list lacks: pages about one part, decisions, the API."""
    sections = {name: pages for entry in config.nav if isinstance(entry, dict) for name, pages in entry.items()}
    listed = {*map(str, config.nav), *(page for pages in sections.values() for page in pages)}
    sections["Look up"] += sorted({path.name for path in (ROOT / "docs").glob("*.md")} - listed)
    sections["Results"].append({"Tables": [f"results/{path.stem}.md" for path in RESULTS]})
    decisions = sorted(path.name for path in (ROOT / "docs" / "decisions").glob("*.md"))
    packages = [
        {name: [f"api/{name}/index.md", *({module: f"api/{name}/{module}.md"} for module in modules(name))]}
        for name in PACKAGES
    ]
    sections["Look up"] += [
        "api/commands.md",
        {"API": ["api/index.md", *packages]},
        {"Decisions": ["decisions/index.md", *(f"decisions/{name}" for name in decisions)]},
    ]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages: decisions, commands, packages and modules."""
    pages = {"decisions/index.md": decisions_page(), "api/index.md": api_page(), "api/commands.md": commands_page()}
    for path in RESULTS:
        pages[f"results/{path.stem}.md"] = results_page(path)
    for package in PACKAGES:
        pages[f"api/{package}/index.md"] = package_page(package)
        for module in modules(package):
            pages[f"api/{package}/{module}.md"] = f"# {package}.{module}\n\n::: {package}.{module}\n"
    for place, text in pages.items():
        files.append(File.generated(config, place, content=text))
    for page in sorted((ROOT / "docs").rglob("*.md")):
        for link in OUTSIDE.finditer(page.read_text("utf-8")):
            if copy_of(link[2]) not in files.src_uris:
                text = (page.parent / f"{link[1]}{link[2]}").read_text("utf-8")
                files.append(File.generated(config, copy_of(link[2]), content=text))
    folder = ROOT / config.extra["figures"]
    for place in sorted(path for pattern in FIGURES for path in folder.glob(pattern) if path.suffix in SHOWN):
        name = f"figures/{place.relative_to(folder).as_posix()}"
        files.append(File.generated(config, name, abs_src_path=str(place.resolve())))
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Show beneath each block that docs/run_page.py ran what it printed; weigh the page for the search."""
    page.meta.setdefault("search", {"boost": BOOSTS.get(page.file.src_uri.partition("/")[0], 1.0)})
    page.meta["tags"] = WORDS.get(page.file.src_uri, [])
    up = "../" * page.file.src_uri.count("/")
    markdown = OUTSIDE.sub(lambda link: f"]({up}{copy_of(link[2])})", markdown)
    markdown = MADE.sub(rf"[`out/\1.html`]({up}figures/\1.html)", markdown)
    if not page.file.src_uri.startswith("results/"):
        markdown = CSV_LINK.sub(r"(results/\1.md)", markdown)
    outputs = ROOT / config.extra["figures"] / page.file.src_uri.removesuffix(".md") / "output.json"
    if not outputs.is_file():
        return markdown
    printed = json.loads(outputs.read_text("utf-8"))
    numbers = count()

    def with_output(fence: re.Match[str]) -> str:
        output = printed.get(str(next(numbers)), "").rstrip()
        return fence[0] + (f'\n\n``` {{ .text .output title="prints" }}\n{output}\n```' if output else "")

    return FENCE.sub(with_output, markdown)


def on_page_content(html: str, page: Page, config: Any, files: Files) -> str:
    """Write formulas as MathML, which browsers show by themselves, and lead names of modules to their pages."""
    html = PICTURE.sub(lambda image: shown_large(image, page.file.src_uri), html)
    html = FORMULA.sub(lambda match: mathml(match[2], block=match[1] == "div"), html)
    return NAME.sub(lambda match: match[0] if match[1] else linked(match[2], match[0], page.url), html)


def on_post_build(config: Any) -> None:
    """Lead each link whose target lacks its anchor to what holds it: of a field the class, of a constant the module."""
    pages = {path.resolve(): path.read_text("utf-8") for path in Path(config.site_dir).rglob("*.html")}
    anchors = {path: set(re.findall(r'\bid="([^"]+)"', text)) for path, text in pages.items()}
    for path, text in pages.items():

        def mended(link: re.Match[str], path: Path = path) -> str:
            place, anchor = link[1], link[2]
            known = anchors.get((path.parent / place).resolve() if place else path)
            while known is not None and anchor and anchor not in known:
                anchor = anchor.rpartition(".")[0]
            return f'href="{place}#{anchor}"' if anchor else f'href="{place or path.name}"'

        new = LINK.sub(mended, text)
        if new != text:
            path.write_text(new, "utf-8")


def copy_of(name: str) -> str:
    """Return the place on the site of a file from outside docs; Markdown stays text, since its links lead elsewhere."""
    place = name.replace("make/", "lists/", 1)  # mkdocs.yml excludes what lies in a folder `make`
    return f"files/{place}.txt" if name.endswith(".md") else f"files/{place}"


def modules(package: str) -> list[str]:
    """Modules of a package by their names within it, such as ``capture`` and ``kernel.poisson``."""
    paths = (path.relative_to(ROOT / package).with_suffix("") for path in (ROOT / package).rglob("*.py"))
    return sorted(".".join(path.parts) for path in paths if not path.stem.startswith("__"))


def summary(path: Path) -> str:
    """First line of a module's docstring."""
    return (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").partition("\n")[0]


def decisions_page() -> str:
    """List of the decisions by their own headings."""
    paths = sorted((ROOT / "docs" / "decisions").glob("*.md"))
    lines = [f"- [{path.read_text('utf-8').partition(chr(10))[0].lstrip('# ')}]({path.name})" for path in paths]
    lead = "Why things are as they are: each record states the question, what was found, and what was decided."
    return f"# Decisions\n\n{lead}\n\n" + "\n".join(lines)


def results_page(path: Path) -> str:
    """Table of a results file, with a link to the file."""
    text = path.read_text("utf-8")
    origin = text.partition("\n")[0].removeprefix("# ") if text.startswith("# ") else ""
    head, *rows = csv.reader(text.splitlines()[bool(origin) :])
    lines = [f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows]
    top = f"<table><thead><tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr></thead><tbody>"
    title = f"# Table: {path.stem.replace('_', ' ')}\n\nThe same as a file: [{path.name}]({path.name}).\n\n"
    title += f"Made by rodcone {origin}.\n\n" if origin else ""
    return title + "\n".join([top, *lines, "</tbody></table>\n"])


def api_page() -> str:
    """List of the packages, in the order in which light goes through them."""
    rows = [f"| [`{name}`]({name}/index.md) | {summary(ROOT / name / '__init__.py')} |" for name in PACKAGES]
    order = "`studies > isp > (scenes | sensor) > render > rodcone`"
    lead = f"Imports point one way: {order}. The commands: [Commands](commands.md)."
    return f"# API\n\n{lead}\n\n| package | what |\n|---|---|\n" + "\n".join(rows)


def package_page(package: str) -> str:
    """List of a package's modules, a line each."""
    rows = [
        f"| [`{name}`]({name}.md) | {summary(ROOT.joinpath(package, *name.split('.')).with_suffix('.py'))} |"
        for name in modules(package)
    ]
    text = summary(ROOT / package / "__init__.py")
    return f"# {package}\n\n{text}\n\n| module | what |\n|---|---|\n" + "\n".join(rows)


def commands_page() -> str:
    """Text of `--help`, of all commands."""
    text = app.generate_docs(output_format="markdown").replace("# rodcone\n", "# Commands\n", 1)
    return re.sub(r"## Table of Contents\n.*?(?=\*\*Commands\*\*)", "", text, flags=re.DOTALL)


def mathml(latex: str, block: bool) -> str:
    """MathML of a formula; one on a line of its own scrolls by itself where it is too wide."""
    if not block:
        return convert(unescape(latex))
    return f'<div class="formula">{convert(unescape(latex), display="block")}</div>'


def shown_large(image: re.Match[str], page: str) -> str:
    """Return a picture's tag with its look: small pictures enlarged, pixel by pixel, drawings on a light ground.

    It isn't said in the pages' Markdown, because a forge would show it as text.
    """
    _, place, kind = image.groups()
    if kind == "svg":
        return f'<img class="drawing" {image[0][5:]}'
    with Image.open((ROOT / "docs" / page).parent / place) as picture:
        width, height = picture.size
    times = 4 if height <= SMALL_PX else 2
    return image[0] if width > WIDE_PX else f'<img class="pixels" width="{times * width}" {image[0][5:]}'


def linked(name: str, code: str, url: str) -> str:
    """`code` as a link to the page of the module that `name` begins with; as it is where there is none."""
    name = ".".join(_PUBLIC.get(name.removeprefix("rodcone."), (name,)))
    package, _, inner = name.partition(".")
    names = [module for module in modules(package) if f"{inner}.".startswith(f"{module}.")]
    if not names:
        return code
    module = max(names, key=len)
    anchor = f"#{name}" if inner != module else ""
    return f'<a href="{get_relative_url(f"api/{package}/{module}.html", url)}{anchor}">{code}</a>'
