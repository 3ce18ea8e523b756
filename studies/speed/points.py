"""Measure the time and the error of settings ("choices") of a stage, and find those that no other beats in both.

A render's error is measured against two references, whose noise is independent of each other. The product of the
render's differences from both, (d - r1)(d - r2), has the squared error of d as its expectation. So the references' own
noise doesn't change the mean of the product, but it does change the quantiles.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from render.error_estimates import pooled
from render.radiance import SpectralRadiance
from rodcone.types import Image
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.readout import noise_variance
from sensor.response import channel_electrons

T = TypeVar("T")


@dataclass(frozen=True)
class Times:
    """Seconds of a call.

    Attributes
    ----------
    first_s : float
        First call, compilation included.
    seconds, processor_s : float
        Medians over the later calls: time on the clock, and processor time of all threads together.
    """

    first_s: float
    seconds: float
    processor_s: float


@dataclass(frozen=True)
class Timing:
    """Setting that is tried in a stage, with its times and its error.

    Attributes
    ----------
    choice : str
    times : Times
    error_e : float
        RMS error [e-].
    share : float or None
        Mean over pixels of the squared error over the pixel's noise variance; None if only the ratio of the two means
        is known.
    """

    choice: str
    times: Times
    error_e: float
    share: float | None = None


def front(pairs: Sequence[tuple[float, float]]) -> list[bool]:
    """Mark the pairs (time, error) on the Pareto front: no other pair is better in one and as good in the other.

    Of several equal pairs only the first is marked.
    """
    flags = [False] * len(pairs)
    least = np.inf
    for index in sorted(range(len(pairs)), key=lambda place: pairs[place]):
        flags[index] = pairs[index][1] < least
        least = min(least, pairs[index][1])
    return flags


def laps(calls: Mapping[str, Callable[[], T]], repeats: int) -> dict[str, tuple[T, NDArray[np.float64]]]:
    """Call each function 1 + `repeats` times; return its last result and its seconds, shape (1 + repeats, 2).

    The columns are seconds on the clock and of the processor. The functions take turns, so that other programs disturb
    all of them alike.
    """
    results: dict[str, T] = {}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in calls}
    for _ in range(repeats + 1):
        for name, call in calls.items():
            wall, processor = time.perf_counter(), time.process_time()
            results[name] = call()
            seconds[name].append((time.perf_counter() - wall, time.process_time() - processor))
    return {name: (results[name], np.array(seconds[name])) for name in calls}


def time_calls(calls: Mapping[str, Callable[[], T]], repeats: int) -> dict[str, tuple[T, Times]]:
    """Return the last result and the times of each function; without repeats the time of the first call counts."""
    points = {}
    for name, (result, seconds) in laps(calls, repeats).items():
        points[name] = result, Times(float(seconds[0, 0]), *np.median(seconds[min(repeats, 1) :], axis=0).tolist())
    return points


def stage_json(
    name: str, question: str, reference: str, noise_e: float, points: Sequence[Timing], reference_times: Times
) -> dict[str, Any]:
    """Return a stage of the chain as JSON holds it: its choices' times and errors with their ratios.

    Parameters
    ----------
    name, question : str
    reference : str
        Name of the choice against whose result errors are measured, and by whose times the times are divided.
    noise_e : float
        Root mean square of the sensor's own noise, to compare the errors with.
    points : sequence of Timing
    reference_times : Times
    """
    shares = [(point.error_e / noise_e) ** 2 if point.share is None else point.share for point in points]
    on_front = front([(point.times.seconds, share) for point, share in zip(points, shares, strict=True)])
    return {
        "name": name,
        "question": question,
        "reference": reference,
        "reference_s": reference_times.seconds,
        "reference_processor_s": reference_times.processor_s,
        "noise_e": noise_e,
        "points": [
            {
                "choice": point.choice,
                **vars(point.times),
                "time_over_reference": point.times.seconds / reference_times.seconds,
                "processor_over_reference": point.times.processor_s / reference_times.processor_s,
                "error_e": point.error_e,
                "share_of_noise_variance": share,
                "on_front": best,
            }
            for point, share, best in zip(points, shares, on_front, strict=True)
        ],
    }


@dataclass(frozen=True)
class NoiseReference:
    """Two references behind one sensor, and the sensor's own noise.

    Attributes
    ----------
    sensor : SensorConfig
    exposure_s : float
        Exposure time, the mean of the automatic exposures of both references.
    references : pair of (channel, h, w) float64
        Expected electrons.
    noise_e2 : (channel, h, w) float64
        The sensor's own noise variance at the references' mean.
    inside : (channel, h, w) bool
        Pixels that count: below the full well, and without a directly visible lamp.
    """

    sensor: SensorConfig
    exposure_s: float
    references: tuple[Image, Image]
    noise_e2: Image
    inside: NDArray[np.bool_]


def electrons(radiance: SpectralRadiance, sensor: SensorConfig, exposure_s: float) -> Image:
    """Return the expected electrons behind every filter at every pixel, shape (channel, h, w)."""
    return np.moveaxis(channel_electrons(form_image(radiance, sensor), sensor, exposure_s), -1, 0)


def yardstick(
    references: tuple[SpectralRadiance, SpectralRadiance], lamps: NDArray[np.bool_], sensor: SensorConfig
) -> NoiseReference:
    """Return exposure, noise and counted pixels for two references; `lamps` (h, w) marks pixels that see a lamp."""
    images = [form_image(reference, sensor) for reference in references]
    exposure_s = float(np.mean([auto_exposure_s(image, sensor) for image in images]))
    first, second = (electrons(reference, sensor, exposure_s) for reference in references)
    expected = (first + second) / 2
    noise_e2 = np.stack([noise_variance(plane, sensor, exposure_s) for plane in expected])
    return NoiseReference(sensor, exposure_s, (first, second), noise_e2, (expected < sensor.pixel.full_well_e) & ~lamps)


def share_map(image_e: Image, yard: NoiseReference) -> Image:
    """Return the squared error over the sensor's noise variance, shape (channel, h, w).

    It is pooled over 3x3 pixels, and NaN outside the pixels that `yard` counts.
    """
    first, second = yard.references
    return pooled_share((image_e - first) * (image_e - second), yard)


def pooled_share(squared_e2: Image, yard: NoiseReference) -> Image:
    """Return the mean over 3x3 pixels of each pixel's squared error over its own noise variance; NaN outside.

    Only pixels in `yard.inside` count. Each error is divided by its own pixel's variance, so that a bright pixel's
    error isn't compared with the noise of a dark one.
    """
    weight = pooled(yard.inside.astype(np.float64))
    total = pooled(np.where(yard.inside, squared_e2 / yard.noise_e2, 0.0))
    return np.where(yard.inside, total / np.maximum(weight, 1 / 9), np.nan)


def mean_error(image_e: Image, yard: NoiseReference) -> tuple[float, float]:
    """Return the RMS error [e-] and the mean share, over pixels and channels.

    Both are estimates free of the references' noise, which may be negative; 0 is returned then.
    """
    first, second = yard.references
    squared_e2 = float(((image_e - first) * (image_e - second))[yard.inside].mean())
    share = float(np.nanmean(share_map(image_e, yard)))
    return float(np.sqrt(max(squared_e2, 0.0))), max(share, 0.0)
