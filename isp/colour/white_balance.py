"""White balance of a developed frame: by Gray World, as calibrated, or as given.

Gray World (Buchsbaum 1980) makes the channels' means alike; where it is too dark for that the calibrated neutral holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.highlights import saturated_nearby
from isp.planes import rows_at
from render.illuminants import illuminant
from rodcone.display import brief
from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import mask
from sensor.curves import Responses, built_in, electrons_from_neutral
from sensor.raw import RawImage, channel_variance

BalanceSource = Literal["gray world", "calibrated", "given"]


@dataclass(frozen=True)
class WhiteBalance:
    """What a frame is balanced by: the calibrated neutral beside Gray World, or a response in its place.

    Attributes
    ----------
    neutral : (channel,) float64 or None
        Calibrated response to a neutral, in the order of `sensor.cfa.channels`, for pictures too dark for Gray World;
        None: the project's own curves under D65.
    given : (channel,) float64 or None
        Response to what should come out neutral, in place of Gray World's means.
    """

    neutral: Floats | None = None
    given: Floats | None = None

    __repr__ = brief

    @classmethod
    def of(
        cls, raw: RawImage, neutral: ArrayLike | None, balance: ArrayLike | WhiteBalance | None = None
    ) -> WhiteBalance:
        """Make the value from a pipeline's keywords; a `WhiteBalance` as `balance` is taken as it is.

        Raises
        ------
        InputError
            For a response that is not one positive number a channel of the mosaic.
        """
        if isinstance(balance, WhiteBalance):
            return balance
        return cls(_response("neutral", neutral, raw), _response("balance", balance, raw))

    def response(self, raw: RawImage) -> Floats:
        """Calibrated response to a neutral, the project's own curves' where none was given, shape (channel,)."""
        return raw.channel_mixing @ neutral_response(raw.channels) if self.neutral is None else self.neutral

    def expected(self, raw: RawImage) -> Floats:
        """Response to a neutral before the picture is known: the given one, else the calibrated, shape (channel,)."""
        return self.response(raw) if self.given is None else self.given

    def gains(self, raw: RawImage, planes: NDArray[np.floating]) -> tuple[Floats, Mapping[str, BalanceSource]]:
        """Gains of a frame, and where they come from.

        Parameters
        ----------
        planes : (h, w, channel) float
            The pipeline's own linear planes [e-], channels in the order of `sensor.cfa.channels`.

        Returns
        -------
        (channel,) float64
            Factor on each channel; green's is 1, or that of `sensor.cfa.unit_channel`.
        mapping of str to str
            Where each channel's factor comes from: ``gray world``, ``calibrated`` where the picture was too dark to
            tell, or ``given``.

        Notes
        -----
        Gray World takes colours over the pixels without a saturated colour sample nearby, W over those it leaves as
        well. W saturates first; taking its pixels out of the colours' means too would leave them the dark part of the
        scene.
        """
        names, unit = raw.channels, raw.unit_channel
        colours = "".join(raw.colour_channels)
        if self.given is not None:
            return self.given[names.index(unit)] / self.given, dict.fromkeys(names, "given")
        neutral = self.response(raw)
        usable = ~saturated_nearby(raw, colours)
        groups = {colours: usable}
        if "W" not in colours and "W" in names:  # before the colours, which then say where green's gain comes from
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
    """Relative electrons of curves, the project's own by default, from a neutral under D65, shape (channel,)."""
    return electrons_from_neutral(responses or built_in(), names, illuminant("D65"))


def _response(name: str, values: ArrayLike | None, raw: RawImage) -> Floats | None:
    if values is None:
        return None
    response = np.asarray(values, dtype=np.float64)
    names = raw.channels
    if response.shape != (len(names),) or not np.all((response > 0) & np.isfinite(response)):
        raise InputError(f"{name}: {response.tolist()!r} is not allowed; give a positive response for each of {names}")
    return response


LEAST_STANDARD_ERRORS = 5.0  # a channel whose mean is less certain than this can't set its own gain


def gray_world(
    means: NDArray[np.float64], standard_errors: NDArray[np.float64], neutral: NDArray[np.float64], green: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Gains that make the mean of each channel equal to green's.

    Parameters
    ----------
    means : (channel,) float64
        Of the pipeline's own linear planes over the pixels that count, the unsaturated ones [e-].
    standard_errors : (channel,) float64
        Of each mean [e-].
    neutral : (channel,) float64
        Calibrated response to a neutral, in any unit: serves where a mean is under five standard errors.
    green : int
        Index of the green channel; where it is too dark all gains are the calibrated ones.

    Returns
    -------
    (channel,) float64, (channel,) bool
        Factor on each channel, and whether Gray World set it; `neutral` did where not.
    """
    certain = (means >= LEAST_STANDARD_ERRORS * standard_errors) & (means > 0)
    certain &= bool(certain[green])
    return np.where(certain, means[green] / np.where(certain, means, 1.0), neutral[green] / neutral), certain
