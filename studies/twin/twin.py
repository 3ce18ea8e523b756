"""A camera's twin: measure a preset from a camera's frames, simulate the same frames with it, and compare figures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import erfc, hypot, isnan, nan, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from rodcone.types import Floats
from sensor.cameras.frame_sets import FrameSet, LightFrames, read_frame_pixels
from sensor.cameras.frames import frame_numbers, measure_set
from sensor.cameras.numbers import PixelNumbers, SourcedValue
from sensor.capture import expose
from sensor.config import LensConfig, SensorConfig
from sensor.device import Device, draw_device
from sensor.emva1288.estimators import FIT_SHARE, LINEAR_RANGE
from sensor.emva1288.from_frames import (
    MOST_CLIPPED,
    NORMAL_95,
    TOLD,
    FrameFigures,
    LightStack,
    stack_of,
    without_surface,
)
from sensor.pixel import PixelConfig
from studies.twin.ramp import Ramp, ramp_of
from studies.twin.tails import is_rounding, noise_histograms, tail_ratio, telegraph_numbers

APART = 0.01  # significance level at which camera and twin count as different, for all tests of one figure together
LEAST_BENT = 4  # least number of lights to which the response's bend is fitted
MOST_MISCOUNTED = 0.5  # mean per photon that differs by more from the median's share is a wrong count of photons
MOST_BENT = 0.3  # largest bend of the response that is tried
RAMP_RANGE = (0.1, 0.75)  # signals over white between which a ramp that columns share is fitted
MOST_RAMP_LIGHTS, MOST_RAMP_ROWS = 32, 512  # that many are enough, and more take memory
SIMULATED_UM = 5.0  # pitch of the simulated pixel, which doesn't matter for light given in electrons


@dataclass(frozen=True)
class TwinFigure:
    """One figure of the camera and of its twin.

    Attributes
    ----------
    name, place : str
        Name of the figure, and the frames that it was measured on.
    camera, twin : float
    low, high : float
        Ends of the 95 % interval of twin over camera.
    alike : bool
        Whether a two-sample test finds no significant difference. The level of 1 % is divided among all tests of this
        figure.
    """

    name: str
    place: str
    camera: float
    twin: float
    low: float
    high: float
    alike: bool

    @property
    def ratio(self) -> float:
        """Return the twin's figure over the camera's."""
        return self.twin / self.camera

    @property
    def verdict(self) -> str:
        """Return a sentence that says what was found."""
        told = "not told apart" if self.alike else "told apart"
        return (
            f"{self.name}: {self.ratio:.3f} of the camera's {self.place}, interval {self.low:.3f} to {self.high:.3f}: "
            f"{told} at {APART:.0%}"
        )


@dataclass(frozen=True)
class Response:
    """Response of the twin: the signal is S = W f(e / well), f(x) = x (1 + bend (1 - x)); W is white above black.

    Attributes
    ----------
    bend : float
        `PixelConfig.response_bend`.
    gain_dn_per_e : float
        DN per electron of a full well.
    source : str
        Source of the bend, or why it is 0.
    denied : bool
        Whether K changes with light, but not because the response bends.
    ramp : Ramp or None
        The ramp that columns share, which then changes K.
    """

    bend: float
    gain_dn_per_e: float
    source: str
    denied: bool = False
    ramp: Ramp | None = None

    def light_e(self, signal_dn: Floats, white_dn: float) -> Floats:
        """Return the electrons whose response is a given signal [DN]."""
        if not self.bend:
            return np.asarray(signal_dn / self.gain_dn_per_e)
        slope = 1 + self.bend
        share = 2 * signal_dn / white_dn / (slope + np.sqrt(slope**2 - 4 * self.bend * signal_dn / white_dn))
        return np.asarray(share * white_dn / self.gain_dn_per_e)


@dataclass(frozen=True)
class FramePair:
    """Mean image and one frame of the camera and of its twin under the same light."""

    camera_mean: Floats
    twin_mean: Floats
    camera_frame: NDArray[Any]
    twin_frame: NDArray[Any]


@dataclass(frozen=True)
class Twin:
    """A camera and its twin.

    Attributes
    ----------
    figures : FrameFigures
        Figures of the camera's frames.
    numbers : PixelNumbers
        The preset's numbers, each with its source.
    sensor : SensorConfig
        The simulated camera.
    camera_dn2, twin_dn2 : (light,) float64
        Temporal variance under each light that isn't clipped.
    signal_dn : (light,) float64
        The camera's mean above that of the dark, under the same lights.
    dark, bright : FramePair
    comparisons : tuple of TwinFigure
    """

    figures: FrameFigures
    numbers: PixelNumbers
    sensor: SensorConfig
    signal_dn: Floats
    camera_dn2: Floats
    twin_dn2: Floats
    dark: FramePair
    bright: FramePair
    comparisons: tuple[TwinFigure, ...]


def twin_of(frames: FrameSet, name: str, seed: int = 0) -> Twin:
    """Measure a camera, and simulate its frames with a twin.

    The simulated light has the camera's own mean under each light, and varies smoothly as the camera's flat frames do.

    Raises
    ------
    InputError
        For frames that `sensor.cameras.frames.measure_set` refuses.
    """
    figures = measure_set(frames)
    dark = _largest(frames, lit=False)
    room_dn = FIT_SHARE * (figures.white_dn - figures.black_dn)
    bright = _largest(frames, lit=True, most_dn=figures.black_dn + room_dn)
    dark_dn, bright_dn = (_pixels(light, frames) for light in (dark, bright))
    mean = {False: _mean_image(dark_dn), True: _mean_image(bright_dn)}
    response = _with_ramp(response_of(figures), frames, figures, mean[True])
    numbers = _with_patterns(frame_numbers(figures, [Path(name)]), figures, response, dark_dn, bright_dn)
    sensor = _sensor(numbers, figures)

    # The same lights with the twin.
    rng = np.random.default_rng([seed, 1])
    device = draw_device(sensor, mean[True].shape, np.random.default_rng([seed, 0]))
    range_dn = figures.white_dn - figures.black_dn
    signal = mean[True] - figures.black_dn
    surface = (signal - without_surface(signal)) / signal.mean()
    points = [point for point in figures.points if point.clipped <= MOST_CLIPPED and np.all(point.signal_dn > 0)]
    stacks = []
    for point in points:
        site_e = response.light_e(point.signal_dn, range_dn)
        light_e = surface / surface.mean() * _site_light(site_e, figures, mean[True].shape)
        stacks.append(stack_of(_taken(light_e, sensor, device, rng, point.frames), figures.cfa, figures.white_dn))
    twin_dark = _taken(np.zeros(mean[False].shape), sensor, device, rng, len(dark_dn))
    light_e = surface / surface.mean() * response.light_e(signal.mean(), range_dn)
    twin_bright = _taken(light_e, sensor, device, rng, len(bright_dn))

    # Figures of both.
    camera_dn2 = np.array([point.variance_dn2.mean() for point in points])
    twin_dn2 = np.array([np.mean([site.variance_dn2 for site in stack.sites]) for stack in stacks])
    both = list(zip(points, stacks, strict=True))
    errors = [_relative_error(point.error_dn2, point.variance_dn2, stack) for point, stack in both]
    compared = [
        _compared("temporal noise", f"at {point.mean_dn.mean():.0f} DN", sqrt(a), sqrt(b), error, len(points))
        for point, a, b, error in zip(points, camera_dn2, twin_dn2, errors, strict=True)
    ]
    compared += _of_pair("dark", dark_dn, twin_dark) + _of_pair("flat", bright_dn, twin_bright)
    compared += _of_tails(dark_dn, twin_dark)
    return Twin(
        figures=figures,
        numbers=numbers,
        sensor=sensor,
        signal_dn=np.array([point.signal_dn.mean() for point in points]),
        camera_dn2=camera_dn2,
        twin_dn2=twin_dn2,
        dark=FramePair(mean[False], _mean_image(twin_dark), dark_dn[0], twin_dark[0]),
        bright=FramePair(mean[True], _mean_image(twin_bright), bright_dn[0], twin_bright[0]),
        comparisons=tuple(compared),
    )


def _mean_image(frames: Sequence[NDArray[Any]]) -> Floats:
    return np.asarray(np.mean(frames, axis=0, dtype=np.float64), dtype=np.float64)


def _pixels(light: LightFrames, frames: FrameSet) -> list[NDArray[Any]]:
    return [read_frame_pixels(frame, frames).dn for frame in light.frames]


def _largest(frames: FrameSet, *, lit: bool, most_dn: float = np.inf) -> LightFrames:
    """Return the light, lit or dark, with the most frames and a mean of at most `most_dn`; of several the brightest."""
    ranked = []
    for light in frames.lights:
        if light.lit is lit and len(light.frames) > 1:
            mean = float(read_frame_pixels(light.frames[0], frames).dn.mean())
            if mean <= most_dn:
                ranked.append((len(light.frames), mean, light))
    return max(ranked, key=lambda one: one[:2])[2]


def response_of(figures: FrameFigures) -> Response:
    """Fit the response's bend to the variance at each light, unless the means over photons contradict it.

    With shot noise of e electrons the variance is (g f')^2 e and the mean g e f / x, so variance over mean, K, is
    g f'^2 x / f: about g (1 + bend (1 - 3 x)). The mean over photons follows 1 + bend (1 - x). All lights have the same
    weight in the fit, because fluctuations of real lamps scatter K by more than the frames' noise does.
    """
    white_dn = figures.white_dn - figures.black_dn
    points = [p for p in figures.points if p.clipped <= MOST_CLIPPED]
    signal = np.array([p.signal_dn.mean() for p in points])
    gain = np.array([p.gain.mean() for p in points])
    photons = np.array([p.photons for p in points])
    used = (signal >= LINEAR_RANGE[0] * white_dn) & (signal <= LINEAR_RANGE[1] * white_dn)
    straight = figures.gain_dn_per_e.value
    if np.count_nonzero(used) < LEAST_BENT or not abs(figures.gain_change) > TOLD * figures.gain_change_error:
        return Response(0.0, straight, "K's change with light isn't told from 0")
    signal, gain, photons = signal[used], gain[used], photons[used]

    def fitted(bend: float) -> tuple[float, float]:
        """Return the squared error of the fit with a bend, and the gain that fits best with it."""
        slope = 1 + bend
        share = Response(bend, 1.0, "").light_e(signal, white_dn) / white_dn
        shape = (slope - 2 * bend * share) ** 2 / (slope - bend * share)
        scale = float(np.sum(shape * gain) / np.sum(shape**2))
        return float(np.sum((gain - scale * shape) ** 2)), scale

    bend = float(minimize_scalar(lambda x: fitted(x)[0], bounds=(-MOST_BENT, MOST_BENT), method="bounded").x)
    by_means = nan
    if not np.any(np.isnan(photons)):
        ratio = signal / photons
        counted = np.abs(ratio / np.median(ratio) - 1) < MOST_MISCOUNTED
        slope, start = np.polyfit(signal[counted], ratio[counted], 1)
        by_means = -slope * white_dn / (start + slope * white_dn)
        if by_means / bend < 0.5:
            denied = f"noise by light would give {bend:.3f}, but means by photons give {by_means:.3f}"
            return Response(0.0, straight, f"{denied}: K changes by another cause", denied=True)
    told = "" if isnan(by_means) else f"; means by photons give {by_means:.3f}"
    return Response(bend, fitted(bend)[1], f"noise of {signal.size} lights, variance over mean{told}")


def _with_ramp(response: Response, frames: FrameSet, figures: FrameFigures, flat: Floats) -> Response:
    """Return the response with a ramp that columns share, if it explains a change of K that no bend explains."""
    if not response.denied or len(figures.cfa) * len(figures.cfa[0]) > 1:
        return response
    lit = []
    for light in frames.lights:
        share = (read_frame_pixels(light.frames[0], frames).dn.mean() - figures.black_dn) / figures.white_dn
        if light.lit and len(light.frames) > 1 and RAMP_RANGE[0] <= share <= RAMP_RANGE[1]:
            lit.append((float(share), light))
    lit.sort(key=lambda one: one[0])
    chosen = lit[:: -(-len(lit) // MOST_RAMP_LIGHTS) or 1]
    top = max(flat.shape[0] - MOST_RAMP_ROWS, 0) // 2

    def pair(light: LightFrames) -> list[NDArray[Any]]:
        return [read_frame_pixels(frame, frames).dn[top : top + MOST_RAMP_ROWS] for frame in light.frames[:2]]

    dark = pair(_largest(frames, lit=False))
    ramp = ramp_of([pair(light) for _, light in chosen], dark, flat[top : top + MOST_RAMP_ROWS], figures.white_dn)
    return response if ramp is None else replace(response, ramp=ramp, gain_dn_per_e=ramp.gain_dn_per_e)


def _with_patterns(
    numbers: PixelNumbers,
    figures: FrameFigures,
    response: Response,
    dark: Sequence[NDArray[Any]],
    bright: Sequence[NDArray[Any]],
) -> PixelNumbers:
    """Return a preset's numbers with noise of columns, of rows and with tails, the response, and the full well.

    The columns' part is taken out of DSNU and PRNU. Electrons follow from the response's gain, and the full well from a
    black level that is a whole number of DN.
    """
    gain = response.gain_dn_per_e
    ramp = response.ramp
    black = round(figures.black_dn - (ramp.step_dn / 2 if ramp else 0.0))  # covered columns are raised by half a step
    dark_dn2 = _column_variance(dark)
    signal = float(np.mean(bright) - np.mean(dark))
    bright_dn2 = max(_column_variance(bright) - dark_dn2, 0.0)
    offset_e, spread = sqrt(dark_dn2) / gain, sqrt(bright_dn2) / signal
    pixel = dict(numbers.pixel)
    for key in ("read_noise_e", "dsnu_e"):
        pixel[key] = replace(pixel[key], value=pixel[key].value * figures.gain_dn_per_e.value / gain)
    rest = {"dsnu_e": offset_e, "prnu": spread}
    for key, columns in rest.items():
        whole = pixel[key].value
        pixel[key] = SourcedValue(sqrt(max(whole**2 - columns**2, 0.0)), f"{pixel[key].source}, less the columns'")
    pixel["column_offset_e"] = SourcedValue(offset_e, f"column means of {len(dark)} dark frames")
    pixel["column_gain_spread"] = SourcedValue(spread, f"column means of {len(bright)} flat frames, surface taken out")
    pixel["full_well_e"] = replace(pixel["full_well_e"], value=(figures.white_dn - black) / gain)
    row_e = min(sqrt(_row_variance(dark)) / gain, pixel["read_noise_e"].value)
    pixel["row_noise_e"] = SourcedValue(row_e, f"row means of {len(dark)} dark frames less their mean frame")
    pixel |= telegraph_numbers(dark, gain, sqrt(pixel["read_noise_e"].value ** 2 - row_e**2))
    pixel["response_bend"] = SourcedValue(response.bend, response.source)
    if ramp:
        source = (
            f"K over lights and pixels of rows that weren't fitted: within {ramp.left:.1%}, {ramp.before:.1%} without"
        )
        pixel["ramp_step_e"] = SourcedValue(ramp.step_dn / gain, source)
        pixel["ramp_rise"] = SourcedValue(ramp.rise, source)
    settings = {**numbers.settings, "black_level_dn": replace(numbers.settings["black_level_dn"], value=black)}
    return replace(numbers, pixel=pixel, settings=settings)


def _column_variance(frames: Sequence[NDArray[Any]]) -> float:
    """Return the variance of the columns' means, without the part that comes from noise of single pixels [DN^2].

    It is computed from the differences between neighbouring columns, because a real camera's columns may also vary
    slowly across the image, but a preset's columns are independent of each other.
    """
    image = without_surface(_mean_image(frames))
    of_pixels = float(np.mean(np.var(image, axis=0, ddof=1))) / int(image.shape[0])
    of_columns = float(np.mean(np.diff(image.mean(axis=0)) ** 2)) / 2
    return max(of_columns - of_pixels, 0.0)


def _row_variance(frames: Sequence[NDArray[Any]]) -> float:
    """Return the temporal variance that the pixels of a row have in common [DN^2].

    The part of the variance of a row's mean that comes from noise of single pixels is subtracted.
    """
    mean = _mean_image(frames)
    freedom = (len(frames) - 1) / len(frames)
    rest = [frame - mean - (frame.mean() - mean.mean()) for frame in frames]
    of_rows = float(np.mean([np.var(one.mean(axis=1), ddof=1) for one in rest])) / freedom
    of_pixels = float(np.mean([np.mean(np.var(one, axis=1, ddof=1)) for one in rest])) / freedom
    return max(of_rows - of_pixels / int(mean.shape[1]), 0.0)


def _sensor(numbers: PixelNumbers, figures: FrameFigures) -> SensorConfig:
    pixel = {key: number.value for key, number in numbers.pixel.items()}
    return SensorConfig(
        pixel=PixelConfig(pitch_um=SIMULATED_UM, fill_factor=1.0, **pixel),
        lens=LensConfig(f_number=2.8),
        cfa=figures.cfa,
        bits=int(numbers.settings["bits"].value),
        black_level_dn=int(numbers.settings["black_level_dn"].value),
        white_level_dn=int(figures.white_dn),
    )


def _site_light(electrons: Floats, figures: FrameFigures, shape: tuple[int, ...]) -> Floats:
    """Return an image (h, w) of electrons from those at each position in the tile."""
    tile = electrons.reshape(len(figures.cfa), len(figures.cfa[0]))
    rows, columns = np.arange(shape[0]) % tile.shape[0], np.arange(shape[1]) % tile.shape[1]
    return np.asarray(tile[rows[:, None], columns[None, :]])


def _taken(
    light_e: Floats, sensor: SensorConfig, device: Device, rng: np.random.Generator, count: int
) -> list[NDArray[Any]]:
    return [expose(light_e, sensor, 0.0, device, rng).dn for _ in range(count)]


def _relative_error(error_dn2: Floats, variance_dn2: Floats, stack: LightStack) -> float:
    """Return the relative standard error of the ratio of two standard deviations, camera's and twin's.

    Each is the root of the mean variance over positions in the tile.
    """
    camera = sqrt(float(np.sum(error_dn2**2))) / float(np.sum(variance_dn2))
    sites = stack.sites
    errors = [site.error_dn2 for site in sites]
    twin = hypot(*errors) / max(sum(site.variance_dn2 for site in sites), 1e-12)
    return 0.5 * float(hypot(camera, twin))


def _compared(name: str, place: str, camera: float, twin: float, error: float, tests: int) -> TwinFigure:
    """Compare two positive figures by their ratio; `error` is its relative standard error."""
    ratio = twin / camera if camera > 0 else np.inf
    share = erfc(abs(ratio - 1) / error / sqrt(2)) if error > 0 and not isnan(ratio) else 0.0
    width = NORMAL_95 * error
    return TwinFigure(name, place, camera, twin, ratio * (1 - width), ratio * (1 + width), share > APART / tests)


def _of_pair(kind: str, camera: Sequence[NDArray[Any]], twin: Sequence[NDArray[Any]]) -> list[TwinFigure]:
    """Compare camera and twin by the fixed pattern of rows, columns and pixels, and by the noise of whole rows."""
    found = []
    images = [without_surface(_mean_image(frames)) for frames in (camera, twin)]
    height, width = images[0].shape
    flickers = [np.subtract(frames[0], frames[1], dtype=np.float64) for frames in (camera, twin)]
    parts = (
        ("row means", [float(np.std(image.mean(axis=1), ddof=1)) for image in images], height),
        ("column means", [float(np.std(image.mean(axis=0), ddof=1)) for image in images], width),
        ("neighbouring columns", [float(np.std(np.diff(image.mean(axis=0)))) for image in images], 2 * width // 3),
        ("spread of pixels", [float(np.std(image)) for image in images], height * width),
        ("row noise", [float(np.std(flicker.mean(axis=1), ddof=1)) for flicker in flickers], height),
    )
    for name, (of_camera, of_twin), samples in parts:
        # The relative error of the ratio of two standard deviations of `samples` draws each is sqrt(2 / (2 samples)).
        found.append(_compared(name, f"in {kind} frames", of_camera, of_twin, sqrt(1 / samples), 2))
    return found


def _of_tails(camera: Sequence[NDArray[Any]], twin: Sequence[NDArray[Any]]) -> list[TwinFigure]:
    """Compare how far the tails of dark frames' temporal noise exceed normal ones, unless rounding alone shapes it."""
    both = [noise_histograms(frames) for frames in (camera, twin)]
    if any(map(is_rounding, both)):
        return []
    (of_camera, of_twin), errors = zip(*map(tail_ratio, both), strict=True)
    error = hypot(errors[0] / of_camera, errors[1] / of_twin)
    return [_compared("tails of the noise", "in dark frames", of_camera, of_twin, error, 1)]
