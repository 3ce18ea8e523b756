"""A page that shows a camera's frames beside those of its twin."""

from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes

from rodcone.display import BLUE, ORANGE
from rodcone.types import Floats
from studies.pages.page import svg_address, write_out
from studies.pages.plots import CHART, STYLE, blank, plain_ticks, svg_text
from studies.twin.twin import FramePair, Twin

CROP = 96  # side of the crops that are shown [pixels]
NAMES = (("camera", BLUE, "-"), ("twin", ORANGE, "--"))


def twin_page(twin: Twin, title: str, version: str) -> str:
    """Write the page: verdicts, photon transfer, and dark and flat frames side by side."""
    bend = twin.numbers.pixel["response_bend"]
    return write_out(
        "twin.html.j2",
        title=title,
        version=version,
        comparisons=twin.comparisons,
        alike=sum(one.alike for one in twin.comparisons),
        notes=(*twin.figures.notes, f"response_bend is {bend.value:.4f}: {bend.source}"),
        transfer=svg_address(twin_svg(twin)),
        dark=svg_address(pair_svg(twin.dark, "Dark")),
        bright=svg_address(pair_svg(twin.bright, "Flat")),
    )


@rc_context(STYLE)
def twin_svg(twin: Twin) -> str:
    """Draw the photon transfer of camera and twin, and the ratio of their temporal noise."""
    figure = blank(2 * CHART[0], CHART[1])
    left, right = figure.subplots(1, 2)
    left.loglog(twin.signal_dn, twin.camera_dn2, color=BLUE, marker="o", markersize=3, linestyle="", label="camera")
    left.loglog(twin.signal_dn, twin.twin_dn2, color=ORANGE, label="twin")
    left.set(title="Photon transfer: temporal variance, DN²", xlabel="mean above dark, DN")
    left.legend(frameon=False)
    right.plot(twin.signal_dn, np.sqrt(twin.twin_dn2 / twin.camera_dn2), color=ORANGE, marker="o", markersize=3)
    right.axhline(1.0, color=BLUE)
    right.set(title="Temporal noise, twin over camera", xlabel="mean above dark, DN")
    plain_ticks(right)
    return svg_text(figure)


@rc_context(STYLE)
def pair_svg(pair: FramePair, title: str) -> str:
    """Draw crops, histograms, profiles of rows and columns, and the spectrum of a row."""
    figure = blank(2 * CHART[0], 2 * CHART[1])
    figure.suptitle(title, x=0.02, ha="left", weight="bold")
    (camera, twin, histogram), (rows, columns, spectrum) = figure.subplots(2, 3)
    frames, means = (pair.camera_frame, pair.twin_frame), (pair.camera_mean, pair.twin_mean)
    low, high = np.percentile(np.concatenate([frame[:CROP, :CROP].ravel() for frame in frames]), (0.5, 99.5))
    for axes, frame, (name, _, _) in zip((camera, twin), frames, NAMES, strict=True):
        axes.imshow(frame[:CROP, :CROP], cmap="gray", vmin=low, vmax=max(high, low + 1), interpolation="nearest")
        axes.set(title=f"One frame of the {name}, {CROP} pixels", xticks=[], yticks=[])
    _draw(histogram, [_histogram(frame) for frame in frames], "Share of pixels over DN, one frame")
    _draw(rows, [_profile(mean, 1) for mean in means], "Mean of each row less the mean, DN")
    _draw(columns, [_profile(mean, 0) for mean in means], "Mean of each column less the mean, DN")
    _draw(spectrum, [_spectrum(mean) for mean in means], "Spectrum of the mean image's rows, DN²")
    spectrum.set(yscale="log", xlabel="periods per pixel")
    histogram.legend(frameon=False)
    return svg_text(figure)


def _draw(axes: Axes, curves: Sequence[tuple[Floats, Floats]], title: str) -> None:
    for (x, y), (name, colour, line) in zip(curves, NAMES, strict=True):
        axes.plot(x, y, color=colour, linestyle=line, linewidth=0.9, label=name)
    axes.set(title=title)


def _histogram(frame: Floats) -> tuple[Floats, Floats]:
    values, counts = np.unique(frame, return_counts=True)
    return values.astype(np.float64), counts / frame.size


def _profile(mean: Floats, axis: int) -> tuple[Floats, Floats]:
    profile = mean.mean(axis=axis) - mean.mean()
    return np.arange(profile.size, dtype=np.float64), profile


def _spectrum(mean: Floats) -> tuple[Floats, Floats]:
    """Return the frequencies along a row [cycles/px] and the rows' mean power at each, without each row's mean."""
    rest = mean - mean.mean(axis=1, keepdims=True)
    power = np.mean(np.abs(np.fft.rfft(rest, axis=1)) ** 2, axis=0) / mean.shape[1]
    periods = np.fft.rfftfreq(mean.shape[1])
    return np.asarray(periods[1:], dtype=np.float64), np.asarray(power[1:], dtype=np.float64)
