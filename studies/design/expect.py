"""Compute the expected error of a sensor's pictures, under a prior over patches, by formula: without any pictures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import log10, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.design.expected_error import Noise, expected_error, sampled, single_gaussian
from isp.design.spectral_prior import PATCH, PRIORS, SpectralPrior, load_spectral_prior
from render.spectrum import tristimulus
from rodcone.colour_spaces import D65_XY, adapt_to_d65, encode_srgb, xyz_from_xy, xyz_to_srgb
from rodcone.errors import InputError, require_name
from rodcone.types import Floats
from sensor.cfa import Tile, channel_map, channels
from sensor.config import SensorConfig
from sensor.diffraction import sampled_otf
from sensor.exposure import AUTO_INFORMATION, exposure_of_electrons_s
from sensor.noise_law import NoiseLaw
from sensor.optics import WAVELENGTH_NM, camera_equation
from sensor.readings.resolve import PlainReading, at_channel, chip_readings, resolve, several
from sensor.readout import spread_charge
from sensor.response import behind_filters, electrons_per_irradiance
from studies.metrics.truth import Light, named_light

# Indices, row by row, of the pixels whose error counts. Pixels nearer to a patch's border lack neighbours.
MIDDLE = np.arange(PATCH**2).reshape(PATCH, PATCH)[2:-2, 2:-2].ravel()
METERED = 64  # pixels along the side of a frame that is drawn from the prior to meter the exposure
_LAB_LINEAR = 216 / 24389  # CIE 15: below this value the cube root of Lab is replaced by a line
_LAB = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])  # L*, a*, b* from roots of X, Y, Z
_NODES, _SHARES = np.polynomial.hermite_e.hermegauss(40)  # quadrature over a Gaussian


@dataclass(frozen=True)
class ExpectedError:
    """Expected error under the prior, a mixture of Gaussians, for two estimates of a patch.

    One is the best estimate if the patch's component of the mixture is known, the other is linear.

    Attributes
    ----------
    luminance_cd_m2 : float
        Mean luminance of the scene.
    exposure_s : float
    psnr_db, linear_psnr_db : float
        PSNR of encoded sRGB for the estimate with the known component and for the linear one. The sRGB curve is
        replaced by its slope.
    luminance_db : float
        PSNR of encoded luminance alone, for the known component.
    lightness, colour : float
        Root mean square error of L*, and of (a*, b*) together, for the known component. Lab is linearised.
    """

    luminance_cd_m2: float
    exposure_s: float
    psnr_db: float
    linear_psnr_db: float
    luminance_db: float
    lightness: float
    colour: float


@dataclass(frozen=True, eq=False)
class LitPrior:
    """Spectra of a prior's coefficients under a light.

    Attributes
    ----------
    light : Light
    basis : (band, coefficient) float64
        Reflectance in the light's bands for a coefficient of 1.
    xyz : (3, coefficient) float64
        XYZ for a coefficient of 1, adapted to D65; a reflectance of 1 has Y = 1.
    """

    light: Light
    basis: Floats
    xyz: Floats


@cache
def view_of(prior_name: str, light_name: str) -> LitPrior:
    """Return the prior's spectra under an illuminant, in bands of 1 nm."""
    prior = load_spectral_prior(prior_name)
    light = named_light(light_name)
    basis = prior.spectra[np.clip(np.searchsorted(prior.edges_nm, light.wavelength_nm) - 1, 0, len(prior.spectra) - 1)]
    white = tristimulus(light.spectrum, light.wavelength_nm, light.width_nm)
    xyz = tristimulus(light.spectrum * basis.T, light.wavelength_nm, light.width_nm)
    return LitPrior(light, basis, adapt_to_d65(xyz, white).T)


def responses_e(sensor: SensorConfig, view: LitPrior) -> Floats:
    """Return the electrons per second in each channel's pixel for a coefficient of 1, shape (channel, coefficient).

    The light is such that a reflectance of 1 has a luminance of 1 cd/m^2.
    """
    weights = electrons_per_irradiance(sensor.undivided, view.light.wavelength_nm, view.light.width_nm, 1.0)
    return np.asarray(weights * view.light.spectrum @ view.basis * camera_equation(sensor.lens))


