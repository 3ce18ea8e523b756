"""Camera shake: how the image moves on the sensor while a hand holds the camera, and the blur that this leaves.

Muscles push the hand at random, and it responds like a damped oscillator: the second-order stochastic process by which
Timmer, Lauk, Pfleger & Deuschl, "Cross-spectral analysis of physiological tremor and muscle activity I", Biological
Cybernetics 78 (1998), describe measured hand tremor. An axis of the image, of variance s^2, has the one-sided spectrum

    S(f) = 4 zeta f0^3 s^2 / pi / ((f0^2 - f^2)^2 + (2 zeta f0 f)^2).

f0 is 4 Hz, as accelerometers on hand-held cameras measured (Japanese Journal of Ergonomics 31 (6), 399, 1995). Two
values are our choice: zeta, which makes the resonance broad, and s. Photographers expose by hand for at most 1 s over
the focal length in mm, on film of 35 mm. s is chosen so that the image of a point then moves by that film's circle of
confusion, 30 um.

If a sensor's rows roll, each row sees the part of the path within its own exposure. So upright lines lean and bend, and
the picture is stretched and squeezed.
"""

import os
from collections.abc import Mapping
from dataclasses import replace
from math import pi, sqrt
from types import MappingProxyType

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.errors import require_name
from rodcone.types import Floats
from sensor.config import LensConfig, SensorConfig, check_frame, row_starts_s
from sensor.random import NoiseTerm, draw_key, normals

RESONANCE_HZ, DAMPING = 4.0, 0.5
POLE_PER_S = 2 * pi * RESONANCE_HZ * complex(-DAMPING, sqrt(1 - DAMPING**2))  # pole of the oscillator
SPEED_RAD_PER_S = 0.030 / sqrt(2)  # rms angular speed of each axis: 30 um in 1/F s behind F mm, both axes together
FOCAL_LENGTH_MM = 6.0  # focal length of a compact camera with Table 1's pixel
# Standard deviation of the image along each axis [um], by the name that `shake` options take.
SHAKES: Mapping[str, float] = MappingProxyType(
    {"hand": SPEED_RAD_PER_S / (2 * pi * RESONANCE_HZ) * FOCAL_LENGTH_MM * 1e3}
)
# Longest time step of a path [s], and its fewest and most steps.
STEP_S = 2e-3
STEPS = (32, 4096)


def held_lens(lens: LensConfig, shake: str | None) -> LensConfig:
    """Return the lens of a camera that is held as one of `SHAKES` names; None leaves the lens as it is.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if shake is None:
        return lens
    require_name("shake", shake, SHAKES)
    return replace(lens, shake_um=SHAKES[shake])


def blur_variance(exposure_s: float) -> float:
    """Return the expected variance of the image's position within an exposure, relative to its variance over all time.

    That is the integral of S(f) (1 - sinc^2(f T)) / s^2, in closed form by the autocorrelation Re((1 - i a) exp(p t)),
    where p is the oscillator's pole and a = -Re p / Im p.
    """
    if exposure_s == 0:
        return 0.0
    turn = POLE_PER_S * exposure_s
    # For short times the terms would cancel, so exp(x) - 1 - x - x^2 / 2 is computed as a series there.
    rest = turn**3 / 6 * (1 + turn / 4 + turn**2 / 20) if abs(turn) < 1e-2 else np.exp(turn) - 1 - turn - turn**2 / 2
    return float(-2 * ((1 + 1j * POLE_PER_S.real / POLE_PER_S.imag) * rest / turn**2).real)


def path(exposure_s: float, key: int) -> NDArray[np.float64]:
    """Draw the positions of the image at even times within an exposure, around their mean, shape (axis, time); s is 1.

    A draw depends on key, axis and time step alone. The mean position within the exposure only shifts the framing and
    isn't blur.
    """
    count = _step_count(exposure_s)
    return _walk(exposure_s / count, count, key)


def _step_count(time_s: float, longest_s: float = STEP_S) -> int:
    return int(np.clip(np.ceil(time_s / longest_s), *STEPS))


def _walk(step_s: float, count: int, key: int) -> NDArray[np.float64]:
    """Draw `count` positions of the image, `step_s` apart, around their mean, in units of s; shape (axis, time)."""
    # Position and speed / (2 pi f0), both with variance 1, are advanced exactly: z' = A z + B n, B B^T = 1 - A A^T.
    turn = np.exp(POLE_PER_S * step_s)
    advance = turn.real * np.eye(2) + turn.imag / sqrt(1 - DAMPING**2) * np.array([[DAMPING, 1.0], [-1.0, -DAMPING]])
    values, vectors = np.linalg.eigh(np.eye(2) - advance @ advance.T)
    push = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = normals(key, NoiseTerm.SHAKE, (4, count)).reshape(2, 2, count)
    states = np.empty((count, 2, 2))  # time, axis, place and speed
    states[0] = draws[..., 0]
    for step in range(1, count):
        states[step] = states[step - 1] @ advance.T + draws[..., step] @ push.T
    places = states[..., 0].T
    return np.asarray(places - places.mean(axis=1, keepdims=True))


def rolling_path(
    starts_s: Floats, exposure_s: float, key: int, longest_s: float = STEP_S
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the path from the first row's exposure to the last one's end, and each row's shares of it.

    Parameters
    ----------
    starts_s : (row,) float64
        Time at which each row's exposure starts [s].
    exposure_s : float
        Exposure time of a row, above 0 [s].
    key : int
    longest_s : float
        Longest step between two positions [s].

    Returns
    -------
    places : (axis, time) float64
        Positions as in `path`, around their mean over the time of all rows.
    shares : (row, time) float64
        Weights from `row_shares`.
    """
    whole_s = float(np.max(starts_s)) + exposure_s
    count = _step_count(whole_s, longest_s)
    step_s = whole_s / count
    return _walk(step_s, count + 1, key), row_shares(starts_s, exposure_s, step_s, count + 1)


