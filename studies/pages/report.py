"""Make the report of a sweep: one self-contained HTML page from values and pictures, which the caller writes to a file.

The page's policy allows only its own script, whose hash is part of the policy. It allows no fetch, except of picture
files beside the page if the page itself leaves some pictures out. Values reach the page only through Jinja's escaping
(text) and ``tojson`` (the script's data block).
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from math import isfinite
from typing import Any

import numpy as np
from markupsafe import Markup

from render.spectrum import VISIBLE_NM
from studies.metrics.metric import HEADLINE, MEANINGS, METRICS, SEEN_BY, Metric
from studies.pages import report_text as text
from studies.pages.page import address, own_file, svg_address, write_out
from studies.pages.plots import SNR, snr_svg
from studies.pages.report_compare import (
    CAMERA,
    axes_of,
    comparisons,
    first_comparison,
    grid,
    group_titles,
    shown_metrics,
)
from studies.pages.report_data import ReportCell, ReportData, ReportLevel, ReportRender
from studies.pages.report_pictures import ReportPictures
from studies.study.render_noise import MOST_SHARE, noise_note

# Scripts that the page joins into one, in this order.
SCRIPTS = ("report_numbers.js", "report_colour.js", "report_charts.js", "report_viewer.js", "report.js")
IN_LUX, IN_CD_M2 = ("lux", "illuminance, lux"), ("x", "scene luminance, cd/m²")  # key and title of light's axis
SEEN_DB = 22.0  # PSNR from which on a picture shows more scene than noise


def balance_text(balance: Mapping[str, str]) -> str:
    """Say which channels Gray World balanced, and which fell back to calibrated gains."""
    fallen = [channel for channel, how in balance.items() if how == "calibrated"]
    if not fallen:
        return ", ".join(sorted(set(balance.values()))) or text.MISSING
    return "calibrated gains" if len(fallen) == len(balance) else f"calibrated for {', '.join(fallen)}"


def cell_view(cell: ReportCell, level: ReportLevel, group: str) -> dict[str, Any]:
    """Return what the page shows beside one picture: texts, and of each figure a mean and an interval.

    The mean is over seeds; the second number is half the width of its 95 % interval, None if it isn't known.
    """
    row = cell.first
    share = cell.mean("mc_share")
    electrons = json.loads(row.mean_electrons) if row else {}
    return {
        "x": cell.luminance_cd_m2,
        "lux": cell.illuminance_lux,
        "figures": {
            metric.key: [float(f"{mean:.7g}"), float(f"{half:.4g}") if isfinite(half) else None]
            for metric in METRICS
            if isfinite(mean := cell.mean(metric.key))
            for half in [cell.half(metric.key)]
        },
        "exposure": text.duration_text(row.exposure_s if row else None),
        "saturated": text.percent(cell.mean("saturated")),
        "substitution": "" if cell.substitution is None else text.substitution_text(cell.substitution),
        "balance": balance_text(cell.balance),
        "mc_share": text.percent(share),
        "over": share > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration_text(row.capture_s if row else None),
        "develop": text.duration_text(row.develop_s if row else None),
        "file": f"pictures/{row.picture}" if row else "",
        "alt": f"{text.camera_name(cell.camera)} picture, {level.name}, {group}",
    }


def level_view(level: ReportLevel, cell: ReportCell) -> dict[str, str]:
    """Return the texts about a light level; its light is that of `cell`."""
    luminance = text.significant(cell.luminance_cd_m2, "cd/m²")
    lux = text.significant(cell.illuminance_lux, "lux")
    words = [luminance, f"{lux} on the scene's reference plane"]
    levels = [word for word, value in zip(words, (luminance, lux), strict=True) if value not in (level.name, "—")]
    return {
        "name": level.name,
        "light": " · ".join(levels),
        "source": level.source,
        "spoken": ", ".join([level.name, *levels]),
    }


@dataclass(frozen=True)
class GroupView:
    """A group of cells as the page shows it: its title, the indices of its first cell and of its truth, its metrics."""

    title: str
    first: int
    truth: int
    metrics: list[Metric]
    cells: tuple[ReportCell, ...]


def group_views(report: ReportData) -> list[GroupView]:
    """Return the groups in the order of the cells."""
    groups = report.by_group
    titled = zip(group_titles(report, CAMERA), groups, strict=True)
    return [
        GroupView(
            title or text.plain_name(report.sensors[0].name),
            index * len(cells),
            index * len(report.truths) // len(groups),
            shown_metrics(cells),
            cells,
        )
        for index, (title, cells) in enumerate(titled)
    ]


def viewer_data(report: ReportData, groups: Sequence[GroupView]) -> dict[str, Any]:
    """Return the data of the page's script: axes, the first comparison, and all cells in the order of the axes."""
    of = first_comparison(report)
    per_view = len(report.cells) // len(report.truths)
    levels = []
    for index in range(len(report.truths)):
        first = report.cells[index * per_view :: len(report.cameras)]
        levels.append([level_view(*pair) for pair in zip(report.levels, first, strict=False)])
    in_lux = all(level.name.endswith("lux") for level in report.levels)
    return {
        "light": dict(zip(("key", "name"), IN_LUX if in_lux else IN_CD_M2, strict=True)),
        "axes": [vars(axis) for axis in axes_of(report)],
        "first": vars(of) | {"level": seen_level(report), "look": report.looked_at},
        "references": [reference_name(render) for render in report.renders],
        "groups": [group_titles(report, axis) for axis in range(len(axes_of(report)))],
        "comparisons": comparisons(report),
        "sizes": [[scene.height, scene.width] for scene in report.scenes],
        "metrics": [vars(metric) for metric in shown_metrics(report.cells)],
        "levels": levels,
        "cells": [cell_view(cell, report.levels[cell.level], group.title) for group in groups for cell in group.cells],
    }