def metric_rows(prior: SpectralPrior, view: LitPrior, reflectance: float) -> tuple[Floats, ...]:
    """Return R for the errors of encoded sRGB, encoded luminance, L* and (a*, b*): |R e|^2 is the squared error of e.

    Here e is the error of the coefficients of a patch whose mean luminous reflectance is 1. Each R has the shape
    (component, pixel, direction, coefficient), for the patch's middle pixels. `reflectance` scales the patch, and
    reflectance 1 is shown as white. A curve's slope is that of the straight line nearest to it over the values of a
    component, which may lie beyond the curve's ends (statistical linearisation, Booton 1954).
    """
    means, factors = prior.patches.means[:, MIDDLE], prior.patches.factors[:, MIDDLE]
    rest = prior.patches.rest[:, None, None]

    def through(curve: Callable[[Floats], Floats], rows: Floats) -> Floats:
        deviation = np.sqrt(((rows @ factors) ** 2).sum(axis=-1) + rest * (rows**2).sum(axis=1))
        values = curve((means @ rows.T)[..., None] + deviation[..., None] * _NODES)
        slope = values @ (_SHARES * _NODES) / _SHARES.sum() / deviation
        return np.asarray(slope[..., None] * rows)

    xyz = view.xyz * reflectance
    lab = _LAB @ through(_lab_root, xyz / xyz_from_xy(D65_XY)[:, None])
    srgb = through(encode_srgb, xyz_to_srgb(xyz.T).T) / sqrt(3)
    return srgb, through(encode_srgb, xyz[1:2]), lab[..., :1, :], lab[..., 1:, :]


def _lab_root(relative: Floats) -> Floats:
    return np.where(relative > _LAB_LINEAR, np.cbrt(relative), (np.maximum(relative, 0.0) * 24389 / 27 + 16) / 116)


def sampling_of(sensor: SensorConfig, responses: Floats, lens: Floats) -> Floats:
    """Return the sampling matrix H of a patch, shape (sample, pixel, coefficient).

    It gives the electrons of each sample from the coefficients of each pixel, through lens, filters and crosstalk.
    """
    # Light passes the filter of the pixel on which it falls; then crosstalk moves its charge to neighbours. So a charge
    # belongs to the channel of the pixel on which its light fell.
    filters = responses[sites_of(sensor.cfa)]
    spread = spread_of(sensor.pixel.crosstalk)
    return np.asarray(np.einsum("st,tp,tc->spc", spread, lens, filters, optimize=True))


def lens_of(sensor: SensorConfig, blur: bool) -> Floats:
    """Return the share of each pixel's light (second axis) that falls on each pixel of a patch (first axis).

    It is the unit matrix, or with `blur` the blur of the sensor's lens at 550 nm.
    """
    points = np.eye(PATCH**2).reshape(-1, PATCH, PATCH)
    if blur:  # diffraction and defocus, as in `sensor.optics.form_image`
        otf = sampled_otf((PATCH, PATCH), sensor.pixel.pitch_um, sensor.lens, folded=False)(WAVELENGTH_NM)
        points = scipy.fft.idctn(otf * scipy.fft.dctn(points, axes=(1, 2)), axes=(1, 2))
    return points.reshape(PATCH**2, -1).T


def sites_of(tile: Tile) -> NDArray[np.intp]:
    """Return for each pixel of a patch the number of its channel among the tile's channels, shape (pixel,)."""
    return np.array([channels(tile).index(name) for name in channel_map(tile, (PATCH, PATCH)).flat])


def spread_of(crosstalk: float) -> Floats:
    """Return the share of each pixel's electrons (second axis) that crosstalk moves to each pixel (first axis)."""
    shape = (PATCH, PATCH)
    return np.stack([spread_charge(one.reshape(shape), crosstalk).ravel() for one in np.eye(PATCH**2)]).T


