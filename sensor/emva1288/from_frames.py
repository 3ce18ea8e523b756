"""Photon transfer from flat and dark frames of any camera: gain, read noise, DSNU and PRNU with 95 % intervals.

Each position of the mosaic's tile is a chip of its own, under the light that its filter passes: one pair of flat frames
gives four points of the line of variance over mean for a Bayer camera. Equations of EMVA 1288, release 4.0 Linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import Tile
from sensor.emva1288.estimators import FIT_SHARE, QUANTISATION_DN2, Estimate

NORMAL_95 = 1.959964  # standard errors to each side of a 95 % interval
MOST_UNEVEN = 0.03  # of the mean, from the darkest block to the brightest, beyond what noise makes
SAME_LIGHT = 0.02  # two frames whose means are nearer than this share of them were lit alike
MOST_CLIPPED = 1e-3  # of a frame's pixels, at white or at 0
LEAST_SIDE = 8  # pixels of each position, so that blocks and columns can be told apart
_BLOCKS = 4  # a side, for the evenness


@dataclass(frozen=True)
class Interval:
    """A measured number with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FrameFigures:
    """What flat and dark frames tell of a camera.

    Attributes
    ----------
    gain_dn_per_e, read_noise_e, dsnu_e, prnu : Interval
    black_dn, white_dn : float
        Mean of the dark frames, and the reading of a full pixel.
    levels_dn : (level, position) float64
        Means above black of each stack of flat frames, by position in the tile.
    frames : tuple of int
        Flat frames of each stack, then dark frames.
    cfa : tuple of str
        Their mosaic.
    """

    gain_dn_per_e: Interval
    read_noise_e: Interval
    dsnu_e: Interval
    prnu: Interval
    black_dn: float
    white_dn: float
    levels_dn: Floats
    frames: tuple[int, ...]
    cfa: Tile


@dataclass(frozen=True)
class _Site:
    """Frames of one light at one position of the tile: their mean, and their temporal variance with its error."""

    mean_dn: NDArray[np.float64]
    variance_dn2: float
    error_dn2: float
    frames: int

    @property
    def temporal_dn2(self) -> float:
        """Temporal variance that is left in the mean over frames."""
        return self.variance_dn2 / self.frames


def figures_of_frames(
    flats: Sequence[NDArray[np.uint16]], darks: Sequence[NDArray[np.uint16]], tile: Tile, white_dn: float
) -> FrameFigures:
    """Measure a camera.

    Parameters
    ----------
    flats, darks : sequence of (h, w) uint16
        Frames of an even surface, two or more at each light, and two or more in the dark, all at one gain.
    white_dn : float
        Reading of a full pixel.

    Raises
    ------
    InputError
        For frames that are too few, too small, uneven, clipped, no pair, or that show no shot noise.
    """
    # Frames
    _require_frames(flats, darks, tile)
    dark = _sites(darks, tile)
    black_dn = float(np.mean([site.mean_dn.mean() for site in dark]))
    stacks = [_sites(stack, tile) for stack in _stacks(flats)]
    _require_exposed(flats, darks, white_dn)
    levels = np.array([[site.mean_dn.mean() for site in stack] for stack in stacks])
    levels -= [site.mean_dn.mean() for site in dark]
    for number, (stack, level) in enumerate(zip(stacks, levels, strict=True), 1):
        _require_even(stack, level, number)

    # Figures
    gain = _gain(stacks, dark, levels, FIT_SHARE * (white_dn - black_dn))
    pixels = sum(site.mean_dn.size for site in dark)
    variance = sum(site.variance_dn2 * site.mean_dn.size for site in dark) / pixels
    error = sqrt(sum((site.error_dn2 * site.mean_dn.size) ** 2 for site in dark)) / pixels
    used = int(np.argmax(np.where(levels.mean(axis=1) <= FIT_SHARE * (white_dn - black_dn), levels.mean(axis=1), -1)))
    return FrameFigures(
        gain_dn_per_e=_interval(gain),
        read_noise_e=_electrons(variance - QUANTISATION_DN2, error, gain),
        dsnu_e=_electrons(*_spread([(site.mean_dn, site.temporal_dn2) for site in dark]), gain),
        prnu=_root(*_spread(_relative(stacks[used], dark, levels[used]))),
        black_dn=black_dn,
        white_dn=white_dn,
        levels_dn=levels,
        frames=(*(stack[0].frames for stack in stacks), len(darks)),
        cfa=tile,
    )


