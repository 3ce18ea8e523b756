"""Draw figures for files by Matplotlib, without its global state: the same bytes each time, on a white ground."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from itertools import pairwise
from math import ceil
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib import rc_context, rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike, NDArray

from render.spectrum import Spectrum
from rodcone.display import BLUE as BLUE  # noqa: PLC0414  (pages and figures import the colours from here)
from rodcone.display import CHANNEL_COLOURS
from rodcone.display import INK as INK  # noqa: PLC0414
from rodcone.display import ORANGE as ORANGE  # noqa: PLC0414
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.emva1288.characterise import Characterisation
from studies.pages.page import TEMPLATES
from studies.photograph.snr import snr_at

UNIT = 1 / 72  # in inches; lengths below are in points, the unit of Matplotlib's SVG
SIDE = 192  # width of a picture [points]
TITLE_LETTERS = 32  # letters in a title line that is no wider than a picture
CHART = (460, 250)  # width and height of a chart [points]
LABEL_GAP = 15  # least gap between the names at the ends of lines [points]
PNG_DPI = 144
GREEN, PURPLE = "#00795a", "#8d4a78"
COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
SOFT = "#565d64"
STYLE: dict[Any, Any] = {
    **rc_params_from_file(TEMPLATES / "plots.mplstyle", use_default_template=False),
    "text.color": INK,
    **dict.fromkeys(("axes.labelcolor", "xtick.color", "ytick.color"), SOFT),
}


def svg_text(figure: Figure) -> str:
    """Write a figure as SVG, without a date and without a link to a document type."""
    text = _saved(figure, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type"))).decode("utf-8")
    return text[text.index("<svg") :]


def png_bytes(figure: Figure) -> bytes:
    """Write a figure as PNG, with two pixels per point."""
    return _saved(figure, format="png", dpi=PNG_DPI, metadata={"Software": None})


def _saved(figure: Figure, **options: Any) -> bytes:
    """Write a figure; it is laid out only once, because each further layout would move its parts a little."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        figure.savefig(buffer, **options)
    return buffer.getvalue()


def blank(width: float, height: float) -> Figure:
    """Return an empty figure of a size in points; its axes are laid out so that nothing overlaps."""
    return Figure((width * UNIT, height * UNIT), layout=ConstrainedLayoutEngine(w_pad=8 * UNIT, h_pad=8 * UNIT))


@rc_context(STYLE)
def picture_rows(rows: Sequence[Sequence[tuple[str, NDArray[np.float64]]]]) -> Figure:
    """Draw rows of encoded pictures (h, w, 3), all equally wide, each with words above it that are no wider."""
    columns = max(len(row) for row in rows)
    rows = [[("\n".join(wrap(words, TITLE_LETTERS)), picture) for words, picture in row] for row in rows]
    lines = [1 + max(words.count("\n") for words, _ in row) for row in rows]
    heights = [
        max(SIDE * picture.shape[0] / picture.shape[1] for _, picture in row) + 14 + 14 * count
        for row, count in zip(rows, lines, strict=True)
    ]
    figure = blank(columns * (SIDE + 10), sum(heights))
    grid = figure.subplots(len(rows), columns, squeeze=False, height_ratios=heights)
    for axes in grid.flat:
        axes.set_axis_off()
    for row, line in zip(rows, grid, strict=True):
        for (words, picture), axes in zip(row, line, strict=False):
            show_picture(axes, picture, words)
    return figure


def show_picture(axes: Axes, picture: NDArray[np.float64], words: str = "") -> None:
    """Draw an encoded picture (h, w, 3) in [0, 1]; its pixels stay squares."""
    axes.set_axis_off()
    axes.imshow(picture, interpolation="none")
    axes.set_title(words)


def plain_ticks(axes: Axes) -> None:
    """Write the ticks of both axes without exponents; a logarithmic axis of under two decades has ticks at 1, 2, 5."""
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if axis.get_scale() == "log" and high < 100 * low:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(lambda value, _: tick_text(value))
        axis.set_minor_formatter(lambda value, _: "")


