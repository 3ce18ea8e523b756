"""Write pages from the templates beside this module; every value that is put into them is escaped."""

from base64 import b64encode
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

TEMPLATES = Path(__file__).parent / "templates"


def address(kind: str, picture: bytes) -> str:
    """Return a picture as a ``data:`` address; `kind` is ``png``, ``webp`` or ``svg+xml``."""
    return f"data:image/{kind};base64,{b64encode(picture).decode('ascii')}"


def svg_address(svg: str) -> str:
    """Return a drawing as a ``data:`` address."""
    return address("svg+xml", svg.encode())


def own_file(name: str) -> Markup:
    """Return a style or script of this package; it goes into a page unescaped, because users can't change it."""
    return Markup((TEMPLATES / name).read_text(encoding="utf-8"))


def write_out(name: str, **values: object) -> str:
    """Return a template filled with values and the style of all pages; a name without a value raises an error."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name).render(**{"style": own_file("report.css"), **values})