def _stacks(flats: Sequence[NDArray[np.uint16]]) -> list[list[NDArray[np.uint16]]]:
    """Frames of the same light together, from dark to bright; those that stand alone are refused."""
    means = [float(frame.mean()) for frame in flats]
    stacks: list[list[int]] = []
    for index in np.argsort(means).tolist():
        if stacks and means[index] - means[stacks[-1][0]] <= SAME_LIGHT * means[index]:
            stacks[-1].append(index)
        else:
            stacks.append([index])
    alone = [stack[0] for stack in stacks if len(stack) == 1]
    if alone:
        raise InputError(
            f"flat frame {alone[0] + 1}: its mean, {means[alone[0]]:.5g} DN, is within {SAME_LIGHT:.0%} of no other's; "
            "allowed: two or more frames at each light; take another one of it, or leave it out"
        )
    return [[flats[index] for index in stack] for stack in stacks]


def _sites(frames: Sequence[NDArray[np.uint16]], tile: Tile) -> list[_Site]:
    """Mean and temporal variance by position, each frame's own brightness taken off: lamps flicker (eqs. 18, 44)."""
    height, width = len(tile), len(tile[0])
    sites = []
    for row in range(height):
        for column in range(width):
            stack = np.array([frame[row::height, column::width] for frame in frames], dtype=np.float64)
            mean = stack.mean(axis=0)
            rest = stack - mean
            rest -= rest.mean(axis=(1, 2), keepdims=True)
            freedom = (len(frames) - 1) * (mean.size - 1)
            variance = float(np.sum(rest**2)) / freedom
            error = max(variance, QUANTISATION_DN2) * sqrt(2 / freedom)  # the same file twice varies in nothing
            sites.append(_Site(mean, variance, error, len(frames)))
    return sites


def _gain(stacks: list[list[_Site]], dark: list[_Site], levels: Floats, most_dn: float) -> Estimate:
    """Slope of the variance that light adds over the signal (eq. 50), in DN per electron; least squares by error."""
    power, slope, of_flats = 0.0, 0.0, 0.0
    of_darks = np.zeros(len(dark))
    for stack, level in zip(stacks, levels, strict=True):
        for index, (site, signal) in enumerate(zip(stack, level, strict=True)):
            if signal <= most_dn and signal > 0:
                weight = signal / site.error_dn2**2
                slope += weight * (site.variance_dn2 - dark[index].variance_dn2)
                power += weight * signal
                of_flats += (weight * site.error_dn2) ** 2
                of_darks[index] += weight * dark[index].error_dn2
    if not power:
        raise InputError(
            f"flat frames: each is over {FIT_SHARE:.0%} of white; allowed: two or more below that; expose them less"
        )
    error = sqrt(of_flats + float(np.sum(of_darks**2))) / power
    slope /= power
    if not slope > 4 * error:  # 4 standard errors: no slope at all would be taken for one once in 3e4 cameras
        raise InputError(
            f"flat frames: their variance grows by {slope:.3g} +- {error:.3g} DN/e-, which can't be told from 0; "
            "allowed: frames that show shot noise; take brighter or more frames, unprocessed"
        )
    return slope, error


def _relative(stack: list[_Site], dark: list[_Site], level: Floats) -> list[tuple[NDArray[np.float64], float]]:
    """Response of each pixel over the mean, less a smooth surface of second order, with its temporal variance."""
    responses = []
    for site, shade, signal in zip(stack, dark, level, strict=True):
        added = (site.mean_dn - shade.mean_dn) / signal
        y, x = (np.linspace(-1, 1, size) for size in added.shape)
        terms = [np.ones_like(added), *np.meshgrid(x, y), *np.meshgrid(x**2, y**2), np.outer(y, x)]
        surface = np.stack([term.ravel() for term in terms], axis=1)
        smooth = surface @ np.linalg.lstsq(surface, added.ravel(), rcond=None)[0]
        rest = added.ravel() - smooth
        freedom = sqrt(rest.size / (rest.size - len(terms)))
        responses.append(((rest * freedom).reshape(added.shape), (site.temporal_dn2 + shade.temporal_dn2) / signal**2))
    return responses


