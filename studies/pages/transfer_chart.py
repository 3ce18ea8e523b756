"""Plots of a characterisation as one self-contained SVG: photon transfer (linear, logarithmic), SNR and linearity."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, floor, isfinite, log10
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sensor.emva1288.characterise import Characterisation
from studies.pages.charts import Point, Scale, Tick, decades, line_path, linear_ticks, tick_text

TEMPLATES = Path(__file__).parent / "templates"
WIDTH, HEIGHT = 440.0, 280.0
LEFT, RIGHT, TOP, BOTTOM = 66.0, 24.0, 26.0, 44.0
HEAD = 44.0


@dataclass(frozen=True)
class Model:
    """A line to judge the points by, and its text."""

    path: str
    at: Point
    anchor: str


@dataclass(frozen=True)
class Panel:
    """One plot in SVG units, its corner at (x, y)."""

    x: float
    y: float
    title: str
    x_label: str
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    points: tuple[Point, ...]
    lines: tuple[Model, ...]
    left: float = LEFT
    right: float = WIDTH - RIGHT
    bottom: float = HEIGHT - BOTTOM


Curve = tuple[str, Callable[[float], float]]


def _axis(values: Sequence[float], log: bool, start: float, stop: float) -> tuple[Scale, tuple[Tick, ...]]:
    """Scale and ticks that hold all values."""
    if log:
        low, high = 10.0 ** floor(log10(min(values))), 10.0 ** ceil(log10(max(values)))
        scale = Scale(low, max(high, 10 * low), start, stop, log=True)
        ticks = decades(scale.low, scale.high)
    else:
        ticks = linear_ticks(min(values), max(values))
        scale = Scale(ticks[0], ticks[-1], start, stop)
    return scale, tuple(Tick(scale.at(tick), tick_text(tick)) for tick in ticks)


def _panel(
    cell: tuple[int, int],
    title: str,
    labels: tuple[str, str],
    data: tuple[Sequence[float], Sequence[float]],
    curves: Sequence[Curve],
    log: tuple[bool, bool] = (False, False),
) -> Panel:
    """Lay out one plot: points, and curves over the same range."""
    pairs = [
        (x, y)
        for x, y in zip(*data, strict=True)
        if isfinite(x) and isfinite(y) and (x > 0 or not log[0]) and (y > 0 or not log[1])
    ]
    across, x_ticks = _axis([x for x, _ in pairs], log[0], LEFT, WIDTH - RIGHT)
    up, y_ticks = _axis([y for _, y in pairs] + ([] if log[1] else [0.0]), log[1], HEIGHT - BOTTOM, TOP)
    low, high = min(x for x, _ in pairs), max(x for x, _ in pairs)
    steps = np.geomspace(low, high, 60) if log[0] else np.linspace(low, high, 60)
    lines = []
    for index, (name, curve) in enumerate(curves):
        inside = [(float(x), curve(float(x))) for x in steps if up.low <= curve(float(x)) <= up.high]
        if inside:
            path = line_path([Point(across.at(x), up.at(y), "") for x, y in inside])
            # the first line's text stands above its end, the second's under its midst, where no point is
            x, y = inside[-1] if index == 0 else inside[len(inside) // 3]
            at = Point(across.at(x) - (6 if index == 0 else 0), max(up.at(y) - 7, TOP + 4), name)
            at = at if index == 0 else Point(at.x, up.at(y) + 18, name)
            lines.append(Model(path, at, "end" if index == 0 else "start"))
    points = tuple(
        Point(across.at(x), up.at(y), f"{labels[0]} {tick_text(round(x, 3))}, {labels[1]} {tick_text(round(y, 4))}")
        for x, y in pairs
    )
    corner = cell[0] * WIDTH, HEAD + cell[1] * HEIGHT
    return Panel(*corner, f"{title}: {labels[1]}", labels[0], x_ticks, y_ticks, points, tuple(lines))


def transfer_svg(result: Characterisation, title: str) -> str:
    """Draw four plots into one SVG document."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    figures = ", ".join(f"{f.name} {f.measured:.4g} {f.unit} (configured {f.configured:.4g})" for f in result.figures)
    return environment.get_template("transfer.svg.j2").render(
        width=2 * WIDTH, height=HEAD + 2 * HEIGHT, title=title, description=figures, panels=_panels(result)
    )


def _panels(result: Characterisation) -> tuple[Panel, ...]:
    transfer, gain = result.transfer, result.gain_dn_per_e
    signal_dn = transfer.mean_dn - result.dark_mean_dn
    signal_e = signal_dn / gain
    noise_e = np.sqrt(np.maximum(transfer.variance_dn2, 0.0)) / gain
    useful = (signal_dn > 0) & (transfer.light_e <= result.saturation_e)  # beyond it clipping hides the noise
    snr_db = 20 * np.log10(np.where(useful, result.snr, np.nan))
    dark_e = float(np.sqrt(max(result.dark_variance_dn2, 0.0)) / gain)
    return (
        _panel(
            (0, 0),
            "Photon transfer",
            ("mean above dark, DN", "temporal variance, DN²"),
            (signal_dn.tolist(), transfer.variance_dn2.tolist()),
            [(f"slope {gain:.4g} DN/e⁻", lambda x: gain * x + result.dark_variance_dn2)],
        ),
        _panel(
            (1, 0),
            "Photon transfer, logarithmic",
            ("signal, e⁻", "temporal noise, e⁻"),
            (signal_e.tolist(), noise_e.tolist()),
            [("shot noise, slope ½", lambda x: float(np.sqrt(x))), ("dark noise", lambda _: dark_e)],
            (True, True),
        ),
        _panel(
            (0, 1),
            "Signal to noise",
            ("signal, e⁻", "SNR, dB"),
            (signal_e.tolist(), snr_db.tolist()),
            [
                ("shot noise alone", lambda x: 10 * log10(x)),
                ("with dark noise", lambda x: 20 * log10(x / float(np.sqrt(x + dark_e**2)))),
            ],
            (True, False),
        ),
        _panel(
            (1, 1),
            "Linearity",
            ("signal, e⁻", "deviation from the line, %"),
            (signal_e.tolist(), (100 * result.linearity_share).tolist()),
            [],
        ),
    )
