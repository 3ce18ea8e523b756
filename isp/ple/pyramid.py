"""From a raw image to every channel at every pixel: coarse scales first, each finer one told by the last.

In the dark a patch of 8x8 pixels holds too little light to say what it shows. Sums of 2x2, 4x4, ... pixels say the means
over larger patches; the finer scale takes them as further samples with a known error.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isp.anscombe import stabilise, unstabilise
from isp.ple.estimate import STRIDE, Estimate, Pilot, estimate, padded
from isp.ple.prior import LETTERS, PATCH, Prior
from isp.ple.tables import Sampling, Singles
from sensor.cfa import channel_map, channels
from sensor.raw import RawImage

SCALES = 4  # coarser ones
CELLS = 4  # a side of a coarse patch
LEAST_CELLS = 5  # a side of the coarsest scale


@dataclass(frozen=True)
class Cells:
    """Sums of samples over square cells.

    Attributes
    ----------
    electrons : (h, w, channel) float32
        Of the mosaic's channels [e-].
    full : (h, w, channel) bool
        Where a saturated W is in the sum.
    counts : (channel,) float64
        Samples in a sum.
    """

    electrons: Singles
    full: NDArray[np.bool_]
    counts: NDArray[np.float64]


def reconstruct(raw: RawImage, prior: Prior) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        Its tile is 2x2, of R, G, B and W.
    prior : Prior
        Of the camera's curves.

    Returns
    -------
    (h, w, channel) float32
        In electrons, channels in the order of `sensor.cfa.channels`.
    (channel,) float64
        Posterior variance of a pixel over a sample's noise, median over the patches.
    """
    names = channels(raw.cfa)
    index = [LETTERS.index(name) for name in names]
    electrons = raw.electrons.astype(np.float32)
    sites = channel_map(raw.cfa, raw.shape)
    full = raw.saturated & (sites == "W")
    found: Estimate | None = None
    before: Sampling | None = None
    for cells in reversed(_pyramid(raw, electrons, full)):
        counts = np.ones(4)
        counts[index] = cells.counts
        rows = tuple(4 * place + channel for place in range(CELLS**2) for channel in index)
        sampling = _sampling(raw, prior, counts, CELLS, rows)
        samples = np.stack(
            [stabilise(cells.electrons[..., i], sampling.dark_e[c], 0.0) for i, c in enumerate(index)], axis=-1
        )
        if found is None or before is None:
            light, pilot = _light(cells, sampling, index), None
        else:
            light, pilot = _told(found, before, sampling, samples.shape[:2])
        found, before = estimate(prior, sampling, samples, cells.full, light, pilot), sampling
    rows = tuple(
        4 * (PATCH * y + x) + LETTERS.index(raw.cfa[y % 2][x % 2]) for y in range(PATCH) for x in range(PATCH)
    )
    sampling = _sampling(raw, prior, np.ones(4), PATCH, rows)
    light, pilot = _told(found, before, sampling, raw.shape)
    found = estimate(prior, sampling, stabilise(electrons, raw.dark_noise_e, 0.0), full, light, pilot)
    planes = found.planes[..., index]
    for part in range(0, len(planes), 256):
        planes[part : part + 256] = unstabilise(planes[part : part + 256], raw.dark_noise_e)
    return planes, found.noise[index]


def _sampling(
    raw: RawImage, prior: Prior, counts: NDArray[np.float64], size: int, rows: tuple[int, ...]
) -> Sampling:
    dark = raw.dark_noise_e * np.sqrt(counts)
    return Sampling(size, rows, tuple((prior.neutral_e * counts).tolist()), tuple(dark.tolist()), raw.prnu)


