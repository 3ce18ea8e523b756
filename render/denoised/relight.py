"""Denoised light under given lights, and what its error is measured by."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from render.denoised.measured_error import measured_error
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.errors import InputError


def relight_denoised(
    transport: Transport,
    spectra: Mapping[str, Spectrum | str] | None = None,
    *,
    powers: Mapping[str, float] | None = None,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
) -> tuple[SpectralRadiance, SpectralRadiance, SpectralRadiance]:
    """Denoised light under given lights (as `Transport.relight`), and its two folds under the same.

    The folds are independent of the picture and of each other, and without bias: the mean over the frame of
    (picture - one)(picture - other) in any linear measure estimates the picture's whole squared error there, bias and
    noise, by `render.denoised.measured_error`. Nothing is known of single pixels. The picture's `relative_mc_error` is
    the root of that limit for its luminance, over its mean.

    Raises
    ------
    InputError
        As `Transport.relight`, and for a transport that wasn't rendered with ``denoise=True``.
    """
    made = transport.denoised
    if made is None:
        raise InputError("denoised: the render has none; allowed: a render with denoise=True; render it so")
    folded = replace(transport, radiance=made.fold_mean, half_difference=made.fold_difference)
    denoised = replace(transport, radiance=made.radiance)
    asked: dict[str, Any] = {"powers": powers, "luminance_cd_m2": luminance_cd_m2, "illuminance_lux": illuminance_lux}
    picture = denoised.relight(spectra, **asked)
    one, other = folded.relight_halves(spectra, **asked)
    luminance = picture.luminance()
    upper = measured_error(luminance - one.luminance(), luminance - other.luminance(), np.ones(picture.shape)).upper
    mean = float(luminance.mean())
    return replace(picture, relative_mc_error=upper**0.5 / mean if mean > 0 else 0.0), one, other
