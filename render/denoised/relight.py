"""Light a denoised transport, and measure the error of the picture."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from render.error_estimates import Halves
from render.radiance import SpectralRadiance
from render.transport import Powers, Spectra, Transport
from rodcone.errors import InputError
from rodcone.types import Floats


def relight_denoised(
    transport: Transport,
    spectra: Spectra | None = None,
    *,
    powers: Powers | None = None,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
    lux: float | None = None,
) -> tuple[SpectralRadiance, SpectralRadiance, SpectralRadiance]:
    """Return the denoised picture under given lights (as `Transport.relight`), and its two folds under the same lights.

    The folds have no bias, and are independent of the picture and of each other. Therefore the mean over the frame of
    (picture - one)(picture - other) estimates the picture's whole squared error, bias and noise, in any measure that is
    linear in light (`measured_error`). It says nothing about single pixels. The picture's `relative_mc_error` is the
    root of that estimate's upper limit for luminance, over the mean luminance.

    Raises
    ------
    InputError
        As `Transport.relight`, and for a transport that wasn't rendered with ``denoise=True``.
    """
    denoised_light = transport.denoised
    if denoised_light is None:
        raise InputError("denoised: the render has none; allowed: a render with denoise=True; render it so")
    folded = replace(transport, light=denoised_light.folds)
    denoised = replace(transport, light=Halves(denoised_light.radiance, transport.light.difference))
    level: dict[str, Any] = {"luminance_cd_m2": luminance_cd_m2, "illuminance_lux": illuminance_lux, "lux": lux}
    picture = denoised.relight(spectra, powers=powers, **level)
    first, second = folded.relight_halves(spectra, powers=powers, **level)
    luminance = picture.luminance()
    upper = measured_error(luminance - first.luminance(), luminance - second.luminance(), np.ones(picture.shape)).upper
    mean = float(luminance.mean())
    return replace(picture, relative_mc_error=upper**0.5 / mean if mean > 0 else 0.0), first, second


BLOCK = 16  # side of a block [pixels], within which a denoiser's errors are correlated
LEAST_BLOCKS = 4  # blocks along the picture's shorter side; in a small picture they are smaller than BLOCK
LEVEL = 0.95  # confidence of the upper limit


@dataclass(frozen=True)
class MeasuredError:
    """Mean squared error over a frame, its standard error, and its upper limit at confidence `LEVEL`, at least 0."""

    mean: float
    standard_error: float
    upper: float


def measured_error(
    one: NDArray[np.floating], other: NDArray[np.floating], weight: NDArray[np.floating]
) -> MeasuredError:
    """Estimate the weighted mean square of a picture's error over the frame; it holds bias and noise.

    The picture is compared with two others whose noise has mean 0 and is independent of the picture's and of each
    other's. The mean product of the two differences is then the picture's mean squared error, however large that noise
    is. Its standard error comes from the spread between blocks of pixels, and its upper limit from Student's t.

    Parameters
    ----------
    one, other : (..., h, w) array
        The picture minus each of the two others, in a measure that is linear in light.
    weight : (..., h, w) array
        Weight of each pixel's squared error, 0 for pixels that don't count; the mean is over all pixels.

    Returns
    -------
    MeasuredError
        The mean may be negative, since it is an estimate; the limit isn't.
    """
    product = one.astype(np.float64) * other * weight
    planes = product.reshape(-1, *product.shape[-2:]).mean(axis=0)
    side = max(1, min(BLOCK, min(planes.shape) // LEAST_BLOCKS))
    sums, pixels = sums_over_blocks(planes, side).ravel(), sums_over_blocks(np.ones(planes.shape), side).ravel()
    mean = float(sums.sum() / planes.size)
    if sums.size == 1:
        return MeasuredError(mean, np.inf, np.inf)
    # Blocks at the edge have fewer pixels, so each is compared with the mean of as many.
    spread = float(np.square(sums - mean * pixels).sum())
    error = (spread * sums.size / (sums.size - 1)) ** 0.5 / planes.size
    return MeasuredError(mean, error, max(0.0, mean + float(scipy.special.stdtrit(sums.size - 1, LEVEL)) * error))


def sums_over_blocks(planes: Floats, side: int) -> Floats:
    """Sum over square blocks of `side` pixels; the pixels left over at the far edges form smaller blocks."""
    rows, columns = (np.arange(0, length, side) for length in planes.shape)
    return np.asarray(np.add.reduceat(np.add.reduceat(planes, rows, axis=0), columns, axis=1))