def row_shares(starts_s: Floats, exposure_s: float, step_s: float, count: int) -> NDArray[np.float64]:
    """Return the weight of each position of a path in the mean over a row's exposure, shape (row, time).

    A row's weights sum to 1. Between two of the `count` positions, `step_s` apart, the image moves in a straight line.
    """

    def until(time_s: Floats) -> Floats:
        # Integral of the tent around each position, whose height is 1 and whose half width is 1 step.
        steps = np.clip(time_s[:, None] / step_s - np.arange(count), -1.0, 1.0)
        return np.asarray(0.5 + steps - steps * np.abs(steps) / 2)

    starts_s = np.asarray(starts_s, dtype=np.float64)
    return (until(starts_s + exposure_s) - until(starts_s)) * (step_s / exposure_s)


def moved_by_rows(electrons: NDArray[np.float64], places_px: Floats, shares: Floats) -> NDArray[np.float64]:
    """Return the electrons that each row collects from an image that moves, shape (h, w, channel).

    Parameters
    ----------
    electrons : (h, w, channel) float64
        Electrons of a still camera.
    places_px : (2, time) float64
        Positions of the image, downwards and to the right [pixels].
    shares : (h, time) float64
        Weight of each position in a row's exposure.

    Notes
    -----
    A row's sum over positions is computed in the spectrum along the row, so that each position costs a transform along
    the columns. The picture continues as its mirror image. Undershoot becomes 0, and each channel keeps the sum that it
    had before that. This isn't the still picture's sum, because a lamp that moves with the rolling rows is seen by more
    of them.
    """
    height, width, channels = electrons.shape
    threads = os.cpu_count() or 1
    down, across = scipy.fft.fftfreq(2 * height)[:, None], scipy.fft.rfftfreq(2 * width)
    result = np.empty_like(electrons)
    for channel in range(channels):
        mirrored = np.pad(electrons[..., channel], ((0, height), (0, width)), "symmetric")
        still = scipy.fft.rfft2(mirrored, workers=threads)
        rows = np.zeros((height, across.size), np.complex128)
        for (y, x), share in zip(np.transpose(places_px), np.transpose(shares), strict=True):
            moved = scipy.fft.ifft(still * np.exp(-2j * pi * down * y), axis=0, overwrite_x=True, workers=threads)
            rows += share[:, None] * moved[:height] * np.exp(-2j * pi * across * x)
        light = scipy.fft.irfft(rows, n=2 * width, axis=1, workers=threads)[:, :width]
        kept = np.maximum(light, 0.0)
        result[..., channel] = kept * (max(light.sum(), 0.0) / (kept.sum() or 1.0))
    return result


def shaken(
    electrons: NDArray[np.float64], sensor: SensorConfig, exposure_s: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the electrons behind every filter, shape (h, w, channel), blurred by the image's movement.

    The transfer function of the path multiplies the picture's spectrum; the picture continues as its mirror image.
    Undershoot becomes 0, and each channel keeps its sum. With a rolling shutter each row sees its own part of the path
    (`moved_by_rows`).

    Parameters
    ----------
    electrons : (h, w, channel) float64
        Electrons of a still camera, as from `sensor.response.channel_electrons`.
    sensor : SensorConfig
        Its lens's `shake_um` is the standard deviation of the image's position; 0 draws nothing. Its `row_time_us` is
        the delay between the starts of two rows.
    exposure_s : float
    rng : numpy.random.Generator
        Gives one key for the path.
    """
    if not sensor.lens.shake_um:
        return electrons
    key = draw_key(rng)
    scale_px = sensor.lens.shake_um / sensor.site_pitch_um
    if exposure_s == 0:
        return electrons
    height, width = electrons.shape[:2]
    if sensor.row_time_us:
        check_frame(sensor, (height, width))
        starts_s = np.repeat(row_starts_s(sensor, height // sensor.sites), sensor.sites)
        walked, shares = rolling_path(starts_s, exposure_s, key)
        return moved_by_rows(electrons, walked * scale_px, shares)
    places = path(exposure_s, key) * scale_px
    count = places.shape[1]
    frequencies = scipy.fft.fftfreq(2 * height), scipy.fft.rfftfreq(2 * width)
    down, across = (np.exp(-2j * pi * np.outer(place, f)) for place, f in zip(places, frequencies, strict=True))
    transfer = down.T @ across / count
    mirrored = np.pad(np.moveaxis(electrons, -1, 0), ((0, 0), (0, height), (0, width)), "symmetric")
    light = scipy.fft.irfft2(scipy.fft.rfft2(mirrored) * transfer, s=mirrored.shape[1:])[:, :height, :width]
    light = np.maximum(light, 0.0)
    sums, totals = light.sum(axis=(1, 2)), electrons.sum(axis=(0, 1))
    return np.moveaxis(light * (totals / np.where(sums > 0, sums, 1.0))[:, None, None], 0, -1)
