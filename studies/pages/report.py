"""The report of a sweep: one self-contained HTML page from values and pictures. Pure: the caller writes it.

The page's policy refuses every fetch, but of pictures beside it where it leaves some out, and every script but its own,
whose hash stands in the policy. Values reach the page only through Jinja's escaping (text) and ``tojson`` (the script's
data block).
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import isfinite
from typing import Any

from markupsafe import Markup

from studies.budget.budget import MOST_SHARE
from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.report_compare import (
    CAMERA,
    OUTCOMES,
    UNKNOWN,
    WHITE_PIXEL,
    Comparison,
    axes_of,
    best,
    counts,
    first_comparison,
    student_t,
    verdicts,
)
from studies.pages.report_data import ReportCell, ReportData, ReportLevel
from studies.pages.report_pictures import ReportPictures
from studies.pages.report_speed import speed_rows
from studies.pages.snr_chart import snr_over_light

# One script, in this order.
SCRIPTS = ("report_numbers.js", "report_colour.js", "report_charts.js", "report_viewer.js", "report.js")
SEEN_DB = 22.0  # PSNR from which on a picture shows what is in it
MOST_NAMED = 3  # cameras in a title


def balance_text(balance: Mapping[str, str]) -> str:
    """Say which channels Gray World balanced, and which fell back."""
    fallen = [channel for channel, how in balance.items() if how == "calibrated"]
    if not fallen:
        return ", ".join(sorted(set(balance.values()))) or text.MISSING
    return "calibrated gains" if len(fallen) == len(balance) else f"calibrated for {', '.join(fallen)}"


def cell_view(cell: ReportCell, level: ReportLevel) -> dict[str, Any]:
    """Return what the page says of one picture, as text, and its figures of every seed, as numbers."""
    row, share = cell.first, cell.figures["mc_share"]
    electrons = json.loads(row.mean_electrons) if row else {}
    return {
        "x": cell.luminance_cd_m2,
        "values": {metric.key: cell.by_seed[metric.key] for metric in text.METRICS if metric.key in cell.by_seed},
        "exposure": text.duration(row.exposure_s if row else None),
        "saturated": text.percent(cell.figures["saturated"]),
        "substitution": text.substitution_text(cell.substitution),
        "balance": balance_text(cell.balance),
        "mc_share": text.percent(share),
        "over": share is not None and share > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration(row.capture_s if row else None),
        "develop": text.duration(row.develop_s if row else None),
        "file": f"pictures/{row.picture}" if row else "",
        "alt": f"{text.camera_name(cell.camera)} picture, {level.name}, {cell.group}",
    }


def level_view(level: ReportLevel, cell: ReportCell) -> dict[str, str]:
    """Return a light level's texts, its light being that of a cell."""
    luminance = text.significant(cell.luminance_cd_m2, "cd/m²")
    lux = text.significant(cell.illuminance_lux, "lux")
    words = [luminance, f"{lux} on the scene's reference plane"]
    known = [said for said, value in zip(words, (luminance, lux), strict=True) if value not in (level.name, "—")]
    return {
        "name": level.name,
        "light": " · ".join(known),
        "source": level.source,
        "spoken": ", ".join([level.name, *known]),
    }


def viewer_data(report: ReportData) -> dict[str, Any]:
    """Return what the page's script reads: axes, what is compared at first, and all cells in the order of the axes."""
    of, per_view = first_comparison(report), len(report.cells) // len(report.truths)
    levels = []
    for index in range(len(report.truths)):
        first = report.cells[index * per_view :: len(report.cameras)]
        levels.append([level_view(*pair) for pair in zip(report.levels, first, strict=False)])
    return {
        "axes": [vars(axis) for axis in axes_of(report)],
        "first": vars(of) | {"level": seen_level(report), "look": report.looked_at},
        "sizes": [[scene.height, scene.width] for scene in report.scenes],
        "metrics": [vars(metric) for metric in shown_metrics(report.cells)],
        "t": student_t(len(report.seeds)),
        "levels": levels,
        "cells": [cell_view(cell, report.levels[cell.level]) for cell in report.cells],
    }


def seen_level(report: ReportData) -> int:
    """Return the darkest level at which some camera's picture, of the first group, shows more scene than noise."""
    for cell in report.by_group[0]:
        if (cell.figures["psnr_db"] or 0.0) >= SEEN_DB:
            return cell.level
    return len(report.levels) - 1


def shown_metrics(cells: Sequence[ReportCell]) -> list[text.Metric]:
    """Return the metrics that are known for some cell: those of targets are so on their own scene alone."""
    return [metric for metric in text.METRICS if any(cell.figures[metric.key] is not None for cell in cells)]


