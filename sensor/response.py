"""Compute expected photo-electrons from irradiance, by the channels' responses, exposure time and camera's window."""

import warnings
from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from render.band_weights import band_weights
from render.radiance import BandRadiance, SpectralRadiance
from render.spectrum import VISIBLE_NM, Spectrum, per_joule, photons_per_joule, spectrum_by_bits
from rodcone.digests import ByBits, by_bits
from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import channel_mixing, channels, check_covers, mask
from sensor.config import SensorConfig
from sensor.optics import SpectralIrradiance, form_image, image_sums, spreads

MOST_LOST = 0.5  # bands that leave out more than this share of a channel's response are refused
NARROW_NM = 20.0  # no filter of a camera is narrower
LEAST_WARNED = 5e-3  # a smaller lost share of a channel's response gives no warning
_STEP_NM = 1.0  # step of the wavelength grid on which shares are summed


def electrons_per_irradiance(
    sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats, exposure_s: float, light: Spectrum | None = None
) -> Floats:
    """Return the electrons of each channel's photodiode per unit irradiance in each band, shape (channel, band).

    They are response x photons per joule, integrated over the light inside the camera's window, x collecting area x
    time. Within a band the light follows the lamp and surfaces that are smooth (`render.band_weights`).

    Parameters
    ----------
    sensor : SensorConfig
    wavelength_nm, width_nm : (band,) float64
    exposure_s : float
    light : Spectrum, optional
        The lamp behind the band means, up to a factor, as `SpectralRadiance.light`.

    Raises
    ------
    InputError
        For a negative exposure, a window beyond 380-780 nm that the bands don't reach, or bands that leave out more
        than half of a channel's response.

    Warns
    -----
    UserWarning
        If the bands don't fill the camera's window, on what each channel loses; if all responses lie within
        `NARROW_NM`, as for an EMVA report with a single wavelength.
    """
    check_window(sensor.window_nm, wavelength_nm, width_nm)
    _check_covered(sensor, wavelength_nm, width_nm)
    ends = [nm for channel in sensor.channels for nm in sensor.responses.curves[channel].wavelength_nm[[0, -1]]]
    if max(ends) - min(ends) < NARROW_NM:
        warnings.warn(
            f"responses: they are known over {min(ends):g}-{max(ends):g} nm, and count as 0 elsewhere; give whole "
            "curves, or a preset that lends them",
            stacklevel=3,
        )
    area_m2 = (sensor.site_pitch_um * 1e-6) ** 2 * sensor.pixel.fill_factor
    curves = tuple(spectrum_by_bits(sensor.responses.curves[channel]) for channel in sensor.channels)
    bands = by_bits((wavelength_nm, width_nm), wavelength_nm, width_nm)
    lamp = None if light is None else spectrum_by_bits(light)
    return area_m2 * exposure_s * _response_weights(curves, sensor.window_nm, bands, lamp)


@lru_cache(maxsize=64)
def _response_weights(
    curves: tuple[ByBits[Spectrum], ...],
    window_nm: tuple[float, float],
    bands: ByBits[tuple[Floats, Floats]],
    lamp: ByBits[Spectrum] | None,
) -> Floats:
    """Return the `band_weights` of the channels, cached.

    A cell of a sweep needs them four times, and its neighbours need the same ones.
    """
    spectra = [curve.value for curve in curves]
    corners = np.concatenate([np.array(window_nm), *(curve.wavelength_nm for curve in spectra)])
    seen = partial(_electrons_per_joule, spectra, window_nm)
    return band_weights(seen, corners, *bands.value, None if lamp is None else lamp.value)


def _electrons_per_joule(curves: Sequence[Spectrum], window_nm: tuple[float, float], wavelength_nm: Floats) -> Floats:
    """Return each curve's electrons per joule of light at these wavelengths, shape (curve, n); 0 outside the window."""
    inside = (wavelength_nm > window_nm[0]) & (wavelength_nm < window_nm[1])
    return np.asarray(per_joule(curves, wavelength_nm) * inside)


