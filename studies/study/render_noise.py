"""Compare a render's Monte Carlo noise with the sensor's own: measure it, note it, and render until it is low."""

from collections.abc import Callable, Sequence
from math import ceil, log2
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.denoised.relight import measured_error
from render.engine import render
from render.scene import Scene
from render.transport import Transport
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import camera_equation, form_image
from sensor.readings.resolve import PlainReading, resolve, unsaturated
from sensor.readout import light_variance
from sensor.response import channel_electrons, electrons_per_irradiance

# Share of the sensor's own noise variance that Monte Carlo noise may add without counting as part of the result; and
# the share of pixels for which that has to hold, because a few see a lamp's rim or a caustic.
MOST_SHARE = 0.03
OF_PIXELS = 0.95

SPECKLE = 5.0  # larger errors, in the sensor's standard deviations, are speckles; chance gives 1 in 2 million pixels
FIRST_SPP = 128  # samples per pixel that are enough to predict how many more are needed
MARGIN = 1.05  # the predicted number of samples is multiplied by this, because it is an estimate
MOST_GROWTH = 4.0  # the number of samples grows at most by this factor from one prediction to the next


def monte_carlo_share(
    error_e: NDArray[np.floating],
    expected_e: NDArray[np.float64],
    sensor: SensorConfig,
    exposure_s: float,
    *,
    of_pixels: float | None = None,
) -> float:
    """Return the Monte Carlo variance of a frame's electrons over the sensor's own; 0 where the well is full.

    Parameters
    ----------
    error_e : (..., h, w) array
        Monte Carlo error [e-]: one draw of it, such as half the difference of its halves, or its standard
        deviation.
    expected_e : (h, w) or (channel, h, w) float64
        Expected electrons of the whole render, of the mosaic or behind every filter. Pixels that reach the full well
        are left out.
    sensor : SensorConfig
    exposure_s : float
        Exposure time, for the dark current [s].
    of_pixels : float, optional
        Share of pixels (0 to 1): the result is the ratio that this share of the pixels stays below. Left out, it is the
        mean Monte Carlo variance over the sensor's mean variance.
    """
    if expected_e.ndim == 2:
        variance_e2, inside = _noise_and_room(expected_e, resolve(sensor, expected_e, exposure_s))
    else:
        parts = zip(sensor.channels, expected_e, strict=True)
        of_channels = [_noise_and_room(plane, resolve(sensor, plane, exposure_s, name)) for name, plane in parts]
        variance_e2, inside = (np.stack(arrays) for arrays in zip(*of_channels, strict=True))
    if not inside.any():
        return 0.0
    if of_pixels is None:
        return _mean_share(error_e, variance_e2, inside)
    return float(np.quantile(error_e[inside] ** 2 / variance_e2[inside], of_pixels))


