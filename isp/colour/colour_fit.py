"""Camera channels to colour at a known noise: the more noise, the more W decides.

A matrix fitted without noise takes differences of channels to show saturated colours, and so amplifies noise. The one
fitted here minimises the expected squared error of surface and noise together (Wiener 1949): where the colours carry
little noise it is the least-squares matrix over all channels; the noisier they are, the more it takes from the channel
with the least noise, W, and the paler the colours get.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.camera_colour import training
from rodcone.errors import InputError
from sensor.cfa import channels
from sensor.raw import RawImage

# Noise variance that is always there, far under any camera's. Under a light of one wavelength balanced channels are all
# the same, and without noise any matrix fits; with the same noise in each they count alike.
LEAST_NOISE = 1e-13
LEAST_SIGNAL = 1e-3  # of the noise: keeps the fit's equations solvable in a frame of pure noise


@dataclass(frozen=True)
class ColourFit:
    """What balanced channels say about colour: moments over training surfaces under one light.

    Attributes
    ----------
    letters : tuple of str
        Channels; the three colours first.
    mean : (channel,) float64
        Mean balanced signal; a surface that reflects all light reads 1.
    moments : (channel, channel) float64
        Mean product of two signals.
    cross : (channel, 3) float64
        Mean product of a signal and linear sRGB under the light, adapted to D65.
    """

    letters: tuple[str, ...]
    mean: NDArray[np.float64]
    moments: NDArray[np.float64]
    cross: NDArray[np.float64]

    def matrix(self, letters: Sequence[str] = ("R", "G", "B"), noise: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Matrix from balanced channels to linear sRGB with the least expected squared error.

        Parameters
        ----------
        letters : sequence of str
            Channels to use, some of `letters`.
        noise : (channel,) array_like
            Noise variance of each [(signal of a surface that reflects all light)^2].

        Returns
        -------
        (3, channel) float64
            Rows sum to 1, so that a neutral stays neutral at any noise.

        Raises
        ------
        InputError
            For a letter that wasn't fitted.
        """
        if not set(letters) <= set(self.letters):
            raise InputError(
                f"letters: {tuple(letters)} are not allowed; fitted were {self.letters}; fit these channels"
            )
        index = [self.letters.index(letter) for letter in letters]
        moments = self.moments[np.ix_(index, index)] + np.diag(np.broadcast_to(noise, len(index)) + LEAST_NOISE)
        # Rows sum to 1: the last coefficient is 1 minus the others, so fit differences from the last channel.
        difference = np.hstack([np.eye(len(index) - 1), -np.ones((len(index) - 1, 1))])
        target = difference @ (self.cross[index] - moments[:, -1:])
        free = np.linalg.solve(difference @ moments @ difference.T, target)
        return np.concatenate([free, 1.0 - free.sum(axis=0, keepdims=True)]).T

    def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray[np.float64]:
        """Matrix of the first three letters without noise, (3, 3): for pipelines that don't ask for the noise."""
        return self.matrix(self.letters[:3])


def fit_colours(
    letters: Sequence[str],
    responses: ArrayLike,
    wavelength_nm: ArrayLike,
    illuminant_spd: ArrayLike,
    reflectances: ArrayLike,
    width_nm: ArrayLike | None = None,
) -> ColourFit:
    """Fit a camera's colours under a light; parameters as `camera_colour.fit_matrix`, the responses of `letters`.

    Raises
    ------
    InputError
        As `isp.colour.camera_colour.fit_matrix`.
    """
    signals, target = training(responses, wavelength_nm, illuminant_spd, reflectances, width_nm)
    if signals.shape[1] != len(letters):
        raise InputError(
            f"responses: {signals.shape[1]} channels don't fit the letters {tuple(letters)}; give one each"
        )
    count = len(signals)
    return ColourFit(tuple(letters), signals.mean(axis=0), signals.T @ signals / count, signals.T @ target / count)


def relative_noise(
    raw: RawImage,
    estimate: NDArray[np.floating],
    noise_gain: NDArray[np.floating],
    gains: NDArray[np.float64],
    fit: ColourFit,
) -> NDArray[np.float64]:
    """Noise variance of a frame's balanced channels, as `ColourFit.matrix` takes it.

    One number a channel and frame: a matrix per pixel would flicker. Noise at the frame's mean, over the signal of a
    surface that reflects all light, on which the frame's mean green would be the training surfaces' mean.

    Parameters
    ----------
    estimate, noise_gain : (h, w, channel) array
        Of `isp.interleaved.reconstruct_with_noise`; the median gain counts.
    gains : (channel,) float64
        White balance.

    Returns
    -------
    (channel,) float64
    """
    letters = channels(raw.cfa)
    kept = ~raw.saturated if not raw.saturated.all() else np.ones(raw.shape, dtype=bool)
    mean = np.maximum(np.asarray(estimate[kept], dtype=np.float64).mean(axis=0), 0.0)
    variance = (mean + raw.dark_noise_e**2) * np.median(noise_gain[kept], axis=0) * gains**2
    green = letters.index("G")
    white = mean[green] * gains[green] / fit.mean[fit.letters.index("G")]
    # A frame without any signal is all noise: there W alone decides, whatever the ratio.
    return np.asarray(variance / max(white**2, LEAST_SIGNAL**2 * float(variance.max())))