def name_at_ends(axes: Axes, ends: Sequence[tuple[str, float, str]]) -> None:
    """Write the names of lines to the right of the axes, without overlap.

    Parameters
    ----------
    axes : Axes
        Axes whose scales and limits are set.
    ends : sequence of (name, y, colour)
        Name of each line, its y at the right end, and its colour.
    """
    box = axes.transLimits
    high = CHART[1] * 0.7  # height of the axes, about [points]
    heights = [float(box.transform(axes.transScale.transform((1.0, y)))[1]) * high for _, y, _ in ends]
    for (name, _, colour), height in zip(ends, spread(heights, LABEL_GAP, 0.0, high), strict=True):
        axes.text(1.02, height / high, name, color=colour, va="center", transform=axes.transAxes)


@rc_context(STYLE)
def light_charts(
    levels_cd_m2: Sequence[float] | NDArray[np.float64], charts: Mapping[str, Mapping[str, ArrayLike]]
) -> Figure:
    """Draw charts side by side over luminance, each with its title and its named lines, shape (level,).

    A chart whose lines stay above 0 and span more than a factor of 20 has a logarithmic scale.
    """
    figure = blank(len(charts) * CHART[0], CHART[1])
    for axes, (title, lines) in zip(figure.subplots(1, len(charts)), charts.items(), strict=True):
        for values, colour in zip(lines.values(), COLOURS, strict=False):
            axes.semilogx(levels_cd_m2, values, color=colour)
        axes.set(title=title, xlabel="luminance, cd/m²", xlim=(levels_cd_m2[0], levels_cd_m2[-1]))
        together = np.array(list(lines.values()))
        if 0 < 20 * together.min() < together.max():
            axes.set_yscale("log")
        plain_ticks(axes)
        name_at_ends(axes, [(name, together[i, -1], COLOURS[i]) for i, name in enumerate(lines)])
    return figure


def tick_text(value: float) -> str:
    """Write a tick without exponent or trailing zeros, with narrow spaces between thousands."""
    text = f"{value:,.6f}".rstrip("0").rstrip(".").replace(",", "\N{NARROW NO-BREAK SPACE}")
    return text.replace("-", "\N{MINUS SIGN}")