def expect(
    sensor: SensorConfig,
    levels_cd_m2: Sequence[float] | Floats,
    light: str = "D65",
    exposure: str | float = AUTO_INFORMATION,
    prior: str = "drawn",
    blur: bool = False,
) -> list[ExpectedError]:
    """Compute the expected error of a sensor's pictures at each level by formula.

    Parameters
    ----------
    sensor : SensorConfig
    levels_cd_m2 : sequence of float
        Mean luminances of scenes.
    light : str
        Illuminant; the camera knows it.
    exposure : str or float
        A rule of `sensor.exposure.RULES`, or a time [s].
    prior : str
        One of `isp.design.spectral_prior.PRIORS`.
    blur : bool
        Whether diffraction and defocus of the sensor's lens spread the light, as at 550 nm.

    Raises
    ------
    InputError
        For an unknown light, prior or rule of exposure, a pixel of several readings, or a tile too large.
    """
    require_name("prior", prior, PRIORS)
    if several(readings := chip_readings(sensor, exposure_s=0.0)):
        count = len(readings)
        raise InputError(f"readings: {count} of a pixel; allowed: none; give [pixel] the well and noise of one of them")
    if 4 % len(sensor.cfa) or 4 % len(sensor.cfa[0]):  # the middle of a patch would lack some of the tile's pixels
        raise InputError(f"cfa: {sensor.cfa} isn't 1, 2 or 4 pixels high and wide; allowed: these; give such a tile")
    spectral = load_spectral_prior(prior)
    forms = _forms(prior, light)
    responses = responses_e(sensor, view_of(prior, light))
    lens = lens_of(sensor, blur)
    sampling = sampling_of(sensor, responses, lens)
    frame_e = np.maximum(drawn_pixels(prior) @ responses.T, 0.0)
    # The estimate with the known component, and the linear one, for which one Gaussian replaces the mixture.
    pooled_forms = np.einsum("k,rmkpce->rmpce", spectral.patches.weights, forms)[:, :, None]
    mixtures = ((spectral.patches, forms), (single_gaussian(spectral.patches), pooled_forms))
    by_mixture = [(sampled(patches, sampling, MIDDLE, lens), metrics) for patches, metrics in mixtures]

    def at(level_cd_m2: float) -> ExpectedError:
        white_cd_m2 = level_cd_m2 / spectral.reflectances.mean()
        time_s, noise = exposed(sensor, frame_e * white_cd_m2, exposure)
        scales = spectral.reflectances * white_cd_m2 * time_s
        known, linear = (
            np.mean([expected_error(samples, s, noise, w) for s, w in zip(scales, metrics, strict=True)], axis=0)
            for samples, metrics in by_mixture
        )
        return ExpectedError(
            luminance_cd_m2=level_cd_m2,
            exposure_s=time_s,
            psnr_db=-10 * log10(known[0]),
            linear_psnr_db=-10 * log10(linear[0]),
            luminance_db=-10 * log10(known[1]),
            lightness=sqrt(known[2]),
            colour=sqrt(known[3]),
        )

    return [at(float(level_cd_m2)) for level_cd_m2 in levels_cd_m2]


@cache
def _forms(prior: str, light: str) -> Floats:
    """Return W = R' R of `metric_rows`, shape (reflectance, metric, component, pixel, coefficient, coefficient)."""
    spectral = load_spectral_prior(prior)
    seen = view_of(prior, light)
    return np.array([[r.swapaxes(-1, -2) @ r for r in metric_rows(spectral, seen, m)] for m in spectral.reflectances])


@cache
def drawn_pixels(prior: str) -> Floats:
    """Draw coefficients of `METERED` x `METERED` pixels from the prior, as a frame on which the exposure is metered."""
    spectral = load_spectral_prior(prior)
    rng = np.random.default_rng(0)
    shape = (METERED, METERED)
    component = rng.choice(len(spectral.patches.weights), shape, p=spectral.patches.weights)
    pixel = MIDDLE[0]
    factors = spectral.patches.factors[component, pixel]
    off = (factors @ rng.standard_normal((*shape, factors.shape[-1], 1)))[..., 0]
    coefficients = (spectral.patches.means[component, pixel] + off) * rng.choice(spectral.reflectances, (*shape, 1))
    # No surface reflects more light of a wavelength than it receives, so deep colours are never bright.
    return np.asarray(coefficients / np.maximum(1.0, (coefficients @ spectral.spectra.T).max(axis=-1, keepdims=True)))


def exposed(sensor: SensorConfig, per_second_e: Floats, exposure: str | float) -> tuple[float, Noise]:
    """Return the exposure time [s] that a rule chooses for a frame, or the given time, and the noise of a sample.

    `per_second_e` are electrons per second behind every filter, shape (h, w, channel). The frame matters because a
    metered channel may be read with a time of its own.
    """
    time_s = exposure_of_electrons_s(exposure, per_second_e, sensor) if isinstance(exposure, str) else exposure
    return time_s, noise_of(resolve(sensor, behind_filters(per_second_e * time_s, sensor), time_s))


def noise_of(readings: Sequence[PlainReading]) -> Noise:
    """Return the noise of a patch's samples, with every source of the sensor and each channel's own reading."""
    tile = readings[0].sensor.cfa
    by_channel = [at_channel(readings, name)[0] for name in channels(tile)]
    numbers = [[x.law.shot, x.law.dark_e, x.law.fixed_e, x.law.prnu, x.headroom_e] for x in by_channel]
    *law, full_e = np.array(numbers)[sites_of(tile)].T
    return Noise(NoiseLaw(*law), full_e)
