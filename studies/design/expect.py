"""Expected error of a sensor under a prior over patches, at a level of light: closed form, no render, no pictures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import hypot, log10, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from isp.design.expected_error import Gaussians, Noise, Samples, expected_error, pooled, sampled
from isp.design.spectral_prior import PATCH, PRIORS, SpectralPrior, load_prior
from render.photometry import tristimulus
from render.spectrum import Floats, Spectrum
from rodcone.colour_spaces import D65_XY, adapt_to_d65, luminance_of_srgb, xyz_from_xy, xyz_to_srgb
from rodcone.errors import unknown
from sensor.cfa import Tile, channels, mask
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.diffraction import sampled_otf
from sensor.exposure import AUTO_INFORMATION, exposure_of_electrons_s
from sensor.optics import WAVELENGTH_NM, camera_equation
from sensor.readings.by_channel import as_metered, of_channel
from sensor.readout import spread_charge
from sensor.response import behind_filters, electrons_per_irradiance
from studies.metrics.truth import Light, light_of

MIDDLE = PATCH // 4  # pixels at a patch's sides whose error doesn't count: they lack neighbours
METERED = 64  # side of the frame, drawn from the prior, that the exposure looks at
_LAB_LINEAR = 216 / 24389  # CIE 15: where the cube root of Lab becomes a line
_LEAST_SRGB = 0.0031308  # IEC 61966-2-1: where the curve of sRGB becomes a line


@dataclass(frozen=True)
class ExpectedError:
    """Expected error under the prior of the best estimate: where the patch's component is known, and a linear one.

    Attributes
    ----------
    luminance_cd_m2 : float
        Mean of the scene.
    exposure_s : float
    psnr_db, linear_psnr_db : float
        Of encoded sRGB, as PSNR is, by the curve's slope; component known, and linear estimate.
    luminance_db : float
        Of encoded luminance alone; component known.
    lightness, colour : float
        Root mean square of the error of L*, and of (a*, b*) together, in Lab, linearised; component known.
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
    """A prior's coefficients under a light.

    Attributes
    ----------
    light : Light
    basis : (band, coefficient) float64
        Reflectance of a coefficient of 1 in the light's bands.
    xyz : (3, coefficient) float64
        Adapted to D65; reflectance 1 has Y = 1.
    """

    light: Light
    basis: Floats
    xyz: Floats


@cache
def view_of(prior_name: str, light_name: str) -> LitPrior:
    """The prior's coefficients under an illuminant, in bands of 1 nm."""
    prior, light = load_prior(prior_name), light_of(light_name)
    basis = prior.spectra[np.clip(np.searchsorted(prior.edges_nm, light.wavelength_nm) - 1, 0, len(prior.spectra) - 1)]
    white = tristimulus(light.spectrum, light.wavelength_nm, light.width_nm)
    xyz = tristimulus(light.spectrum * basis.T, light.wavelength_nm, light.width_nm)
    return LitPrior(light, basis, adapt_to_d65(xyz, white).T)


def responses_e(sensor: SensorConfig, view: LitPrior) -> Floats:
    """Electrons of each channel's pixel in a second from a coefficient of 1, reflectance 1 having 1 cd/m^2."""
    light = view.light
    weights = electrons_per_irradiance(sensor.undivided, light.wavelength_nm, light.width_nm, 1.0)
    return np.asarray(weights * light.spectrum @ view.basis * camera_equation(sensor.lens))


def unit_response_e(sensor: SensorConfig, view: LitPrior) -> Floats:
    """Electrons of a pixel of response 1 in each band, as `responses_e` has them; shape (band, coefficient)."""
    light, ones = view.light, Spectrum(np.array([300.0, 1100.0]), np.ones(2))
    even = replace(sensor, cfa=("W",), responses=Responses({"W": ones})).undivided
    weights = electrons_per_irradiance(even, light.wavelength_nm, light.width_nm, 1.0)[0]
    return np.asarray((weights * light.spectrum)[:, None] * view.basis * camera_equation(sensor.lens))


