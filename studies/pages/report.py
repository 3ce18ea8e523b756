"""The report of a demo or a sweep: one self-contained HTML page from results and pictures. Pure: the caller writes it.

The page's policy refuses every fetch and every script but its own, whose hash stands in the policy. Results reach the
page only through Jinja's escaping (text) and ``tojson`` (the script's data block).
"""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from rodcone.errors import InputError
from studies.budget.budget import MOST_SHARE
from studies.pages import report_text as text
from studies.pages.report_cells import (
    exposure_name,
    exposures,
    group_names,
    groups,
    ordered_cells,
    scenes,
    seeds,
    view_names,
    views,
)
from studies.pages.report_charts import group_charts, shown_metrics, speed_charts, speed_rows
from studies.pages.report_view import FURTHER_ROWS, render_rows, stage_rows, summary, titles, viewer_data

TEMPLATES = Path(__file__).parent / "templates"
TRUTH = "truth"
KEYS = (
    "rodcone", "seed", "scene", "size", "environment", "render", "exposure_rule", "display_white",
    "levels", "sensors", "cameras", "cells", "stages", "left_out", "notes",
)  # fmt: skip
AT_FIRST = (text.PSNR, text.SSIM, text.DELTA_E)  # the charts shown before others are asked for


def data_uri(name: str, picture: bytes) -> str:
    """Return `picture` as a ``data:`` address; its type comes from its first bytes."""
    if picture.startswith(b"\x89PNG\r\n\x1a\n"):
        kind = "png"
    elif picture[:4] == b"RIFF" and picture[8:12] == b"WEBP":
        kind = "webp"
    elif picture.startswith(b"<svg"):
        kind = "svg+xml"
    else:
        raise InputError(f"picture {name!r}: starts with {picture[:8]!r}; allowed: PNG, WebP; encode it as one of them")
    return f"data:image/{kind};base64,{b64encode(picture).decode('ascii')}"


def _picture(pictures: Mapping[str, bytes], name: str | None) -> str:
    """Address of a picture; empty for one that is left out of the page."""
    if name is None:
        return ""
    if name not in pictures:
        raise InputError(
            f"picture {name!r} is missing; give PNG or WebP bytes for each cell's picture and for {TRUTH!r}"
        )
    return data_uri(name, pictures[name])


def page_view(results: Mapping[str, Any], pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the template's variables."""
    cells = ordered_cells(results)
    data = viewer_data(results, cells)
    data["exposures"] = [exposure_name(time) for time in exposures(results)]
    metrics = shown_metrics(cells)
    share = text.Metric("mc_share", "Monte Carlo share", 1, "", higher=False)
    aim = (MOST_SHARE, f"aim {text.percent(MOST_SHARE)}")
    speed = speed_rows(results, cells)
    none_known = [()] * len(groups(results))  # of a sweep in which no cell has all of its seeds yet
    per_view, per_cells = len(groups(results)) // len(views(results)), len(cells) // len(views(results))
    return {
        "results": results,
        "name": results.get("name", results["scene"]),
        "data": data,
        "cells": list(zip(cells, data["cells"], strict=True)),
        "sources": [_picture(pictures, cell["picture"]) for cell in cells],
        "truths": [_picture(pictures, name) for name in results.get("truths", [TRUTH])],
        "titles": titles(results["cameras"]),
        "metrics": metrics,
        "on_targets": [metric.key for metric in text.ON_TARGETS],
        "at_first": [metric.key for metric in AT_FIRST],
        "rows": [(metric.key, metric.name) for metric in metrics] + list(FURTHER_ROWS),
        "summary": summary(results, cells),
        "groups": data["groups"],
        # Each scene under each spectrum: its title, the places of its groups, what names them within it, what is known.
        "views": [
            {
                "name": name,
                "groups": list(range(place * per_view, (place + 1) * per_view)),
                "titles": group_names(results),
                "metrics": shown_metrics(cells[place * per_cells : (place + 1) * per_cells]),
            }
            for place, name in enumerate(view_names(results))
        ],
        # One row of charts for each group.
        "charts": list(zip(*(group_charts(results, cells, metric) for metric in metrics), strict=True)) or none_known,
        "share_charts": group_charts(results, cells, share, log_y=True, percent=True, rule=aim),
        "speed": speed,
        "speed_charts": speed_charts(speed),
        "renders": render_rows(results, cells),
        # Effect and cost, as `sensor.left_out.left_out` parts them.
        "left_out": [line.partition(": ")[::2] for line in results["left_out"]],
        "scenes": scenes(results),
        "configuration": list(results.get("configuration", {}).items()),
        "seeds": seeds(results),
        "stages": stage_rows(results["stages"]),
        "total": text.duration(sum(stage["seconds"] or 0.0 for stage in results["stages"])),
        "text": text,
    }


def render_report(results: Mapping[str, Any], pictures: Mapping[str, bytes]) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    results : mapping
        What ``results.json`` holds: configuration, levels, sensors, cameras, one cell for each of their combinations.
        Where there are several scenes, spectra or exposures, ``scenes`` (name and size), ``spectra`` and ``exposures``
        (``auto``, or a time such as ``10ms``) name them, each cell its own in ``scene``, ``spectrum``, ``exposure``,
        and ``truths`` the truth's picture of each scene under each spectrum. Cells may name a ``seed``; with several,
        numbers are means with 95 % intervals and pictures are the first seed's. A cell's ``picture`` is None where the
        page leaves it out; ``name`` is the study's.
    pictures : mapping of str to bytes
        PNG or WebP files by each cell's ``picture``, and ``"truth"``.

    Returns
    -------
    str
        HTML that needs no other file and may fetch none.
    """
    for key in KEYS:
        if key not in results:
            raise InputError(f"results: {key!r} is missing; needed: {', '.join(KEYS)}")
    style = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    script = (TEMPLATES / "report.js").read_text(encoding="utf-8")
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("report.html.j2")
    # The style and the script are files of this package, never input.
    return page.render(page_view(results, pictures), style=Markup(style), script=Markup(script), digest=digest)
