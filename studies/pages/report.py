"""The report of a sweep: one self-contained HTML page from values and pictures. Pure: the caller writes it.

The page's policy refuses every fetch, but of pictures beside it where it leaves some out, and every script but its own,
whose hash stands in the policy. Values reach the page only through Jinja's escaping (text) and ``tojson`` (the script's
data block).
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from math import ceil, floor, isfinite, log10
from typing import Any

from markupsafe import Markup

from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.report_compare import (
    RIVALS,
    Comparison,
    axes_of,
    best,
    comparisons,
    first_comparison,
    group_titles,
    shown_metrics,
    verdicts,
)
from studies.pages.report_data import ReportCell, ReportData, ReportLevel, ReportRender
from studies.pages.report_pictures import ReportPictures
from studies.pages.report_speed import speed_rows
from studies.pages.snr_chart import snr_over_light
from studies.study.render_noise import MOST_SHARE

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
        "figures": {
            metric.key: [float(f"{mean:.7g}"), half_of(cell, metric.key)]
            for metric in text.METRICS
            if (mean := cell.figures[metric.key]) is not None and isfinite(mean)
        },
        "exposure": text.duration(row.exposure_s if row else None),
        "saturated": text.percent(cell.figures["saturated"]),
        "substitution": "" if cell.substitution is None else text.substitution_text(cell.substitution),
        "balance": balance_text(cell.balance),
        "mc_share": text.percent(share),
        "over": share is not None and share > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration(row.capture_s if row else None),
        "develop": text.duration(row.develop_s if row else None),
        "file": f"pictures/{row.picture}" if row else "",
        "alt": f"{text.camera_name(cell.camera)} picture, {level.name}, {cell.group}",
    }


def half_of(cell: ReportCell, key: str) -> float | None:
    """Half the width of a figure's 95 % interval; None for one seed."""
    low, high = cell.intervals.get(key, (None, None))
    return None if low is None or high is None else float(f"{(high - low) / 2:.4g}")


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
        "alone": alone(report),
        "references": [reference_name(render) for render in report.renders],
        "groups": [group_titles(report, axis) for axis in range(len(axes_of(report)))],
        "comparisons": comparisons(report),
        "sizes": [[scene.height, scene.width] for scene in report.scenes],
        "metrics": [vars(metric) for metric in shown_metrics(report.cells)],
        "levels": levels,
        "cells": [cell_view(cell, report.levels[cell.level]) for cell in report.cells],
    }


def alone(report: ReportData) -> str:
    """Say how a study does in which nothing competes: its PSNR from the first level to the last; else empty."""
    if any(len(axes_of(report)[axis].values) > 1 for axis in RIVALS):
        return ""
    cells = [cell for cell in report.by_group[0] if cell.figures["psnr_db"] is not None]
    ends = [
        f"{text.metric_text(text.PSNR, cell)} at {report.levels[cell.level].name}"
        for cell in ([cells[0], cells[-1]] if len(cells) > 1 else cells)
    ]
    return f"Nothing to compare: one camera, sensor and exposure. PSNR {' to '.join(ends) or 'unknown'}."


def seen_level(report: ReportData) -> int:
    """Return the darkest level at which some camera's picture, of the first group, shows more scene than noise."""
    for cell in report.by_group[0]:
        if (cell.figures["psnr_db"] or 0.0) >= SEEN_DB:
            return cell.level
    return len(report.levels) - 1


def reference_name(render: ReportRender) -> str:
    """Name of the picture that all are measured against: it is rendered, and so has noise of its own."""
    return "Reference" + (f", {text.significant(render.spp)} samples" if render.spp else "")


def samples_text(samples: float) -> str:
    """Write a number of samples with two digits, rounded up."""
    step = 10 ** max(floor(log10(samples)) - 1, 0)
    return text.significant(float(ceil(samples / step) * step))


def render_warning(report: ReportData) -> str:
    """Say where the render's noise exceeds the sensor's, and with how many samples it wouldn't; empty where nowhere."""
    over = [(share, cell) for share, cell in known_shares(report.cells) if share > 1]
    if not over:
        return ""
    share, cell = over[0]
    place = f"{report.levels[cell.level].name}, {cell.group}, {text.camera_name(cell.camera)}"
    wanted = [share * cell.first.spp for share, cell in over if cell.first and cell.first.spp]
    remedy = f" With {samples_text(max(wanted))} samples a pixel it would be below." if wanted else ""
    return (
        f"The render's own noise exceeds the sensor's in {len(over)} of {len(report.cells)} pictures, in variance up "
        f"to {text.significant(share, digits=2)} times ({place}).{remedy}"
    )


def summary(report: ReportData, of: Comparison) -> list[tuple[str, list[tuple[text.Metric, list[tuple[str, float]]]]]]:
    """Return the tables of verdicts: for each row its name and, by metric, outcome and lead along the axis."""
    metrics = shown_metrics(report.cells)
    found = [verdicts(report, of, metric) for metric in metrics]
    return [
        (
            name,
            [
                (metric, list(zip(lead.outcome[row].tolist(), lead.mean[row].tolist(), strict=True)))
                for metric, lead in zip(metrics, found, strict=True)
            ],
        )
        for row, name in enumerate(axes_of(report)[of.rows].values)
    ]


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
        metrics=metrics,
        answer=data["comparisons"][of.compared]["answers"].get(f"{of.a} {of.b}", [None])[0],
        over=data["comparisons"][of.compared]["over"].get(f"{of.a} {of.b}", ""),
        warning=render_warning(report),
        cells=list(zip(report.cells, data["cells"], strict=True)),
        leading=leading,
        sources=[addresses[cell.picture] if cell.picture else "" for cell in report.cells],
        truths=[addresses[name] if name else "" for name in report.truths],
        titles=titles(report),
        shares=known_shares(report.cells),
        scene_shares=[known_shares(cells) for cells in report.by_scene],
        budget_share=budget_share(report),
        aim=MOST_SHARE,
        meanings=[text.BALANCE_MEANINGS.get(balance, balance) for balance in report.balances],
        groups=[cells[0].group for cells in report.by_group],
        # Each scene under each spectrum: its title, its groups' indices, their titles within it, its known metrics.
        views=[
            {
                "name": name,
                "groups": list(range(index * per_view, (index + 1) * per_view)),
                "titles": text.group_names(
                    [text.plain_name(sensor.name) for sensor in report.sensors], report.exposures, report.balances
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
