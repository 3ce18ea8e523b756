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

from isp.kernel.run import reconstruct_strips
from isp.reference import reference_with_noise
from isp.settings import DEFAULTS, Reconstruction, Settings
from rodcone.jit import backend
from sensor.raw import RawImage


def reconstruct(raw: RawImage, settings: Settings = DEFAULTS) -> NDArray[np.float32]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        One exposure; any tile of channels.
    settings : Settings
        Widths of Omega and the patches, sigmas, units of the distance.

    Returns
    -------
    (h, w, channel) float32
        f_i(x) of eq. (1) [e-], channels in the order of `sensor.cfa.channels`.

    Raises
    ------
    InputError
        Where Omega may miss a channel of the tile.

    Notes
    -----
    Other sizes, sigmas and neighbourhoods run the kernels compiled already; another patch or size of tile compiles its
    own. Besides the result a call takes some 0.6 GB at most.
    """
    settings.check_reaches(raw.cfa)
    if backend() == "numpy":
        return reference_with_noise(raw, settings).estimate.astype(np.float32)
    return reconstruct_strips(raw, settings, noise=False)[0]


def reconstruct_with_noise(raw: RawImage, settings: Settings = DEFAULTS) -> Reconstruction:
    """As `reconstruct`, with the factor by which the weights reduce white noise, and the engine that ran."""
    settings.check_reaches(raw.cfa)
    engine = backend()
    if engine == "numpy":
        return reference_with_noise(raw, settings)
    estimate, noise_gain = reconstruct_strips(raw, settings, noise=True)
    return Reconstruction(estimate=estimate, noise_gain=noise_gain, engine=engine)
