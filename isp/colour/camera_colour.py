"""From camera channels to colour: white balance, matrix, sRGB. Both cameras share all of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.illuminants import illuminant
from render.photometry import photons_per_joule, tristimulus
from render.spectrum import DEFAULT_WAVELENGTH_NM, Floats, band_widths
from rodcone.errors import InputError
from sensor.curves import Responses, rgbw

Image = NDArray[np.float64]
BalanceSource = Literal["gray world", "calibrated", "given"]

LEAST_STANDARD_ERRORS = 5.0  # a channel whose mean is less certain than this can't set its own gain

# IEC 61966-2-1 (sRGB): chromaticities of its primaries and of D65.
SRGB_PRIMARIES_XY = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
_D65_XY = np.array([0.3127, 0.3290])
# Bradford cone responses (Lam 1985), as ICC.1:2010 Annex E gives them.
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


@dataclass(frozen=True)
class Balance:
    """White balance gains.

    Attributes
    ----------
    gains : (channel,) float64
        Factor on each channel; green's is 1.
    sources : tuple of str
        Where each gain comes from: ``gray world``, ``calibrated`` where the picture was too dark to tell, or ``given``.
    """

    gains: Floats
    sources: tuple[BalanceSource, ...]


def gray_world(
    planes: Image, usable: NDArray[np.bool_], standard_errors: Floats, neutral: Floats, green: int
) -> Balance:
    """Gains that make the mean of each channel equal to green's (Buchsbaum 1980).

    Parameters
    ----------
    planes : (h, w, channel) float64
        The pipeline's own linear planes [e-].
    usable : (h, w) bool
        Pixels that count: the unsaturated ones.
    standard_errors : (channel,) float64
        Of each channel's mean [e-].
    neutral : (channel,) float64
        Calibrated response to a neutral, in any unit: serves where a mean is under five standard errors.
    green : int
        Index of the green channel; where it is too dark all gains are the calibrated ones.
    """
    calibrated = neutral[green] / neutral
    if not usable.any():
        return Balance(calibrated, tuple("calibrated" for _ in neutral))
    means = planes[usable].mean(axis=0)
    certain = (means >= LEAST_STANDARD_ERRORS * standard_errors) & (means > 0)
    certain &= bool(certain[green])
    gains = np.where(certain, means[green] / np.where(certain, means, 1.0), calibrated)
    sources: list[BalanceSource] = ["gray world" if sure else "calibrated" for sure in certain]
    return Balance(gains, tuple(sources))


def neutral_response(letters: Sequence[str], responses: Responses | None = None) -> Floats:
    """Relative electrons of curves, the project's own by default, from a neutral under D65, shape (letter,)."""
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(nm)
    light = illuminant("D65").band_average(nm, width) * photons_per_joule(nm)
    return np.asarray((responses or rgbw()).band_average(tuple(letters), nm, width) @ light)


def fit_matrix(
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Matrix from white-balanced camera channels to linear sRGB, least squares over reflectances.

    Responses are balanced so that a spectrally flat surface gives equal channels: what Gray World does to a scene
    whose mean is grey. The fit keeps that neutral exactly neutral. The target is XYZ under the light, adapted to D65.

    Parameters
    ----------
    responses : (channel, band) array_like
        Electrons per photon; three channels, or four with W.
    wavelength_nm : (band,) array_like
        Centres; evenly spaced where `width_nm` is left out.
    illuminant_spd : (band,) array_like
        Spectral power of the light, any scale.
    reflectances : (patch, band) array_like
        Training surfaces, such as the ColorChecker's. This and `responses` may also come transposed.
    width_nm : (band,) array_like, optional
        Widths of bands that aren't evenly spaced.

    Returns
    -------
    (3, channel) float64
        Rows sum to 1.

    Raises
    ------
    InputError
        Where a shape doesn't fit the wavelengths, or there are too few surfaces.
    """
    signals, target = training(responses, wavelength_nm, illuminant_spd, reflectances, width_nm)
    # Rows sum to 1: the last coefficient is 1 minus the others, so fit differences from the last channel.
    free, *_ = np.linalg.lstsq(signals[:, :-1] - signals[:, -1:], target - signals[:, -1:], rcond=None)
    return np.concatenate([free, 1.0 - free.sum(axis=0, keepdims=True)]).T


def training(
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Balanced signals (patch, channel) and linear sRGB (patch, 3) of training surfaces; as `fit_matrix` takes them."""
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    width = band_widths(nm, width_nm)
    camera, surfaces = _band_last("responses", responses, nm.size), _band_last("reflectances", reflectances, nm.size)
    light = _band_last("illuminant_spd", illuminant_spd, nm.size)[0]
    if surfaces.shape[0] < camera.shape[0]:
        raise InputError(f"reflectances: {surfaces.shape[0]} surfaces can't fit {camera.shape[0]} channels; give more")
    photons = light * photons_per_joule(nm) * width
    signals = (surfaces * photons) @ camera.T / (photons @ camera.T)
    white = tristimulus(light, nm, width)
    return signals, xyz_to_srgb(adapt_to_d65(tristimulus(surfaces * light, nm, width) / white[1], white))


def _band_last(name: str, values: ArrayLike, bands: int) -> NDArray[np.float64]:
    """Two-dimensional array with the band on the last axis, transposed if it came on the first."""
    array = np.atleast_2d(np.asarray(values, dtype=np.float64))
    if array.ndim == 2 and array.shape[1] == bands:
        return array
    if array.ndim == 2 and array.shape[0] == bands:
        return array.T
    raise InputError(
        f"{name}: shape {array.shape} doesn't fit {bands} wavelengths; give (n, {bands}), one column a band"
    )


def xyz_from_xy(xy: Floats) -> Floats:
    """XYZ of a chromaticity (x, y) at Y = 1."""
    return np.array([xy[0] / xy[1], 1.0, (1 - xy[0] - xy[1]) / xy[1]])


def rgb_to_xyz(primaries_xy: Floats) -> NDArray[np.float64]:
    """Matrix from linear R, G, B with these primaries, (3, 2) x and y, to XYZ; (1, 1, 1) gives D65 at Y = 1."""
    columns = np.stack([xyz_from_xy(xy) for xy in primaries_xy], axis=1)
    return np.asarray(columns * np.linalg.solve(columns, xyz_from_xy(_D65_XY)))


def xyz_to_srgb(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear sRGB of XYZ over the last axis; D65 at Y = 1 gives (1, 1, 1)."""
    return np.asarray(xyz @ np.linalg.inv(rgb_to_xyz(SRGB_PRIMARIES_XY)).T)


def luminance_of_srgb(rgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """Y of linear sRGB over the last axis."""
    return np.asarray(rgb @ rgb_to_xyz(SRGB_PRIMARIES_XY)[1])


def adapt_to_d65(xyz: NDArray[np.float64], white_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bradford chromatic adaptation of XYZ (last axis) from a light's white to D65; Y of the white is kept."""
    source = _BRADFORD @ (white_xyz / white_xyz[1])
    matrix = np.linalg.inv(_BRADFORD) @ np.diag(_BRADFORD @ xyz_from_xy(_D65_XY) / source) @ _BRADFORD
    return np.asarray(xyz @ matrix.T)


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Encode linear sRGB for display, clipped to [0, 1] (IEC 61966-2-1)."""
    clipped = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
