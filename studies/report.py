"""The demo's report: one self-contained HTML page from results and pictures. Pure: the caller writes the file.

The page's policy refuses every fetch and every script but its own, whose hash stands in the policy. Results reach the
page only through Jinja's escaping (text) and ``tojson`` (the script's data block).
"""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from render.errors import InputError, require_keys, require_range
from studies import report_text as text
from studies.budget import MOST_SHARE
from studies.charts import Chart, Line, line_chart

TEMPLATES = Path(__file__).parent / "templates"
TRUTH = "truth"
KEYS = (
    "rodcone", "seed", "scene", "size", "environment", "render", "exposure_rule", "display_white",
    "levels", "sensors", "cameras", "cells", "stages", "left_out", "notes",
)  # fmt: skip
# What stands beneath each picture, in this order: key of the cell's view, label.
VIEWER_ROWS = (
    ("psnr_db", "PSNR"),
    ("ssim", "SSIM"),
    ("delta_e_median", "ΔE2000, median"),
    ("delta_e_p95", "ΔE2000, 95 %"),
    ("exposure", "Exposure"),
    ("saturated", "Saturated"),
    ("substitution", "Substitution"),
    ("balance", "White balance"),
)
CHARTED = (text.PSNR, text.SSIM, text.DELTA_E)
METRICS = (*CHARTED, text.DELTA_E_95)


def data_uri(name: str, picture: bytes) -> str:
    """Return `picture` as a ``data:`` address; its type comes from its first bytes."""
    if picture.startswith(b"\x89PNG\r\n\x1a\n"):
        kind = "png"
    elif picture[:4] == b"RIFF" and picture[8:12] == b"WEBP":
        kind = "webp"
    else:
        raise InputError(f"picture {name!r}: starts with {picture[:8]!r}; allowed: PNG, WebP; encode it as one of them")
    return f"data:image/{kind};base64,{b64encode(picture).decode('ascii')}"


def _picture(pictures: Mapping[str, bytes], name: str) -> str:
    if name not in pictures:
        raise InputError(
            f"picture {name!r} is missing; give PNG or WebP bytes for each cell's picture and for {TRUTH!r}"
        )
    return data_uri(name, pictures[name])


def ordered_cells(results: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the cells by sensor, level, camera; each combination has to be there exactly once."""
    sensors = [sensor["name"] for sensor in results["sensors"]]
    cameras = list(results["cameras"])
    found: dict[tuple[str, int, str], Mapping[str, Any]] = {}
    for cell in results["cells"]:
        require_keys("cell's sensor", [cell["sensor"]], sensors)
        require_keys("cell's camera", [cell["camera"]], cameras)
        require_range("cell's level", cell["level"], 0, len(results["levels"]) - 1, "give the level's place in levels")
        place = (cell["sensor"], cell["level"], cell["camera"])
        if place in found:
            raise InputError(f"cells: {place!r} comes twice; give each sensor, level and camera once")
        found[place] = cell
    wanted = list(product(sensors, range(len(results["levels"])), cameras))
    for place in wanted:
        if place not in found:
            raise InputError(f"cells: {place!r} is missing; give one cell for each sensor, level and camera")
    return [found[place] for place in wanted]


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
    substitution = {True: "on", False: "off", None: "not applicable"}[cell["substitution"]]
    electrons = cell["mean_electrons"] or {}
    seconds = cell["seconds"] or {}
    return {
        **{metric.key: text.metric_text(metric, cell) for metric in METRICS},
        "snr_db": text.fixed(cell["snr_db"], 1, "dB"),
        "exposure": text.duration(cell["exposure_s"]),
        "saturated": text.percent(cell["saturated"]),
        "substitution": substitution,
        "balance": balance_text(cell["balance"]),
        "mc_share": text.percent(cell["mc_share"]),
        "over": cell["mc_share"] is not None and cell["mc_share"] > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration(seconds.get("capture")),
        "develop": text.duration(seconds.get("develop")),
        "best": [metric.key for metric in METRICS if text.leader(metric, rivals)[0] is cell],
        "alt": f"{text.camera_name(cell['camera'])} picture, {level['name']}, {cell['sensor']}",
    }


def level_view(level: Mapping[str, Any]) -> dict[str, str]:
    """Return a light level's texts."""
    luminance = text.significant(level["luminance_cd_m2"], "cd/m²")
    lux = text.significant(level["illuminance_lux"], "lux")
    return {
        "name": str(level["name"]),
        "luminance": luminance,
        "lux": lux,
        "source": str(level["source"]),
        "spoken": f"{level['name']}, {luminance}, {lux}",
    }


def sensor_charts(
    results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]], metric: text.Metric, **options: Any
) -> list[Chart]:
    """Return `metric` over luminance, one chart a sensor, all on one scale."""
    luminance = [level["luminance_cd_m2"] for level in results["levels"]]
    for value in luminance:
        require_range("luminance_cd_m2", value, 1e-12, 1e12, "the axis is logarithmic: give a positive luminance")
    charts = []
    for sensor in results["sensors"]:
        lines = []
        for camera in results["cameras"]:
            own = [cell for cell in cells if (cell["sensor"], cell["camera"]) == (sensor["name"], camera)]
            name = text.camera_name(camera)
            write = text.percent if options.get("percent") else None
            values = [write(cell[metric.key]) if write else text.metric_text(metric, cell) for cell in own]
            words = [
                f"{name}, {level['name']}: {value}" for level, value in zip(results["levels"], values, strict=True)
            ]
            lines.append(Line(name, [cell[metric.key] for cell in own], words))
        charts.append(
            line_chart(
                f"{metric.name}, {sensor['name']}",
                f"{metric.name} over scene luminance for {text.join([line.name for line in lines])}. "
                "The table of all pictures holds the numbers.",
                luminance,
                lines,
                shared=[cell[metric.key] for cell in cells],
                **options,
            )
        )
    return charts