def single_group(report: ReportData) -> str:
    """Describe a study in which there is nothing to compare: its PSNR at the first and the last level."""
    cells = [cell for cell in report.by_group[0] if isfinite(cell.mean("psnr_db"))]
    ends = [
        f"{text.figure_text(cell, 'psnr_db', 1, 'dB')} at {report.levels[cell.level].name}"
        for cell in ([cells[0], cells[-1]] if len(cells) > 1 else cells)
    ]
    return f"Nothing to compare: one camera, sensor and exposure. PSNR {' to '.join(ends) or 'unknown'}."


def seen_level(report: ReportData) -> int:
    """Return the darkest level at which some camera's picture in the first group shows more scene than noise."""
    for cell in report.by_group[0]:
        if cell.mean("psnr_db") >= SEEN_DB:
            return cell.level
    return len(report.levels) - 1


def reference_name(render: ReportRender) -> str:
    """Return the name of the picture that all others are measured against.

    It states the render's samples, because that picture has noise of its own.
    """
    return "Reference" + (f", {text.significant(render.spp)} samples" if render.spp else "")


def known_shares(report: ReportData) -> list[tuple[float, int]]:
    """Return the known Monte Carlo variances over the sensor's own, the largest first, each with its cell's index."""
    shares = [(cell.mean("mc_share"), place) for place, cell in enumerate(report.cells)]
    return sorted((pair for pair in shares if isfinite(pair[0])), key=lambda pair: -pair[0])


