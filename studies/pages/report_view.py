"""The report's texts for its template: each cell, each light level, each stage, each render, ready to be written."""

from collections.abc import Mapping, Sequence
from typing import Any

from studies.budget.budget import MOST_SHARE
from studies.pages import report_text as text
from studies.pages.report_cells import groups, scenes, seeds, spectrum_name, views
from studies.pages.report_charts import by_group

# What stands beneath each picture beside the metrics, in this order: key of the cell's view, label.
FURTHER_ROWS = (
    ("exposure", "Exposure"),
    ("saturated", "Saturated"),
    ("substitution", "Substitution"),
    ("balance", "White balance"),
)
MOST_NAMED = 3  # cameras in a title


def balance_text(balance: Mapping[str, str] | None) -> str:
    """Say which channels Gray World balanced, and which fell back."""
    if not balance:
        return text.MISSING
    fallen = [channel for channel, how in balance.items() if how == "calibrated"]
    if not fallen:
        return ", ".join(sorted(set(balance.values())))
    return "calibrated gains" if len(fallen) == len(balance) else f"calibrated for {', '.join(fallen)}"


def cell_view(cell: Mapping[str, Any], level: Mapping[str, Any], rivals: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return everything the page says about one cell, as text; `best` names the metrics in which it leads `rivals`."""
    electrons = cell["mean_electrons"] or {}
    seconds = cell["seconds"] or {}
    return {
        **{metric.key: text.metric_text(metric, cell) for metric in text.METRICS},
        "snr_db": text.interval_text(cell, "snr_db", 1, "dB"),
        "exposure": text.duration(cell["exposure_s"]),
        "saturated": text.percent(cell["saturated"]),
        "substitution": text.substitution_text(cell["substitution"]),
        "balance": balance_text(cell["balance"]),
        "mc_share": text.percent(cell["mc_share"]),
        "over": cell["mc_share"] is not None and cell["mc_share"] > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        **{step: text.duration(seconds.get(step)) for step in ("capture", "develop", "measure")},
        "best": [metric.key for metric in text.METRICS if text.leader(metric, rivals)[0] is cell],
        "file": cell.get("file") or "",
        "alt": f"{text.camera_name(cell['camera'])} picture, {level['name']}, {cell['group']}",
    }


def level_view(level: Mapping[str, Any], cell: Mapping[str, Any]) -> dict[str, str]:
    """Return a light level's texts, its light being that of a cell."""
    luminance = text.significant(cell["luminance_cd_m2"], "cd/m²")
    lux = text.significant(cell["illuminance_lux"], "lux")
    name = str(level["name"])
    light = [words for words in (luminance, lux) if words not in (name, text.MISSING)]
    return {
        "name": name,
        "light": " · ".join(light),
        "source": str(level["source"]),
        "spoken": ", ".join([name, *light]),
    }


def viewer_data(results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what the page's script reads: each scene under each spectrum, its levels, and the texts of all cells."""
    count, levels = len(results["cameras"]), results["levels"]
    texts = []
    for index, cell in enumerate(cells):
        start = index - index % count
        texts.append(cell_view(cell, levels[cell["level"]], cells[start : start + count]))
    per_view = len(cells) // len(views(results))
    sizes = {scene["name"]: scene["size"] for scene in scenes(results)}
    return {
        "views": [
            {
                "scene": scene,
                "spectrum": spectrum_name(spectrum),
                "height": sizes[scene][0],
                "width": sizes[scene][1],
                "levels": [level_view(level, cells[place * per_view + at * count]) for at, level in enumerate(levels)],
            }
            for place, (scene, spectrum) in enumerate(views(results))
        ],
        "groups": groups(results),
        "sensors": len(results["sensors"]),
        "cameras": [text.camera_name(camera) for camera in results["cameras"]],
        "cells": texts,
    }


def summary(results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the report's sentences: one headline, and a list for each group."""
    names = [str(level["name"]) for level in results["levels"]]
    count = len(results["cameras"])
    return {
        "headline": text.headline(names, _rows(cells, count)),
        "groups": [
            {"name": group, "sentences": text.sensor_sentences(names, _rows(own, count))}
            for group, own in zip(groups(results), by_group(results, cells), strict=True)
        ],
        "render": text.render_sentence(results["render"]) if results.get("render") else "",
        "budget": text.budget_sentence(cells),
        "share": text.share_sentence(names, cells),
        "seeds": text.seeds_sentence(seeds(results)),
    }


def _rows(cells: Sequence[Mapping[str, Any]], count: int) -> list[Sequence[Mapping[str, Any]]]:
    """Part cells in order into conditions: one of each camera."""
    return [cells[start : start + count] for start in range(0, len(cells), count)]


def titles(cameras: Sequence[str]) -> list[str]:
    """Return the cameras as the title names them: each, or how many they are."""
    if len(cameras) > MOST_NAMED:
        return [f"{len(cameras)} cameras"]
    return [text.CAMERA_TITLES.get(camera, text.camera_name(camera)) for camera in cameras]


def render_rows(results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Return each render's cost and error; the share is the largest of the pictures made from it."""
    one = [{**results["render"], "scene": scenes(results)[0]["name"]}] if results.get("render") else []
    rows = []
    for made in results.get("renders", one):
        own = [cell["mc_share"] for cell in cells if cell.get("scene", made["scene"]) == made["scene"]]
        shares = [share for share in own if share is not None]
        rows.append(
            {
                "scene": str(made["scene"]),
                "spp": text.significant(made["spp"]),
                "bands": text.significant(made["bands"]),
                "seconds": text.duration(made["seconds"]),
                "share": text.percent(max(shares, default=None)),
            }
        )
    return rows


def stage_rows(stages: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each stage with its time as text and as a share of the whole (0 to 100)."""
    known = [stage["seconds"] or 0.0 for stage in stages]
    total = sum(known) or 1.0
    return [
        {"name": stage["name"], "time": text.duration(stage["seconds"]), "share": round(100 * seconds / total, 2)}
        for stage, seconds in zip(stages, known, strict=True)
    ]
