"""One scale: each patch picks a component and takes its estimate, and overlapping patches are averaged."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from os import cpu_count
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from isp.ple.pick import BLOCK, blocks, pick
from isp.ple.prior import PATCH, Prior
from isp.ple.tables import PILOT_VARIANCE, STEP, Sampling, Singles, Table, table, taper, window

STRIDE = 2  # pixels from patch to patch
STRIP = 100_000  # patches that are estimated together
LEAST_LIGHT = 1e-3  # electrons
COARSE_STEPS = 2  # of light from table to table where a scale only tells the finer one
DOUBT = 2.0
INFLATE = 2.0
LEAST_VARIANCE = 0.02  # of an estimate, beside its posterior one [units of noise^2]


@dataclass(frozen=True)
class Scale:
    """Samples of one scale.

    Attributes
    ----------
    shape : (h, w)
    samples : (h + border, w + border) or (h + border, w + border, channel) float32
        In units of noise, continued beyond the frame by `border`.
    full : like `samples`, bool
        W's saturated samples: only lower bounds.
    samplings : tuple of tuple of Sampling
        Of the first patches' rows and columns; those of the others repeat them.
    columns : (sample,) intp or None
        Which numbers of a patch are samples, in the order of the samplings' rows; None: all.
    """

    shape: tuple[int, int]
    samples: Singles
    full: NDArray[np.bool_]
    samplings: tuple[tuple[Sampling, ...], ...]
    columns: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class PatchPilot:
    """What a coarser scale says of each patch.

    Attributes
    ----------
    means : (ny, nx, 4) float32
        Of the patch, by channel [units of noise].
    variance : (ny, nx) float32
        Of these means.
    """

    means: Singles
    variance: Singles


@dataclass(frozen=True)
class ScaleEstimate:
    """Every channel at every pixel of a scale.

    Attributes
    ----------
    planes : (h, w, 4) float32
        In units of noise.
    variance : (h/2, w/2, 4) float32
        Posterior variance of the mean of a patch's middle.
    noise : (4,) float64
        Posterior variance of a pixel, median over the patches.
    """

    planes: Singles
    variance: Singles
    noise: NDArray[np.float64]


@dataclass(frozen=True)
class Patches:
    """Estimates of some patches, values times weight; arrays over the patches first."""

    values: Singles
    weight: Singles
    inner: Singles
    noise: Singles


def border(length: int, size: int) -> tuple[int, int]:
    """Samples to add before and behind, so that every one lies in as many patches."""
    return size - STRIDE, (length - 1) // STRIDE * STRIDE + size - length


def padded(samples: NDArray[Any], size: int) -> NDArray[Any]:
    """Samples (h, w, ...), continued by reflection by their `border`."""
    sides = [border(length, size) for length in samples.shape[:2]]
    return np.pad(samples, sides + [(0, 0)] * (samples.ndim - 2), mode="reflect")


def estimate(prior: Prior, scale: Scale, light: Singles, pilot: PatchPilot | None) -> ScaleEstimate:
    """Estimate every channel at every pixel of one scale.

    Parameters
    ----------
    prior : Prior
    scale : Scale
    light : (ny, nx) float32
        Of each patch [e- of white in G].
    pilot : PatchPilot or None
    """
    size = scale.samplings[0][0].size
    shape, (ny, nx) = scale.shape, light.shape
    coarse = 1 if size == PATCH else COARSE_STEPS
    steps = np.round(np.log(np.maximum(light, LEAST_LIGHT)) / np.log(STEP) / coarse).astype(np.int16) * coarse
    rows = max(1, STRIP // nx)

    def strip(first: int) -> tuple[Singles, ...]:
        last = min(first + rows, ny)
        part = slice(first * STRIDE, (last - 1) * STRIDE + size)
        y, full = _windows(scale.samples[part], size), scale.full[part]
        hit = _windows(full, size) if full.any() else np.zeros((len(y), 1), bool)
        if scale.columns is not None:
            y, hit = y[:, scale.columns], hit[:, scale.columns] if full.any() else hit
        told = None
        if pilot is not None:
            told = PatchPilot(pilot.means[first:last].reshape(-1, 4), pilot.variance[first:last].ravel())
        groups = _by_sampling(scale.samplings, range(first, last), nx)
        found = _solve(prior, groups, y, hit, steps[first:last].ravel(), told)
        return *_overlapped(found, (last - first, nx), size), found.noise

    # Sums run strip by strip, whatever the threads.
    total = np.zeros(((ny - 1) * STRIDE + size, (nx - 1) * STRIDE + size, 4), np.float32)
    weight = np.zeros(total.shape[:2], np.float32)
    variance = np.zeros((total.shape[0] // STRIDE, total.shape[1] // STRIDE, 4), np.float32)
    cells, noise = np.zeros(variance.shape[:2], np.float32), []
    # BLAS's own threads would wait for each other.
    with _blas().limit(limits=1), ThreadPoolExecutor(cpu_count()) as threads:
        for first, (values, weights, inner, count, each) in zip(
            range(0, ny, rows), threads.map(strip, range(0, ny, rows)), strict=True
        ):
            for sums, part, start in (
                (total, values, first * STRIDE),
                (weight, weights, first * STRIDE),
                (variance, inner, first),
                (cells, count, first),
            ):
                sums[start : start + len(part)] += part
            noise.append(each)
    total /= weight[..., None]
    variance /= cells[..., None]
    edge = size - STRIDE
    inside = total[edge : edge + shape[0], edge : edge + shape[1]]
    kept = tuple(slice(edge // STRIDE, edge // STRIDE + -(-length // STRIDE)) for length in shape)
    return ScaleEstimate(inside, variance[kept], np.median(np.concatenate(noise), axis=0))


@cache
def _blas() -> ThreadpoolController:
    """BLAS as loaded here; looking for it takes milliseconds."""
    return ThreadpoolController().select(user_api="blas")


def _windows(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Patches `STRIDE` apart, shape (patch, sample)."""
    view = sliding_window_view(values, (size, size), axis=(0, 1))[::STRIDE, ::STRIDE]
    if values.ndim == 3:
        view = np.moveaxis(view, 2, -1)
    return view.reshape(view.shape[0] * view.shape[1], -1)