def _noise_and_room(
    expected_e: NDArray[np.float64], readings: Sequence[PlainReading]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return for each pixel the sensor's variance of an estimate of the light, and whether the pixel isn't saturated.

    `expected_e` is a mosaic, or what one channel would read at every pixel.
    """
    return light_variance(expected_e, readings), unsaturated(expected_e, readings)


def _mean_share(error_e: NDArray[np.floating], variance_e2: NDArray[np.float64], inside: NDArray[np.bool_]) -> float:
    return float(np.square(error_e[inside]).mean() / variance_e2[inside].mean())


def monte_carlo_bound(
    errors_e: NDArray[np.floating], expected_e: NDArray[np.float64], readings: Sequence[PlainReading]
) -> float:
    """Return the Monte Carlo variance of a frame over the sensor's own noise variance; 0 if every pixel is full.

    Parameters
    ----------
    errors_e : (1 or 2, h, w) array
        One draw of the unbiased light's error [e-], or the differences of denoised light from two independent folds.
        The mean product of these two is the whole squared error. Its upper limit is used (`render.denoised.relight`).
    expected_e : (h, w) float64
    readings : sequence of PlainReading
        Readings that the camera takes of the frame (`sensor.readings.resolve.resolve`).
    """
    variance_e2, inside = _noise_and_room(expected_e, readings)
    if not inside.any():
        return 0.0
    if len(errors_e) == 1:
        return _mean_share(errors_e[0], variance_e2, inside)
    sensor_noise_e2 = variance_e2[inside].sum() / inside.size
    return measured_error(errors_e[0], errors_e[1], inside / sensor_noise_e2).upper


def render_share(
    transport: Transport,
    sensor: SensorConfig,
    luminance_cd_m2: float,
    longest_s: float,
    exposure_s: float | None = None,
    *,
    samples: int = 1,
) -> float:
    """Return the Monte Carlo variance over the sensor's own below which `OF_PIXELS` of the pixels lie, in any channel.

    The bands of a path rise and fall together, so their standard errors are added; the variance can't be larger. It is
    pooled over 3x3 pixels.

    Parameters
    ----------
    transport : Transport
    sensor : SensorConfig
    luminance_cd_m2 : float
        Mean scene luminance.
    longest_s : float
        Longest auto exposure [s].
    exposure_s : float, optional
        Exposure time; left out, the automatic exposure chooses it.
    samples : int
        Samples of the light along each side of a pixel.
    """
    irradiance = form_image(transport.relight(luminance_cd_m2=luminance_cd_m2), sensor, samples)
    time_s = auto_exposure_s(irradiance, sensor, longest_s) if exposure_s is None else exposure_s
    expected_e = np.moveaxis(channel_electrons(irradiance, sensor, time_s), -1, 0)
    variance = transport.relight_variance(luminance_cd_m2=luminance_cd_m2)
    if samples > 1:  # because the errors of a pixel's samples are independent
        bands, height, width = variance.shape
        blocks = variance.reshape(bands, height // samples, samples, width // samples, samples)
        variance = blocks.mean(axis=(2, 4)) / samples**2
    weights = electrons_per_irradiance(sensor, transport.wavelength_nm, transport.width_nm, time_s, irradiance.light)
    weights = weights * camera_equation(sensor.lens)
    error_e = np.tensordot(weights, np.sqrt(np.maximum(variance, 0.0)), axes=1)
    return monte_carlo_share(error_e, expected_e, sensor, time_s, of_pixels=OF_PIXELS)


def speckle_sizes(
    error_e: NDArray[np.floating], expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float
) -> NDArray[np.float64]:
    """Return the errors of unsaturated pixels in the sensor's standard deviations, if above `SPECKLE`; (pixel,).

    If the render's noise is smaller than the sensor's, only single bright samples cause errors as large as these. The
    parameters are as in `monte_carlo_share`, for one frame.
    """
    variance_e2, inside = _noise_and_room(expected_e, resolve(sensor, expected_e, exposure_s))
    size = np.abs(error_e) / np.sqrt(variance_e2)
    return np.asarray(size[(size > SPECKLE) & inside])


def noise_note(share: float, spp: float, speckles: NDArray[np.float64] | None = None) -> str:
    """Return a note that a render's noise shows, and how many samples would hide it; empty if it doesn't show.

    Parameters
    ----------
    share : float
        Monte Carlo variance over the sensor's own.
    spp : float
        Samples per pixel of the render; 0 for a file, for which no number of samples can be given.
    speckles : (pixel,) float64, optional
        As from `speckle_sizes`.
    """
    if share >= 1:
        times = f"{share:.2g}" if share < 10 else f"{share:.0f}"
        what = f"the render's noise has {times} times the sensor's variance: it shows in pictures and reference"
        factor = share
    elif speckles is not None and speckles.size:
        spots = f"{speckles.size} pixels are speckles" if speckles.size > 1 else "1 pixel is a speckle"
        what = f"{spots}: the render's noise there is over {SPECKLE:g} times the sensor's"
        factor = float(speckles.max()) / SPECKLE  # one sample's part of a pixel falls as their number grows
    else:
        return ""
    remedy = f"; {2 ** ceil(log2(spp * factor))} samples a pixel would do" if spp else ""
    return f"{what}{remedy}"


def render_quietly(
    scene: Scene,
    size: tuple[int, int],
    share: Callable[[Transport], float],
    *,
    most_share: float,
    max_spp: int,
    max_seconds: float | None,
    **options: Any,
) -> Transport:
    """Render until `share` is `most_share` or less, or until samples or time are used up; return what was rendered.

    Parameters
    ----------
    share : callable
        Function that returns a render's noise variance over the sensor's own, such as `render_share`.
    most_share : float
    max_spp : int
        Samples per pixel, at most.
    max_seconds : float or None
        Time, at most.
    **options
        Options of `render.engine.render`: bands, seed, cache, progress.
    """
    transport = None
    most_samples = min(FIRST_SPP, max_spp)
    while True:
        transport = render(scene, size, max_spp=most_samples, max_seconds=max_seconds, resume=transport, **options)
        now = share(transport)
        if now <= most_share or transport.stopped_by != "samples" or transport.spp >= max_spp:
            return transport
        most_samples = min(max_spp, int(np.ceil(transport.spp * min(MARGIN * now / most_share, MOST_GROWTH))))
