"""What each approximation does to a picture, in electrons, found on a small pilot render.

Everything is linear in light and time, so it is found once for 1 cd/m^2 and 1 s and scaled. Each effect is computed
from the pilot's even and from its odd half: the product of the two has the effect's square as its mean, free of Monte
Carlo noise. That noise is drawn anew from the variance, and goes through the lens as the light does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from render.transport import Transport
from sensor.config import LensConfig, SensorConfig, without_terms
from sensor.kernel.poisson import LARGEST_ERROR
from sensor.response import behind_filters, imaged_electrons
from sensor.shake import shaken
from studies.budget.bands import merge_radiance, merge_transport

Pair = NDArray[np.float64]  # (2, h, w): electrons from the even and from the odd half [e- per cd/m^2 and s]

DIFFRACTION = "diffraction"
IMAGING_TERMS = {DIFFRACTION: "diffraction", "veiling glare": "veiling_glare", "cos^4": "horizontal_view_deg"}
KERNEL = "kernel"  # name of the error of the fast readout, which replaces the exact one
SHAKE = "camera shake"  # the only effect of the lens that depends on the exposure time
LENS_TERMS = IMAGING_TERMS | {SHAKE: "shake_um"}
DRAWS = 2  # number of draws of Monte Carlo noise
PATHS = 8  # number of paths of a shaking camera that are tried
SINGLE_EPSILON = 2.0**-24  # largest relative rounding error of one operation in single precision
NORMAL_REACH = 6.7  # standard deviations at which `sensor.kernel.kernel.normal_pair` ends


@dataclass(frozen=True)
class BandErrors:
    """Errors that one choice of wide bands makes.

    Attributes
    ----------
    response : (2, h, w) float64
        Error because light and response vary together within a band: exact radiance averaged over wide bands, less that
        in fine bands.
    light : (2, h, w) float64
        Error because the light and what the scene does with it vary together within a band: the product of their
        averages, less the average of their product.
    jitter : (h, w) float64
        Variance of one path's electrons because it draws its wavelengths within the bands at random.
    """

    response: Pair
    light: Pair
    jitter: NDArray[np.float64]


@dataclass(frozen=True)
class Effects:
    """Expected electrons of one sensor under one spectrum at 1 cd/m^2 and 1 s, and what approximations do to them.

    Attributes
    ----------
    full : (2, h, w) float64
        Electrons with everything modelled, in fine bands.
    blurred, sharp : (draw, h, w) float64
        Draws of the pilot's Monte Carlo noise, with diffraction and without. Diffraction evens noise out, but it also
        carries noise from the rim of a lamp to pixels below saturation.
    lens : mapping of str to (2, h, w) float64
        Change when one term of the lens is left out.
    bands : mapping of int to BandErrors
        Errors by the count of `studies.budget.bands.COUNTS`.
    """

    full: Pair
    blurred: NDArray[np.float64]
    sharp: NDArray[np.float64]
    lens: Mapping[str, Pair]
    bands: Mapping[int, BandErrors]


def find_effects(
    transport: Transport,
    sensor: SensorConfig,
    lens: LensConfig,
    groups: Mapping[int, Sequence[NDArray[np.intp]]],
    rng: np.random.Generator,
) -> Effects:
    """Find all effects for a sensor under the transport's own spectra.

    They are the effects on the light. Crosstalk is left out: it spreads an effect as it spreads charge, and makes no
    mean square larger.

    Parameters
    ----------
    transport : Transport
        The pilot, in fine bands.
    sensor : SensorConfig
    lens : LensConfig
        The lens with everything that the reference models.
    groups : mapping of int to sequence of index arrays
        Choices of wide bands, as `studies.budget.bands.band_groups` makes them.
    rng : numpy.random.Generator
        Generator for the draws of Monte Carlo noise.
    """
    halves = transport.relight_halves(luminance_cd_m2=1.0)
    bare = replace(sensor, lens=without_terms(lens, IMAGING_TERMS.values()))
    full = _electrons(halves, replace(sensor, lens=lens))
    plain = _electrons(halves, bare)
    without = {
        name: _electrons(halves, replace(sensor, lens=without_terms(lens, [field]))) - full
        for name, field in IMAGING_TERMS.items()
        if getattr(lens, field)
    }
    return Effects(
        full=full,
        blurred=_noise(transport, replace(sensor, lens=lens), rng),
        sharp=_noise(transport, replace(sensor, lens=replace(lens, diffraction=0.0)), rng),
        lens=without,
        bands={factor: _band_errors(transport, halves, plain, bare, chosen) for factor, chosen in groups.items()},
    )


def shake_effect(
    transport: Transport, sensor: SensorConfig, lens: LensConfig, exposure_s: float, rng: np.random.Generator
) -> Pair:
    """Return the change if camera shake is left out, as in `Effects.lens`, for the path of `PATHS` with the most."""
    halves = transport.relight_halves(luminance_cd_m2=1.0)
    held = replace(sensor, lens=lens)
    still = [imaged_electrons(half, held, 1.0) for half in halves]
    effects = []
    for key in rng.integers(0, 2**63, PATHS):
        moved = [shaken(half, held, exposure_s, np.random.default_rng(key)) for half in still]
        effects.append(np.stack([behind_filters(a - b, held) for a, b in zip(still, moved, strict=True)]))
    return max(effects, key=lambda pair: float((pair[0] * pair[1]).mean()))


def kernel_rms_e(expected_e: NDArray[np.float64], bands: int) -> NDArray[np.float64]:
    """Bound the error of the fast readout's expected electrons, (h, w); a bound, because a machine may lack Dr.Jit.

    A sum over bands in single precision rounds bands + 2 times. A draw's distribution function is off by at most
    `LARGEST_ERROR`, and so is its mean by that times the width of the distribution.
    """
    rounding = (bands + 2) * SINGLE_EPSILON * expected_e
    return np.asarray(rounding + LARGEST_ERROR * 2 * NORMAL_REACH * np.sqrt(expected_e))


def _noise(transport: Transport, sensor: SensorConfig, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw the transport's Monte Carlo noise in electrons; a pixel's bands rise and fall together."""
    deviation = np.moveaxis(np.sqrt(np.maximum(transport.relight_variance(luminance_cd_m2=1.0), 0.0)), 0, -1)
    signs = rng.choice(np.array([-1, 1], np.float32), (DRAWS, *deviation.shape[:2], 1))
    lights = [deviation, *((1 + sign) * deviation for sign in signs)]  # because a lens takes no negative light
    lit = transport.relight_halves(luminance_cd_m2=1.0)[0]
    level, *draws = _electrons([replace(lit, values=light, signed=False) for light in lights], sensor)
    return np.asarray(np.stack(draws) - level)


