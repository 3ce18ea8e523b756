"""Conversion of camera channels to colour: the least-squares matrix, and a fit that takes a frame's noise into account.

A matrix that is fitted without noise makes saturated colours from differences of channels, and thus amplifies noise.
`ColourFit` minimises the expected squared error of surface and noise together (Wiener 1949). If the colours have little
noise, it gives the least-squares matrix over all channels. The noisier they are, the larger is the weight of W, the
channel with the least noise, and the paler the colours become.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.planes import rows_at
from render.spectrum import Spectrum, band_widths, colour_matching_functions, observer_weights, photons_per_joule
from rodcone.colour_spaces import adapt_to_d65, luminance_of_srgb, xyz_to_srgb
from rodcone.display import brief
from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.raw import RawImage, channel_variance

# Noise variance that is always added, far below that of any camera. Under a light of one wavelength all balanced
# channels are equal, so that any matrix would fit; with the same noise in each channel they get equal weights.
LEAST_NOISE = 1e-13
MEDIAN_STEP = 7  # medians take every seventh pixel; the step is odd, so that all cells of the tile take part
WHITE_REST = 3.0  # variance of what W sees beyond the colours, over its variance for the training surfaces
LEAST_SIGNAL = 1e-3  # least ratio of signal to noise, which keeps the equations solvable in a frame of pure noise


@dataclass(frozen=True)
class ColourFit:
    """Relation of white-balanced channels to colour, as moments over training surfaces under one light.

    Attributes
    ----------
    channels : tuple of str
        Channels; the three colours come first, if there are three.
    mean : (channel,) float64
        Mean balanced signal; a surface that reflects all light has a signal of 1.
    moments : (channel, channel) float64
        Mean product of two signals.
    cross : (channel, 3) float64
        Mean product of a signal and linear sRGB under the light, adapted to D65.
    plain : (3, 3) float64 or None
        A given matrix from the three colours to linear sRGB, which is used instead of the moments. It doesn't depend on
        noise, and W is then luminance by itself.
    """

    channels: tuple[str, ...]
    mean: Floats
    moments: Floats
    cross: Floats
    plain: Floats | None = None

    __repr__ = brief

    @classmethod
    def of(cls, matrix: ArrayLike | ColourFit) -> ColourFit:
        """Convert a pipeline's argument, a matrix or a `ColourFit`, to a `ColourFit`.

        Raises
        ------
        InputError
            For a matrix that isn't 3x3 and finite.
        """
        if isinstance(matrix, ColourFit):
            return matrix
        plain = np.asarray(matrix, dtype=np.float64)
        if plain.shape != (3, 3) or not np.all(np.isfinite(plain)):
            raise InputError(
                f"matrix: shape {plain.shape} is not allowed; give 3x3 finite numbers, as fit_matrix makes them"
            )
        return cls(("R", "G", "B", "W"), mean=np.ones(4), moments=np.eye(4), cross=np.eye(4, 3), plain=plain)

    def matrix(self, names: Sequence[str] = (), noise: ArrayLike = 0.0) -> Floats:
        """Compute the matrix from balanced channels to linear sRGB that has the least expected squared error.

        Parameters
        ----------
        names : sequence of str
            Channels to use, by default the three colours.
        noise : (channel,) array_like
            Noise variance of each channel [(signal of a surface that reflects all light)^2].

        Returns
        -------
        (3, channel) float64
            The matrix. Its rows sum to 1, so that a neutral stays neutral at any noise.

        Raises
        ------
        InputError
            For a channel that wasn't fitted.
        """
        used = tuple(names) or self.channels[:3]
        if not set(used) <= set(self.channels):
            raise InputError(f"channels: {used} are not allowed; fitted were {self.channels}; fit these channels")
        if self.plain is not None:
            return np.hstack([self.plain, np.zeros((3, len(used) - 3))])
        index = [self.channels.index(name) for name in used]
        moments = self.moments[np.ix_(index, index)] + np.diag(np.broadcast_to(noise, len(index)) + LEAST_NOISE)
        # Rows sum to 1, because differences from the last channel are fitted, whose coefficient is 1 minus the others.
        difference = np.hstack([np.eye(len(index) - 1), -np.ones((len(index) - 1, 1))])
        target = difference @ (self.cross[index] - moments[:, -1:])
        free = np.linalg.solve(difference @ moments @ difference.T, target)
        return np.concatenate([free, 1.0 - free.sum(axis=0, keepdims=True)]).T


def fit_colours(
    names: Sequence[str],
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
    lamp: Spectrum | None = None,
) -> ColourFit:
    """Fit a camera's colours under a light; `responses` are those of channels `names`, and the rest as in `training`.

    Beside three colours, W is modelled as a_R R + a_G G + a_B B plus an independent rest, where a sums to 1 and is
    fitted by least squares. W then adds nothing to the colours except where it has less noise than they have. (When W
    was fitted freely to a chart's two dozen surfaces, the result was 4.7 dB worse than with the three colours on
    `night_street` without noise.) One or two channels can't distinguish colours; they are fitted to luminance, and the
    picture is grey.

    Raises
    ------
    InputError
        As `fit_matrix`.
    """
    signals, target = training(responses, wavelength_nm, illuminant_spd, reflectances, width_nm, lamp)
    if signals.shape[1] != len(names):
        raise InputError(f"responses: {signals.shape[1]} channels don't fit the names {tuple(names)}; give one each")
    if len(names) < 3:
        target = grey_of(target)
    mean = signals.mean(axis=0)
    rest = np.zeros(len(names))
    if "W" in names[3:]:
        white = names.index("W")
        colours = signals[:, :3]
        explained = colours @ fit_through_neutral(colours, signals[:, [white]])[0]
        rest[white] = WHITE_REST * np.mean((signals[:, white] - explained) ** 2)
        signals[:, white] = explained
    moments = signals.T @ signals / len(signals) + np.diag(rest)
    cross = signals.T @ target / len(signals)
    return ColourFit(channels=tuple(names), mean=mean, moments=moments, cross=cross)


def grey_of(srgb: Floats) -> Floats:
    """Replace linear sRGB (..., 3) by a grey of the same luminance."""
    return np.repeat(luminance_of_srgb(srgb)[..., None], 3, axis=-1)


def fit_matrix(
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
) -> Floats:
    """Fit the matrix from white-balanced camera channels to linear sRGB by least squares over reflectances.

    Responses are balanced so that a spectrally flat surface gives equal channels, as Gray World does for a scene whose
    mean is grey. The fit keeps that neutral exactly neutral. The target is XYZ under the light, adapted to D65.

    Parameters
    ----------
    responses : (channel, band) array_like
        Electrons per photon of three channels, or of four with W.
    wavelength_nm : (band,) array_like
        Band centres, evenly spaced if `width_nm` is left out.
    illuminant_spd : (band,) array_like
        Spectral power of the light at any scale.
    reflectances : (patch, band) array_like
        Training surfaces, such as those of the ColorChecker. This array and `responses` may also be transposed.
    width_nm : (band,) array_like, optional
        Band widths, if the bands aren't evenly spaced.

    Returns
    -------
    (3, channel) float64
        The matrix, whose rows sum to 1.

    Raises
    ------
    InputError
        If a shape doesn't fit the wavelengths, or there are too few surfaces.
    """
    signals, target = training(responses, wavelength_nm, illuminant_spd, reflectances, width_nm)
    return fit_through_neutral(signals, target)


def fit_through_neutral(signals: Floats, target: Floats) -> Floats:
    """Fit a matrix (output, channel) from signals (patch, channel) to targets (patch, output); its rows sum to 1.

    A neutral therefore stays neutral. Because the last coefficient is 1 minus the others, differences from the last
    channel are fitted.
    """
    free, *_ = np.linalg.lstsq(signals[:, :-1] - signals[:, -1:], target - signals[:, -1:], rcond=None)
    return np.concatenate([free, 1.0 - free.sum(axis=0, keepdims=True)]).T


def training(
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
    lamp: Spectrum | None = None,
) -> tuple[Floats, Floats]:
    """Compute the balanced signals (patch, channel) and linear sRGB (patch, 3) of training surfaces.

    Parameters
    ----------
    responses, wavelength_nm, illuminant_spd, reflectances, width_nm
        As in `fit_matrix`.
    lamp : Spectrum, optional
        The light within the bands, up to a factor, if the responses are weights that follow its spectrum
        (`sensor.response.electrons_per_irradiance`). If it is left out, camera and eye are both averages over bands,
        and their errors within a band are nearly the same.
    """
    nm = np.asarray(wavelength_nm, dtype=np.float64)
    width = band_widths(nm, width_nm)
    camera, surfaces = _band_last("responses", responses, nm.size), _band_last("reflectances", reflectances, nm.size)
    light = _band_last("illuminant_spd", illuminant_spd, nm.size)[0]
    if surfaces.shape[0] < camera.shape[0]:
        raise InputError(f"reflectances: {surfaces.shape[0]} surfaces can't fit {camera.shape[0]} channels; give more")
    photons = light * photons_per_joule(nm) * width
    signals = (surfaces * photons) @ camera.T / (photons @ camera.T)
    if lamp is None:
        eye = np.array([curve.band_average(nm, width) for curve in colour_matching_functions()]).T * width[:, None]
    else:
        eye = observer_weights(nm, width, lamp).T
    white = light @ eye
    return signals, xyz_to_srgb(adapt_to_d65((surfaces * light) @ eye / white[1], white))


def _band_last(name: str, values: ArrayLike, bands: int) -> Floats:
    """Return a two-dimensional array with the band on the last axis; transpose it if the band is on the first."""
    array = np.atleast_2d(np.asarray(values, dtype=np.float64))
    if array.ndim == 2 and array.shape[1] == bands:
        return array
    if array.ndim == 2 and array.shape[0] == bands:
        return array.T
    raise InputError(
        f"{name}: shape {array.shape} doesn't fit {bands} wavelengths; give (n, {bands}), one column a band"
    )


def relative_noise(
    raw: RawImage,
    estimate: NDArray[np.floating],
    noise_gain: NDArray[np.floating],
    gains: Floats,
    fit: ColourFit,
    light: ArrayLike = 1.0,
) -> Floats:
    """Estimate the noise variance of a frame's balanced channels, for `ColourFit.matrix`.

    Each channel has one number per frame and light. It is the variance at the frame's mean times `light`, relative to
    the squared signal of a surface that reflects all light. That signal is estimated from the same multiple of the
    frame's mean green (or `sensor.cfa.unit_channel`), on the assumption that the surfaces there reflect as much as the
    training surfaces on average.

    Parameters
    ----------
    estimate, noise_gain : (h, w, channel) array
        As `isp.interleaved.reconstruction.reconstruct_with_noise` returns them; the median gain counts. A gain of shape
        (channel,) holds for every pixel.
    gains : (channel,) float64
        White balance.
    light : float or (n,) array_like
        Light for which the noise is estimated, over the frame's mean.

    Returns
    -------
    (channel,) or (n, channel) float64
        Variances [(signal of a surface that reflects all light)^2].
    """
    unit = raw.unit_channel
    green = raw.channels.index(unit)
    saturated = raw.saturated
    kept = ~saturated if not saturated.all() else np.ones(raw.shape, dtype=bool)
    rows = np.asarray(rows_at(estimate, kept), dtype=np.float64)
    mean = np.maximum(np.einsum("nc->c", rows) / len(rows), 0.0)
    medians = noise_gain
    if noise_gain.ndim > 1:
        noise_gains = np.ascontiguousarray(rows_at(noise_gain, kept)[::MEDIAN_STEP].T)
        medians = np.median(noise_gains, axis=1, overwrite_input=True)
    times = np.asarray(light, dtype=np.float64)[..., None]
    variance = channel_variance(raw, mean * times) * medians * gains**2
    white = mean[green] * gains[green] / fit.mean[fit.channels.index(unit)] * times
    # A frame without any signal is only noise. The matrix then depends on W alone, whatever the divisor is.
    return np.asarray(variance / np.maximum(white**2, LEAST_SIGNAL**2 * variance.max(axis=-1, keepdims=True)))
