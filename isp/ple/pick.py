"""Choice of each patch's component in the prior: candidates by an approximate likelihood, then the likeliest one."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.ple.tables import Table
from rodcone.types import Singles

BLOCK = 1000  # patches at once, which fit into a core's cache, where rows of a power of two would share the same places
UNEXPLAINED = 1.2  # misfit from which on a patch is held against oblique lines too
MOST = 12  # largest number of trained candidates per patch


@dataclass(frozen=True)
class PickedComponents:
    """The likeliest component of each patch so far.

    Attributes
    ----------
    component : (patch,) int16
    misfit, likelihood : (patch,) float32
        Misfit as `pick` returns it, and the logarithm of the likelihood.
    """

    component: NDArray[np.int16]
    misfit: Singles
    likelihood: Singles


def pick(components: Table, evidence: Singles, noise: Singles | None) -> tuple[NDArray[np.int16], Singles]:
    """Pick each patch's likeliest component.

    Parameters
    ----------
    components : Table
    evidence : (patch, sample + 1) or (patch, sample + 5) float32
        Samples [units of noise], the number 1, and the pilot's means, if there is a pilot.
    noise : (patch,) float32 or None
        The pilot's variance over the one that the table assumes; None without a pilot.

    Returns
    -------
    (patch,) int16
        Number of the component.
    (patch,) float32
        Misfit: the mean of the squared whitened samples, which is about 1 if the component explains the patch.
    """
    count = len(evidence)
    choice = PickedComponents(
        np.zeros(count, np.int16), np.empty(count, np.float32), np.full(count, -np.inf, np.float32)
    )
    # Without a pilot there are few patches, so that every component is a candidate.
    candidates = np.ones((len(components.values), count), bool) if noise is None else _candidates(components, evidence)
    _compare(components, evidence, noise, candidates, choice)
    sectors = components.trained + len(components.aliased)
    if noise is not None and components.mix.lines:
        candidates[:sectors], candidates[sectors:] = False, choice.misfit > UNEXPLAINED
        _compare(components, evidence, noise, candidates, choice)
    return choice.component, choice.misfit


def _compare(
    components: Table, evidence: Singles, noise: Singles | None, candidates: NDArray[np.bool_], choice: PickedComponents
) -> None:
    """Replace the choice of each patch by a likelier one among `candidates` (component, patch)."""
    size = len(components.rows)
    width = size if noise is None else size + 4
    # These arrays are reused for all blocks, because allocating them anew would take as long as the sums.
    block, reads = (np.empty((BLOCK, columns), np.float32) for columns in (evidence.shape[1], width))
    components.make_whitenings(np.flatnonzero(candidates.any(axis=1)).tolist())
    for k, group in ((k, group) for k, row in enumerate(candidates) for group in blocks(np.flatnonzero(row))):
        whitening = components.whitening(k)
        np.take(evidence, group, axis=0, out=block[: group.size], mode="clip")
        read = np.matmul(block[: group.size], whitening.reads[: evidence.shape[1], :width], out=reads[: group.size])
        square = np.vecdot(read[:, :size], read[:, :size])
        likelihood = whitening.log_scale - 0.5 * square
        if noise is not None:
            # One row per direction of the pilot, for sums along them.
            innovation = read[:, size:].T.copy()
            spread = noise[group] + whitening.spread[:, None].astype(np.float32)
            likelihood -= 0.5 * (np.log(spread.prod(axis=0)) + (innovation * innovation / spread).sum(axis=0))
        wins = likelihood > choice.likelihood[group]
        winners = group[wins]
        choice.likelihood[winners], choice.component[winners] = likelihood[wins], k
        choice.misfit[winners] = square[wins] / size


def blocks(index: NDArray[np.intp], length: int = BLOCK) -> Iterator[NDArray[np.intp]]:
    """Yield parts of an index that are `length` long."""
    return (index[first : first + length] for first in range(0, len(index), length))


def _candidates(components: Table, evidence: Singles) -> NDArray[np.bool_]:
    """Return which components may be the likeliest, (component, patch).

    A trained component may be if its approximate likelihood (`Table.quick`) is near the largest. Fine lines may be if
    the pilot has a colour that lines would have. Oblique lines are no candidates here.
    """
    size = len(components.rows)
    trained = components.trained
    candidates = np.zeros((len(components.values), len(evidence)), np.bool_)
    count = components.directions.shape[1]
    starts = np.cumsum([0, *range(count, 0, -1)]).tolist()
    products = np.empty((components.quick.shape[1], BLOCK), np.float32)
    for first in range(0, len(evidence), BLOCK):
        rows = evidence[first : first + BLOCK]
        off = np.concatenate([rows[:, :size], rows[:, size + 1 :] @ components.white.T], axis=1) - components.centre
        coordinates = np.ascontiguousarray((off @ components.directions).T)
        features = products[:, : len(off)]
        for i, start in enumerate(starts[:-1]):
            np.multiply(coordinates[i], coordinates[i:], out=features[start : starts[i + 1]])
        features[starts[-1] : starts[-1] + count] = coordinates
        features[-2] = np.einsum("ij,ij->i", off, off) - np.einsum("ij,ij->j", coordinates, coordinates)
        features[-1] = 1.0
        quick = components.quick @ features
        likely = quick > quick.max(axis=0) - components.margin
        crowded = np.flatnonzero(likely.sum(axis=0, dtype=np.int8) > MOST)
        least = np.full(len(rows), -np.inf, np.float32)
        least[crowded] = np.partition(quick[:, crowded], len(quick) - MOST, axis=0)[-MOST]
        candidates[:trained, first : first + BLOCK] = likely & (quick >= least)
        if components.mix.lines:
            light = (rows[:, size + 1 :] - components.sampling.black).T
            seen = np.abs(components.aliased @ light) > components.least_aliased @ light
            candidates[trained : trained + len(seen), first : first + BLOCK] = seen
    return candidates
