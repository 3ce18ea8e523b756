"""Limits at which a render stops: samples, error or time, whichever is reached first."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from render.integrator.points import LOG2_POINTS
from render.transport import Stop, Transport
from rodcone.errors import InputError, require_fields

DEFAULT_SPP = 64
PILOT_FROM = 64  # samples per pixel, above which a pilot render shows where they are needed
MOST_POINTS = 1 << LOG2_POINTS  # largest number of points of each half, in the mean over the picture
MOST_SPP = 2 * MOST_POINTS  # largest allowed limit, and the ceiling if only an error or a time is asked for
LEAST_POINTS = 8  # points of each half from which on the error is reliable enough to stop
A_POWER = 8  # chunks from one power of two to the next, so that at most an eighth more is drawn than asked for


def chunk_from(start: int) -> int:
    """Return the length of the chunk that begins at a point of the sequence: 1 before 16, 2 before 32, and so on."""
    return max(1, (1 << start.bit_length() >> 1) // A_POWER)


@dataclass(frozen=True)
class Limits:
    """Limits of a render, which stops at the first that is reached; without any, after `DEFAULT_SPP` samples per pixel.

    Attributes
    ----------
    spp, max_spp : int or None
        Samples per pixel; `max_spp` is meant to be combined with another limit.
    noise : float or None
        Relative Monte Carlo error to reach.
    max_seconds : float or None
    seed : int
    mean_rate : float
        Mean over the picture of the pixels' rates. All counts below are points of a pixel of rate 1.

    Raises
    ------
    InputError
        For a limit out of range, or both `spp` and `max_spp`.
    """

    spp: Annotated[int | None, (1, MOST_SPP, "give samples per pixel")] = None
    max_spp: Annotated[int | None, (1, MOST_SPP, "give samples per pixel")] = None
    noise: Annotated[float | None, (1e-6, 10.0, "give a relative error such as 0.02")] = None
    max_seconds: Annotated[float | None, (1e-3, 1e7, "give seconds")] = None
    seed: Annotated[int, (0, 2**63, "give a whole number")] = 0
    mean_rate: float = 1.0

    def __post_init__(self) -> None:
        require_fields(self)
        if self.spp is not None and self.max_spp is not None:
            raise InputError(
                f"spp and max_spp: {self.spp!r} and {self.max_spp!r} are both given; allowed: one; leave spp out"
            )

    @property
    def most_samples(self) -> int:
        """Return the samples per pixel, of both halves, after which the render stops in any case; not rounded up."""
        return self.spp or self.max_spp or (MOST_SPP if self.noise or self.max_seconds else DEFAULT_SPP)

    @property
    def most_points(self) -> int:
        """Return the points of each half after which the render stops in any case: a whole number of chunks."""
        half = math.ceil(self.most_samples / 2 / self.mean_rate)
        chunk = chunk_from(half)
        return -(-half // chunk) * chunk

    def next_look(self, count: int) -> int:
        """Return the number of points of each half at which the error is checked next: 2^n, and half-way between."""
        if self.noise is None or count < LEAST_POINTS:
            return self.most_points if self.noise is None else min(LEAST_POINTS, self.most_points)
        power = 1 << count.bit_length() >> 1
        return min(power + power // 2 if count < power + power // 2 else 2 * power, self.most_points)

    def met_by(self, earlier: Transport) -> bool:
        """Return whether an earlier render has already reached a limit."""
        count = int(earlier.counts.min()) // 2
        last_s = earlier.seconds / max(count, 1)
        rated = replace(self, mean_rate=float(earlier.counts.mean() / earlier.counts.min()))
        return rated.stop(count, earlier.relative_mc_error, earlier.seconds, last_s) is not None

    def stop(self, count: int, error: float, seconds: float, last_s: float) -> Stop | None:
        """Return the limit that is reached, or None.

        Parameters
        ----------
        count : int
            Points of each half so far.
        error : float
            Relative Monte Carlo error.
        seconds, last_s : float
            Time so far, and time of the last run; another run is assumed to take as long.
        """
        if count >= self.most_points:
            return "samples"
        if self.noise is not None and count >= LEAST_POINTS and error <= self.noise:
            return "noise"
        if self.max_seconds is not None and count > 0 and seconds + last_s > self.max_seconds:
            return "seconds"
        return None

    def share(self, count: float, error: float, seconds: float) -> float:
        """Return the share of the work that is done, 0 to 1, by the limit that is nearest."""
        by_noise = (self.noise / error) ** 2 if self.noise and error else 0.0
        return min(max(count / self.most_points, seconds / (self.max_seconds or np.inf), by_noise), 1.0)
