"""One scale: each patch picks a component and takes its estimate, and overlapping patches are averaged.

The estimate X of a pixel is a weighted mean of the estimates x_p by all patches p that cover it,

    X = sum_p w_p h x_p / sum_p w_p h,   w_p = 1 / (max(1, misfit)^DOUBT (v + LEAST_VARIANCE)).

Here v is the patch's posterior variance, averaged over pixels and channels; h is a window that falls towards the edges
of the patch (`isp.ple.tables.window`); misfit is the mean squared residual over its expected value, which is 1 for a
patch that its component explains (`isp.ple.pick.pick`).

Words: A *sampling* says which channels the samples of a patch belong to, with their gains and noise; all patches at the
same place within the tile share one. The *pilot* is what the coarser scale estimated for a patch: the means of its four
channels. *Light* is a patch's mean brightness, in electrons that a G sample collects from a white of that brightness. A
*table* holds the prior's components at one light. A *full* sample is a saturated W, which is only a lower bound.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from os import cpu_count
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from isp.blas import one_thread
from isp.ple.curve import TOGETHER, on_the_curve
from isp.ple.overlap import STRIDE, Patches, overlapped
from isp.ple.pick import BLOCK, blocks, pick
from isp.ple.prior import PATCH, Prior
from isp.ple.tables import PILOT_VARIANCE, STEP, Sampling, Table, table, window
from rodcone.types import Singles

STRIP = 100_000  # patches that are estimated together
LEAST_LIGHT = 1e-3  # electrons
COARSE_STEPS = 2  # of light from table to table at coarse scales, which need no finer ones
DOUBT = 2.0  # power by which a patch that its component explains badly counts less
INFLATE = 2.0  # of the pilot's variance: it has seen the same samples
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
        Posterior variance of the mean over the middle half of a patch, mean over the patches.
    noise : (4,) float64
        Posterior variance of a pixel over the noise of a sample, median over the patches.
    """

    planes: Singles
    variance: Singles
    noise: NDArray[np.float64]


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
        y = _windows(scale.samples[part], size)
        full = scale.full[part]
        hit = _windows(full, size) if full.any() else np.zeros((len(y), 1), bool)
        if scale.columns is not None:
            y = y[:, scale.columns]
            hit = hit[:, scale.columns] if full.any() else hit
        part_pilot = None
        if pilot is not None:
            part_pilot = PatchPilot(pilot.means[first:last].reshape(-1, 4), pilot.variance[first:last].ravel())
        groups = _by_sampling(scale.samplings, range(first, last), nx)
        patches = _solve(prior, groups, y, hit, steps[first:last].ravel(), part_pilot)
        return *overlapped(patches, (last - first, nx), size), patches.noise

    # Sums run in the order of the strips: the result doesn't depend on threads.
    total = np.zeros(((ny - 1) * STRIDE + size, (nx - 1) * STRIDE + size, 4), np.float32)
    weight = np.zeros(total.shape[:2], np.float32)
    variance = np.zeros((total.shape[0] // STRIDE, total.shape[1] // STRIDE, 4), np.float32)
    cells = np.zeros(variance.shape[:2], np.float32)
    noise = []
    with one_thread(), ThreadPoolExecutor(cpu_count()) as threads:
        # Tables first, each once: strips would make the same ones at the same time.
        list(threads.map(lambda key: table(prior, *key), _table_keys(scale.samplings, steps)))
        for first, (values, weights, inner, count, patch_noise) in zip(
            range(0, ny, rows), threads.map(strip, range(0, ny, rows)), strict=True
        ):
            for sums, part, start in (
                (total, values, first * STRIDE),
                (weight, weights, first * STRIDE),
                (variance, inner, first),
                (cells, count, first),
            ):
                sums[start : start + len(part)] += part
            noise.append(patch_noise)
    total /= weight[..., None]
    total += scale.samplings[0][0].black
    variance /= cells[..., None]
    edge = size - STRIDE
    inside = total[edge : edge + shape[0], edge : edge + shape[1]]
    frame = tuple(slice(edge // STRIDE, edge // STRIDE + -(-length // STRIDE)) for length in shape)
    return ScaleEstimate(inside, variance[frame], np.median(np.concatenate(noise), axis=0))


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
    order = numbers[np.array(rows)[:, None] % len(samplings), np.arange(nx) % len(samplings[0])].ravel()
    return [(sampling, np.flatnonzero(order == number)) for number, sampling in enumerate(distinct)]


def _table_keys(samplings: tuple[tuple[Sampling, ...], ...], steps: NDArray[np.int16]) -> list[tuple[Sampling, int]]:
    """Every sampling with each step of light that its patches have."""
    down, across = len(samplings), len(samplings[0])
    keys = (
        (samplings[i][j], step)
        for i, j in np.ndindex(down, across)
        for step in np.unique(steps[i::down, j::across]).tolist()
    )
    return list(dict.fromkeys(keys))


def _solve(
    prior: Prior,
    groups: list[tuple[Sampling, NDArray[np.intp]]],
    y: Singles,
    full: NDArray[np.bool_],
    steps: NDArray[np.int16],
    pilot: PatchPilot | None,
) -> Patches:
    """Estimate the patches of each sampling, by light.

    A patch with saturated Ws is estimated twice: from R, G and B alone, and then with each of these Ws at the larger of
    that estimate and its reading.
    """
    count = len(y)
    values = 4 * groups[0][0].size ** 2
    patches = Patches(*(np.empty((count, *shape), np.float32) for shape in ((values,), (), (4,), (4,))))
    hit = np.asarray(full.any(axis=1))
    if hit.any():
        y = y.copy()
    for sampling, among in groups:
        clipped = among[hit[among]]
        if clipped.size:
            rows = np.array(sampling.rows)
            colours = rows % 4 != 3
            blind = Sampling(
                sampling.size, tuple(rows[colours].tolist()), sampling.gains, sampling.dark_e, sampling.prnu
            )
            _solve_by_light(prior, blind, y[:, colours], steps, pilot, clipped, patches)
            weight = window(sampling.size).ravel()[rows // 4] * patches.weight[clipped, None]
            guess = patches.values[np.ix_(clipped, rows)] / weight + sampling.black[rows % 4]
            y[clipped] = np.where(full[clipped], np.maximum(y[clipped], guess), y[clipped])
        _solve_by_light(prior, sampling, y, steps, pilot, among, patches)
    return patches


def _solve_by_light(
    prior: Prior,
    sampling: Sampling,
    y: Singles,
    steps: NDArray[np.int16],
    pilot: PatchPilot | None,
    among: NDArray[np.intp],
    patches: Patches,
) -> None:
    order = among[np.argsort(steps[among], kind="stable")]  # of int16: a radix sort
    bounds = np.flatnonzero(np.diff(steps[order], prepend=-(1 << 15), append=-(1 << 15)))
    for first, last in pairwise(bounds.tolist()):
        index = order[first:last]
        part_pilot = None if pilot is None else PatchPilot(pilot.means[index], pilot.variance[index])
        _solve_one_light(table(prior, sampling, int(steps[index[0]])), y, part_pilot, index, patches)


def _solve_one_light(
    components: Table, y: Singles, pilot: PatchPilot | None, index: NDArray[np.intp], patches: Patches
) -> None:
    """Estimate the patches `index` of all, whose samples are y, from the prior's components at one light.

    With i_d the pilot's innovation in direction d (`Whitening.reads`), s_d its variance without the pilot's own noise
    n, and c_d its covariance with the patch's values,

        x = t + C_xy C_yy^-1 (y - t_y) + sum_d c_d i_d / (n + s_d),   v = v_y - sum_d c_d^2 / (n + s_d),

    where v_y is the posterior variance given the samples alone.
    """
    noise = None
    # Patches whose linear estimate falls under black: `on_the_curve` estimates them again.
    below = [np.empty(0, np.intp)]
    # What the table's matrices take: samples, 1, the pilot's means.
    own = y.shape[1]
    evidence = np.empty((len(index), own + 1 if pilot is None else own + 5), np.float32)
    evidence[:, :own], evidence[:, own] = y[index], 1.0
    if pilot is not None:
        noise = (INFLATE * pilot.variance + components.pilot_floor) / (PILOT_VARIANCE + components.pilot_floor)
        evidence[:, own + 1 :] = pilot.means
    component, misfit = pick(components, evidence, noise)
    block, values = (np.empty((BLOCK, width), np.float32) for width in (evidence.shape[1], patches.values.shape[1]))
    order = np.argsort(component, kind="stable")
    bounds = np.flatnonzero(np.diff(component[order], prepend=-1, append=-1))
    for first, last in pairwise(bounds.tolist()):
        k = int(component[order[first]])
        estimator = components.estimator(k)
        whitening = components.whitening(k)
        linear = estimator.linear[: evidence.shape[1]]
        for group in blocks(order[first:last]):
            variance, inner = estimator.variance, estimator.inner
            rows = np.take(evidence, group, axis=0, out=block[: group.size], mode="clip")
            if noise is not None:
                precision = 1.0 / (noise[group, None] + whitening.spread)
                variance, inner = (
                    estimator.variance - precision @ estimator.pilot_variance,
                    estimator.inner - precision @ estimator.pilot_inner,
                )
                # The pilot's means p give way to i_d / (n + s_d), the precision times the innovation.
                rows[:, -4:] = rows @ whitening.reads[:, -4:] * precision
            # A patch that no component explains has a larger posterior variance, by `doubt`.
            doubt = np.maximum(misfit[group], 1.0) ** DOUBT
            place = index[group]
            weight = (1.0 / (doubt * (variance.mean(axis=-1) + LEAST_VARIANCE))).astype(np.float32)
            rows *= weight[:, None]
            weighted = np.matmul(rows, linear, out=values[: group.size])
            if noise is not None and components.mix.size == PATCH:
                below.append(group[(weighted < 0.0).any(axis=1)])  # the finest scale: its output is seen
            patches.weight[place] = weight
            patches.inner[place] = doubt[:, None] * np.maximum(inner, 0.0)
            patches.noise[place] = variance * (estimator.noise / estimator.variance)
            patches.values[place] = weighted  # times the window, which `linear` holds
    if noise is not None:
        for group in blocks(np.concatenate(below), TOGETHER):
            place = index[group]
            weight = patches.weight[place, None]
            straight = patches.values[place] / weight
            curved = on_the_curve(components, component[group], evidence[group], noise[group], straight)
            patches.values[place] = weight * curved