def _by_sampling(
    samplings: tuple[tuple[Sampling, ...], ...], rows: range, nx: int
) -> list[tuple[Sampling, NDArray[np.intp]]]:
    """Each sampling, and which patches of these rows have it."""
    distinct = list(dict.fromkeys(sampling for line in samplings for sampling in line))
    numbers = np.array([[distinct.index(sampling) for sampling in line] for line in samplings])
    each = numbers[np.array(rows)[:, None] % len(samplings), np.arange(nx) % len(samplings[0])].ravel()
    return [(sampling, np.flatnonzero(each == number)) for number, sampling in enumerate(distinct)]


def _solve(
    prior: Prior,
    groups: list[tuple[Sampling, NDArray[np.intp]]],
    y: Singles,
    full: NDArray[np.bool_],
    steps: NDArray[np.int16],
    pilot: PatchPilot | None,
) -> Patches:
    """Estimate patches by light; where Ws are full, first without any W, then with what that says of the full ones."""
    count, values = len(y), 4 * groups[0][0].size ** 2
    found = Patches(*(np.empty((count, *shape), np.float32) for shape in ((values,), (), (4,), (4,))))
    hit = np.asarray(full.any(axis=1))
    if hit.any():
        y = y.copy()
    for sampling, among in groups:
        some = among[hit[among]]
        if some.size:
            rows = np.array(sampling.rows)
            kept = rows % 4 != 3
            blind = Sampling(sampling.size, tuple(rows[kept].tolist()), sampling.gains, sampling.dark_e, sampling.prnu)
            _solve_by_light(prior, blind, y[:, kept], steps, pilot, some, found)
            weight = window(sampling.size).ravel()[rows // 4] * found.weight[some, None]
            guess = found.values[np.ix_(some, rows)] / weight
            y[some] = np.where(full[some], np.maximum(y[some], guess), y[some])
        _solve_by_light(prior, sampling, y, steps, pilot, among, found)
    return found


def _solve_by_light(
    prior: Prior,
    sampling: Sampling,
    y: Singles,
    steps: NDArray[np.int16],
    pilot: PatchPilot | None,
    among: NDArray[np.intp],
    found: Patches,
) -> None:
    order = among[np.argsort(steps[among], kind="stable")]  # of 16 bits: the fast sort
    bounds = np.flatnonzero(np.diff(steps[order], prepend=-(1 << 15), append=-(1 << 15)))
    for first, last in pairwise(bounds.tolist()):
        index = order[first:last]
        told = None if pilot is None else PatchPilot(pilot.means[index], pilot.variance[index])
        _solve_one_light(table(prior, sampling, int(steps[index[0]])), y[index], told, index, found)


def _solve_one_light(at: Table, y: Singles, pilot: PatchPilot | None, index: NDArray[np.intp], found: Patches) -> None:
    """Estimate the patches `index`, whose samples are y, from one table."""
    noise = None
    told = [y, np.ones((len(y), 1), np.float32)]  # what the table's matrices take: samples, 1, the pilot's means
    if pilot is not None:
        noise = (INFLATE * pilot.variance + at.pilot_floor) / (PILOT_VARIANCE + at.pilot_floor)
        told.append(pilot.means)
    known = np.concatenate(told, axis=1)
    chosen, misfit = pick(at, known, noise)
    taken, values = (np.empty((BLOCK, width), np.float32) for width in (known.shape[1], found.values.shape[1]))
    order = np.argsort(chosen, kind="stable")
    bounds = np.flatnonzero(np.diff(chosen[order], prepend=-1, append=-1))
    for first, last in pairwise(bounds.tolist()):
        k = int(chosen[order[first]])
        by = at.estimator(k)
        linear = by.linear[: known.shape[1]]
        for some in blocks(order[first:last]):
            variance, inner = by.variance, by.inner
            own = np.take(known, some, axis=0, out=taken[: some.size], mode="clip")
            if noise is not None:
                sure = 1.0 / (noise[some, None] + at.spread[k])
                variance, inner = by.variance - sure @ by.pilot_variance, by.inner - sure @ by.pilot_inner
                # The pilot's innovation over its variance stands for its means.
                own[:, -4:] = own @ at.reads[k][:, -4:] * sure
            # A patch that no component explains knows its pixels by as much less.
            doubt = np.maximum(misfit[some], 1.0) ** DOUBT
            place, weight = index[some], (1.0 / (doubt * (variance.mean(axis=-1) + LEAST_VARIANCE))).astype(np.float32)
            own *= weight[:, None]
            found.weight[place] = weight
            found.inner[place] = doubt[:, None] * np.maximum(inner, 0.0)
            found.noise[place] = variance * (by.noise / by.variance)
            found.values[place] = np.matmul(own, linear, out=values[: some.size])


def _overlapped(found: Patches, shape: tuple[int, int], size: int) -> tuple[Singles, ...]:
    """Sums over overlapping patches: values and weights by pixel, variances and weights by cells of 2x2 pixels."""
    (ny, nx), across = shape, size // STRIDE
    total = np.zeros(((ny - 1) * STRIDE + size, nx - 1 + across, 4 * STRIDE), np.float32)
    values = found.values.reshape(ny, nx, size, -1)
    # Some rows of patches at once, so that values are read once. In a row patches that don't overlap, so that a sum
    # runs over a patch's width.
    together = max(1, 4 * BLOCK // nx)
    for first in range(0, ny, together):
        some = slice(first, min(first + together, ny))
        for i in range(size):
            rows = total[first * STRIDE + i : (some.stop - 1) * STRIDE + i + 1 : STRIDE]
            for j in range(min(across, nx)):
                part = values[some, j::across, i]
                line = rows[:, j : j + part.shape[1] * across].reshape(part.shape)  # a view: `total` takes the sum
                line += part
    # The window is a product of two lines: weights are summed across, then down, and so are the cells.
    inner = np.concatenate([found.inner, np.ones((ny * nx, 1), np.float32)], axis=1)
    inner = (inner * found.weight[:, None]).reshape(ny, nx, 5)
    each, sides = inner[..., 4:], taper(size).reshape(across, STRIDE)
    weight, cells = (np.zeros((ny, nx - 1 + across, width), np.float32) for width in (STRIDE, 5))
    for j in range(across):
        weight[:, j : j + nx] += each * sides[j]
        cells[:, j : j + nx] += inner
    weights = np.zeros((len(total), nx - 1 + across, STRIDE), np.float32)
    sums = np.zeros((ny - 1 + across, nx - 1 + across, 5), np.float32)
    for i in range(across):
        sums[i : i + ny] += cells
        for side in range(STRIDE):
            weights[STRIDE * i + side :: STRIDE][:ny] += weight * sides[i, side]
    return total.reshape(len(total), -1, 4), weights.reshape(len(total), -1), sums[..., :4], sums[..., 4]