def _pyramid(raw: RawImage, electrons: Singles, full: NDArray[np.bool_]) -> list[Cells]:
    """Cells of 2x2, 4x4, ... pixels."""
    height, width = (length // 2 for length in raw.shape)
    quads = electrons[: 2 * height, : 2 * width].reshape(height, 2, width, 2)
    hit = full[: 2 * height, : 2 * width].reshape(height, 2, width, 2)
    sums, fulls, counts = [], [], []
    for name in channels(raw.cfa):
        sites = [(i, j) for i in (0, 1) for j in (0, 1) if raw.cfa[i][j] == name]
        sums.append(sum(quads[:, i, :, j] for i, j in sites))
        fulls.append(np.any([hit[:, i, :, j] for i, j in sites], axis=0))
        counts.append(len(sites))
    levels = [Cells(np.stack(sums, axis=-1), np.stack(fulls, axis=-1), np.array(counts, dtype=np.float64))]
    while len(levels) < SCALES and min(levels[-1].full.shape[:2]) // 2 >= LEAST_CELLS:
        last = levels[-1]
        height, width = (length // 2 for length in last.full.shape[:2])
        blocks = [
            values[: 2 * height, : 2 * width].reshape(height, 2, width, 2, -1) for values in (last.electrons, last.full)
        ]
        levels.append(Cells(blocks[0].sum(axis=(1, 3)), blocks[1].any(axis=(1, 3)), 4 * last.counts))
    return levels


def _light(cells: Cells, sampling: Sampling, index: list[int]) -> Singles:
    """Light of each patch from its own sums, each channel as sure as its noise over the frame; full Ws left out."""
    gains, dark = np.array(sampling.gains)[index], np.array(sampling.dark_e)[index]
    weights = gains / (np.maximum(cells.electrons.mean(axis=(0, 1)), 0.1) + dark**2)
    weights = np.where(_sums(padded(cells.full, CELLS), STRIDE) > 0, 0.0, weights)
    sums = _sums(padded(cells.electrons, CELLS), STRIDE)
    return np.asarray((sums * weights).sum(axis=-1) / (CELLS**2 * (weights @ gains)), dtype=np.float32)


def _told(coarse: Estimate, before: Sampling, now: Sampling, shape: tuple[int, ...]) -> tuple[Singles, Pilot]:
    """Light and pilot of each patch of a scale of this shape, from the coarser scale's estimate.

    A patch of the finer scale covers 4x4 cells of the coarser one, and moves on by one.
    """
    old, new = np.array(before.dark_e), np.array(now.dark_e)
    share = np.array(now.gains) / np.array(before.gains)
    sides = []
    for length, cells in zip(shape, coarse.planes.shape[:2], strict=True):
        patches = (length - 1) // STRIDE + now.size // STRIDE
        sides.append((CELLS - 1, patches + CELLS - 1 - (CELLS - 1) - cells))
    electrons = np.stack([unstabilise(coarse.planes[..., c], old[c]) for c in range(4)], axis=-1)
    finer = electrons * share
    slope = share**2 * (np.maximum(electrons, 0) + old**2 + 0.375) / (np.maximum(finer, 0) + new**2 + 0.375)
    wide = np.repeat(np.repeat(coarse.variance, STRIDE, 0), STRIDE, 1)[: slope.shape[0], : slope.shape[1]]
    variance = (wide * slope).mean(axis=-1)
    roots = 2.0 * np.sqrt(np.maximum(finer + new**2 + 0.125, 0.01))
    light = finer[..., 3] / now.gains[3]
    held = np.concatenate([roots, variance[..., None], light[..., None]], axis=-1).astype(np.float32)
    means = _sums(np.pad(held, [*sides, (0, 0)], mode="symmetric"), 1) / CELLS**2
    return means[..., 5], Pilot(np.ascontiguousarray(means[..., :4]), means[..., 4])


def _sums(values: NDArray[np.generic], stride: int) -> Singles:
    """Sums over `CELLS` x `CELLS`, `stride` apart."""
    ends = [(length - CELLS) // stride * stride + 1 for length in values.shape[:2]]
    rows = sum(values[i : i + ends[0] : stride].astype(np.float32) for i in range(CELLS))
    return np.asarray(sum(rows[:, j : j + ends[1] : stride] for j in range(CELLS)))
