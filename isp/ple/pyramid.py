"""Estimation of every channel at every pixel of a raw image, from the coarsest scale to the finest.

In the dark a patch of 8x8 pixels holds too little light to show what is there. Sums over 2x2, 4x4, ... pixels show the
means over larger patches; the next finer scale uses these means as further samples with a known error.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.ple.estimate import PatchPilot, ScaleEstimate, estimate
from isp.ple.mosaic import (
    CELLS,
    Cells,
    counted_noise,
    full_white,
    pyramid,
    scale_of_cells,
    scale_of_pixels,
    site_electrons,
)
from isp.ple.overlap import STRIDE, border
from isp.ple.prior import LETTERS, PATCH, Prior
from isp.ple.residual_lines import blend_with_lines
from isp.ple.tables import PILOT_ERROR, Sampling
from isp.ple.twicing import twice_colours
from isp.ple.units import readings
from rodcone.types import Singles
from sensor.raw import RawImage

TOGETHER = 32  # rows that stay in a core's cache while they are worked on
COLOUR_SPREAD = 0.2  # relative error of the light that a patch's own sums show as if the patch were grey


@dataclass(frozen=True)
class PatchLight:
    """Light of each patch, (ny, nx) [e- of white in G], whose variance by noise is ``shot * light + floor``."""

    mean: Singles
    shot: Singles
    floor: Singles


def reconstruct(raw: RawImage, prior: Prior, white_e: ArrayLike) -> tuple[Singles, NDArray[np.float64]]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        Raw image whose tile holds only R, G, B and W, and is 1, 2 or 4 pixels high and wide.
    prior : Prior
        Prior of the camera's curves.
    white_e : (4,) array_like
        Electrons of R, G, B and W from white under the scene's light, relative to G.

    Returns
    -------
    (h, w, channel) float32
        Estimates [e-], channels in the order of `sensor.cfa.channels`.
    (channel,) float64
        Posterior variance of a pixel over the variance of a sample's noise, the median over the patches.
    """
    electrons = site_electrons(raw)
    full = full_white(raw)
    shot, dark_e = counted_noise(raw)
    white_e = np.asarray(white_e) / shot  # in counted electrons
    levels = pyramid(raw, white_e, electrons, full)
    coarsest = levels[-1]
    light = _light_of_sums(coarsest, [border(length, CELLS) for length in coarsest.full.shape[:2]], STRIDE).mean
    estimates = estimate(prior, scale_of_cells(coarsest), light, None)
    for coarse, cells in zip(levels[:0:-1], levels[-2::-1], strict=True):
        sums = _light_of_sums(cells, [border(length, CELLS) for length in cells.full.shape[:2]], STRIDE)
        estimates = estimate(
            prior, scale_of_cells(cells), *_from_coarser(estimates, coarse.sampling, cells.sampling, sums)
        )

    cells = levels[0]
    sums = _light_of_sums(cells, _sides(raw.shape, cells.full.shape, PATCH), 1)
    scale = scale_of_pixels(raw, white_e, electrons, full)
    estimates = estimate(prior, scale, *_from_coarser(estimates, cells.sampling, scale.samplings[0][0], sums))
    index = list(cells.index)
    planes = estimates.planes[..., index]
    noise = estimates.noise[index]
    del estimates, scale, levels, sums  # as much as the planes, and nothing needs them from here on
    plain = raw.plain_noise
    apart = [(c, i) for c, i in enumerate(index) if any(x.channel == LETTERS[i] for x in raw.channel_noise)]

    def in_electrons(values: Singles) -> NDArray[np.float64]:
        result = readings(plain.dark_noise_e / plain.shot).electrons(values) * plain.shot
        for c, i in apart:
            result[..., c] = readings(float(dark_e[i])).electrons(values[..., c]) * shot[i]
        return result

    black = [float(readings(float(dark_e[i])).mean(np.zeros(1))[0]) for i in index]
    blend_with_lines(planes, raw.cfa, noise, black, lambda values: in_electrons(values) / (white_e * shot)[index])
    in_noise = planes
    planes = np.empty_like(planes)
    for first in range(0, len(planes), TOGETHER):
        planes[first : first + TOGETHER] = in_electrons(in_noise[first : first + TOGETHER])
    twice_colours(planes, in_noise, raw)
    return planes, noise


