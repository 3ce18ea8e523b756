"""The report of a sweep: one self-contained HTML page from values and pictures. Pure: the caller writes it.

The page's policy refuses every fetch and every script but its own, whose hash stands in the policy. Values reach the
page only through Jinja's escaping (text) and ``tojson`` (the script's data block).
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from itertools import product
from math import isfinite
from typing import Any

from studies.budget.budget import MOST_SHARE, OF_PIXELS
from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.report_charts import SHARE, group_charts, shown_metrics, speed_charts, speed_rows
from studies.pages.report_data import ReportCell, ReportData, ReportLevel
from studies.pages.snr_table import snr_over_light

# What stands beneath each picture beside the metrics, in this order: key of the cell's view, label.
FURTHER_ROWS = (
    ("exposure", "Exposure"),
    ("saturated", "Saturated"),
    ("substitution", "Substitution"),
    ("balance", "White balance"),
)
AT_FIRST = (text.PSNR, text.SSIM, text.DELTA_E)  # the metrics shown before others are asked for
MOST_NAMED = 3  # cameras in a title


def balance_text(balance: Mapping[str, str]) -> str:
    """Say which channels Gray World balanced, and which fell back."""
    fallen = [channel for channel, how in balance.items() if how == "calibrated"]
    if not fallen:
        return ", ".join(sorted(set(balance.values()))) or text.MISSING
    return "calibrated gains" if len(fallen) == len(balance) else f"calibrated for {', '.join(fallen)}"


def cell_view(cell: ReportCell, level: ReportLevel, rivals: Sequence[ReportCell]) -> dict[str, Any]:
    """Return everything the page says about one cell, as text; `best` names the metrics in which it leads `rivals`."""
    row, share = cell.first, cell.figures["mc_share"]
    electrons = json.loads(row.mean_electrons) if row else {}
    return {
        **{metric.key: text.metric_text(metric, cell) for metric in text.METRICS},
        "snr_db": text.interval_text(cell, "snr_db", 1, "dB"),
        "exposure": text.duration(row.exposure_s if row else None),
        "saturated": text.percent(cell.figures["saturated"]),
        "substitution": text.substitution_text(cell.substitution),
        "balance": balance_text(cell.balance),
        "mc_share": text.percent(share),
        "over": share is not None and share > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration(row.capture_s if row else None),
        "develop": text.duration(row.develop_s if row else None),
        "best": [metric.key for metric in text.METRICS if text.leader(metric, rivals)[0] is cell],
        "file": f"pictures/{row.picture}" if row else "",
        "alt": f"{text.camera_name(cell.camera)} picture, {level.name}, {cell.group}",
    }


def level_view(level: ReportLevel, cell: ReportCell) -> dict[str, str]:
    """Return a light level's texts, its light being that of a cell."""
    luminance = text.significant(cell.luminance_cd_m2, "cd/m²")
    lux = text.significant(cell.illuminance_lux, "lux")
    light = [words for words in (luminance, lux) if words not in (level.name, text.MISSING)]
    return {
        "name": level.name,
        "light": " · ".join(light),
        "source": level.source,
        "spoken": ", ".join([level.name, *light]),
    }


def viewer_data(report: ReportData) -> dict[str, Any]:
    """Return what the page's script reads: each scene under each spectrum, its levels, and the texts of all cells."""
    texts = [
        cell_view(cell, report.levels[cell.level], condition) for condition in report.conditions for cell in condition
    ]
    views = []
    for index, (scene, spectrum) in enumerate(product(report.scenes, report.spectra)):
        first = report.by_group[index * len(report.sensors) * len(report.exposures)]
        levels = zip(report.levels, first[:: len(report.cameras)], strict=True)
        views.append(
            {
                "scene": scene.name,
                "spectrum": text.spectrum_name(spectrum),
                "height": scene.height,
                "width": scene.width,
                "levels": [level_view(level, cell) for level, cell in levels],
            }
        )
    return {
        "views": views,
        "groups": [cells[0].group for cells in report.by_group],
        "sensors": len(report.sensors),
        "exposures": [text.exposure_name(exposure) for exposure in report.exposures],
        "cameras": [text.camera_name(camera) for camera in report.cameras],
        "cells": texts,
    }


