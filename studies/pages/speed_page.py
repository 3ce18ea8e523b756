"""Speed against error as one self-contained page: a chart and a table for each stage. It has no script."""

from collections.abc import Mapping
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from studies.pages import report_text as text
from studies.pages.page import address, own_file, write_out
from studies.pages.plots import BLUE, CHART, ORANGE, SOFT, STYLE, blank, name_at_ends, plain_ticks, svg_text


def bench_page(results: Mapping[str, Any]) -> str:
    """Return the HTML of a bench's results as `rodcone bench --json` prints them."""
    drawn = [(stage, address("svg+xml", svg_text(plane(stage)).encode())) for stage in results["stages"]]
    return write_out("bench.html.j2", results=results, stages=drawn, text=text, style=own_file("report.css"))


@rc_context(STYLE)
def plane(stage: Mapping[str, Any]) -> Figure:
    """Draw one stage's error over time; the reference itself, which has no error, stands in the table alone."""
    points = [point for point in stage["points"] if point["error_e"] > 0 and point["seconds"] > 0]
    figure = blank(*CHART)
    axes = figure.subplots()
    for point in points:
        mark = {"color": BLUE, "marker": "o"} if point["on_front"] else {"color": ORANGE, "marker": "s"}
        axes.loglog(point["seconds"], point["error_e"], **mark)
    front = sorted((point["seconds"], point["error_e"]) for point in points if point["on_front"])
    axes.loglog([seconds for seconds, _ in front], [error for _, error in front], color=BLUE)
    low, high = axes.get_ylim()
    if low <= stage["noise_e"] <= high:
        axes.axhline(stage["noise_e"], color=SOFT, linestyle="--")
        axes.annotate(
            "the sensor's own noise", (0.01, stage["noise_e"]), (0, 3), axes.get_yaxis_transform(), "offset points"
        )
    axes.set(title="error, e⁻", xlabel="seconds")
    plain_ticks(axes)
    colours = {True: BLUE, False: ORANGE}
    name_at_ends(axes, [(point["choice"], point["error_e"], colours[point["on_front"]]) for point in points])
    return figure
