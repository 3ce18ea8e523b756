"""The report of a sweep: one self-contained HTML page from values and pictures. Pure: the caller writes it.

The page's policy refuses every fetch and every script but its own, whose hash stands in the policy. Values reach the
page only through Jinja's escaping (text) and ``tojson`` (the script's data block).
"""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from studies.budget.budget import MOST_SHARE, OF_PIXELS
from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.report_charts import SHARE, group_charts, shown_metrics, speed_charts, speed_rows
from studies.pages.report_data import ReportData
from studies.pages.report_view import (
    AT_FIRST,
    FURTHER_ROWS,
    budget_share,
    finding_rows,
    known_shares,
    leads,
    titles,
    viewer_data,
)


def page_view(report: ReportData, pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the template's variables."""
    data = viewer_data(report)
    metrics = shown_metrics(report.cells)
    speed = speed_rows(report)
    view_names = text.view_names([scene.name for scene in report.scenes], report.spectra)
    per_view, per_cells = len(data["groups"]) // len(view_names), len(report.cells) // len(view_names)
    addresses = {name: address("png", picture) for name, picture in pictures.items()}
    return {
        "report": report,
        "data": data,
        "cells": list(zip(report.cells, data["cells"], strict=True)),
        "sources": [addresses[cell.picture] if cell.picture else "" for cell in report.cells],
        "truths": [addresses[name] if name else "" for name in report.truths],
        "titles": titles(report.cameras),
        "metrics": metrics,
        "on_targets": [metric.key for metric in text.ON_TARGETS],
        "at_first": AT_FIRST,
        "rows": [(metric.key, metric.name) for metric in metrics] + list(FURTHER_ROWS),
        "leads": leads(report),
        "findings": [finding_rows(report, cells) for cells in report.by_group],
        "shares": known_shares(report.cells),
        "scene_shares": [known_shares(cells) for cells in report.by_scene],
        "budget_share": budget_share(report),
        "aim": MOST_SHARE,
        "of_pixels": OF_PIXELS,
        "groups": data["groups"],
        # Each scene under each spectrum: its title, the places of its groups, what names them within it, what is known.
        "views": [
            {
                "name": name,
                "groups": list(range(place * per_view, (place + 1) * per_view)),
                "titles": text.group_names([sensor.name for sensor in report.sensors], report.exposures),
                "metrics": shown_metrics(report.cells[place * per_cells : (place + 1) * per_cells]),
            }
            for place, name in enumerate(view_names)
        ],
        # One row of charts for each group; empty where no cell has all of its seeds yet.
        "charts": list(zip(*(group_charts(report, metric) for metric in metrics), strict=True))
        or [()] * len(data["groups"]),
        "share_charts": group_charts(report, SHARE),
        "speed": speed,
        "speed_charts": speed_charts(speed),
        # Effect and cost, as `sensor.optics.left_out` parts them.
        "left_out": [line.partition(": ")[::2] for line in report.left_out],
        "text": text,
    }


def render_report(report: ReportData, pictures: Mapping[str, bytes]) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    report : ReportData
    pictures : mapping of str to bytes
        PNG files by the names that cells and truths have for them.

    Returns
    -------
    str
        HTML that needs no other file and may fetch none.
    """
    script = own_file("report.js")
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    return write_out(
        "report.html.j2", **page_view(report, pictures), style=own_file("report.css"), script=script, digest=digest
    )