def finding_rows(report: ReportData, cells: Sequence[ReportCell]) -> list[list[str]]:
    """Return a row for each level of a group: who leads in each metric by how much, and what fell back in whom."""
    rows = []
    for start in range(0, len(cells), len(report.cameras)):
        condition = cells[start : start + len(report.cameras)]
        row = [report.levels[condition[0].level].name]
        for metric in AT_FIRST:
            best, lead = text.leader(metric, condition)
            by = text.fixed(lead, metric.digits, metric.unit)
            row.append(f"{text.camera_name(best.camera)}, by {by}" if best else text.MISSING)
        swapped = [
            text.camera_name(cell.camera) + ("" if cell.substitution == 1 else " (some seeds)")
            for cell in condition
            if cell.substitution
        ]
        fallen = [text.camera_name(cell.camera) for cell in condition if "calibrated" in cell.balance.values()]
        row += [", ".join(names) or text.MISSING for names in (swapped, fallen)]
        rows.append(row)
    return rows


def leads(report: ReportData) -> list[tuple[str, int]]:
    """Return in how many conditions each camera leads in PSNR, and in how many none does."""
    leaders = [text.leader(text.PSNR, condition)[0] for condition in report.conditions]
    led = [cell.camera if cell else "no lead" for cell in leaders]
    return [(text.camera_name(camera), led.count(camera)) for camera in (*report.cameras, "no lead")]


def known_shares(cells: Sequence[ReportCell]) -> list[tuple[float, ReportCell]]:
    """Return the cells whose Monte Carlo share is known, the largest first."""
    known = [(share, cell) for cell in cells if (share := cell.figures["mc_share"]) is not None and isfinite(share)]
    return sorted(known, key=lambda pair: -pair[0])


def budget_share(report: ReportData) -> float | None:
    """Return the largest share of the noise variance that a plan predicts for all its approximations."""
    shares = (cell.first.budget_share for cell in report.cells if cell.first)
    return max((share for share in shares if share is not None), default=None)


def titles(cameras: Sequence[str]) -> list[str]:
    """Return the cameras as the title names them: each, or how many they are."""
    if len(cameras) > MOST_NAMED:
        return [f"{len(cameras)} cameras"]
    return [text.CAMERA_TITLES.get(camera, text.camera_name(camera)) for camera in cameras]


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
    # What several parts of the page show
    data = viewer_data(report)
    metrics = shown_metrics(report.cells)
    speed = speed_rows(report)
    view_names = text.view_names([scene.name for scene in report.scenes], report.spectra)
    per_view, per_cells = len(data["groups"]) // len(view_names), len(report.cells) // len(view_names)
    addresses = {name: address("png", picture) for name, picture in pictures.items()}
    script = own_file("report.js")
    # The page
    return write_out(
        "report.html.j2",
        style=own_file("report.css"),
        script=script,
        digest=b64encode(sha256(script.encode()).digest()).decode("ascii"),
        report=report,
        data=data,
        cells=list(zip(report.cells, data["cells"], strict=True)),
        sources=[addresses[cell.picture] if cell.picture else "" for cell in report.cells],
        truths=[addresses[name] if name else "" for name in report.truths],
        titles=titles(report.cameras),
        metrics=metrics,
        on_targets=[metric.key for metric in text.ON_TARGETS],
        at_first=AT_FIRST,
        rows=[(metric.key, metric.name) for metric in metrics] + list(FURTHER_ROWS),
        leads=leads(report),
        findings=[finding_rows(report, cells) for cells in report.by_group],
        shares=known_shares(report.cells),
        scene_shares=[known_shares(cells) for cells in report.by_scene],
        budget_share=budget_share(report),
        aim=MOST_SHARE,
        of_pixels=OF_PIXELS,
        groups=data["groups"],
        # Each scene under each spectrum: its title, its groups' indices, their titles within it, its known metrics.
        views=[
            {
                "name": name,
                "groups": list(range(index * per_view, (index + 1) * per_view)),
                "titles": text.group_names([sensor.name for sensor in report.sensors], report.exposures),
                "metrics": shown_metrics(report.cells[index * per_cells : (index + 1) * per_cells]),
            }
            for index, name in enumerate(view_names)
        ],
        # One row of charts for each group; empty where no cell has all of its seeds yet.
        charts=list(zip(*(group_charts(report, metric) for metric in metrics), strict=True))
        or [()] * len(data["groups"]),
        share_charts=group_charts(report, SHARE),
        speed=speed,
        speed_charts=speed_charts(speed),
        # Effect and cost, as `sensor.optics.left_out` parts them.
        left_out=[line.partition(": ")[::2] for line in report.left_out],
        snr=snr_over_light({each.name: each.config for each in report.sensors if each.config}),
        text=text,
    )
