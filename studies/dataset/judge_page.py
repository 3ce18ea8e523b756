"""Scores as one self-contained page: for each camera a chart of PSNR over light, and a table of every metric."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from studies.dataset.judge import MEASURED, Score
from studies.pages import report_text as text
from studies.pages.page import svg_address, write_out
from studies.pages.plots import CHART, COLOURS, STYLE, blank, name_at_ends, plain_ticks, svg_text


def judge_page(head: Mapping[str, Any], scores: Sequence[Score]) -> str:
    """Return the page of what `studies.dataset.judge.judge` gives, in order of cameras."""
    by_camera = {camera: list(lines) for camera, lines in groupby(scores, key=lambda score: score.camera)}
    charts = {camera: svg_address(svg_text(psnr_chart(x))) for camera, x in by_camera.items()}
    return write_out("judge.html.j2", head=head, cameras=by_camera, charts=charts, metrics=MEASURED, text=text)


@rc_context(STYLE)
def psnr_chart(scores: Sequence[Score]) -> Figure:
    """Draw each developer's PSNR over luminance with its interval; what is expected is a line without one."""
    figure = blank(*CHART)
    axes, ends = figure.subplots(), []
    for index, developer in enumerate(dict.fromkeys(score.developer for score in scores)):
        line, colour = [score for score in scores if score.developer == developer], COLOURS[index % len(COLOURS)]
        values = np.array([score.means["psnr_db"] for score in line])
        halves = np.nan_to_num([score.halves["psnr_db"] for score in line])
        light = [score.luminance_cd_m2 for score in line]
        axes.errorbar(light, values, halves, color=colour, capsize=3, linestyle="-" if line[0].scenes else ":")
        ends.append((developer, float(values[-1]), colour))
    axes.set(title="PSNR, dB, mean over scenes and its 95 % interval", xlabel="cd/m²", xscale="log")
    plain_ticks(axes)
    name_at_ends(axes, ends)
    return figure
