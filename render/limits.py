"""When a render stops: samples, error or time, whichever comes first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from render.transport import Stop, Transport
from rodcone.errors import InputError, require_range, require_whole

DEFAULT_SPP = 64
PASSES = 8  # scatter of fewer passes says little about the error
PASS_SPP = 16  # samples a pixel and pass where only an error or a time is asked for
MOST_SPP = 1 << 16  # ceiling where only an error is asked for
MOST_ROUNDING = 1.2  # samples drawn over those asked for, at most; below 5 an even number of passes may draw more


@dataclass(frozen=True)
class Limits:
    """When a render stops: at whichever comes first; with none of the three after `DEFAULT_SPP` samples a pixel.

    Attributes
    ----------
    spp : int or None
        Samples a pixel, drawn in `PASSES` passes or some more.
    max_spp : int or None
        The same, drawn in passes of at most `PASS_SPP`: for a render that is to stop earlier.
    noise : float or None
        Relative Monte Carlo error to reach.
    max_seconds : float or None
    seed : int

    Raises
    ------
    InputError
        For a limit out of range, or both `spp` and `max_spp`.
    """

    spp: int | None = None
    max_spp: int | None = None
    noise: float | None = None
    max_seconds: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("spp", "max_spp"):
            if getattr(self, name) is not None:
                require_whole(name, getattr(self, name), 1, MOST_SPP, "give samples per pixel")
        if self.spp is not None and self.max_spp is not None:
            raise InputError(
                f"spp and max_spp: {self.spp!r} and {self.max_spp!r} are both given; allowed: one; leave spp out"
            )
        if self.noise is not None:
            require_range("noise", self.noise, 1e-6, 10.0, "give a relative error such as 0.02")
        if self.max_seconds is not None:
            require_range("max_seconds", self.max_seconds, 1e-3, 1e7, "give seconds")
        require_whole("seed", self.seed, 0, 2**63, "give a whole number")

    @property
    def most_spp(self) -> int:
        """Samples a pixel after which the render stops in any case."""
        return self.spp or self.max_spp or (MOST_SPP if self.noise or self.max_seconds else DEFAULT_SPP)

    def pass_spp(self, drawn: Callable[[int], int], earlier: Sequence[int] = ()) -> int:
        """Samples a pixel of each pass to come: the most that keep to `PASSES` and `MOST_ROUNDING`.

        Parameters
        ----------
        drawn : callable
            Samples that the sampler draws where so many are asked for.
        earlier : sequence of int
            Samples of each pass that was made already; passes of the last one's size are preferred.
        """
        whole = -(-self.most_spp // PASSES)
        wanted = min(whole, PASS_SPP) if self.max_spp or self.most_spp == MOST_SPP else whole
        missing = self.most_spp - sum(earlier)
        for spp in range(earlier[-1] if earlier else wanted, 1, -1):
            held = drawn(spp)
            pairs = -(-missing // (2 * held))
            enough = len(earlier) + 2 * pairs >= PASSES
            if enough and sum(earlier) + 2 * held * pairs <= MOST_ROUNDING * self.most_spp:
                return held
        return 1

    def met_by(self, earlier: Transport) -> bool:
        """Whether a render that was made earlier leaves nothing to do."""
        pass_seconds = earlier.seconds / earlier.passes
        reached = self.stop(earlier.spp, earlier.passes, earlier.relative_mc_error, earlier.seconds, pass_seconds)
        return reached is not None

    def stop(self, drawn: int, passes: int, error: float, seconds: float, pass_seconds: float) -> Stop | None:
        """Which limit is reached, None while none is."""
        if drawn >= self.most_spp:
            return "samples"
        if self.noise is not None and passes >= PASSES and error <= self.noise:
            return "noise"
        if self.max_seconds is not None and seconds + 2 * pass_seconds > self.max_seconds:
            return "seconds"  # the next pair of passes would end after it
        return None

    def share(self, drawn: int, error: float, seconds: float) -> float:
        """Share of the work done, 0 to 1: by the limit that is nearest."""
        by_noise = (self.noise / error) ** 2 if self.noise and error else 0.0
        return min(max(drawn / self.most_spp, seconds / (self.max_seconds or np.inf), by_noise), 1.0)
