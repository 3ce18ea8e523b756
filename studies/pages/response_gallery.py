"""Measured responses of cameras side by side, as SVG."""

from collections.abc import Mapping
from math import ceil

from matplotlib import rc_context

from rodcone.plots import CHANNEL_COLOURS
from sensor.cameras.library import MeasuredCamera
from studies.pages.plots import STYLE, blank, plain_ticks, svg_text

COLUMNS, WIDTH, HEIGHT = 6, 118.0, 92.0  # cameras in a row; size of each [points]


@rc_context(STYLE)
def gallery_svg(cameras: Mapping[str, MeasuredCamera]) -> str:
    """Draw electrons per photon over wavelength, each camera's greatest 1; ``*`` where channels don't share a unit."""
    rows = ceil(len(cameras) / COLUMNS)
    figure = blank(COLUMNS * WIDTH, rows * HEIGHT + 20)
    grid = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    for axes, (name, camera) in zip(grid.flat, cameras.items(), strict=False):
        for channel, curve in camera.responses.curves.items():
            axes.plot(curve.wavelength_nm, curve.values, color=CHANNEL_COLOURS[channel], linewidth=0.9)
        axes.set_title(f"{name}{'' if camera.balanced else '*'}".replace("$", r"\$"), fontsize=7)  # a formula's sign
        axes.set(xlim=(380, 780), ylim=(0, 1.05))
        axes.tick_params(labelsize=6)
        plain_ticks(axes)
    for axes in list(grid.flat)[len(cameras) :]:
        axes.set_visible(False)
    figure.supxlabel("nm", fontsize=7)
    return svg_text(figure)
