"""Estimation of one scale: each patch by the component that fits it best, then the mean of overlapping patches.

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

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from os import cpu_count
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from isp.blas import one_thread
from isp.ple.curve import TOGETHER as CURVED_TOGETHER
from isp.ple.curve import on_the_curve
from isp.ple.overlap import STRIDE, add_patches, gather, weights
from isp.ple.pick import BLOCK, blocks, pick
from isp.ple.prior import PATCH, Prior
from isp.ple.tables import PILOT_VARIANCE, STEP, Sampling, Table, table, window
from rodcone.types import Singles

TOGETHER = 8000  # patches that are estimated together
LEAST_LIGHT = 1e-3  # least light of a patch [e- of white in G]
COARSE_STEPS = 2  # steps of light between two tables of a coarse scale, which needs no finer ones
DOUBT = 2.0  # power of the misfit by which the weight of a patch is divided
INFLATE = 2.0  # factor on the pilot's variance, because the pilot was computed from the same samples
LEAST_VARIANCE = 0.02  # added to an estimate's posterior variance [units of noise^2]
# Values of some patches, (patch, value) float32: every channel at every pixel, times window and weight. With them, the
# tables from which they were computed.
Solved: TypeAlias = tuple[Singles, list[Table]]


@dataclass(frozen=True)
class Scale:
    """Samples of one scale.

    Attributes
    ----------
    shape : (h, w)
    samples : (h + border, w + border) or (h + border, w + border, channel) float32
        Samples [units of noise], continued beyond the frame by `isp.ple.overlap.border`.
    full : like `samples`, bool
        Which samples are saturated Ws, so that they are only lower bounds.
    samplings : tuple of tuple of Sampling
        Samplings of the patches in the first rows and columns; those of the other patches repeat them.
    columns : (sample,) intp or None
        Which of a patch's numbers in `samples` are samples, in the order of `Sampling.rows`; None if all are.
    """

    shape: tuple[int, int]
    samples: Singles
    full: NDArray[np.bool_]
    samplings: tuple[tuple[Sampling, ...], ...]
    columns: NDArray[np.intp] | None = None

    @cached_property
    def any_full(self) -> bool:
        """Return whether any sample is full."""
        return bool(self.full.any())


@dataclass(frozen=True)
class PatchPilot:
    """A coarser scale's estimate of each patch's means.

    Attributes
    ----------
    means : (ny, nx, 4) float32
        Mean over the patch, per channel [units of noise].
    variance : (ny, nx) float32
        Variance of these means.
    """

    means: Singles
    variance: Singles


@dataclass(frozen=True)
class LitPatches:
    """Patches of one sampling at one step of light.

    Attributes
    ----------
    sampling : Sampling
    step : int
        Step of light: the patches' light is about ``STEP ** step``.
    index : (patch,) intp
        Numbers of the patches, counted row by row over the scale.
    last : bool
        Whether no other patches of this sampling and light follow.
    """

    sampling: Sampling
    step: int
    index: NDArray[np.intp]
    last: bool = True

    def parts(self) -> Iterator["LitPatches"]:
        """Split the patches into groups of at most `TOGETHER`."""
        end = len(self.index)
        for first in range(0, end, TOGETHER):
            yield replace(self, index=self.index[first : first + TOGETHER], last=first + TOGETHER >= end)


@dataclass(frozen=True)
class Patches:
    """Weights and posterior variances of patches.

    Attributes
    ----------
    weight : (patch,) float32
        w_p of the module's formula.
    inner : (patch, 4) float32
        Posterior variance of the mean over the patch's middle half, per channel.
    noise : (patch, 4) float32
        Posterior variance of a pixel over the variance of a sample's noise, per channel.
    """

    weight: Singles
    inner: Singles
    noise: Singles


@dataclass(frozen=True)
class ScaleEstimate:
    """Every channel at every pixel of a scale.

    Attributes
    ----------
    planes : (h, w, 4) float32
        Estimates [units of noise].
    variance : (h/2, w/2, 4) float32
        Posterior variance of the mean over a patch's middle half, averaged over the patches that cover each 2x2 pixels.
    noise : (4,) float64
        Posterior variance of a pixel over the variance of a sample's noise, the median over the patches.
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
        Light of each patch [e- of white in G].
    pilot : PatchPilot or None
    """
    size = scale.samplings[0][0].size
    shape, (ny, nx) = scale.shape, light.shape
    coarse = 1 if size == PATCH else COARSE_STEPS
    steps = np.round(np.log(np.maximum(light, LEAST_LIGHT)) / np.log(STEP) / coarse).astype(np.int16) * coarse
    groups = _groups(scale.samplings, steps)
    total = np.zeros(((ny - 1) * STRIDE + size, (nx - 1) * STRIDE + size, 4), np.float32)
    patches = Patches(*(np.empty((ny * nx, *width), np.float32) for width in ((), (4,), (4,))))
    with one_thread(), ThreadPoolExecutor(cpu_count()) as threads:
        # Tables are made before, each once, because the parts of a group would make the same one at the same time.
        list(threads.map(lambda group: table(prior, group.sampling, group.step), groups))
        parts = [part for group in groups for part in group.parts()]
        using = set[Table]()
        # Patches are added in the order of the parts, so that the result doesn't depend on the threads.
        for part, (values, tables) in zip(
            parts, _in_turn(threads, lambda part: _solve(prior, part, scale, pilot, patches), parts), strict=True
        ):
            add_patches(total, values, part.index, size)
            using.update(tables)
            if part.last:
                for components in using:
                    components.end_frame()
                using.clear()
    weight, variance, cells = weights(patches.weight, patches.inner, (ny, nx), size)
    total /= weight[..., None]
    total += scale.samplings[0][0].black
    variance /= cells[..., None]
    edge = size - STRIDE
    inside = total[edge : edge + shape[0], edge : edge + shape[1]]
    frame = tuple(slice(edge // STRIDE, edge // STRIDE + -(-length // STRIDE)) for length in shape)
    return ScaleEstimate(inside, variance[frame], np.median(patches.noise, axis=0))


def _in_turn(
    threads: ThreadPoolExecutor, solve: Callable[[LitPatches], Solved], parts: Sequence[LitPatches]
) -> Iterator[Solved]:
    """Yield the results of parts in their order; few run at once, because each needs memory for `TOGETHER` patches."""
    waiting = deque[Future[Solved]]()
    for part in parts:
        if len(waiting) > (cpu_count() or 1):
            yield waiting.popleft().result()
        waiting.append(threads.submit(solve, part))
    while waiting:
        yield waiting.popleft().result()


def _groups(samplings: tuple[tuple[Sampling, ...], ...], steps: NDArray[np.int16]) -> list[LitPatches]:
    """Group the patches by sampling and step of light."""
    ny, nx = steps.shape
    distinct = list(dict.fromkeys(sampling for line in samplings for sampling in line))
    numbers = np.array([[distinct.index(sampling) for sampling in line] for line in samplings], np.int8)
    order = numbers[np.arange(ny)[:, None] % len(samplings), np.arange(nx) % len(samplings[0])].ravel()
    groups = []
    for number, sampling in enumerate(distinct):
        among = np.flatnonzero(order == number)
        own_steps = steps.ravel()[among]
        among = among[np.argsort(own_steps, kind="stable")]  # a radix sort, because these are int16
        own_steps = np.sort(own_steps, kind="stable")
        bounds = np.flatnonzero(np.diff(own_steps, prepend=-(1 << 15), append=-(1 << 15))).tolist()
        groups += [LitPatches(sampling, int(own_steps[a]), among[a:b]) for a, b in pairwise(bounds)]
    return groups


def _solve(prior: Prior, part: LitPatches, scale: Scale, pilot: PatchPilot | None, patches: Patches) -> Solved:
    """Estimate patches of one sampling and light.

    A patch with saturated Ws is estimated twice: from R, G and B alone, and then with each of these Ws at the larger of
    that estimate and its reading.
    """
    sampling, index = part.sampling, part.index
    y = _samples(scale.samples, scale, index)
    own_pilot = None
    if pilot is not None:
        own_pilot = PatchPilot(pilot.means.reshape(-1, 4)[index], pilot.variance.ravel()[index])
    full = _samples(scale.full, scale, index) if scale.any_full else np.zeros((len(index), 1), bool)
    clipped = np.flatnonzero(full.any(axis=1))
    components = table(prior, sampling, part.step)
    tables = [components]
    if clipped.size:
        rows = np.array(sampling.rows)
        colours = rows % 4 != 3
        blind = table(prior, replace(sampling, rows=tuple(rows[colours].tolist())), part.step)
        tables.append(blind)
        blind_pilot = own_pilot and PatchPilot(own_pilot.means[clipped], own_pilot.variance[clipped])
        values, known = _solve_one_light(blind, y[np.ix_(clipped, colours)], blind_pilot)
        weight = window(sampling.size).ravel()[rows // 4] * known.weight[:, None]
        guess = values[:, rows] / weight + sampling.black[rows % 4]
        y[clipped] = np.where(full[clipped], np.maximum(y[clipped], guess), y[clipped])
    values, known = _solve_one_light(components, y, own_pilot)
    for name, of_patches in vars(known).items():
        getattr(patches, name)[index] = of_patches
    return values, tables


def _samples(values: NDArray[Any], scale: Scale, index: NDArray[np.intp]) -> NDArray[Any]:
    """Return the samples of patches, shape (patch, sample)."""
    samples = gather(values, index, scale.samplings[0][0].size)
    return samples if scale.columns is None else samples[:, scale.columns]


def _solve_one_light(components: Table, y: Singles, pilot: PatchPilot | None) -> tuple[Singles, Patches]:
    """Estimate patches whose samples are y from the prior's components at one light.

    Let i_d be the pilot's innovation in direction d (`Whitening.reads`), s_d its variance without the pilot's own noise
    n, and c_d its covariance with the patch's values. With t and C of `isp.ple.tables`, estimate and variance are

        x = t + C_xy C_yy^-1 (y - t_y) + sum_d c_d i_d / (n + s_d),   v = v_y - sum_d c_d^2 / (n + s_d),

    where v_y is the posterior variance given the samples alone.
    """
    noise, count = None, len(y)
    values = np.empty((count, len(components.taper)), np.float32)
    patches = Patches(*(np.empty((count, *width), np.float32) for width in ((), (4,), (4,))))
    # Patches whose linear estimate falls under black: `on_the_curve` estimates them again.
    below = [np.empty(0, np.intp)]
    # The table's matrices are applied to the samples, the number 1 and the pilot's means.
    own = y.shape[1]
    evidence = np.empty((count, own + 1 if pilot is None else own + 5), np.float32)
    evidence[:, :own], evidence[:, own] = y, 1.0
    if pilot is not None:
        noise = (INFLATE * pilot.variance + components.pilot_floor) / (PILOT_VARIANCE + components.pilot_floor)
        evidence[:, own + 1 :] = pilot.means
    component, misfit = pick(components, evidence, noise)
    block, made = (np.empty((BLOCK, array.shape[1]), np.float32) for array in (evidence, values))
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
                # The pilot's means p are replaced by i_d / (n + s_d), the innovations times their precisions.
                rows[:, -4:] = rows @ whitening.reads[:, -4:] * precision
            # If no component explains a patch, its posterior variance is larger by the factor `doubt`.
            doubt = np.maximum(misfit[group], 1.0) ** DOUBT
            weight = (1.0 / (doubt * (variance.mean(axis=-1) + LEAST_VARIANCE))).astype(np.float32)
            rows *= weight[:, None]
            weighted = np.matmul(rows, linear, out=made[: group.size])
            if noise is not None and components.mix.size == PATCH:
                below.append(group[(weighted < 0.0).any(axis=1)])  # only at the finest scale, which becomes the picture
            patches.weight[group] = weight
            patches.inner[group] = doubt[:, None] * np.maximum(inner, 0.0)
            patches.noise[group] = variance * (estimator.noise / estimator.variance)
            values[group] = weighted  # with the window, which `linear` includes
    if noise is not None:
        for group in blocks(np.concatenate(below), CURVED_TOGETHER):
            weight = patches.weight[group, None]
            straight = values[group] / weight
            curved = on_the_curve(components, component[group], evidence[group], noise[group], straight)
            values[group] = weight * curved
    return values, patches
