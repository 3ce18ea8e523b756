"""A design as one self-contained page: tile and filters, gains over light, and what it gives up; the gains' plot."""

from collections.abc import Mapping, Sequence
from importlib import metadata

from matplotlib import rc_context

from rodcone.display import CHANNEL_COLOURS
from sensor.cfa import Tile
from sensor.config import SensorConfig
from sensor.curves import Responses
from studies.design.expect import ExpectedError
from studies.design.search import Goal
from studies.pages.page import svg_address, write_out
from studies.pages.plots import CHART, SOFT, STYLE, blank, plain_ticks, responses_svg, svg_text


def tile_text(tile: Tile) -> str:
    """Rows of a tile, as --mosaic takes them."""
    return "/".join(tile)


def design_page(goal: Goal, camera: SensorConfig, by_camera: Mapping[str, Sequence[ExpectedError]], tried: int) -> str:
    """Return the page's HTML; the first of `by_camera` is the reference, the second the design."""
    reference, design, *_ = by_camera.values()
    given_up = [
        f"{level}: {figure} {loss:.2f} {unit}"
        for level, error, compared in zip(goal.levels, design, reference, strict=True)
        for figure, loss, unit in (
            ("PSNR", compared.psnr_db - error.psnr_db, "dB"),
            ("luminance", compared.luminance_db - error.luminance_db, "dB"),
            ("a*, b*", error.colour - compared.colour, "in Lab"),
        )
        if loss > 0.005
    ]
    rows = [
        (name, [f"{error.psnr_db - compared.psnr_db:+.2f}" for error, compared in zip(errors, reference, strict=True)],
         [f"{compared.colour - error.colour:+.2f}" for error, compared in zip(errors, reference, strict=True)])
        for name, errors in list(by_camera.items())[1:]
    ]  # fmt: skip
    responses = Responses({name: camera.responses.curves[name] for name in camera.channels})
    return write_out(
        "design.html.j2",
        tile=tile_text(camera.cfa),
        reference=next(iter(by_camera)),
        goal=goal,
        levels=list(goal.levels),
        rows=rows,
        given_up=given_up,
        tried=tried,
        colours=CHANNEL_COLOURS,
        responses=svg_address(responses_svg({"electrons per photon": responses})),
        gains=svg_address(gain_svg(by_camera)),
        version=metadata.version("rodcone"),
    )


@rc_context(STYLE)
def gain_svg(by_camera: Mapping[str, Sequence[ExpectedError]]) -> str:
    """Draw the gain in expected PSNR [dB] and in the error of a*, b* over luminance."""
    figure = blank(2 * CHART[0], 1.2 * CHART[1])
    decibels, colours = figure.subplots(1, 2)
    reference, *others = by_camera
    for index, name in enumerate(others):
        pairs = list(zip(by_camera[name], by_camera[reference], strict=True))
        light = [row.luminance_cd_m2 for row, _ in pairs]
        style = {"marker": ".", "linestyle": "-" if index < 10 else "--"}  # colours begin anew
        decibels.semilogx(light, [row.psnr_db - beside.psnr_db for row, beside in pairs], label=name, **style)
        colours.semilogx(light, [beside.colour - row.colour for row, beside in pairs], **style)
    for axes, title in ((decibels, "expected gain in PSNR [dB]"), (colours, "less error of a*, b*")):
        axes.axhline(0.0, color=SOFT, linewidth=0.8)
        axes.set(title=f"{title} over {reference}", xlabel="cd/m²")
        plain_ticks(axes)
    decibels.legend(fontsize=7, ncols=1 + len(others) // 8)
    return svg_text(figure)
