"""The interleaved reconstruction of Parmar & Wandell (2009), section 3.1, which gives every channel at every pixel.

    f_i(x) = (1 / W_y) sum_{y in Omega} G(beta_d, sigma_d) G(beta_s, sigma_s) S_i(y) g_i(y)      eqs. (1), (3)

What the paper leaves open is decided as follows:

- One guide serves all channels: every sample is read as W (`isp.interleaved.panchromatic`), in units of noise by the
  Anscombe transform. The paper's own method instead fills a plane per channel (`isp.planes`), in electrons, and eq. (6)
  mixes it with that of W.
- Patches continue beyond the border by reflection without repeating the edge.
- Omega ends at the border, where W_y normalises. Samples are averaged in electrons.
- The largest weight counts as 1, so that W_y is never 0. If all others underflow, the most similar sample is the
  result.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from isp.colour.white_balance import neutral_response
from isp.interleaved.kernel.run import reconstruct_strips
from isp.interleaved.numpy_form import reference_with_noise
from isp.interleaved.panchromatic import read_as_white
from isp.settings import DEFAULTS, Reconstruction, Settings
from rodcone.jit import backend
from rodcone.types import Floats
from sensor.raw import RawImage


def reconstruct(raw: RawImage, settings: Settings = DEFAULTS, neutral: Floats | None = None) -> NDArray[np.float32]:
    """Reconstruct every channel at every pixel.

    Parameters
    ----------
    raw : RawImage
        One exposure with any tile of channels.
    settings : Settings
        Widths of Omega and of the patches, sigmas, and units of the distance.
    neutral : (channel,) float64, optional
        Response to a neutral in any unit, in the order of `sensor.cfa.channels`; by default that of the project's own
        curves under D65. The paper's own method doesn't use it.

    Returns
    -------
    (h, w, channel) float32
        f_i(x) of eq. (1) [e-], channels in the order of `sensor.cfa.channels`.

    Raises
    ------
    InputError
        If Omega may miss a channel of the tile.

    Notes
    -----
    Other frame sizes, sigmas and neighbourhoods use the kernels that are already compiled; another patch or tile size
    compiles new ones. Besides the result a call needs 32 bytes per pixel and some 0.6 GB.
    """
    return reconstruct_with_noise(raw, settings, neutral).estimate.astype(np.float32, copy=False)


def reconstruct_with_noise(
    raw: RawImage, settings: Settings = DEFAULTS, neutral: Floats | None = None
) -> Reconstruction:
    """Reconstruct as `reconstruct`; also return by which factor the weights reduce white noise, guide and engine."""
    settings.check_reaches(raw.cfa)
    engine = backend()
    white = None
    if settings.distance == "noise":
        white = read_as_white(raw, neutral_response(raw.channels) if neutral is None else neutral)
        raw = white.raw
    guide = None if white is None else white.guide
    if engine == "numpy":
        return replace(reference_with_noise(raw, settings, guide), white=white)
    estimate, noise_gain = reconstruct_strips(raw, settings, guide)
    return Reconstruction(estimate, noise_gain, engine, white)
