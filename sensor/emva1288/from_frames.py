"""Photon transfer from flat and dark frames of any camera: gain, read noise, DSNU and PRNU with 95 % intervals.

Each position of the mosaic's tile is a chip of its own, under the light that its filter passes: one pair of flat frames
gives four points of the line of variance over mean for a Bayer camera. Equations of EMVA 1288, release 4.0 Linear.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, nan, sqrt

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import Tile
from sensor.emva1288.estimators import FIT_SHARE, QUANTISATION_DN2, Estimate

NORMAL_95 = 1.959964  # standard errors to each side of a 95 % interval
MOST_UNEVEN = 0.03  # largest difference between blocks of a flat frame beyond noise, as a share of the mean
SAME_LIGHT = 0.02  # two frames whose means differ by less than this share were taken under the same light
MOST_CLIPPED = 1e-3  # largest share of a frame's pixels at white or at 0
LEAST_SIDE = 8  # least pixels of each position along a side, so that blocks and columns can be distinguished
LEAST_LIGHTS = 3  # least number of lights from which a change of K over the range is computed
SPREAD = (0.4, 0.6)  # shares of the range: one light must be dimmer, one brighter, so that nothing is extrapolated
TOLD = 2.0  # a change of K is significant from this many standard errors on
UNKNOWN_CHANGE = 0.05  # relative change of K over the range that is allowed for if the lights can't show it
_BLOCKS = 4  # blocks along each side of a frame, to measure its evenness
_SURFACE_TERMS = 6  # terms of a surface of second order: 1, x, y, x^2, y^2, xy


@dataclass(frozen=True)
class Interval:
    """A measured number with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class LightPoint:
    """One light's point of the photon transfer, by position in the tile.

    Attributes
    ----------
    exposure_s, photons : float
        Exposure time [s] and photons per pixel; NaN where they aren't known.
    frames : int
    mean_dn, variance_dn2, error_dn2 : (position,) float64
        Mean, temporal variance, and the variance's standard error.
    dark_dn, dark_variance_dn2, dark_error_dn2 : (position,) float64
        The same for the dark frames that belong to this light.
    clipped : float
        Share of the pixels that read white.
    drift : float
        Difference between the brightest and the darkest frame, over the mean.
    """

    exposure_s: float
    photons: float
    frames: int
    mean_dn: Floats
    variance_dn2: Floats
    error_dn2: Floats
    dark_dn: Floats
    dark_variance_dn2: Floats
    dark_error_dn2: Floats
    clipped: float
    drift: float

    @property
    def signal_dn(self) -> Floats:
        """Return the mean above the dark [DN]."""
        return self.mean_dn - self.dark_dn

    @property
    def gain(self) -> Floats:
        """Return the variance that the light adds over the signal [DN/e-]: K at this light."""
        return (self.variance_dn2 - self.dark_variance_dn2) / self.signal_dn