def _electrons(halves: Sequence[SpectralRadiance], sensor: SensorConfig) -> Pair:
    return np.stack([behind_filters(imaged_electrons(half, sensor, 1.0), sensor) for half in halves])


def _band_errors(
    transport: Transport,
    halves: Sequence[SpectralRadiance],
    plain: Pair,
    sensor: SensorConfig,
    groups: Sequence[NDArray[np.intp]],
) -> BandErrors:
    averaged = [merge_radiance(half, groups) for half in halves]
    # A level is reached by the luminance that the wide bands compute, whose error is therefore counted here.
    mean = SpectralRadiance(
        transport.mean_radiance(luminance_cd_m2=1.0)[None, None],
        transport.wavelength_nm,
        width_nm=transport.width_nm,
        light=halves[0].light,
    )
    followed = _electrons(averaged, sensor) / merge_radiance(mean, groups).luminance().item()
    wide = _electrons(merge_transport(transport, groups).relight_halves(luminance_cd_m2=1.0), sensor)
    return BandErrors(followed - plain, wide - followed, _jitter(halves, sensor, groups))


def _jitter(
    halves: Sequence[SpectralRadiance], sensor: SensorConfig, groups: Sequence[NDArray[np.intp]]
) -> NDArray[np.float64]:
    """Return the variance of the electrons over the wavelengths within wide bands that a path may draw, shape (h, w).

    All bands are varied together, because a path draws one offset for all of them.
    """
    positions = max(len(group) for group in groups)
    if positions == 1:
        return np.zeros(halves[0].shape)
    values = np.maximum(halves[0].values + halves[1].values, 0) / 2
    radiances = []
    for position in range(positions):
        chosen = np.zeros_like(values)
        for group in groups:
            index = group[position * len(group) // positions]
            chosen[..., group] = values[..., [index]]
        radiances.append(replace(halves[0], values=chosen))
    return np.asarray(_electrons(radiances, sensor).var(axis=0))
