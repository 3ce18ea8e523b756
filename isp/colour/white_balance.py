"""White balance of a developed frame: by Gray World, by a calibrated neutral, or by a given one.

Gray World (Buchsbaum 1980) makes the channels' means equal. If a picture is too dark for it, the calibrated neutral
applies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.highlights import saturated_nearby
from isp.crosstalk import is_undone
from isp.planes import rows_at
from render.illuminants import illuminant
from rodcone.display import brief
from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import mask, unmixed
from sensor.curves import Responses, built_in, electrons_from_neutral
from sensor.raw import RawImage, channel_variance

BalanceSource = Literal["gray world", "calibrated", "given"]


@dataclass(frozen=True)
class WhiteBalance:
    """Responses by which a frame is balanced: a calibrated neutral beside Gray World, or a given one instead of it.

    Attributes
    ----------
    neutral : (channel,) float64 or None
        Calibrated response to a neutral, in the order of `sensor.cfa.channels`, for pictures that are too dark for Gray
        World. None means that of the project's own curves under D65.
    given : (channel,) float64 or None
        Response to what should become neutral, in place of Gray World's means.
    """

    neutral: Floats | None = None
    given: Floats | None = None

    __repr__ = brief

    @classmethod
    def of(
        cls, raw: RawImage, neutral: ArrayLike | None, balance: ArrayLike | WhiteBalance | None = None
    ) -> WhiteBalance:
        """Make a `WhiteBalance` from a pipeline's arguments; if `balance` is one, return it.

        Raises
        ------
        InputError
            For a response that isn't one positive number per channel of the mosaic.
        """
        if isinstance(balance, WhiteBalance):
            return balance
        return cls(_response("neutral", neutral, raw), _response("balance", balance, raw))

    def response(self, raw: RawImage) -> Floats:
        """Return the calibrated response to a neutral, by default that of the project's own curves, (channel,)."""
        return raw.channel_mixing @ neutral_response(raw.channels) if self.neutral is None else self.neutral

    def expected(self, raw: RawImage) -> Floats:
        """Return the response to a neutral before the picture is known: given or else calibrated, shape (channel,)."""
        return self.response(raw) if self.given is None else self.given

    def without_crosstalk(self, raw: RawImage) -> WhiteBalance:
        """Return the same responses as the raw image reads them once its crosstalk is undone."""
        if not is_undone(raw.crosstalk):
            return self
        neutral, given = (
            None if read is None else unmixed(raw.channel_mixing, read) for read in (self.neutral, self.given)
        )
        return replace(self, neutral=neutral, given=given)

    def gains(self, raw: RawImage, planes: NDArray[np.floating]) -> tuple[Floats, Mapping[str, BalanceSource]]:
        """Compute the white-balance gains of a frame, and state where they come from.

        Parameters
        ----------
        planes : (h, w, channel) float
            The pipeline's linear planes [e-], channels in the order of `sensor.cfa.channels`.

        Returns
        -------
        (channel,) float64
            Factor on each channel; the factor of green, or else of `sensor.cfa.unit_channel`, is 1.
        mapping of str to str
            Origin of each channel's factor: ``gray world``, ``calibrated`` if the picture was too dark, or ``given``.

        Notes
        -----
        Gray World averages colours over the pixels without a saturated colour sample nearby. It averages W over those
        of them that also have no saturated W nearby. W saturates first, and if its saturated pixels were left out of
        the colours' means as well, only the dark part of the scene would remain.
        """
        names, unit = raw.channels, raw.unit_channel
        colours = "".join(raw.colour_channels)
        if self.given is not None:
            return self.given[names.index(unit)] / self.given, dict.fromkeys(names, "given")
        neutral = self.response(raw)
        usable = ~saturated_nearby(raw, colours)
        groups = {colours: usable}
        if "W" not in colours and "W" in names:  # W's group first: the colours then set green's gain and its source
            groups = {unit + "W": usable & ~saturated_nearby(raw, "W"), colours: usable}
        factors = np.ones(len(names))
        sources: dict[str, BalanceSource] = dict.fromkeys(names, "calibrated")
        for group, pixels in groups.items():
            index = [names.index(channel) for channel in group]
            samples = np.maximum([np.sum(pixels & mask(raw.cfa, channel, raw.shape)) for channel in group], 1)
            rows = np.asarray(rows_at(planes, pixels), dtype=np.float64)
            means = np.einsum("nc->c", rows) / max(len(rows), 1)
            errors = np.sqrt(channel_variance(raw, np.maximum(means, 0.0))[index] / samples)
            factors[index], certain = gray_world(means[index], errors, neutral[index], green=group.index(unit))
            for channel, sure in zip(group, certain, strict=True):
                sources[channel] = "gray world" if sure else "calibrated"
        return factors, sources


def neutral_response(names: Sequence[str], responses: Responses | None = None) -> Floats:
    """Compute the relative electrons of curves, by default the project's own, from a neutral under D65, (channel,)."""
    return electrons_from_neutral(responses or built_in(), names, illuminant("D65"))


def _response(name: str, values: ArrayLike | None, raw: RawImage) -> Floats | None:
    if values is None:
        return None
    response = np.asarray(values, dtype=np.float64)
    names = raw.channels
    if response.shape != (len(names),) or not np.all((response > 0) & np.isfinite(response)):
        raise InputError(f"{name}: {response.tolist()!r} is not allowed; give a positive response for each of {names}")
    return response


LEAST_STANDARD_ERRORS = 5.0  # Gray World sets a channel's gain if the mean is at least so many standard errors


def gray_world(
    means: NDArray[np.float64], standard_errors: NDArray[np.float64], neutral: NDArray[np.float64], green: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Compute the gains that make the mean of each channel equal to green's.

    Parameters
    ----------
    means : (channel,) float64
        Means of the pipeline's linear planes over unsaturated pixels [e-].
    standard_errors : (channel,) float64
        Standard error of each mean [e-].
    neutral : (channel,) float64
        Calibrated response to a neutral, in any unit, which applies where a mean is under five standard errors.
    green : int
        Index of the green channel; if green is too dark, all gains are the calibrated ones.

    Returns
    -------
    (channel,) float64, (channel,) bool
        Factor on each channel, and whether Gray World set it, rather than `neutral`.
    """
    certain = (means >= LEAST_STANDARD_ERRORS * standard_errors) & (means > 0)
    certain &= bool(certain[green])
    return np.where(certain, means[green] / np.where(certain, means, 1.0), neutral[green] / neutral), certain
