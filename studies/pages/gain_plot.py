"""The plot of expected gains over light."""

from collections.abc import Mapping, Sequence

from matplotlib import rc_context

from studies.design.expect import ExpectedError
from studies.pages.plots import CHART, SOFT, STYLE, blank, plain_ticks, svg_text


@rc_context(STYLE)
def gain_svg(by_camera: Mapping[str, Sequence[ExpectedError]]) -> str:
    """Draw the gain in expected PSNR [dB] and in the error of a*, b* over luminance."""
    figure = blank(2 * CHART[0], 1.2 * CHART[1])
    decibels, colours = figure.subplots(1, 2)
    reference, *others = by_camera
    for index, name in enumerate(others):
        pairs = list(zip(by_camera[name], by_camera[reference], strict=True))
        light = [row.luminance_cd_m2 for row, _ in pairs]
        style = {"marker": ".", "linestyle": "-" if index < 10 else "--"}  # colours repeat after 10
        decibels.semilogx(light, [row.psnr_db - beside.psnr_db for row, beside in pairs], label=name, **style)
        colours.semilogx(light, [beside.colour - row.colour for row, beside in pairs], **style)
    for axes, title in ((decibels, "expected gain in PSNR [dB]"), (colours, "less error of a*, b*")):
        axes.axhline(0.0, color=SOFT, linewidth=0.8)
        axes.set(title=f"{title} over {reference}", xlabel="cd/m²")
        plain_ticks(axes)
    decibels.legend(fontsize=7, ncols=1 + len(others) // 8)
    return svg_text(figure)
