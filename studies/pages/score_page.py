"""A sheet of cameras' figures of merit, to be printed: one page for one camera or two."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from math import isfinite

from matplotlib import rc_context

from studies.pages.page import svg_address, write_out
from studies.pages.plots import CHART, COLOURS, STYLE, blank, plain_ticks, svg_text
from studies.score.figure import Merit
from studies.score.over_light import AtLight

MOST_ON_A_PAGE = 2  # for more cameras than this, the conditions of a figure are written below its row
MOST_VISUAL_NOISE = 10.0  # largest visual noise that is drawn
PLAIN = 1000.0  # value from which on a figure has no decimals


def score_page(
    scores: Mapping[str, Sequence[Merit]], curves: Mapping[str, Sequence[AtLight]], set_up: str, version: str
) -> str:
    """Write the sheet: a row for each figure, with its computed and its measured value for each camera."""
    rows: dict[str, dict[str, Merit]] = {one.name: {} for found in scores.values() for one in found}
    missing: dict[str, list[str]] = {}
    for camera, found in scores.items():
        for one in found:
            if one.missing:
                missing.setdefault(f"{one.title}: {one.missing}", []).append(camera)
            else:
                rows[one.name][camera] = one
    lines = [(next(iter(of.values())), [of.get(camera) for camera in scores]) for of in rows.values() if of]
    return write_out(
        "score.html.j2",
        cameras=list(scores),
        groups=[list(group) for _, group in groupby(lines, key=lambda line: line[0].name.partition(".")[0])],
        chart=svg_address(curves_svg(curves)),
        missing=[(reason, of if len(scores) > 1 else []) for reason, of in missing.items()],
        number=number_text,
        few=len(scores) <= MOST_ON_A_PAGE,
        two=len(scores) == MOST_ON_A_PAGE,
        half=half_text,
        standards=list(dict.fromkeys(row.standard for row, _ in lines)),
        set_up=set_up,
        version=version,
    )


def number_text(value: float) -> str:
    """Write a figure with four digits, or as a whole number if it is large; write a dash if it isn't finite."""
    if not isfinite(value):
        return "—"
    return f"{value:.4g}" if abs(value) < PLAIN else f"{value:.0f}"


def half_text(merit: Merit) -> str:
    """Write half of an interval's width with two digits, or as a whole number if it is large."""
    half = (merit.high - merit.low) / 2
    return f"{half:.2g}" if half < 100 else f"{half:.0f}"


@rc_context(STYLE)
def curves_svg(curves: Mapping[str, Sequence[AtLight]]) -> str:
    """Draw SNR, accuracy and visual noise over light: lines are computed, dots are measured on simulated frames."""
    figure = blank(3 * CHART[0], CHART[1])
    left, middle, right = figure.subplots(1, 3)
    for (camera, rows), colour in zip(curves.items(), COLOURS, strict=False):
        lux = [row.lux for row in rows]
        for axes, computed, measured in (
            (left, [row.snr_db for row in rows], [row.measured_snr_db for row in rows]),
            (middle, [row.accuracy for row in rows], [row.measured_accuracy for row in rows]),
            (right, [row.visual_noise for row in rows], [row.measured_visual_noise for row in rows]),
        ):
            axes.semilogx(lux, computed, color=colour, label=camera)
            axes.semilogx(lux, measured, color=colour, marker="o", markersize=3, linestyle="")
    left.set(title="SNR of a pixel [dB]", xlabel="lux on an 18 % grey card", ylim=(-20, None))
    middle.set(title="contrast transfer accuracy", xlabel="lux on an 18 % grey card", ylim=(0, 1.02))
    right.set(title="visual noise of 18 % grey", xlabel="lux on an 18 % grey card", ylim=(0, MOST_VISUAL_NOISE))
    for axes in (left, middle, right):
        plain_ticks(axes)
    left.legend(fontsize=8, frameon=False)
    return svg_text(figure)