def _sides(shape: tuple[int, ...], coarse: tuple[int, ...], size: int) -> list[tuple[int, int]]:
    """Return how many cells to add at either end of each axis, so that every patch of the finer scale has 4x4 cells.

    Parameters
    ----------
    shape, coarse : height and width
        The finer scale's, and the coarser scale's.
    size : int
        Side of the finer scale's patches, in its own pixels.
    """
    patches = [(length - 1) // STRIDE + size // STRIDE for length in shape]
    return [
        (size // STRIDE - 1, count + CELLS - size // STRIDE - cells)
        for count, cells in zip(patches, coarse, strict=False)
    ]


def _light_of_sums(cells: Cells, sides: list[tuple[int, int]], stride: int) -> PatchLight:
    """Estimate the light of patches of 4x4 cells, as if grey, from their own sums without those of full Ws.

    Parameters
    ----------
    cells : Cells
    sides : list of two pairs of int
        Cells to add by reflection at either end of each axis.
    stride : int
        Cells from patch to patch.
    """
    gains, dark = (np.array(values)[list(cells.index)] for values in (cells.sampling.gains, cells.sampling.dark_e))
    weights = gains / (np.maximum(_medians(cells), 0.1) + dark**2)
    mode: Literal["reflect", "symmetric"] = "symmetric" if cells.presence.all() else "reflect"  # keeps the mosaic
    full, sums = (_sums(np.pad(a, [*sides, (0, 0)], mode=mode), stride) for a in (cells.full, cells.electrons))
    weights = np.where(full > 0, 0.0, weights)
    share = cells.presence.mean(axis=(0, 1))  # share of the cells that contain a channel
    gains = gains * share
    floors = dark**2 * share
    whole = CELLS**2 * (weights @ gains)
    mean = (sums * weights).sum(axis=-1) / whole
    shot, floor = (CELLS**2 * (weights**2 * values).sum(axis=-1) / whole**2 for values in (gains, floors))
    return PatchLight(*(values.astype(np.float32) for values in (mean, shot, floor)))


def _medians(cells: Cells) -> NDArray[np.float64]:
    """Return the median of each channel's electrons over the cells that contain the channel, shape (channel,)."""
    down, across, _ = cells.presence.shape
    medians = np.empty(len(cells.index))
    for c in range(len(cells.index)):
        parts = [cells.electrons[a::down, b::across, c].ravel() for a, b in np.argwhere(cells.presence[..., c])]
        medians[c] = np.median(np.concatenate(parts))
    return medians


def _from_coarser(
    coarse: ScaleEstimate, before: Sampling, now: Sampling, sums: PatchLight
) -> tuple[Singles, PatchPilot]:
    """Estimate light and pilot of each patch of a scale, from the coarser scale's estimate and the patch's own light.

    A patch of 8x8 pixels covers 4x4 cells of the coarser scale; a patch of 4x4 cells covers 2x2 of the coarser ones.
    `before` and `now` are the samplings of the coarser scale and of this one.
    """
    values = np.empty((*coarse.planes.shape[:2], 7), np.float32)
    for first in range(0, len(values), TOGETHER):
        part = slice(first, first + TOGETHER)
        wide = np.repeat(np.repeat(coarse.variance[first // STRIDE : -(-part.stop // STRIDE)], STRIDE, 0), STRIDE, 1)
        planes = coarse.planes[part]
        values[part] = _in_finer_units(planes, wide[: len(planes), : planes.shape[1]], before, now)
    means = _patch_means(values, sums.mean.shape, now.size)
    light, light_variance = means[..., 5], means[..., 6]
    most = np.maximum(np.maximum(sums.mean, light), 0.0)
    sums_variance = sums.shot * most + sums.floor + (COLOUR_SPREAD * most) ** 2
    both = (light * sums_variance + sums.mean * light_variance) / (sums_variance + light_variance)
    return both.astype(np.float32), PatchPilot(np.ascontiguousarray(means[..., :4]), means[..., 4])


def _in_finer_units(planes: Singles, variance: Singles, before: Sampling, now: Sampling) -> NDArray[np.float64]:
    """Convert a scale's estimates to a finer scale's units of noise, (row, column, 7).

    The seven planes are readings of the four channels, their mean variance, light, and the variance of light.
    """
    values = np.empty((7, *planes.shape[:2]))
    values[4] = 0.0
    for c in range(4):
        share = now.gains[c] / before.gains[c]
        old, new = readings(before.dark_e[c]), readings(now.dark_e[c])
        finer = old.electrons(planes[..., c]) * share
        positive = np.maximum(finer, 0.0)
        error = variance[..., c] * (share / old.slope(positive / share)) ** 2
        values[c] = new.mean(positive)
        values[4] += 0.25 * error * new.slope(positive) ** 2
    light = finer / now.gains[3]
    values[5:] = light, error / now.gains[3] ** 2 + (PILOT_ERROR * light) ** 2
    return np.moveaxis(values, 0, -1)


def _patch_means(values: Singles, shape: tuple[int, ...], size: int) -> Singles:
    """Average values over the cells that each patch of a finer scale covers."""
    side = size // STRIDE
    sides = [(side - 1, count - cells) for count, cells in zip(shape, values.shape[:2], strict=True)]
    wide = np.pad(values, [*sides, (0, 0)], mode="symmetric")
    return _sums(wide, 1, side) / np.float32(side**2)


def _sums(values: NDArray[Any], stride: int, side: int = CELLS) -> Singles:
    """Sum values over squares of `side` x `side` that are `stride` apart."""
    ends = [(length - side) // stride * stride + 1 for length in values.shape[:2]]
    rows = values[: ends[0] : stride].astype(np.float32)
    for i in range(1, side):
        rows += values[i : i + ends[0] : stride]
    sums = rows[:, : ends[1] : stride].copy()
    for j in range(1, side):
        sums += rows[:, j : j + ends[1] : stride]
    return sums
