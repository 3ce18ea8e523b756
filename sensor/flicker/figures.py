"""Flicker figures of IEEE 2020 for a lamp and an exposure, without a frame.

Over all phases of the lamp at which an exposure may start, x is the light that it collects over the mean. The
definitions are those of the working group's own program (github.com/CARpublic/P2020-flicker), which takes them from
the mean of a region in a video's frames.
"""

from dataclasses import dataclass
from math import asin, pi

import numpy as np

from rodcone.errors import require_range
from rodcone.types import Floats
from sensor.flicker.waveform import Waveform

TOLERANCE = 0.1  # light within this share of the mean counts as steady, by that program's default
_EQUAL = 1e-9  # light within this share of the mean is steady, except for rounding


@dataclass(frozen=True)
class FlickerFigures:
    """How much a lamp's flicker shows in frames of one exposure time.

    Attributes
    ----------
    modulation_index : float
        Flicker modulation index, (most - least) / (most + least) of the light collected; 0 is steady, 1 goes dark.
    mitigation_probability : float
        Modulation mitigation probability: share of exposures whose light is within the tolerance of the mean.
    """

    modulation_index: float
    mitigation_probability: float


def flicker_figures(waveform: Waveform, exposure_s: float, tolerance: float = TOLERANCE) -> FlickerFigures:
    """Return the flicker modulation index and the modulation mitigation probability of IEEE 2020, in closed form.

    For a cosine of depth d the light swings by a = d |sinc(f T)|: the index is a; the probability is 1 where a is
    within the tolerance t, else (2 / pi) arcsin(t / a). For straight pieces the light is a parabola between any two
    starts at which a corner of the waveform enters or leaves the exposure, so that extremes and crossings are exact.

    Parameters
    ----------
    waveform : Waveform or str
        Or a text that `waveform` takes, such as ``"pwm@100Hz:0.3"``.
    exposure_s : float
        Above 0 [s].
    tolerance : float
        Share of the mean.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.flicker_figures(rodcone.waveform("pwm@100Hz:0.25"), "10ms")
    FlickerFigures(modulation_index=0.0, mitigation_probability=1.0)
    >>> round(rodcone.flicker_figures(rodcone.waveform("sodium_high@100Hz"), "2ms").modulation_index, 3)
    0.889
    """
    require_range("tolerance", tolerance, 1e-6, 1.0, "give a share of the mean")
    if waveform.depth:
        swing = waveform.depth * abs(float(np.sinc(exposure_s * waveform.frequency_hz)))
        swing = swing if swing > _EQUAL else 0.0
        return FlickerFigures(swing, 1.0 if swing <= tolerance else 2 / pi * asin(tolerance / swing))
    least, most, within = _of_pieces(waveform, exposure_s, tolerance)
    swing = (most - least) / (most + least)
    return FlickerFigures(swing if swing > _EQUAL else 0.0, within)


def _of_pieces(waveform: Waveform, exposure_s: float, tolerance: float) -> tuple[float, float, float]:
    """Return the least and most light that an exposure collects, and the share of its starts with light near the mean.

    Light is relative to the mean, and near it means within `tolerance`.
    """
    places = np.array(waveform.places)
    corners = np.concatenate([places, (places - exposure_s * waveform.frequency_hz) % 1.0])
    corners = np.unique(corners)
    starts = np.stack([corners[:-1], (corners[:-1] + corners[1:]) / 2, corners[1:]])
    first, middle, last = waveform.mean(starts * waveform.period_s, exposure_s)
    # A parabola a u^2 + b u + c over 0 <= u <= 1 between two corners, through three points.
    a = 2 * (first + last - 2 * middle)
    b = last - first - a
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = -b / (2 * a)
    turning = np.clip(np.where(np.isfinite(turning), turning, 0.0), 0.0, 1.0)
    values = np.concatenate([first, last, first + turning * (b + a * turning)])
    # Edges of the parts that lie between crossings of 1 - tolerance and 1 + tolerance.
    edges = [np.zeros_like(a), np.ones_like(a)]
    for level in (1 - tolerance, 1 + tolerance):
        edges += _crossings(a, b, first - level)
    cuts = np.sort(np.stack(edges), axis=0)
    u = (cuts[:-1] + cuts[1:]) / 2
    inside = np.abs(first + u * (b + a * u) - 1) <= tolerance * (1 + _EQUAL)
    share = (np.diff(cuts, axis=0) * inside).sum(axis=0) @ np.diff(corners)
    return max(0.0, float(values.min())), float(values.max()), float(share)


def _crossings(a: Floats, b: Floats, c: Floats) -> list[Floats]:
    """Return both roots of a u^2 + b u + c, each clipped to the range 0 to 1, and 0 for a root that isn't there."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - 4 * a * c)
        half = -(b + np.where(b >= 0, root, -root)) / 2
        both = (half / a, c / half)
    return [np.clip(np.where(np.isfinite(x), x, 0.0), 0.0, 1.0) for x in both]
