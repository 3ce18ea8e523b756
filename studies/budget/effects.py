"""Find on a small pilot render what each approximation changes in a picture, in electrons.

All changes are linear in light and time, so they are found once for 1 cd/m^2 and 1 s, and scaled. Each is computed
twice, from the even and from the odd half of the pilot's samples. The mean product of the two is the mean square of the
change, free of Monte Carlo noise. Monte Carlo noise itself is drawn from the pilot's variance, and imaged by the lens
as the light is.
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
KERNEL = "kernel"  # name of the error that the fast readout makes in comparison with the exact one
SHAKE = "camera shake"  # the only effect of the lens that depends on the exposure time
LENS_TERMS = IMAGING_TERMS | {SHAKE: "shake_um"}
DRAWS = 2  # number of draws of Monte Carlo noise
PATHS = 8  # number of random paths of a shaking camera that are tried
SINGLE_EPSILON = 2.0**-24  # largest relative rounding error of one operation in single precision
NORMAL_REACH = 6.7  # standard deviations at which `sensor.kernel.kernel.normal_pair` ends


@dataclass(frozen=True)
class BandErrors:
    """Errors that one choice of wide bands makes.

    Attributes
    ----------
    response : (2, h, w) float64
        Error because light and response vary together within a band: electrons of the exact radiance averaged over wide
        bands, less those in fine bands.
    light : (2, h, w) float64
        Error because the lamp's spectrum and the scene's transport vary together within a band: electrons of the
        product of their averages, less those of the average of their product.
    jitter : (h, w) float64
        Variance of one path's electrons because its wavelengths within the bands are random.
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
        Draws of the pilot's Monte Carlo noise, with diffraction and without. Diffraction smooths noise, but it also
        spreads noise from the rim of a lamp to pixels below saturation.
    lens : mapping of str to (2, h, w) float64
        Change when one term of the lens is left out.
    bands : mapping of int to BandErrors
        Errors for each number of bands in `studies.budget.bands.COUNTS`.
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

    They are effects on the collected light, before crosstalk: that spreads an effect as it spreads charge, and makes no
    mean square larger.

    Parameters
    ----------
    transport : Transport
        The pilot, in fine bands.
    sensor : SensorConfig
    lens : LensConfig
        The lens with all of its effects, as the reference models it.
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
    """Return the change if camera shake is left out, as in `Effects.lens`, for the worst of `PATHS` random paths."""
    halves = transport.relight_halves(luminance_cd_m2=1.0)
    held = replace(sensor, lens=lens)
    still = [imaged_electrons(half, held, 1.0) for half in halves]
    effects = []
    for key in rng.integers(0, 2**63, PATHS):
        moved = [shaken(half, held, exposure_s, np.random.default_rng(key)) for half in still]
        effects.append(np.stack([behind_filters(a - b, held) for a, b in zip(still, moved, strict=True)]))
    return max(effects, key=lambda pair: float((pair[0] * pair[1]).mean()))


def kernel_rms_e(expected_e: NDArray[np.float64], bands: int) -> NDArray[np.float64]:
    """Return a bound on the fast readout's error in each pixel's mean, (h, w) [e-]; Dr.Jit isn't needed for it.

    A sum over bands in single precision rounds bands + 2 times. The distribution function of a draw is off by at most
    `LARGEST_ERROR`, so the draw's mean is off by at most that times the width of the distribution.
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
    # A study scales its light to a level by the luminance in wide bands, so the error of that luminance counts here.
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
    """Return the variance of a path's electrons over the wavelengths that it may draw within wide bands, shape (h, w).

    All bands vary together, because a path draws one offset for all of them.
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