def metric_rows(prior: SpectralPrior, view: LitPrior, reflectance: float) -> tuple[Floats, ...]:
    """R of encoded sRGB, encoded luminance, L* and (a*, b*) for errors of a patch of mean luminous reflectance 1.

    Each has the shape (component, pixel, direction, coefficient), at the middle pixels; |R e|^2 is the squared error.
    Reflectance 1 is shown as white.
    """
    means, to_xyz = prior.patches.means[:, middle_pixels()], view.xyz * reflectance
    to_srgb = xyz_to_srgb(to_xyz.T).T
    # Slopes about the component's mean: of the curve of sRGB, and of the cube root of Lab.
    linear, xyz = means @ to_srgb.T, means @ to_xyz.T
    srgb = _curve_slope(linear)[..., None] * to_srgb
    luminance = _curve_slope(xyz[..., 1:2])[..., None] * luminance_of_srgb(to_srgb.T)
    white = xyz_from_xy(D65_XY)
    relative = np.maximum(xyz / white, _LAB_LINEAR)
    root = (relative ** (-2 / 3) / 3)[..., None] * (to_xyz / white[:, None])
    lab = np.stack([116 * root[..., 1, :], 500 * (root[..., 0, :] - root[..., 1, :]),
                    200 * (root[..., 1, :] - root[..., 2, :])], axis=-2)  # fmt: skip
    return srgb / sqrt(3), luminance, lab[..., :1, :], lab[..., 1:, :]


def _curve_slope(linear: Floats) -> Floats:
    return np.asarray(1.055 / 2.4 * np.clip(linear, _LEAST_SRGB, 1.0) ** (1 / 2.4 - 1))


def middle_pixels() -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Numbers of a patch's middle pixels, row by row."""
    inside = np.zeros((PATCH, PATCH), dtype=bool)
    inside[MIDDLE:-MIDDLE, MIDDLE:-MIDDLE] = True
    return np.flatnonzero(inside)


def sampling_of(sensor: SensorConfig, responses: Floats, blur: bool = False) -> Floats:
    """H of a patch: electrons of each sample from each pixel's coefficients, through lens, filters and crosstalk."""
    site = sites_of(sensor.cfa, channels(sensor.cfa))
    # What a filter passes at a pixel goes to its neighbours: the channel is that of the pixel that the light fell on.
    lens, spread = lens_of(sensor, blur), spread_of(sensor.pixel.crosstalk)
    return np.asarray(np.einsum("st,tp,tc->spc", spread, lens, responses[site], optimize=True))


def lens_of(sensor: SensorConfig, blur: bool) -> Floats:
    """Share of each pixel's light (second axis) on each pixel of a patch: the unit matrix, or the lens's at 550 nm."""
    points = np.eye(PATCH**2).reshape(-1, PATCH, PATCH)
    if blur:  # as `sensor.optics.form_image` has diffraction and defocus
        otf = sampled_otf((PATCH, PATCH), sensor.pixel.pitch_um, sensor.lens, folded=False)(WAVELENGTH_NM)
        points = scipy.fft.idctn(otf * scipy.fft.dctn(points, axes=(1, 2)), axes=(1, 2))
    return points.reshape(PATCH**2, -1).T


def sites_of(tile: Tile, names: Sequence[str]) -> NDArray[np.intp]:
    """Number among some channels of that of each pixel of a patch, shape (pixel,)."""
    return np.asarray(np.argmax([mask(tile, name, (PATCH, PATCH)).ravel() for name in names], axis=0))


def spread_of(crosstalk: float) -> Floats:
    """Share of each pixel's electrons (second axis) that each pixel of a patch collects (first axis)."""
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
    """Expected error of a sensor's pictures at each level, in closed form.

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
        Whether diffraction and defocus of the sensor's lens spread the light, at 550 nm, and nobody undoes it.

    Raises
    ------
    InputError
        For an unknown light, prior or rule of exposure.
    """
    if prior not in PRIORS:
        raise unknown("prior", prior, PRIORS)
    spectral, seen, forms = load_prior(prior), view_of(prior, light), _forms(prior, light)
    pooled_forms = np.einsum("k,rmkpce->rmpce", spectral.patches.weights, forms)[:, :, None]
    responses = responses_e(sensor, seen)
    sampling, frame_e = sampling_of(sensor, responses, blur), np.maximum(drawn_pixels(prior) @ responses.T, 0.0)
    known, linear = (
        sampled(patches, sampling, middle_pixels(), lens_of(sensor, blur))
        for patches in (spectral.patches, pooled_patches(prior))
    )
    by_light: dict[str, tuple[list[float], float]] = {}
    result = []
    for level_cd_m2 in levels_cd_m2:
        white_cd_m2 = float(level_cd_m2) / spectral.reflectances.mean()
        time_s, noise = exposed(sensor, frame_e * white_cd_m2, exposure)
        scales = spectral.reflectances * white_cd_m2 * time_s
        key = f"{white_cd_m2 * time_s:.9g} {noise}"  # at full exposure more light changes nothing
        if key not in by_light:
            errors = _mean_error(spectral.patches.weights, known, scales, noise, forms)
            by_light[key] = errors, _mean_error(np.ones(1), linear, scales, noise, pooled_forms)[0]
        errors, linear_error = by_light[key]
        result.append(
            ExpectedError(
                luminance_cd_m2=float(level_cd_m2),
                exposure_s=time_s,
                psnr_db=-10 * log10(errors[0]),
                linear_psnr_db=-10 * log10(linear_error),
                luminance_db=-10 * log10(errors[1]),
                lightness=sqrt(errors[2]),
                colour=sqrt(errors[3]),
            )
        )
    return result