def _spread(images: list[tuple[NDArray[np.float64], float]]) -> Estimate:
    """Variance over pixels less the temporal one (eqs. 66, 67), and its error by columns: they are independent."""
    squares = np.concatenate(
        [
            np.mean((image - image.mean()) ** 2, axis=0) * image.size / (image.size - 1) - noise
            for image, noise in images
        ]
    )
    return float(squares.mean()), float(squares.std(ddof=1) / sqrt(squares.size))


def _interval(estimate: Estimate) -> Interval:
    value, error = estimate
    return Interval(value, max(value - NORMAL_95 * error, 0.0), value + NORMAL_95 * error)


def _root(variance: float, error: float) -> Interval:
    """Root of a variance, the ends of the interval being roots too: it stays right where the variance is near 0."""
    low, high = variance - NORMAL_95 * error, variance + NORMAL_95 * error
    return Interval(sqrt(max(variance, 0.0)), sqrt(max(low, 0.0)), sqrt(max(high, 0.0)))


def _electrons(variance_dn2: float, error_dn2: float, gain: Estimate) -> Interval:
    slope, error = gain
    variance = variance_dn2 / slope**2
    return _root(variance, hypot(error_dn2 / slope**2, 2 * variance * error / slope))


def _require_frames(flats: Sequence[NDArray[np.uint16]], darks: Sequence[NDArray[np.uint16]], tile: Tile) -> None:
    for name, frames in (("flat", flats), ("dark", darks)):
        if len(frames) < 2:
            raise InputError(f"{name} frames: {len(frames)} given; allowed: two or more; take another one")
    shapes = {frame.shape for frame in (*flats, *darks)}
    if len(shapes) > 1:
        raise InputError(f"frames: their shapes differ, {sorted(shapes)}; allowed: one; take frames of one camera")
    shape = shapes.pop()
    if shape[0] < LEAST_SIDE * len(tile) or shape[1] < LEAST_SIDE * len(tile[0]):
        raise InputError(
            f"frames: {shape[0]} x {shape[1]} pixels are too few; allowed: {LEAST_SIDE} tiles a side; crop less"
        )


def _require_exposed(flats: Sequence[NDArray[np.uint16]], darks: Sequence[NDArray[np.uint16]], white_dn: float) -> None:
    dark_dn = float(np.mean([frame.mean() for frame in darks]))
    for name, frames, edge in (("flat", flats, white_dn), ("dark", darks, 0.0)):
        for number, frame in enumerate(frames, 1):
            clipped = float(np.mean(frame >= edge if name == "flat" else frame <= edge))
            if clipped > MOST_CLIPPED:
                fix = "expose it less" if name == "flat" else "its noise is cut off: take frames with a black level"
                raise InputError(
                    f"{name} frame {number}: {clipped:.2%} of its pixels read {edge:g} DN, where they are clipped; "
                    f"allowed: {MOST_CLIPPED:.1%}; {fix}"
                )
            if name == "flat" and not frame.mean() > dark_dn:
                raise InputError(
                    f"flat frame {number}: its mean, {frame.mean():.5g} DN, is not over the dark frames' "
                    f"{dark_dn:.5g}; allowed: frames of a lit surface; sort them"
                )


def _require_even(stack: list[_Site], level: Floats, number: int) -> None:
    """Refuse light or a surface that isn't even: its structure would pass for PRNU."""
    for site, signal in zip(stack, level, strict=True):
        rows = np.array_split(site.mean_dn, _BLOCKS)
        blocks = [block for row in rows for block in np.array_split(row, _BLOCKS, axis=1)]
        means = np.array([block.mean() for block in blocks])
        # 4 standard errors of a block to each side: 16 blocks of noise alone are refused once in a thousand frames
        noise = 8 * float(np.mean([block.std() / sqrt(block.size) for block in blocks]))
        uneven = (float(np.ptp(means)) - noise) / signal
        if uneven > MOST_UNEVEN:
            raise InputError(
                f"flat frames of light {number}: they are not flat, {uneven:.1%} from the darkest part to the "
                f"brightest; allowed: {MOST_UNEVEN:.0%}; light an even surface, out of focus, or measure the middle "
                "alone (--window)"
            )