@dataclass(frozen=True)
class FrameFigures:
    """Figures of a camera that flat and dark frames give.

    Attributes
    ----------
    gain_dn_per_e, read_noise_e, dsnu_e, prnu : Interval
    gain_error : (float, float)
        Two relative standard errors of K: by the frames and the scatter over lights, and by K's change over the range.
    gain_change, gain_change_error : float
        Change of K over the standard's range, relative to K, and its standard error; NaN if the lights can't show it.
    black_dn, white_dn : float
        Mean of the dark frames, and the reading of a full pixel.
    levels_dn : (level, position) float64
        Means above black of each stack of flat frames, by position in the tile.
    frames : tuple of int
        Flat frames of each stack, then dark frames.
    cfa : tuple of str
        The frames' mosaic.
    points : tuple of LightPoint
        The photon transfer, from dim to bright.
    notes : tuple of str
        Notes on what was assumed, and on what a reader has to know about these frames.
    """

    gain_dn_per_e: Interval
    read_noise_e: Interval
    dsnu_e: Interval
    prnu: Interval
    gain_error: tuple[float, float]
    gain_change: float
    gain_change_error: float
    black_dn: float
    white_dn: float
    levels_dn: Floats
    frames: tuple[int, ...]
    cfa: Tile
    points: tuple[LightPoint, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class LightStack:
    """Frames of one light, reduced: exposure time, photons and share of white pixels, and sites by position."""

    exposure_s: float
    photons: float
    clipped: float
    drift: float
    sites: tuple["Site", ...]


@dataclass(frozen=True)
class Site:
    """Frames of one light at one position of the tile: their mean, and their temporal variance with its error."""

    mean_dn: NDArray[np.float64]
    variance_dn2: float
    error_dn2: float
    frames: int

    @property
    def temporal_dn2(self) -> float:
        """Return the temporal variance that is left in the mean over frames [DN^2]."""
        return self.variance_dn2 / self.frames


@dataclass(frozen=True)
class SystemGain:
    """K with its two standard errors [DN/e-]: by frames and lights, and by its change over the range.

    `change` is K's change over the range, relative to K, and `change_error` its standard error; NaN if the lights can't
    show it.
    """

    value: float
    scatter: float
    model: float
    change: float
    change_error: float

    @property
    def estimate(self) -> Estimate:
        """Return the value and its whole standard error."""
        return self.value, hypot(self.scatter, self.model)


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
    _require_frames(flats, darks, tile)
    stacks = [stack_of(frames, tile, white_dn) for frames in _stacks(flats)]
    _require_exposed(flats, darks, white_dn)
    return figures_of_stacks(stacks, [stack_of(darks, tile, white_dn)], tile, white_dn)


def stack_of(
    frames: Sequence[NDArray[np.uint16]], tile: Tile, white_dn: float, exposure_s: float = nan, photons: float = nan
) -> LightStack:
    """Reduce the frames of one light."""
    means = [float(frame.mean()) for frame in frames]
    clipped = float(np.mean([np.mean(frame >= white_dn) for frame in frames]))
    drift = (max(means) - min(means)) / max(float(np.mean(means)), 1e-12)
    return LightStack(exposure_s, photons, clipped, drift, tuple(_sites(frames, tile)))


def figures_of_stacks(
    flats: Iterable[LightStack], darks: Sequence[LightStack], tile: Tile, white_dn: float
) -> FrameFigures:
    """Measure a camera from reduced frames.

    Each light is compared with the dark frames of its exposure time or, if there are none, with the dark stack of the
    most frames. Flat stacks may come one by one. Only one image is kept in memory: of the stacks up to 70 % of white
    that with the most frames, and the brightest of these.

    Raises
    ------
    InputError
        For frames that are uneven, too bright, or that show no shot noise.
    """
    # Points of the photon transfer
    common = max(darks, key=lambda stack: stack.sites[0].frames)
    black_dn = float(np.mean([site.mean_dn.mean() for site in common.sites]))
    points: list[LightPoint] = []
    kept: tuple[tuple[int, float], LightStack, LightPoint] | None = None
    for stack in flats:
        own = [dark for dark in darks if dark.exposure_s == stack.exposure_s]
        point = _point(stack, max(own, key=lambda dark: dark.sites[0].frames) if own else common)
        points.append(point)
        rank = (stack.sites[0].frames, float(point.signal_dn.mean()))
        dim = 0 < point.signal_dn.mean() <= FIT_SHARE * (white_dn - black_dn)
        if dim and point.clipped <= MOST_CLIPPED and (kept is None or rank > kept[0]):
            kept = rank, stack, point
    points.sort(key=lambda point: float(point.mean_dn.mean()))
    if kept is None:
        raise InputError(
            f"flat frames: each is over {FIT_SHARE:.0%} of white; allowed: two or more below that; expose them less"
        )
    _, bright, bright_point = kept
    notes = _evenness(bright, bright_point.signal_dn)

    # Figures
    gain = _gain(points, FIT_SHARE * _saturation_dn(points, white_dn - black_dn))
    pixels = sum(site.mean_dn.size for site in common.sites)
    variance = sum(site.variance_dn2 * site.mean_dn.size for site in common.sites) / pixels
    error = sqrt(sum((site.error_dn2 * site.mean_dn.size) ** 2 for site in common.sites)) / pixels
    return FrameFigures(
        gain_dn_per_e=_interval(gain.estimate),
        read_noise_e=_electrons(variance - QUANTISATION_DN2, error, gain.estimate),
        dsnu_e=_electrons(*_spread([(site.mean_dn, site.temporal_dn2) for site in common.sites]), gain.estimate),
        prnu=_root(*_spread(_relative(bright.sites, common.sites, bright_point.signal_dn))),
        gain_error=(gain.scatter / gain.value, gain.model / gain.value),
        gain_change=gain.change,
        gain_change_error=gain.change_error,
        black_dn=black_dn,
        white_dn=white_dn,
        levels_dn=np.array([point.signal_dn for point in points]),
        frames=(*(point.frames for point in points), common.sites[0].frames),
        cfa=tile,
        points=tuple(points),
        notes=(*notes, *_notes(points, darks, gain)),
    )


def _point(stack: LightStack, dark: LightStack) -> LightPoint:
    def by_site(values: Iterable[float]) -> Floats:
        return np.array(list(values), dtype=np.float64)

    return LightPoint(
        exposure_s=stack.exposure_s,
        photons=stack.photons,
        frames=stack.sites[0].frames,
        mean_dn=by_site(site.mean_dn.mean() for site in stack.sites),
        variance_dn2=by_site(site.variance_dn2 for site in stack.sites),
        error_dn2=by_site(site.error_dn2 for site in stack.sites),
        dark_dn=by_site(site.mean_dn.mean() for site in dark.sites),
        dark_variance_dn2=by_site(site.variance_dn2 for site in dark.sites),
        dark_error_dn2=by_site(site.error_dn2 for site in dark.sites),
        clipped=stack.clipped,
        drift=stack.drift,
    )


def _saturation_dn(points: Sequence[LightPoint], white_dn: float) -> float:
    """Return the signal at saturation [DN]: that of the light next brighter than the one whose variance is greatest.

    If no brighter light was taken, it is white above black.
    """
    peak = max(range(len(points)), key=lambda index: float(points[index].variance_dn2.mean()))
    return min(float(points[peak + 1].signal_dn.max()), white_dn) if peak + 1 < len(points) else white_dn


def _notes(points: Sequence[LightPoint], darks: Sequence[LightStack], gain: SystemGain) -> list[str]:
    """Say what was assumed, and how well these frames agree with it."""
    used = [point for point in points if point.clipped <= MOST_CLIPPED]
    notes = [
        "frames are single exposures: frames that a camera averaged (stacked) or denoised would show less noise",
        f"light that changes from frame to frame is taken out; it changed by {max(x.drift for x in used):.2%} at most",
    ]
    at_0 = max(float(np.mean(site.mean_dn <= 0)) for dark in darks for site in dark.sites)
    notes.append(f"the dark isn't cut off at 0: {at_0:.2%} of its pixels read 0 in all frames")
    if np.isnan(gain.change):
        notes.append(
            f"fewer than {LEAST_LIGHTS} lights, or lights that leave a part of the range out, don't tell whether K "
            f"changes with light: {UNKNOWN_CHANGE:.0%} over the range is allowed for"
        )
    else:
        told = abs(gain.change) > TOLD * gain.change_error
        verdict = "the camera is not linear" if told else "this is not told from 0"
        notes.append(
            f"K changes by {gain.change:+.1%} +- {gain.change_error:.1%} from the dark to {FIT_SHARE:.0%} of "
            f"saturation: {verdict}; the interval of K holds both"
        )
    return notes


def _stacks(flats: Sequence[NDArray[np.uint16]]) -> list[list[NDArray[np.uint16]]]:
    """Group frames of the same light, from dark to bright; refuse a frame that is the only one at its light."""
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


def _sites(frames: Sequence[NDArray[np.uint16]], tile: Tile) -> list[Site]:
    """Return mean and temporal variance for each position in the tile (eqs. 18, 44).

    Each frame's own mean is subtracted, because lamps flicker.
    """
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
            error = max(variance, QUANTISATION_DN2) * sqrt(2 / freedom)  # not 0 for one file given twice
            sites.append(Site(mean, variance, error, len(frames)))
    return sites


def _gain(points: Sequence[LightPoint], most_dn: float) -> SystemGain:
    """Fit the slope of the variance that light adds over the signal (eq. 50) [DN/e-], through the dark point.

    The standard error has two parts. One is that of the frames, widened by the scatter of K over the lights where that
    is more than the frames explain (Birge's ratio). The other is the change of K over the range, fitted as a second
    term of the line, together with the error of that term: lights that can't tell a small change from 0 can't exclude
    one either.
    """
    used = [point for point in points if point.clipped <= MOST_CLIPPED]
    signal = np.array([point.signal_dn for point in used]).reshape(-1)
    flats = np.array([point.error_dn2 for point in used]).reshape(-1)
    darks = np.array([point.dark_error_dn2 for point in used]).reshape(-1)
    excess = np.array([point.variance_dn2 - point.dark_variance_dn2 for point in used]).reshape(-1)
    keep = (signal > 0) & (signal <= most_dn)
    if not np.any(keep):
        raise InputError(
            f"flat frames: each is over {FIT_SHARE:.0%} of white; allowed: two or more below that; expose them less"
        )
    position = np.tile(np.arange(len(used[0].mean_dn)), len(used))[keep]
    signal, flats, darks, excess = signal[keep], flats[keep], darks[keep], excess[keep]
    power = float(np.sum(signal**2))
    slope = float(np.sum(signal * excess)) / power
    # A dark stack may serve several lights: its error counts once for all of one position.
    of_darks = sum(float(np.sum(signal[position == site] * darks[position == site])) ** 2 for site in set(position))
    error = sqrt(float(np.sum((signal * flats) ** 2)) + of_darks) / power
    if not slope > 4 * error:  # 4 standard errors: no slope at all would be taken for one once in 3e4 cameras
        raise InputError(
            f"flat frames: their variance grows by {slope:.3g} +- {error:.3g} DN/e-, which can't be told from 0; "
            "allowed: frames that show shot noise; take brighter or more frames, unprocessed"
        )
    lights = sum(bool(np.any((point.signal_dn > 0) & (point.signal_dn <= most_dn))) for point in used)
    if lights < LEAST_LIGHTS or signal.min() > SPREAD[0] * most_dn or signal.max() < SPREAD[1] * most_dn:
        return SystemGain(slope, error, slope * UNKNOWN_CHANGE / sqrt(12), nan, nan)
    # The second term: excess = K0 s + k1 s^2, weighted by the errors.
    sigma = np.hypot(flats, darks)
    terms = np.stack([signal, signal**2], axis=1) / sigma[:, None]
    inverse = np.linalg.inv(terms.T @ terms)
    bend = inverse @ terms.T @ (excess / sigma)
    freedom = signal.size - 2
    birge = sqrt(max(float(np.sum((excess / sigma - terms @ bend) ** 2)) / freedom, 1.0))
    change, change_error = float(bend[1]) * most_dn / slope, sqrt(float(inverse[1, 1])) * birge * most_dn / slope
    # K is anywhere in its range: the standard deviation of an even distribution.
    model = hypot(change, change_error) / sqrt(12)
    return SystemGain(slope, error * birge, slope * model, change, change_error)


def _relative(stack: Sequence[Site], dark: Sequence[Site], level: Floats) -> list[tuple[NDArray[np.float64], float]]:
    """Return each pixel's response over the mean, less a smooth surface of second order, and its temporal variance.

    There is one such pair for each position in the tile.
    """
    responses = []
    for site, shade, signal in zip(stack, dark, level, strict=True):
        added = (site.mean_dn - shade.mean_dn) / signal
        rest = without_surface(added).ravel()
        freedom = sqrt(rest.size / (rest.size - _SURFACE_TERMS))
        responses.append(((rest * freedom).reshape(added.shape), (site.temporal_dn2 + shade.temporal_dn2) / signal**2))
    return responses


def without_surface(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Subtract a fitted smooth surface of second order: a lens's shading, or a lamp that stands at one side."""
    y, x = (np.linspace(-1, 1, size) for size in image.shape)
    terms = [np.ones_like(image), *np.meshgrid(x, y), *np.meshgrid(x**2, y**2), np.outer(y, x)]
    surface = np.stack([term.ravel() for term in terms], axis=1)
    # The normal equations: six terms over a whole frame are well apart, and lstsq would copy them.
    weights = np.linalg.solve(surface.T @ surface, surface.T @ image.ravel())
    return image - (surface @ weights).reshape(image.shape)


def _spread(images: list[tuple[NDArray[np.float64], float]]) -> Estimate:
    """Return the variance over pixels less the temporal one (eqs. 66, 67), and its error.

    The error comes from the scatter over columns, because these are independent.
    """
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
    """Return the root of a variance, and the roots of its interval's ends: so it stays right near 0."""
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


def _evenness(stack: LightStack, level: Floats) -> list[str]:
    """Say how even the light was; refuse structure beyond a smooth surface, because it would pass for PRNU."""
    uneven = max(_unevenness(site.mean_dn, signal) for site, signal in zip(stack.sites, level, strict=True))
    if uneven <= MOST_UNEVEN:
        return [f"the flat frames are even within {max(uneven, 0.0):.1%} from the darkest part to the brightest"]
    rest = max(
        _unevenness(without_surface(site.mean_dn), signal) for site, signal in zip(stack.sites, level, strict=True)
    )
    if rest > MOST_UNEVEN:
        raise InputError(
            f"flat frames of {level.mean():.4g} DN: they are not flat, {uneven:.1%} from the darkest part to the "
            f"brightest, {rest:.1%} without a smooth surface; allowed: {MOST_UNEVEN:.0%}; light an even surface, out "
            "of focus, or measure the middle alone (--window)"
        )
    return [
        f"warning: the flat frames aren't even, {uneven:.1%} from the darkest part to the brightest: a surface of "
        f"second order is taken out of PRNU, which leaves {max(rest, 0.0):.1%}"
    ]


def _unevenness(image: NDArray[np.float64], signal: float) -> float:
    """Return by how much an image's darkest and brightest parts differ beyond noise, over the signal."""
    rows = np.array_split(image, _BLOCKS)
    blocks = [block for row in rows for block in np.array_split(row, _BLOCKS, axis=1)]
    means = np.array([block.mean() for block in blocks])
    # 4 standard errors of a block to each side: 16 blocks of noise alone are refused once in a thousand frames
    noise = 8 * float(np.mean([block.std() / sqrt(block.size) for block in blocks]))
    return (float(np.ptp(means)) - noise) / signal
