"""Light of a lamp over time: mains lamps, pulse width modulation and measured tables, and its mean over an exposure.

A lamp on the mains brightens twice per cycle, so it flickers at 100 Hz or 120 Hz. How deeply depends on what stores
energy between two peaks: a filament's heat, a phosphor's glow, nothing in a sodium arc. The depths below are the
percent flicker, (most - least) / (most + least), of Lehman, Wilkins, Berman, Poplawski & Miller, "Proposing measures of
flicker in the low frequencies for lighting applications" (IEEE ECCE 2011), who also list the flicker index of single
lamps. The numbers are as commonly quoted, because the paper's own table was not at hand. A cosine of depth d has the
flicker index d / pi; it differs from theirs by at most 0.01, for the tube by 0.021.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np

from rodcone.curve_file import is_curve_file
from rodcone.display import brief
from rodcone.errors import InputError, in_place, read_errors, require_fields, require_range, unknown
from rodcone.files import read_bounded
from rodcone.types import Floats

# Depth of each kind of lamp on the mains: percent flicker over 100.
LAMPS: Mapping[str, float] = MappingProxyType(
    {
        "incandescent": 0.063,  # 60 W
        "fluorescent": 0.284,  # a T12 tube on a magnetic ballast
        "compact_magnetic": 0.370,  # a compact fluorescent lamp on a magnetic ballast
        "compact_electronic": 0.077,  # a spiral with electronics
        "metal_halide": 0.520,
        "sodium_high": 0.950,
    }
)
PWM = "pwm"
HZ = 0.1, 1e6, "give hertz"
MOST_BYTES, MOST_POINTS = 1 << 23, 1 << 17
_UNITS_S = {"time_s": 1.0, "time_ms": 1e-3, "time_us": 1e-6}
_FORM = re.compile(r"\s*(\w+)@(\d+\.?\d*)Hz(?::(\d*\.?\d+))?\s*$")
_FIX = "write fluorescent@100Hz, pwm@1000Hz:0.25 (lit for a quarter of each period), or a CSV's name"


@dataclass(frozen=True)
class Waveform:
    """Light of a lamp over time, over its own mean: a cosine about 1, or straight pieces.

    Attributes
    ----------
    frequency_hz : float
        Periods per second.
    depth : float
        Amplitude of the cosine, which is brightest at time 0; 0 for straight pieces.
    places, levels : tuple of float
        Ends of the straight pieces, as shares of a period from 0 to 1, and the light there up to a factor, 0 or more.
        Two equal places are a jump. Left out, the light is even but for the cosine.

    Raises
    ------
    InputError
        For a number out of range, places that fall, a lamp that is dark all the time, or both a cosine and pieces.

    Examples
    --------
    >>> import rodcone
    >>> lamp = rodcone.Waveform(100.0, depth=0.3)
    >>> [round(float(x), 3) for x in lamp.mean([0.0, 0.005], 1e-9)]
    [1.3, 0.7]
    >>> float(lamp.mean(0.0, 0.01).round(12))
    1.0
    """

    frequency_hz: Annotated[float, HZ]
    depth: Annotated[float, (0.0, 1.0, "give a share of the mean")] = 0.0
    places: tuple[float, ...] = (0.0, 1.0)
    levels: tuple[float, ...] = (1.0, 1.0)

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("places", "levels"):
            object.__setattr__(self, name, tuple(float(x) for x in getattr(self, name)))
        require_fields(self)
        places, levels = np.array(self.places), np.array(self.levels)
        if not 2 <= places.size == levels.size <= MOST_POINTS:
            raise InputError(
                f"levels: {levels.size} for {places.size} places; allowed: one each, 2 to {MOST_POINTS}; give as many"
            )
        if not (places[0] == 0 and places[-1] == 1 and np.all(places[1:] >= places[:-1])):
            raise InputError("places: they don't rise from 0 to 1; allowed: shares of a period in order; sort them")
        if not (np.all(np.isfinite(levels)) and levels.min() >= 0):
            raise InputError(f"levels: {levels.min():g} is no light; allowed: finite, 0 or more; correct the table")
        mean = float(np.trapezoid(levels, places))
        if mean <= 0:
            raise InputError("levels: the lamp is dark all the time; allowed: some light; correct the table")
        if self.depth and np.ptp(levels) > 0:
            raise InputError(f"depth: {self.depth:g} beside straight pieces; allowed: 0; put the cosine into levels")
        object.__setattr__(self, "levels", tuple((levels / mean).tolist()))

    @property
    def period_s(self) -> float:
        """Return the time after which the light repeats [s]."""
        return 1 / self.frequency_hz

    def mean(self, start_s: float | Floats, exposure_s: float) -> Floats:
        """Return the mean light within an exposure, relative to that of all time, from the exact integral.

        For a cosine that is 1 + depth sinc(f T) cos(2 pi f (t + T / 2)), with sinc(x) = sin(pi x) / (pi x).

        Parameters
        ----------
        start_s : float or array of float
            When the exposure starts [s].
        exposure_s : float
            Its length, above 0 [s].
        """
        start = np.asarray(start_s, np.float64) * self.frequency_hz
        periods = exposure_s * self.frequency_hz
        if self.depth:
            return np.asarray(1 + self.depth * np.sinc(periods) * np.cos(2 * pi * (start + periods / 2)))
        # Whole periods apart from the rest: long after time 0 the difference of two integrals would cancel.
        whole = np.floor(periods)
        first = start - np.floor(start)
        last = first + (periods - whole)
        return np.asarray((whole + self._integral(last) - self._integral(first)) / periods)

    def _integral(self, place: Floats) -> Floats:
        """Integrate the straight pieces from 0 to a place in two periods."""
        places, levels = np.array(self.places), np.array(self.levels)
        widths = np.diff(places)
        before = np.concatenate([[0.0], np.cumsum(widths * (levels[1:] + levels[:-1]) / 2)])
        turn = np.floor(place)
        within = place - turn
        piece = np.clip(np.searchsorted(places, within, side="right") - 1, 0, widths.size - 1)
        step = within - places[piece]
        slope = np.diff(levels)[piece] / np.where(widths > 0, widths, 1.0)[piece]
        return np.asarray(turn + before[piece] + step * (levels[piece] + slope * step / 2))


def pwm(frequency_hz: float, duty: float) -> Waveform:
    """Return a switched lamp: fully on for a share `duty` of each period, from time 0, and off for the rest.

    Raises
    ------
    InputError
        For a number out of range.
    """
    require_range("duty", duty, 1e-4, 1.0, "give the share of a period that is lit")
    return Waveform(frequency_hz, places=(0.0, duty, duty, 1.0), levels=(1.0, 1.0, 0.0, 0.0))


def read_waveform(path: str | Path) -> Waveform:
    """Read one period of a lamp's light from a CSV with a header: ``time_s``, ``time_ms`` or ``time_us``, and light.

    The light is in any unit, because only its shape counts; it is interpolated linearly between two rows. The last
    row's time is the end of the period.

    Raises
    ------
    InputError
        For a file that can't be read, another header, a row that isn't two numbers, times that don't rise, or negative
        light; the file is named.
    """
    place = f"flicker: {str(path)!r}"
    with read_errors(f"{place} can't be read", "give a CSV with the columns time_ms and light"):
        lines = read_bounded(Path(path), MOST_BYTES).decode("utf-8-sig").splitlines()
    rows = [(number, line.split(",")) for number, line in enumerate(lines, 1) if line.strip()]
    head = rows[0][1] if rows else []
    unit_s = _UNITS_S.get(head[0].strip().lower()) if len(head) == 2 else None
    if unit_s is None:
        raise InputError(
            f"{place} begins with {','.join(head)!r}; allowed: {', '.join(_UNITS_S)} and a column of light; name them"
        )
    values = []
    for number, cells in rows[1:]:
        try:
            pair = [float(cell) for cell in cells]
        except ValueError:
            pair = []
        if len(pair) != 2 or not all(map(isfinite, pair)):
            raise InputError(
                f"{place}, line {number}: {','.join(cells)!r} isn't whole; allowed: a time and its light; complete the "
                "row, or take it out"
            )
        values.append(pair)
    times, light = np.array(values, np.float64).reshape(-1, 2).T
    if times.size < 2 or not np.all(times[1:] > times[:-1]):
        raise InputError(f"{place}: its times don't rise from row to row; allowed: one period in order; sort the rows")
    places = (times - times[0]) / (times[-1] - times[0])
    with in_place(place):
        return Waveform(1 / (unit_s * (times[-1] - times[0])), places=tuple(places), levels=tuple(light))


def waveform(text: str) -> Waveform:
    """Return the waveform of a lamp: by name and frequency, by pulse width modulation, or from a table.

    Parameters
    ----------
    text : str
        ``fluorescent@100Hz`` for one of `LAMPS` on mains of 50 Hz; ``pwm@1000Hz:0.25`` for a lamp that is lit for a
        quarter of each millisecond; or a CSV's name (`read_waveform`).

    Raises
    ------
    InputError
        For anything else.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.waveform("sodium_high@120Hz").depth
    0.95
    >>> rodcone.waveform("pwm@1000Hz:0.25").levels
    (4.0, 4.0, 0.0, 0.0)
    """
    if is_curve_file(text):
        return read_waveform(text)
    match = _FORM.match(text)
    if match is None or (match[1] == PWM) != (match[3] is not None):
        raise InputError(f"flicker: {text!r} is no waveform; allowed: LAMP@FREQUENCYHz, pwm@FREQUENCYHz:DUTY; {_FIX}")
    name = match[1]
    hertz = float(match[2])
    with in_place("flicker"):
        if name == PWM:
            return pwm(hertz, float(match[3]))
        if name not in LAMPS:
            raise unknown("lamp", name, (*LAMPS, PWM))
        return Waveform(hertz, LAMPS[name])
