"""The expected error of one tile after another: every channel is sampled at every pixel once, and a tile picks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.design.expected_error import Doubles, Samples


@dataclass(frozen=True, eq=False)
class Projected:
    """Samples whose error counts along some directions alone: those of metrics W = R' R.

    Attributes
    ----------
    samples : Samples
        Its coefficients are R times those of the prior, one metric's after another's.
    forms : (metric, component, pixel, direction, direction) float64
        W of these coefficients: 1 on the diagonal for each metric's own.
    """

    samples: Samples
    forms: Doubles


def projected(samples: Samples, *rows: Doubles) -> Projected:
    """Project the middle pixels on metrics' rows R, each of shape (component, pixel, direction, coefficient)."""
    every = np.concatenate(rows, axis=2)
    metric = np.repeat(np.arange(len(rows)), [row.shape[2] for row in rows])
    forms = np.stack([np.diag((metric == number).astype(np.float64)) for number in range(len(rows))])
    cross = np.einsum("kspc,kpdc->kspd", samples.cross, every, optimize=True)
    return Projected(
        Samples(
            means=samples.means,
            signal=samples.signal,
            cross=cross,
            beside=cross,
            within=every @ samples.within @ every.swapaxes(-1, -2),
        ),
        np.broadcast_to(forms[:, None, None], (len(rows), *every.shape[:2], len(metric), len(metric))),
    )


def picked(every: Samples, channel: NDArray[np.intp], spread: Doubles | None = None) -> Samples:
    """Samples of a tile.

    Parameters
    ----------
    every : Samples
        Of each channel at each pixel, in the order (channel, pixel).
    channel : (pixel,) intp
        Channel of each pixel.
    spread : (pixel, pixel) float64, optional
        Share of the electrons of one pixel's light (second axis) that another collects (first axis).
    """
    at = channel * len(channel) + np.arange(len(channel))
    means, signal, cross = every.means[:, at], every.signal[:, at[:, None], at], every.cross[:, at]
    if spread is not None:
        means, signal = means @ spread.T, spread @ signal @ spread.T
        cross = np.einsum("st,ktpd->kspd", spread, cross, optimize=True)
    return Samples(means=means, signal=signal, cross=cross, beside=cross, within=every.within)
