"""Which of the prior's components a patch comes from: first by a few directions, then exactly among the likeliest."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from isp.ple.tables import Singles, Table

BLOCK = 1000  # patches whose numbers stay in a core's cache; lines a power of two apart would share its places
MOST = 24  # components that a patch is held against, of the likeliest in a few directions


def pick(at: Table, known: Singles, noise: Singles | None) -> tuple[NDArray[np.int16], Singles]:
    """Pick each patch's likeliest component.

    Parameters
    ----------
    at : Table
    known : (patch, sample + 1) or (patch, sample + 5) float32
        Samples in units of noise, 1, and with a pilot its means.
    noise : (patch,) float32 or None
        The pilot's variance over the table's typical one.

    Returns
    -------
    (patch,) int16
        The component.
    (patch,) float32
        Its misfit: squared whitened samples over their number, 1 in the mean of patches that it explains.
    """
    count, size = len(known), len(at.centre)
    best, chosen = np.full(count, -np.inf, np.float32), np.zeros(count, np.int16)
    misfit = np.empty(count, np.float32)
    width = size if noise is None else size + 4
    # Arrays are made once: fresh memory costs as much as the sums.
    taken, reads = (np.empty((BLOCK, each), np.float32) for each in (known.shape[1], width))
    candidates = _candidates(at, known[:, :size])
    for k, some in ((k, some) for k, row in enumerate(candidates) for some in blocks(np.flatnonzero(row))):
        np.take(known, some, axis=0, out=taken[: some.size], mode="clip")
        read = np.matmul(taken[: some.size], at.reads[k][: known.shape[1], :width], out=reads[: some.size])
        square = np.vecdot(read[:, :size], read[:, :size])
        likelihood = at.log_scale[k] - 0.5 * square
        if noise is not None:
            # A row a direction, for sums along them.
            news, spread = read[:, size:].T.copy(), noise[some] + at.spread[k, :, None].astype(np.float32)
            likelihood -= 0.5 * (np.log(spread.prod(axis=0)) + (news * news / spread).sum(axis=0))
        better = likelihood > best[some]
        winners = some[better]
        best[winners], chosen[winners], misfit[winners] = likelihood[better], k, square[better] / size
    return chosen, misfit


def blocks(index: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Parts of an index, `BLOCK` long."""
    return (index[first : first + BLOCK] for first in range(0, len(index), BLOCK))


def _candidates(at: Table, y: Singles) -> NDArray[np.bool_]:
    """Which components may be the likeliest, shape (component, patch), by the likelihood in a few directions."""
    quick = np.empty((len(at.quick), len(y)), np.float32)
    few = at.few.shape[1]
    starts = np.cumsum([0, *range(few, 0, -1)]).tolist()
    held = np.empty((at.quick.shape[1], BLOCK), np.float32)
    for first in range(0, len(y), BLOCK):
        off = y[first : first + BLOCK] - at.centre
        told = np.ascontiguousarray((off @ at.few).T)
        features = held[:, : len(off)]
        for i, start in enumerate(starts[:-1]):
            np.multiply(told[i], told[i:], out=features[start : starts[i + 1]])
        features[starts[-1] : starts[-1] + few] = told
        features[-2] = np.einsum("ij,ij->i", off, off) - np.einsum("ij,ij->j", told, told)
        features[-1] = 1.0
        quick[:, first : first + BLOCK] = at.quick @ features
    candidates = np.asarray(quick > quick.max(axis=0) - at.margin)
    crowded = np.flatnonzero(candidates.sum(axis=0, dtype=np.int8) > MOST)
    least = np.full(len(y), -np.inf, np.float32)
    least[crowded] = np.partition(quick[:, crowded], len(quick) - MOST, axis=0)[-MOST]
    candidates &= quick >= least
    return candidates