def place_name(report: ReportData, groups: Sequence[GroupView], place: int) -> str:
    """Return the level, group and camera of a cell in words."""
    cell = report.cells[place]
    group = groups[place // len(groups[0].cells)]
    return f"{report.levels[cell.level].name}, {group.title}, {text.camera_name(cell.camera)}"


def render_warning(report: ReportData, groups: Sequence[GroupView]) -> str:
    """Say in which cell the render's noise shows most beside the sensor's; return an empty text if it shows in none."""
    shares = known_shares(report)
    over = sum(share >= 1 for share, _ in shares)
    if not over:
        return ""
    share, place = shares[0]
    first = report.cells[place].first
    note = noise_note(share, first.spp if first else 0)
    where = place_name(report, groups, place)
    return f"T{note[1:]} ({where}; above the sensor's in {over} of {len(report.cells)} pictures)."


def budget_share(report: ReportData) -> float | None:
    """Return the largest share of the noise variance that a plan predicts for all its approximations."""
    shares = (cell.first.budget_share for cell in report.cells if cell.first)
    return max((share for share in shares if share is not None), default=None)


def speed_rows(report: ReportData) -> list[tuple[str, str, float, float]]:
    """Return each camera and sensor with the mean seconds of capture and of development; first calls don't count.

    A time is NaN if a picture isn't made yet, or if there were only first calls.
    """
    cells = grid(report)
    rows = []
    for sensor, camera in product(range(len(report.sensors)), range(len(report.cameras))):
        firsts = [cell.first for cell in cells[:, :, sensor, ..., camera].ravel()]
        steps = [(first.capture_s, first.develop_s) if first else (np.nan, np.nan) for first in firsts]
        known = ([step for step in of if step is not None] for of in zip(*steps, strict=True))
        capture_s, develop_s = (float(np.mean(of)) if of else np.nan for of in known)
        rows.append(
            (
                text.camera_name(report.cameras[camera]),
                text.plain_name(report.sensors[sensor].name),
                capture_s,
                develop_s,
            )
        )
    return rows


def render_report(report: ReportData, pictures: ReportPictures) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    report : ReportData
    pictures : ReportPictures
        Pictures by the names that cells and truths have for them.

    Returns
    -------
    str
        HTML that may fetch nothing, except picture files beside it if it leaves some pictures out.
    """
    # What several parts of the page show.
    groups = group_views(report)
    of = first_comparison(report)
    data = viewer_data(report, groups)
    shares = known_shares(report)
    per_scene = len(report.cells) // len(report.scenes)
    addresses = {name: address("webp", content) for name, content in pictures.files.items()}
    errors = {name: address("webp", content) for name, content in pictures.flip_maps.items()}
    data["flip"] = [errors.get(cell.picture or "", "") for cell in report.cells]
    script = "".join(own_file(name) for name in SCRIPTS)
    # The page.
    return write_out(
        "report.html.j2",
        script=Markup(script),
        digest=b64encode(sha256(script.encode()).digest()).decode("ascii"),
        fetched="" if all(cell.picture or not cell.first for cell in report.cells) else " 'self' file:",
        report=report,
        data=data,
        of=of,
        groups=groups,
        varying=sum(len(axis.values) > 1 for axis in axes_of(report)),
        metrics=shown_metrics(report.cells),
        headline=HEADLINE,
        said_by=MEANINGS,
        seen_by=SEEN_BY,
        alone=single_group(report),
        answer=data["comparisons"][of.compared]["answers"].get(f"{of.a} {of.b}", [None])[0],
        warning=render_warning(report, groups),
        sources=[addresses[cell.picture] if cell.picture else "" for cell in report.cells],
        truths=[addresses[name] if name else "" for name in report.truths],
        largest=(shares[0][0], place_name(report, groups, shares[0][1])) if shares else None,
        scene_shares=[
            max((share for share, place in shares if place // per_scene == scene), default=None)
            for scene in range(len(report.scenes))
        ],
        budget_share=budget_share(report),
        aim=MOST_SHARE,
        meanings=[text.BALANCE_MEANINGS.get(balance, balance) for balance in report.balances],
        speed=speed_rows(report),
        stages=sorted(report.stages.items(), key=lambda stage: -stage[1]),
        # Effect and cost, which `sensor.optics.left_out` separates by a colon.
        left_out=[line.partition(": ")[::2] for line in report.left_out],
        snr=_snr_address(report),
        text=text,
    )


def _snr_address(report: ReportData) -> str:
    """Plot the sensors' SNR over the level of D65 in 33 ms; return a ``data:`` address, or an empty text for no sensor.

    Sensors whose window reaches beyond 380-780 nm are left out, because the plot's light ends there.
    """
    sensors = {
        sensor.name: sensor.config
        for sensor in report.sensors
        if sensor.config and VISIBLE_NM[0] <= sensor.config.window_nm[0] and sensor.config.window_nm[1] <= VISIBLE_NM[1]
    }
    return svg_address(snr_svg(sensors, "D65", 0.033, SNR)) if sensors else ""