def spread(heights: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Move label positions apart until neighbours have the distance `gap`, within `low`..`high` if there is room."""
    order = sorted(range(len(heights)), key=lambda index: heights[index])
    placed = list(heights)
    for before, after in pairwise(order):
        placed[after] = max(placed[after], placed[before] + gap)
    over = max((placed[index] for index in order), default=low) - high
    if over > 0:
        placed = [position - over for position in placed]
        for before, after in pairwise(order[::-1]):
            placed[after] = min(max(heights[after], low), placed[before] - gap)
    return placed


COLUMNS, WIDTH, HIGHEST = 4, 480.0, 200.0  # panels in a row; total width, and height of the tallest panel [points]
BAND_NM = 5.0  # width of the bands in which spectra are drawn: the steps of the published tables of lamps
NM = np.arange(380.0 + BAND_NM / 2, 780.0, BAND_NM)
# Line styles, which sensors take in turn.
LINES: tuple[Any, ...] = ("-", "--", ":", "-.", (0, (6, 1, 1, 1, 1, 1)), (0, (1, 3)), (0, (9, 3)), (0, (3, 1)))
MOST_NAMES = 20  # most names that a plot lists one above the other
LEAST_CD_M2, MOST_CD_M2, POINTS = 1e-4, 1e5, 181  # from starlight to sunlit snow
SNR = 10.0  # SNR that plots mark; it is 20 dB

Curves = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]  # by channel: wavelength [nm], value


def lights_svg(lights: Mapping[str, Spectrum]) -> str:
    """Draw spectra by name in bands of 5 nm, each divided by its greatest value."""
    spectra = {name: light.band_average(NM, BAND_NM) for name, light in lights.items()}
    return _svg({name: {"": (NM, values / values.max())} for name, values in spectra.items()})


def responses_svg(responses: Mapping[str, Responses]) -> str:
    """Draw curves of electrons per photon by name; the greatest value of relative curves is 1."""
    return _svg(
        {
            name: {channel: (curve.wavelength_nm, curve.values) for channel, curve in response.curves.items()}
            for name, response in responses.items()
        }
    )


@rc_context(STYLE)
def _svg(panels: Mapping[str, Curves]) -> str:
    rows, columns = ceil(len(panels) / COLUMNS), min(len(panels), COLUMNS)
    figure = blank(WIDTH, rows * min(0.8 * WIDTH / columns, HIGHEST) + 20)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, (name, curves) in zip(grid.flat, panels.items(), strict=False):
        for channel, (nm, values) in curves.items():
            axes.plot(nm, values, color=CHANNEL_COLOURS.get(channel, INK), linewidth=0.9)
        axes.set_title(name.replace("$", r"\$"), fontsize=8)  # $ would begin a formula
        axes.set(xlim=(380, 780), ylim=(0, 1.05))
        axes.tick_params(labelsize=7)
        plain_ticks(axes)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_visible(False)
    figure.supxlabel("nm", fontsize=8)
    return svg_text(figure)


@rc_context(STYLE)
def snr_svg(sensors: Mapping[str, SensorConfig], light: str, exposure_s: float, mark: float) -> str:
    """Draw SNR [dB] over luminance up to the full well; `mark` is a line across."""
    figure = blank(1.5 * CHART[0], 1.3 * CHART[1])
    axes = figure.subplots()
    luminance = np.geomspace(LEAST_CD_M2, MOST_CD_M2, POINTS)
    for index, (name, sensor) in enumerate(sensors.items()):
        for channel, ratio in snr_at(luminance, sensor, light, exposure_s).items():
            colour = CHANNEL_COLOURS.get(channel, SOFT)
            # A $ would begin a formula.
            line = LINES[index % len(LINES)]
            label = f"{name} {channel}".replace("$", r"\$")
            axes.semilogx(luminance, 20 * np.log10(ratio), ls=line, color=colour, label=label)
    axes.axhline(20 * np.log10(mark), color=SOFT, linewidth=0.8)
    axes.set(title=f"SNR of a pixel [dB], {light}, {1e3 * exposure_s:g} ms", xlabel="cd/m²", ylim=(-20, None))
    plain_ticks(axes)
    if (names := len(axes.lines) - 1) > MOST_NAMES:
        figure.legend(fontsize=8, loc="outside right upper", ncols=ceil(names / MOST_NAMES))
    else:
        axes.legend(fontsize=8)
    return svg_text(figure)


@rc_context(STYLE)
def transfer_svg(result: Characterisation, title: str) -> str:
    """Draw the four plots of a characterisation into one SVG document."""
    transfer, gain = result.transfer, result.gain_dn_per_e
    signal_dn = transfer.mean_dn - result.dark_mean_dn
    signal_e = signal_dn / gain
    useful = (signal_dn > 0) & (transfer.light_e <= result.saturation_e)  # clipping hides noise above it
    dark_e = float(np.sqrt(max(result.dark_variance_dn2, 0.0)) / gain)
    light_e = np.geomspace(signal_e[signal_e > 0].min(), signal_e.max(), 60)
    figure = blank(2 * CHART[0], 2.3 * CHART[1])
    figure.suptitle(title, x=0.02, ha="left", weight="bold")
    linear, logarithmic, snr, linearity = figure.subplots(2, 2).flat

    _draw(linear, signal_dn, transfer.variance_dn2)
    line_dn = np.array([0.0, signal_dn.max()])
    linear.plot(line_dn, gain * line_dn + result.dark_variance_dn2, color=BLUE, label=f"slope {gain:.4g} DN/e⁻")
    linear.set(title="Photon transfer: temporal variance, DN²", xlabel="mean above dark, DN")

    result.plot(logarithmic)
    logarithmic.set(title="Photon transfer, logarithmic: temporal noise, e⁻", ylabel="")

    _draw(snr, signal_e[useful], 20 * np.log10(result.snr[useful]))
    snr.plot(light_e, 10 * np.log10(light_e), color=BLUE, label="shot noise alone")
    with_dark_db = 20 * np.log10(light_e / np.sqrt(light_e + dark_e**2))
    snr.plot(light_e, with_dark_db, color=ORANGE, linestyle="--", label="with dark noise")
    snr.set(xscale="log", title="Signal to noise: SNR, dB", xlabel="signal, e⁻")

    _draw(linearity, signal_e, 100 * result.linearity_share)
    linearity.set(title="Linearity: deviation from the line, %", xlabel="signal, e⁻")
    for axes in (linear, logarithmic, snr, linearity):
        plain_ticks(axes)
    for axes in (linear, logarithmic, snr):
        axes.legend()
    return svg_text(figure)


def _draw(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw those measured points that are finite."""
    finite = np.isfinite(x) & np.isfinite(y)
    axes.plot(x[finite], y[finite], color=BLUE, marker="o", markersize=4.0, linestyle="")