@cache
def _forms(prior: str, light: str) -> Floats:
    """W = R' R of each metric by reflectance, (reflectance, metric, component, pixel, coefficient, coefficient)."""
    spectral, seen = load_prior(prior), view_of(prior, light)
    by_reflectance = [metric_rows(spectral, seen, reflectance) for reflectance in spectral.reflectances]
    return np.stack([np.stack([row.swapaxes(-1, -2) @ row for row in rows]) for rows in by_reflectance])


@cache
def pooled_patches(prior: str) -> Gaussians:
    """One Gaussian with mean and covariance of the prior's patches."""
    return pooled(load_prior(prior).patches)


@cache
def drawn_pixels(prior: str) -> Floats:
    """Coefficients of `METERED` x `METERED` pixels drawn from the prior, which the exposure looks at."""
    spectral, rng, count = load_prior(prior), np.random.default_rng(0), METERED**2
    component, pixel = rng.choice(len(spectral.patches.weights), count, p=spectral.patches.weights), middle_pixels()[0]
    factors = spectral.patches.factors[component, pixel]
    coefficients = spectral.patches.means[component, pixel] + np.einsum(
        "ncd,nd->nc", factors, rng.standard_normal((count, factors.shape[-1]))
    )
    coefficients *= spectral.reflectances[rng.integers(len(spectral.reflectances), size=count), None]
    # No surface reflects more light of any wavelength than falls on it: a deep colour is no bright one.
    coefficients /= np.maximum(1.0, (coefficients @ spectral.spectra.T).max(axis=1, keepdims=True))
    return np.asarray(coefficients.reshape(METERED, METERED, -1))


def _mean_error(weights: Floats, samples: Samples, scales: Floats, noise: Noise, forms: Floats) -> list[float]:
    """Mean over equally likely reflectances of a patch, shape (metric,)."""
    ones = np.ones(samples.means.shape[1])
    errors = [expected_error(weights, samples, s * ones, noise, form) for s, form in zip(scales, forms, strict=True)]
    return [float(error) for error in np.mean(errors, axis=0)]


def exposed(sensor: SensorConfig, per_second_e: Floats, exposure: str | float) -> tuple[float, Noise]:
    """Exposure of a frame by a rule or a time [s], and the noise of a sample; channels may be read apart by the frame.

    `per_second_e` are electrons behind every filter, shape (h, w, channel).
    """
    time_s = exposure_of_electrons_s(exposure, per_second_e, sensor) if isinstance(exposure, str) else exposure
    metered = as_metered(sensor, behind_filters(per_second_e * time_s, sensor)) if sensor.chip.channels else sensor
    return time_s, noise_of(metered, time_s)


def noise_of(sensor: SensorConfig, exposure_s: float) -> Noise:
    """Noise of a sample, every source of the sensor in it; of a patch's samples where channels are read apart."""
    plain = _noise_of_channel(sensor, exposure_s, "")
    noise = [_noise_of_channel(sensor, exposure_s, name) for name in channels(sensor.cfa)]
    if all(x == plain for x in noise):
        return plain
    by_channel = np.array([(x.dark_e, x.full_e, x.shot) for x in noise])
    dark_e, full_e, shot = by_channel[sites_of(sensor.cfa, channels(sensor.cfa))].T
    return Noise(dark_e=dark_e, prnu=plain.prnu, full_e=full_e, shot=shot)


def _noise_of_channel(sensor: SensorConfig, exposure_s: float, channel: str) -> Noise:
    alone, share = of_channel(sensor, channel)
    pixel = alone.pixel
    dark_current_e = pixel.dark_current_e_per_s * exposure_s
    rounding_e = alone.gain_e_per_dn / sqrt(12)
    dark_e = hypot(pixel.read_noise_e, pixel.fixed_dark_e, rounding_e, sqrt(dark_current_e))
    full_e = pixel.full_well_e - dark_current_e
    return Noise(dark_e=dark_e / share, prnu=pixel.fixed_gain, full_e=full_e / share, shot=1 / share)
