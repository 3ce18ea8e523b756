"""Drawings of a few kinds of marks, written as SVG for the page and as PNG: pictures, text, lines and boxes."""

from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TypeAlias

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont, ImageOps

from studies.pages.charts import Point, line_path
from studies.photograph.png import to_png

TEMPLATES = Path(__file__).parent / "templates"
PNG_SCALE = 2  # PNG pixels a unit of the drawing
MARGIN = 10  # around a drawing that is a file alone
# Colours of the PNG, which is on white; the SVG takes them from paper_drawing.css, where dark mode has others.
_COLOURS = {
    "ink": "#1d2125", "soft": "#565d64", "tile": "#1d2125", "grid": "#d9dad5", "axis": "#b4b7b3",
    "0": "#0068a8", "1": "#b34700", "2": "#00795a", "3": "#8d4a78",
}  # fmt: skip
# Pillow's own font has Latin letters alone; the SVG writes the signs themselves.
_PLAIN = str.maketrans({"µ": "u", "²": "^2", "×": "x", "√": "root", "−": "-", "⁻": "-", "\u202f": " ", "\xa0": " "})


@dataclass(frozen=True)
class Picture:
    """Encoded sRGB (h, w, 3) in [0, 1] at a place; its pixels stay squares."""

    x: float
    y: float
    width: float
    height: float
    pixels: NDArray[np.float64]

    @property
    def address(self) -> str:
        """The picture as PNG in a ``data:`` address."""
        return f"data:image/png;base64,{b64encode(to_png(self.pixels)).decode('ascii')}"


@dataclass(frozen=True)
class Text:
    """Words at a place; `anchor` is start, middle or end, `colour` ink, soft, or 0 to 3."""

    x: float
    y: float
    words: str
    anchor: str = "start"
    colour: str = "ink"
    bold: bool = False


@dataclass(frozen=True)
class Line:
    """A line through points; `colour` ink, grid, axis, or 0 to 3."""

    points: tuple[tuple[float, float], ...]
    colour: str = "ink"
    dashed: bool = False

    @property
    def path(self) -> str:
        """Path of the SVG."""
        return line_path([Point(x, y, "") for x, y in self.points])


@dataclass(frozen=True)
class Box:
    """A rectangle: its outline in `colour`, filled with `fill`, a colour as CSS writes it, where given."""

    x: float
    y: float
    width: float
    height: float
    colour: str = "ink"
    fill: str = "none"


Mark: TypeAlias = Picture | Text | Line | Box


@dataclass(frozen=True)
class Drawing:
    """Marks on a sheet, later ones on top; `title` and `description` are what a screen reader says."""

    width: float
    height: float
    title: str
    description: str
    marks: tuple[Mark, ...]


def to_svg(drawing: Drawing, *, alone: bool = True) -> str:
    """Write a drawing as SVG.

    Parameters
    ----------
    alone : bool
        As a file with its own style; otherwise as part of a page that has `drawing_style`.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    marks = [(type(mark).__name__, mark) for mark in drawing.marks]
    style = Markup(drawing_style()) if alone else ""  # a file of this package, never input
    return environment.get_template("paper_drawing.svg.j2").render(
        drawing=drawing, marks=marks, style=style, margin=MARGIN if alone else 0
    )


def drawing_style() -> str:
    """Style that every drawing of a page shares."""
    return (TEMPLATES / "paper_drawing.css").read_text(encoding="utf-8")


def to_picture(drawing: Drawing) -> bytes:
    """Write a drawing as PNG on white, `PNG_SCALE` pixels a unit."""
    sheet = Image.new("RGB", (round(drawing.width * PNG_SCALE), round(drawing.height * PNG_SCALE)), "white")
    pen = ImageDraw.Draw(sheet)
    for mark in drawing.marks:
        _put(sheet, pen, mark)
    sheet = ImageOps.expand(sheet, MARGIN * PNG_SCALE, "white")
    buffer = BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _put(sheet: Image.Image, pen: ImageDraw.ImageDraw, mark: Mark) -> None:
    scale = PNG_SCALE
    if isinstance(mark, Picture):
        pixels = Image.fromarray(np.rint(mark.pixels * 255).astype(np.uint8))
        size = round(mark.width * scale), round(mark.height * scale)
        sheet.paste(pixels.resize(size, Image.Resampling.NEAREST), (round(mark.x * scale), round(mark.y * scale)))
    elif isinstance(mark, Text):
        font = ImageFont.load_default(12 * scale)
        anchor = {"start": "ls", "middle": "ms", "end": "rs"}[mark.anchor]
        place, words = (mark.x * scale, mark.y * scale), mark.words.translate(_PLAIN)
        pen.text(place, words, _COLOURS[mark.colour], font, anchor, stroke_width=int(mark.bold) * scale / 4)
    elif isinstance(mark, Line):
        width = scale if mark.colour in ("grid", "axis") else 2 * scale
        points = [(x * scale, y * scale) for x, y in mark.points]
        for piece in _dashes(points) if mark.dashed else [points]:
            pen.line(piece, _COLOURS[mark.colour], width)
    else:
        corners = [mark.x * scale, mark.y * scale, (mark.x + mark.width) * scale, (mark.y + mark.height) * scale]
        fill = None if mark.fill == "none" else mark.fill
        pen.rectangle(corners, fill, _COLOURS[mark.colour], scale)


_Place: TypeAlias = tuple[float, float]


def _dashes(points: list[_Place], dash: float = 6.0 * PNG_SCALE) -> list[list[_Place]]:
    """Every second piece of a line, each `dash` long."""
    places = np.array(points)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    starts = np.arange(0.0, along[-1], 2 * dash)
    ends = np.minimum(starts + dash, along[-1])

    def at(distance: float) -> _Place:
        return float(np.interp(distance, along, places[:, 0])), float(np.interp(distance, along, places[:, 1]))

    return [[at(start), at(end)] for start, end in zip(starts, ends, strict=True)]