def summary(report: ReportData, of: Comparison) -> dict[str, Any]:
    """Return what the page says first: verdicts by metric and light, one table a row, and counts over everything."""
    axes, metrics = axes_of(report), shown_metrics(report.cells)
    counted = [counts(report, of, metric) for metric in metrics]
    values = axes[of.compared].values
    return {
        "a": values[of.a],
        "b": values[of.b],
        "rows": [
            (name, [(metric, verdicts(report, of, metric, row)) for metric in metrics])
            for row, name in enumerate(axes[of.rows].values)
        ],
        "head": axes[of.along].values,
        "conditions": len(report.cells) // len(values),
        "counts": list(zip(metrics, counted, strict=True)),
        "total": {outcome: sum(found[outcome] for found in counted) for outcome in (*OUTCOMES, UNKNOWN)},
    }


def known_shares(cells: Sequence[ReportCell]) -> list[tuple[float, ReportCell]]:
    """Return the cells whose Monte Carlo share is known, the largest first."""
    known = [(share, cell) for cell in cells if (share := cell.figures["mc_share"]) is not None and isfinite(share)]
    return sorted(known, key=lambda pair: -pair[0])


def budget_share(report: ReportData) -> float | None:
    """Return the largest share of the noise variance that a plan predicts for all its approximations."""
    shares = (cell.first.budget_share for cell in report.cells if cell.first)
    return max((share for share in shares if share is not None), default=None)


def titles(report: ReportData) -> list[str]:
    """Return what is compared as the title names it: each, or how many they are."""
    compared = axes_of(report)[first_comparison(report).compared]
    if len(compared.values) > MOST_NAMED:
        return [f"{len(compared.values)} {compared.name.lower()}s"]
    cameras = compared.name == "Camera"
    return (
        [text.CAMERA_TITLES.get(camera, text.camera_name(camera)) for camera in report.cameras]
        if cameras
        else list(compared.values)
    )


def render_report(report: ReportData, pictures: ReportPictures) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    report : ReportData
    pictures : ReportPictures
        By the names that cells and truths have for them.

    Returns
    -------
    str
        HTML that may fetch nothing but the pictures beside it, and these only where it leaves some out.
    """
    # What several parts of the page show
    data, of = viewer_data(report), first_comparison(report)
    metrics = shown_metrics(report.cells)
    leading = {metric.key: best(report, metric) for metric in metrics}
    view_names = text.view_names([scene.name for scene in report.scenes], report.spectra)
    per_view, per_cells = len(report.by_group) // len(view_names), len(report.cells) // len(view_names)
    addresses = {name: address(_kind(content), content) for name, content in pictures.files.items()}
    errors = {name: address(_kind(content), content) for name, content in pictures.flip_maps.items()}
    data["flip"] = [errors.get(cell.picture or "", "") for cell in report.cells]
    script = "".join(own_file(name) for name in SCRIPTS)
    # The page
    return write_out(
        "report.html.j2",
        style=own_file("report.css"),
        script=Markup(script),
        digest=b64encode(sha256(script.encode()).digest()).decode("ascii"),
        fetched="" if all(cell.picture or not cell.first for cell in report.cells) else " 'self' file:",
        report=report,
        data=data,
        of=of,
        varying=sum(len(axis.values) > 1 for axis in axes_of(report)),
        summary=summary(report, of),
        white_pixel=of.compared == CAMERA and (report.cameras[of.a], report.cameras[of.b]) == WHITE_PIXEL,
        cells=list(zip(report.cells, data["cells"], strict=True)),
        leading=leading,
        sources=[addresses[cell.picture] if cell.picture else "" for cell in report.cells],
        truths=[addresses[name] if name else "" for name in report.truths],
        titles=titles(report),
        shares=known_shares(report.cells),
        scene_shares=[known_shares(cells) for cells in report.by_scene],
        budget_share=budget_share(report),
        aim=MOST_SHARE,
        groups=[cells[0].group for cells in report.by_group],
        # Each scene under each spectrum: its title, its groups' indices, their titles within it, its known metrics.
        views=[
            {
                "name": name,
                "groups": list(range(index * per_view, (index + 1) * per_view)),
                "titles": text.group_names(
                    [text.plain_name(sensor.name) for sensor in report.sensors], report.exposures
                ),
                "metrics": shown_metrics(report.cells[index * per_cells : (index + 1) * per_cells]),
                "scene": report.scenes[index // len(report.spectra)],
            }
            for index, name in enumerate(view_names)
        ],
        speed=speed_rows(report),
        stages=sorted(report.stages.items(), key=lambda stage: -stage[1]),
        # Effect and cost, as `sensor.optics.left_out` parts them.
        left_out=[line.partition(": ")[::2] for line in report.left_out],
        snr=snr_over_light({each.name: each.config for each in report.sensors if each.config}),
        text=text,
    )


def _kind(content: bytes) -> str:
    """Kind of a picture by its first bytes, for its address."""
    return "png" if content.startswith(b"\x89PNG") else "webp"