def summary(results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the report's sentences: one headline, and a list for each sensor."""
    names = [str(level["name"]) for level in results["levels"]]
    count = len(results["cameras"])
    rows = [cells[start : start + count] for start in range(0, len(cells), count)]
    per = len(names)
    return {
        "headline": text.headline(names, rows),
        "sensors": [
            {"name": sensor["name"], "sentences": text.sensor_sentences(names, rows[place * per : (place + 1) * per])}
            for place, sensor in enumerate(results["sensors"])
        ],
        "render": text.render_sentence(results["render"]),
        "share": text.share_sentence(names, cells),
    }


def stage_rows(stages: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each stage with its time as text and as a share of the whole (0 to 100)."""
    known = [stage["seconds"] or 0.0 for stage in stages]
    total = sum(known) or 1.0
    return [
        {"name": stage["name"], "time": text.duration(stage["seconds"]), "share": round(100 * seconds / total, 2)}
        for stage, seconds in zip(stages, known, strict=True)
    ]


def page_view(results: Mapping[str, Any], pictures: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the template's variables."""
    cells = ordered_cells(results)
    count = len(results["cameras"])
    levels = results["levels"]
    views = []
    for index, cell in enumerate(cells):
        start = index - index % count
        views.append(cell_view(cell, levels[cell["level"]], cells[start : start + count]))
    share = text.Metric("mc_share", "Monte Carlo share", 1, "", higher=False)
    aim = (MOST_SHARE, f"aim {text.percent(MOST_SHARE)}")
    data = {
        "levels": [level_view(level) for level in levels],
        "sensors": [sensor["name"] for sensor in results["sensors"]],
        "cameras": [text.camera_name(camera) for camera in results["cameras"]],
        "cells": views,
    }
    return {
        "results": results,
        "height": results["size"][0],
        "width": results["size"][1],
        "data": data,
        "cells": list(zip(cells, views, strict=True)),
        "sources": [_picture(pictures, cell["picture"]) for cell in cells],
        "truth": _picture(pictures, TRUTH),
        "titles": [text.CAMERA_TITLES.get(camera, text.camera_name(camera)) for camera in results["cameras"]],
        "rows": VIEWER_ROWS,
        "summary": summary(results, cells),
        "charted": CHARTED,
        # One row of charts for each sensor.
        "charts": list(zip(*(sensor_charts(results, cells, metric) for metric in CHARTED), strict=True)),
        "share_charts": sensor_charts(results, cells, share, log_y=True, percent=True, rule=aim),
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
