"""Settings of the interleaved reconstruction, checked when they are made, and its results."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_name
from rodcone.jit import Backend
from sensor.cfa import Tile
from sensor.raw import RawImage

Distance = Literal["noise", "raw"]

NEIGHBOURHOOD = 21  # from Parmar & Wandell 2009, section 3.1; the paper states no other of these four settings
# The best of 45 settings over light levels, sensors and scenes (`benchmarks/bench_quality.py settings`,
# docs/decisions/0015). Fine texture rarely repeats, so that a patch of one pixel, the bilateral filter, is best.
PATCH = 1
SIGMA_D = 6.0
SIGMA_S = 3.0
SMALLEST_SIGMA = 1e-3  # the next pixel's spatial weight is then exp(-5e5), so that smaller values change nothing


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Parameters of eqs. (1)-(6).

    Attributes
    ----------
    neighbourhood, patch : int
        Odd widths of Omega and of the patches h_i [pixels]. The time grows with the square of `neighbourhood`.
    sigma_d : float
        Standard deviation of the spatial weight, eq. (4) [pixels]; 0.001 to inf.
    sigma_s : float
        Standard deviation of the similarity weight, eq. (5) [standard deviations of one pixel's noise, or electrons];
        0.001 to inf.
    distance : {"noise", "raw"}
        With "noise" one guide serves all channels, in units of noise (`isp.interleaved.panchromatic`). With "raw", as
        in the paper, distances are in electrons, between patches of W's plane and, in the share alpha of eq. (6), of
        the channel's own plane; alpha is counted over the patch.

    Raises
    ------
    InputError
        If a width is even or not positive, a sigma is under 0.001 or NaN, or the distance is neither of the two.
    """

    neighbourhood: int = NEIGHBOURHOOD
    patch: int = PATCH
    sigma_d: float = SIGMA_D
    sigma_s: float = SIGMA_S
    distance: Distance = "noise"

    @cached_property
    def reach(self) -> int:
        """Return the largest offset in Omega along one axis [pixels]."""
        return self.neighbourhood // 2

    def __post_init__(self) -> None:
        for name in ("neighbourhood", "patch"):
            value = getattr(self, name)
            if not isinstance(value, int) or value < 1 or value % 2 == 0:
                raise InputError(f"{name}: {value!r} isn't allowed; give an odd whole number such as 5")
        for name in ("sigma_d", "sigma_s"):
            value = getattr(self, name)
            if not value >= SMALLEST_SIGMA:  # written so that NaN fails
                raise InputError(f"{name}: {value!r} isn't allowed; give {SMALLEST_SIGMA:g} to inf")
        require_name("distance", self.distance, get_args(Distance))

    def check_reaches(self, tile: Tile) -> None:
        """Raise `InputError` if Omega, cut off at a corner of the frame, may hold no sample of some channel."""
        smallest = 2 * max(len(tile), len(tile[0])) - 1
        if self.neighbourhood < smallest:
            raise InputError(
                f"neighbourhood: {self.neighbourhood} may miss a channel of the tile {tile}; "
                f"allowed: odd numbers from {smallest}; try {max(smallest, NEIGHBOURHOOD)}"
            )


DEFAULTS = Settings()
# The paper's own method. The paper states neither patch nor sigmas. For each patch, sigma_s is the best of 30, 100, 300
# and 1000 e-, the same for all levels of light (docs/decisions/0037-lamps-in-the-dark.md).
PAPER = Settings(distance="raw", sigma_s=300.0)
PAPER_5X5 = Settings(distance="raw", sigma_s=1000.0, patch=5)


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed frame.

    Attributes
    ----------
    estimate : (h, w, channel) ndarray
        f_i(x) of eq. (1) [e-], channels in the order of `sensor.cfa.channels`.
    noise_gain : (h, w, channel) ndarray
        sum w^2 / (sum w)^2, 0 to 1: the factor by which the weights reduce the variance of white noise on the samples.
    engine : {"cuda", "llvm", "numpy"}
        Engine that computed the frame.
    white : WhiteReading or None
        The frame read as W, with the guide; None if each channel has a guide of its own.
    """

    estimate: NDArray[np.floating]
    noise_gain: NDArray[np.floating]
    engine: Backend
    white: WhiteReading | None = None


@dataclass(frozen=True)
class WhiteReading:
    """A frame whose every sample was converted to W (`isp.interleaved.panchromatic.read_as_white`).

    Attributes
    ----------
    raw : RawImage
        The frame, in which full samples of W are raised to what W would read if the colours around were a neutral's.
    shares : (rows, columns, channel) float
        Each channel's electrons per electron of W in the surroundings of every tile, in the order of
        `sensor.cfa.channels`.
    guide : (h, w) float
        What W would read at every pixel [standard deviations of the noise of a sample of W].
    lines : (rows, columns) float
        Certainty, 0 to 1, that grey lines two pixels apart make the colour that the samples of a tile show.
    window_shares : (rows, columns, channel) float
        Like `shares`, in the window of each tile by which the guide reads samples as W.
    """

    raw: RawImage
    shares: NDArray[np.floating]
    guide: NDArray[np.floating]
    lines: NDArray[np.floating]
    window_shares: NDArray[np.floating]
