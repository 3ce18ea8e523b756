"""The interleaved reconstruction of Parmar & Wandell (2009), section 3.1: every channel at every pixel.

    f_i(x) = (1 / W_y) sum_{y in Omega} G(beta_d, sigma_d) G(beta_s, sigma_s) S_i(y) g_i(y)      eqs. (1), (3)

What the paper leaves open is settled so:

- Patches h_i are compared in units of noise: Anscombe-transformed and filled by normalised convolution
  (`isp.planes`), extended beyond the border by reflection without repeating the edge.
- The squared distance that noise alone makes is subtracted (`isp.similarity.noise_distance`), clamped at 0.
- Omega ends at the border, where W_y normalises. Samples are averaged in electrons.
- The largest weight counts as 1, so W_y is never 0: where all others underflow, the most similar sample is the result.
"""

import numpy as np
from numpy.typing import NDArray

from isp.reference import reference_with_noise
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S, Distance, Reconstruction, Settings
from isp.strip_sums import Started, end_rows, start_rows
from isp.strips import strip_rows
from isp.tiles import number_tile
from rodcone.jit import arrays, backend, dr
from sensor.cfa import channels
from sensor.raw import RawImage


def reconstruct(
    raw: RawImage,
    *,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    distance: Distance = "noise",
) -> NDArray[np.float32]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        One exposure; any tile of letters.
    neighbourhood, patch : int
        Odd widths of Omega and of the patches h_i [pixels]. The time grows with the square of the first.
    sigma_d : float
        Standard deviation of the spatial weight, eq. (4) [pixels]; 0.001 to inf.
    sigma_s : float
        Standard deviation of the similarity weight, eq. (5) [standard deviations of one pixel's noise, or electrons];
        0.001 to inf.
    distance : {"noise", "raw"}
        Patches in units of noise, debiased and trusted as far as their SNR allows, or in electrons as the paper has it.

    Returns
    -------
    (h, w, channel) float32
        f_i(x) of eq. (1) [e-], channels in the order of `sensor.cfa.channels`.

    Raises
    ------
    InputError
        Where a parameter is outside its range, or Omega may miss a letter of the tile.

    Notes
    -----
    Other sizes, sigmas and neighbourhoods run the kernels compiled already; another patch or size of tile compiles its
    own. Besides the result a call takes some 1.2 GB at most.
    """
    settings = Settings(neighbourhood, patch, sigma_d, sigma_s, distance)
    settings.check_reaches(raw.cfa)
    if backend() == "numpy":
        return reference_with_noise(raw, settings).estimate.astype(np.float32)
    return _reconstruct(raw, settings, noise=False)[0]


def reconstruct_with_noise(
    raw: RawImage,
    *,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    distance: Distance = "noise",
) -> Reconstruction:
    """As `reconstruct`, with the factor by which the weights reduce white noise, and the engine that ran."""
    settings = Settings(neighbourhood, patch, sigma_d, sigma_s, distance)
    settings.check_reaches(raw.cfa)
    engine = backend()
    if engine == "numpy":
        return reference_with_noise(raw, settings)
    estimate, noise_gain = _reconstruct(raw, settings, noise=True)
    return Reconstruction(estimate, noise_gain, engine)


def _reconstruct(raw: RawImage, settings: Settings, *, noise: bool) -> list[NDArray[np.float32]]:
    """Estimate and, where asked for, noise gain, strip by strip."""
    pattern, jit, height = number_tile(raw.cfa), arrays(), raw.shape[0]
    step, started = strip_rows(raw.shape, pattern, settings.patch), list[Started]()
    shape = (*raw.shape, len(channels(raw.cfa)))
    results = [dr.empty(jit.Float, int(np.prod(shape))) for _ in range(1 + noise)]
    for first in range(0, height, step):
        rows = first, min(first + step, height)
        started.append(start_rows(raw, rows, pattern, settings, noise=noise))
        if len(started) > 1:
            end_rows(started.pop(0), raw, pattern, results)
    end_rows(started.pop(), raw, pattern, results)
    return [values.numpy().reshape(shape) for values in results]
