"""A self-contained page on speed and error: a chart and a table for each stage of a bench. It has no script."""

from collections.abc import Mapping
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from studies.pages import report_text as text
from studies.pages.page import svg_address, write_out
from studies.pages.plots import BLUE, CHART, ORANGE, SOFT, STYLE, blank, name_at_ends, plain_ticks, svg_text

LEAST_SHARE = 1e-5  # smallest share of the noise variance that is written as a number


def bench_page(results: Mapping[str, Any]) -> str:
    """Return a page about a bench's results, which are as `rodcone bench --json` prints them."""
    charts = [(stage, svg_address(svg_text(plane(stage)))) for stage in results["stages"]]
    return write_out("bench.html.j2", results=results, stages=charts, text=text, least=LEAST_SHARE)


@rc_context(STYLE)
def plane(stage: Mapping[str, Any]) -> Figure:
    """Draw one stage's share of the noise variance over time; choices with almost no noise are only in the table."""
    points = [x for x in stage["points"] if x["share_of_noise_variance"] >= LEAST_SHARE and x["seconds"] > 0]
    figure = blank(*CHART)
    axes = figure.subplots()
    for point in points:
        mark = {"color": BLUE, "marker": "o"} if point["on_front"] else {"color": ORANGE, "marker": "s"}
        axes.loglog(point["seconds"], point["share_of_noise_variance"], **mark)
    front = sorted((point["seconds"], point["share_of_noise_variance"]) for point in points if point["on_front"])
    axes.loglog([seconds for seconds, _ in front], [share for _, share in front], color=BLUE)
    low, high = axes.get_ylim()
    if low <= 1.0 <= high:
        axes.axhline(1.0, color=SOFT, linestyle="--")
        axes.annotate("the sensor's own noise", (0.01, 1.0), (0, 3), axes.get_yaxis_transform(), "offset points")
    axes.set(title="share of the sensor's noise variance", xlabel="seconds")
    plain_ticks(axes)
    colours = {True: BLUE, False: ORANGE}
    ends = [(point["choice"], point["share_of_noise_variance"], colours[point["on_front"]]) for point in points]
    name_at_ends(axes, ends)
    return figure
