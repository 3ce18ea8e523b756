"""The generalised Anscombe transform from electrons to units of noise, and its exact unbiased inverse."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensor.calibration import ChannelNoise, NoiseStep
from sensor.cfa import mask
from sensor.raw import RawImage, gains_shot

# A smaller PRNU counts as 0: it adds less than 1 % to shot noise up to a million electrons, and ln(1 + p) loses digits.
LEAST_PRNU = 1e-4
_LEAST = 2.0 * np.sqrt(0.375)  # the Anscombe transform of 0 electrons, to which smaller values are raised


def stabilise(electrons: NDArray[np.floating], dark_noise_e: float, prnu: float) -> NDArray[Any]:
    """Transform a mosaic to units of its own noise: generalised Anscombe transform at unit gain, with PRNU.

    It is the integral of 1 / sqrt(s^2 + e + 3/8 + (p e)^2), for e electrons, dark noise s and PRNU p:

        t = ln(1 + 2 p sqrt(v) + 2 p^2 e') / p,    e' = e + 3/8,    v = s^2 + e' + (p e')^2

    which for p -> 0 is 2 sqrt(e + 3/8 + s^2) (Murtagh, Starck & Bijaoui 1995, eq. 7) minus a constant. From a few
    electrons on, the standard deviation of t is 1. Where e' is negative, PRNU is left out; below -s^2, t is 0.

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        Mosaic [e-].
    dark_noise_e : float
        s, as `RawImage.dark_noise_e` [e-].
    prnu : float
        p, as `RawImage.prnu`.

    Returns
    -------
    (h, w) of the same type
        Stabilised mosaic [standard deviations of a pixel's noise].
    """
    if prnu < LEAST_PRNU:
        return np.asarray(2.0 * np.sqrt(np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0)))
    seen = np.maximum(electrons + 0.375, 0.0)
    variance = np.maximum(electrons + (0.375 + dark_noise_e**2), 0.0) + (prnu * seen) ** 2
    return np.asarray(np.log(1.0 + 2.0 * prnu * np.sqrt(variance) + 2.0 * prnu**2 * seen) / prnu)


def stabilise_raw(electrons: NDArray[np.floating], raw: RawImage) -> NDArray[Any]:
    """Apply `stabilise` with the noise of a raw image, which has steps if pixels were read several times.

    From each step on, the variance is k e + s^2 + (p e)^2 with other k, s and p. Its integral is the transform at k e
    with PRNU p / k, divided by k. Each piece is shifted so that it meets the piece below. A channel with its own
    readings has its own k. The transform is applied to its counted electrons e / k, whose variance has the form above
    with k = 1. The same is done if columns' gains also act on dark current, so that k isn't 1
    (`sensor.raw.gains_shot`).

    Parameters
    ----------
    electrons : (h, w) float32 or float64
        The mosaic of `raw`, or a part of it that begins with a whole tile.
    """
    stable = _stabilise_in_steps(electrons, raw)
    for noise in map(raw.noise_of, _read_apart(raw)):
        at = mask(raw.cfa, noise.channel, electrons.shape)
        stable[at] = _counted(electrons[at], noise)
    return stable


def stabilise_channel(electrons: NDArray[np.floating], raw: RawImage, channel: str) -> NDArray[Any]:
    """Transform a plane of `channel` [e-] to units of its samples' noise, as `stabilise_raw` transforms the samples."""
    if channel in _read_apart(raw):
        return _counted(electrons, raw.noise_of(channel))
    return _stabilise_in_steps(electrons, raw)


def _stabilise_in_steps(electrons: NDArray[np.floating], raw: RawImage) -> NDArray[Any]:
    stable = _counted(electrons, raw.plain_noise)
    for step, offset in _joined(raw):
        stable = np.where(electrons >= step.from_e, _piece(electrons, step) + offset, stable).astype(electrons.dtype)
    return stable


def _read_apart(raw: RawImage) -> list[str]:
    return [noise.channel for noise in raw.channel_noise]


def _counted(electrons: NDArray[np.floating], noise: ChannelNoise) -> NDArray[Any]:
    return stabilise(electrons / noise.shot, noise.dark_noise_e / noise.shot, noise.prnu)


def _electrons(stable: NDArray[np.floating], noise: ChannelNoise) -> NDArray[np.float64]:
    return unstabilise(stable, noise.dark_noise_e / noise.shot) * noise.shot


def _joined(raw: RawImage) -> list[tuple[NoiseStep, float]]:
    """Return a raw image's noise steps, each with the offset that joins its piece of the transform to that below."""
    joined: list[tuple[NoiseStep, float]] = []
    both = gains_shot(raw, raw.dark_current_e)
    below = partial(_counted, noise=raw.plain_noise)
    offset = 0.0
    for step in (replace(step, shot=step.shot + both) for step in raw.noise_steps):
        seam_e = np.array(step.from_e)
        offset += float(below(seam_e) - _piece(seam_e, step))
        joined.append((step, offset))
        below = partial(_piece, step=step)
    return joined


def _piece(electrons: NDArray[np.floating], step: NoiseStep) -> NDArray[Any]:
    dark_e = float(np.hypot(step.read_noise_e, step.dsnu_e))
    return stabilise(electrons * step.shot, dark_e, step.prnu / step.shot) / step.shot


def without_prnu(raw: RawImage) -> RawImage:
    """Return a raw image without PRNU, for which `unstabilise_raw` inverts `stabilise_raw`."""
    return replace(
        raw,
        prnu=0.0,
        noise_steps=tuple(replace(step, prnu=0.0) for step in raw.noise_steps),
        channel_noise=tuple(replace(noise, prnu=0.0) for noise in raw.channel_noise),
    )


def unstabilise_raw(stable: NDArray[np.floating], raw: RawImage) -> NDArray[np.float64]:
    """Invert `stabilise_raw` for a raw image `without_prnu`.

    Below the first step this is `unstabilise`. Above a step, where noise is tens of electrons or more, the result is at
    most k / 4 electrons off, with the step's k.
    """
    electrons = _electrons(stable, raw.plain_noise)
    for step, offset in _joined(raw):
        dark_e = float(np.hypot(step.read_noise_e, step.dsnu_e))
        bright = unstabilise(step.shot * (stable - offset), dark_e) / step.shot
        electrons = np.where(stable >= _piece(np.array(step.from_e), step) + offset, bright, electrons)
    for noise in map(raw.noise_of, _read_apart(raw)):
        at = mask(raw.cfa, noise.channel, stable.shape)
        electrons[at] = _electrons(stable[at], noise)
    return electrons


def unstabilise(stable: NDArray[np.floating], dark_noise_e: float) -> NDArray[np.float64]:
    """Compute the electrons whose noisy samples have a given mean after the generalised Anscombe transform.

    Because the mean of a root is not the root of a mean, the algebraic inverse would be 1/4 e- too low. This is the
    closed form of the exact unbiased inverse (Makitalo & Foi 2011), shifted by the dark noise's variance (Makitalo &
    Foi, "Optimal inversion of the generalized Anscombe transformation for Poisson-Gaussian noise", IEEE TIP 22(1),
    2013).

    Parameters
    ----------
    stable : array
        Denoised values [standard deviations of noise].
    dark_noise_e : float
        Dark noise that was given to `stabilise` [e-]; its PRNU has to be 0.

    Returns
    -------
    array of float64
        Electrons, at least ``-dark_noise_e**2``, where the transform ends.
    """
    root = np.maximum(np.asarray(stable, dtype=np.float64), _LEAST)
    inverse = 1.0 / root
    series = inverse * (np.sqrt(1.5) / 4 + inverse * (0.625 * np.sqrt(1.5) * inverse - 1.375))
    return np.asarray(0.25 * root * root - (0.125 + dark_noise_e**2) + series)