def channel_electrons(irradiance: SpectralIrradiance, sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Return each photodiode's expected photo-electrons behind every filter, shape (h, w, channel).

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.full((8, 8, 4), 1e-3), np.arange(430.0, 780.0, 100.0))
    >>> image = rodcone.form_image(light, rodcone.low_noise())
    >>> rodcone.channel_electrons(image, rodcone.low_noise(), 0.01).shape
    (8, 8, 4)
    """
    weights = electrons_per_irradiance(
        sensor, irradiance.wavelength_nm, irradiance.widths_nm, exposure_s, irradiance.light
    )
    planes = np.moveaxis(irradiance.values, -1, 0)
    flat = planes.reshape(planes.shape[0], -1)  # a view where the memory is band-planar
    electrons = weights.astype(flat.dtype) @ flat
    return np.asarray(np.moveaxis(electrons.reshape(-1, *planes.shape[1:]), 0, -1), dtype=np.float64)


def imaged_electrons(
    radiance: SpectralRadiance | BandRadiance, sensor: SensorConfig, exposure_s: float, samples_per_pixel: int = 1
) -> NDArray[np.float64]:
    """Return `channel_electrons` of `form_image`, shape (h, w, channel), computed faster for a lens that spreads light.

    For such a lens it takes a quarter of the time. Where no undershoot is cut off, the difference is within 1e-6 of the
    pixel's own light and the picture's mean together (`sensor.optics.image_sums`). The parameters are those of these
    two functions. Radiance that comes band by band is in memory as a whole only if a pixel is one sample and the lens
    doesn't spread light.
    """
    if samples_per_pixel == 1 and not spreads(sensor.lens):
        whole = radiance.whole() if isinstance(radiance, BandRadiance) else radiance
        return channel_electrons(form_image(whole, sensor), sensor, exposure_s)
    weights = electrons_per_irradiance(sensor, radiance.wavelength_nm, radiance.widths_nm, exposure_s, radiance.light)
    return image_sums(radiance, weights, sensor, samples_per_pixel)


def expected_electrons(irradiance: SpectralIrradiance, sensor: SensorConfig, exposure_s: float) -> NDArray[np.float64]:
    """Return the expected photo-electrons behind each photodiode's own filter, shape (h, w), without dark current.

    Dark current is added by `read_out`.

    Parameters
    ----------
    irradiance : SpectralIrradiance
        Bands that it lacks count as dark: a warning says so, and a channel that loses more than half is refused.
    sensor : SensorConfig
    exposure_s : float
        0 or more [s].

    Raises
    ------
    InputError
        For a negative exposure, a frame smaller than the mosaic's tile, and as `electrons_per_irradiance`.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.full((8, 8, 4), 1e-3), np.arange(430.0, 780.0, 100.0))
    >>> image = rodcone.form_image(light, rodcone.low_noise())
    >>> rodcone.expected_electrons(image, rodcone.low_noise(), 0.01).shape
    (8, 8)
    """
    return behind_filters(channel_electrons(irradiance, sensor, exposure_s), sensor)


def mixing_of(sensor: SensorConfig) -> Floats:
    """Return the electrons that each channel of a raw image reads in an even field, over those behind each filter.

    This is `sensor.cfa.channel_mixing`: a maker's calibration sees the channels as crosstalk mixes them.
    """
    shares = {reading.channel: reading.light_share for reading in sensor.chip.channels}
    return channel_mixing(sensor.cfa, sensor.pixel.crosstalk, shares)


def behind_filters(electrons: NDArray[np.float64], sensor: SensorConfig) -> NDArray[np.float64]:
    """Pick each photodiode's channel from the electrons of every channel: (h, w, channel) becomes (h, w).

    Raises
    ------
    InputError
        For a frame smaller than the mosaic's tile.
    """
    shape = (electrons.shape[0], electrons.shape[1])
    mosaic = sensor.photosites.cfa
    check_covers(mosaic, shape)
    result = np.empty(shape)
    for index, channel in enumerate(channels(mosaic)):
        np.copyto(result, electrons[..., index], where=mask(mosaic, channel, shape))
    return result


def check_window(window_nm: tuple[float, float], wavelength_nm: Floats, width_nm: Floats) -> None:
    """Raise `InputError` if a camera's window opens beyond 380-780 nm and the bands don't reach that far.

    Missing bands count as dark. Within 380-780 nm a scene may leave bands out; beyond, it would go unnoticed that a W
    pixel may collect 16-35 % of its electrons there. A gap of less than one band is allowed.
    """
    low, high = window_nm
    beyond = ((low, min(VISIBLE_NM[0], high), width_nm[0]), (max(VISIBLE_NM[1], low), high, width_nm[-1]))
    for first, last, band_nm in beyond:
        sum_nm = _inside_nm((first, last), wavelength_nm, width_nm).sum()
        if last - first - sum_nm >= band_nm:
            raise InputError(
                f"window_nm: {window_nm!r} asks for light at {first:g} to {last:g} nm and the scene's bands, "
                f"{_reach(wavelength_nm, width_nm)}, hold {sum_nm:g} nm of it; narrow the window or render those bands"
            )


def lost_shares(sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats) -> dict[str, float]:
    """Return the share of each channel's electrons that absent bands leave out.

    It holds for light of equal energy within the camera's window.

    Parameters
    ----------
    sensor : SensorConfig
    wavelength_nm, width_nm : (band,) float64
        Bands of the scene.

    Returns
    -------
    dict of str to float
        Share by channel, 0 to 1.
    """
    low, high = sensor.window_nm
    edges = np.linspace(low, high, max(2, round((high - low) / _STEP_NM) + 1))
    nm = (edges[1:] + edges[:-1]) / 2
    step = np.diff(edges)
    first, last = wavelength_nm - width_nm / 2, wavelength_nm + width_nm / 2
    held_nm = np.clip(np.minimum(last, edges[1:, None]) - np.maximum(first, edges[:-1, None]), 0.0, None).sum(axis=1)
    names = sensor.channels
    electrons = sensor.responses.band_average(names, nm, step) * photons_per_joule(nm) * step
    lost = electrons @ np.clip(1 - held_nm / step, 0.0, 1.0)
    total = electrons.sum(axis=1)
    return {name: float(a / b) if b else 0.0 for name, a, b in zip(names, lost, total, strict=True)}


def _check_covered(sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats) -> None:
    """Warn where the bands don't fill the camera's window; refuse them where a channel loses more than half."""
    low, high = sensor.window_nm
    if _inside_nm(sensor.window_nm, wavelength_nm, width_nm).sum() >= (1 - 1e-9) * (high - low):
        return
    shares = lost_shares(sensor, wavelength_nm, width_nm)
    most = max(shares.values())
    if most <= LEAST_WARNED:
        return
    message = (
        f"radiance: its bands, {_reach(wavelength_nm, width_nm)}, don't fill the camera's window, {low:g} to "
        f"{high:g} nm; of light of equal energy there, they leave out "
        f"{', '.join(f'{share:.1%} of {channel}' for channel, share in shares.items())}"
    )
    if most > MOST_LOST:
        raise InputError(f"{message}; allowed: half; give those bands, or narrow the camera's window_nm")
    warnings.warn(f"{message}; give those bands, or narrow the camera's window_nm", UserWarning, stacklevel=2)


def _inside_nm(window_nm: tuple[float, float], wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Return the width of each band's part inside the window [nm], shape (band,)."""
    low, high = window_nm
    first, last = wavelength_nm - width_nm / 2, wavelength_nm + width_nm / 2
    return np.asarray(np.clip(np.minimum(last, high) - np.maximum(first, low), 0.0, None))


def _reach(wavelength_nm: Floats, width_nm: Floats) -> str:
    return f"{(wavelength_nm - width_nm / 2).min():g} to {(wavelength_nm + width_nm / 2).max():g} nm"
