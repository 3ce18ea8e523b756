"""The demo's report: one self-contained HTML page from results and pictures. Pure: the caller writes the file.

The page's policy refuses every fetch and every script but its own, whose hash stands in the policy. Results reach the
page only through Jinja's escaping (text) and ``tojson`` (the script's data block).
"""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from render.errors import InputError, require_range
from studies import report_text as text
from studies.budget import MOST_SHARE
from studies.charts import Chart, Line, line_chart
from studies.report_cells import exposure_name, exposures, groups, ordered_cells, seeds

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
        **{metric.key: text.metric_text(metric, cell) for metric in METRICS},
        "snr_db": text.interval_text(cell, "snr_db", 1, "dB"),
        "exposure": text.duration(cell["exposure_s"]),
        "saturated": text.percent(cell["saturated"]),
        "substitution": text.substitution_text(cell["substitution"]),
        "balance": balance_text(cell["balance"]),
        "mc_share": text.percent(cell["mc_share"]),
        "over": cell["mc_share"] is not None and cell["mc_share"] > MOST_SHARE,
        "electrons": " ".join(f"{name}\N{NBSP}{text.significant(mean)}" for name, mean in electrons.items()),
        "capture": text.duration(seconds.get("capture")),
        "develop": text.duration(seconds.get("develop")),
        "best": [metric.key for metric in METRICS if text.leader(metric, rivals)[0] is cell],
        "alt": f"{text.camera_name(cell['camera'])} picture, {level['name']}, {cell['group']}",
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


def group_charts(
    results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]], metric: text.Metric, **options: Any
) -> list[Chart]:
    """Return `metric` over luminance, one chart a sensor and exposure, all on one scale."""
    luminance = [level["luminance_cd_m2"] for level in results["levels"]]
    for value in luminance:
        require_range("luminance_cd_m2", value, 1e-12, 1e12, "the axis is logarithmic: give a positive luminance")
    ends = [end for cell in cells for end in cell["intervals"].get(metric.key, ())]
    charts = []
    for group in groups(results):
        own = [cell for cell in cells if cell["group"] == group]
        lines = [_line(results, own, camera, metric, options.get("percent", False)) for camera in results["cameras"]]
        charts.append(
            line_chart(
                f"{metric.name}, {group}",
                f"{metric.name} over scene luminance for {text.join([line.name for line in lines])}. "
                "The table of all pictures holds the numbers.",
                luminance,
                lines,
                shared=[*(cell[metric.key] for cell in cells), *ends],
                **options,
            )
        )
    return charts


def _line(
    results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]], camera: str, metric: text.Metric, percent: bool
) -> Line:
    """Return one camera's values over the levels, in words too."""
    own = [cell for cell in cells if cell["camera"] == camera]
    name = text.camera_name(camera)
    written = [text.percent(cell[metric.key]) if percent else text.metric_text(metric, cell) for cell in own]
    words = [f"{name}, {level['name']}: {value}" for level, value in zip(results["levels"], written, strict=True)]
    known = [cell["intervals"].get(metric.key) for cell in own]
    return Line(name, [cell[metric.key] for cell in own], words, known if any(known) else ())


def summary(results: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the report's sentences: one headline, and a list for each sensor and exposure."""
    names = [str(level["name"]) for level in results["levels"]]
    count = len(results["cameras"])
    rows = [cells[start : start + count] for start in range(0, len(cells), count)]
    per = len(names)
    return {
        "headline": text.headline(names, rows),
        "groups": [
            {"name": group, "sentences": text.sensor_sentences(names, rows[place * per : (place + 1) * per])}
            for place, group in enumerate(groups(results))
        ],
        "render": text.render_sentence(results["render"]),
        "share": text.share_sentence(names, cells),
        "seeds": text.seeds_sentence(seeds(results)),
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
        "groups": groups(results),
        "exposures": [exposure_name(time) for time in exposures(results)],
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
        "groups": data["groups"],
        # One row of charts for each group.
        "charts": list(zip(*(group_charts(results, cells, metric) for metric in CHARTED), strict=True)),
        "share_charts": group_charts(results, cells, share, log_y=True, percent=True, rule=aim),
        # Effect and cost, as `sensor.left_out.left_out` parts them.
        "left_out": [line.partition(": ")[::2] for line in results["left_out"]],
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
        Where there are several exposures, ``exposures`` names them and each cell its own in ``exposure`` (``auto``, or
        a time such as ``10ms``). Cells may name a ``seed``; with several, numbers are means with 95 % intervals and
        pictures are the first seed's.
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
