"""Merge a render's fine bands into fewer, wider ones, which shows without another render what those would give."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from render.error_estimates import Halves
from render.radiance import SpectralRadiance
from render.transport import Transport
from rodcone.types import Floats

FINE_NM = 10.0  # nm, width of the reference's bands over 380-780 nm
# Numbers of bands that a plan may choose; each line of a lamp adds a band of its own. The renderer computes four
# bands at a time, so that numbers between these cost as much as the next multiple of four.
COUNTS = (4, 8, 12, 16, 20, 28, 40)


def possible_counts(width_nm: Floats) -> tuple[int, ...]:
    """Return the numbers of bands that a plan may choose; a wider range may also keep all of its fine bands."""
    return (*COUNTS, width_nm.size) if width_nm.size > COUNTS[-1] else COUNTS


def band_groups(width_nm: Floats, count: int) -> list[NDArray[np.intp]]:
    """Divide the fine bands into about `count` groups of neighbours, as equal as they can be; return their indices.

    The narrow band of a lamp's line is a group of its own, so lamps with lines have more groups than `count`.
    """
    size = width_nm.size / min(count, width_nm.size)
    narrow = width_nm < FINE_NM / 4
    groups: list[NDArray[np.intp]] = []
    for run in np.split(np.arange(width_nm.size), np.flatnonzero(np.diff(narrow.astype(int))) + 1):
        pieces = run.size if narrow[run[0]] else max(1, round(run.size / size))
        groups += np.array_split(run, pieces)
    return groups


def wide_bands(nm: Floats, width_nm: Floats, groups: Sequence[NDArray[np.intp]]) -> tuple[Floats, Floats]:
    """Return the centres and widths of merged bands [nm]."""
    first = np.array([nm[group[0]] - width_nm[group[0]] / 2 for group in groups])
    last = np.array([nm[group[-1]] + width_nm[group[-1]] / 2 for group in groups])
    return (first + last) / 2, last - first


def merge_transport(transport: Transport, groups: Sequence[NDArray[np.intp]]) -> Transport:
    """Return the transport in wide bands, from the same paths.

    The variance assumes that bands rise and fall together, which is the most that it can be. The irradiance meter is
    left out, because its bands are the fine ones.
    """
    nm, width_nm = wide_bands(transport.wavelength_nm, transport.width_nm, groups)
    matrix = _means(transport.width_nm, groups)
    means = transport.scene_means
    # The covariance is that of the bands of all light groups, followed by the uncovered part.
    every = scipy.linalg.block_diag(*[matrix] * len(transport.groups), 1.0)

    def merged(halves: Halves) -> Halves:
        return Halves(_merge(matrix, halves.mean), _merge(matrix, halves.difference))

    return replace(
        transport,
        light=merged(transport.light),
        variance=_merge(matrix, np.sqrt(np.maximum(transport.variance, 0.0))) ** 2,
        seen=tuple(
            x if len(x.mean) == 1 else merged(Halves(x.mean[None], x.difference[None]))[0] for x in transport.seen
        ),
        scene_means=replace(means, radiance=means.radiance @ matrix.T, covariance=every @ means.covariance @ every.T),
        meter=None,
        wavelength_nm=nm,
        width_nm=width_nm,
        shared=transport.shared
        and replace(transport.shared, correlation=_merge(matrix, transport.shared.correlation[None])[0]),
    )


def merge_radiance(radiance: SpectralRadiance, groups: Sequence[NDArray[np.intp]]) -> SpectralRadiance:
    """Average exact radiance over wide bands: what a render would give that made no error within a band."""
    nm, width_nm = wide_bands(radiance.wavelength_nm, radiance.widths_nm, groups)
    values = radiance.values @ _means(radiance.widths_nm, groups).T.astype(radiance.values.dtype)
    return replace(radiance, values=values, wavelength_nm=nm, width_nm=width_nm)


def _means(width_nm: Floats, groups: Sequence[NDArray[np.intp]]) -> Floats:
    """Return the weights of the fine bands in the mean over each wide band, shape (wide, fine)."""
    matrix = np.zeros((len(groups), width_nm.size))
    for row, group in enumerate(groups):
        matrix[row, group] = width_nm[group] / width_nm[group].sum()
    return matrix


def _merge(matrix: Floats, planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average (group, band, h, w) over the fine bands of each wide band."""
    return np.asarray(np.einsum("wf,gfyx->gwyx", matrix, planes, optimize=True), dtype=np.float32)
