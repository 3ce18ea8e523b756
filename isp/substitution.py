"""Luminance substitution: in the deepest dark W gives the picture its luminance (Parmar & Wandell 2009, 3.1.3).

The paper switches. Here the weight falls smoothly with the frame's SNR, so that a sweep over light shows no step; over
a half counts as on, which is the switch's decision. W is not luminance: what it sees besides is taken out by the matrix
fitted on surfaces (`isp.colour.colour_fit`), as far as the noise of the colours allows.
"""

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import MEDIAN_STEP, ColourFit
from rodcone.colour_spaces import luminance_of_srgb
from rodcone.errors import InputError
from sensor.raw import RawImage

# Figure 6 fixes them: Table 1 at 25 cd/m^2 substitutes at 5 ms, and not at 10 and 20 ms. The geometric mean of the
# expected SNR at 5 and 10 ms on `still_life`, under each reading of the table (docs/decisions/0005).
SUBSTITUTION_SNR = 4.95  # `table1_output`: 3.59 and 6.82
SUBSTITUTION_SNR_TABLE1_PIXEL = 0.672  # `table1_pixel`: 0.476 and 0.951
OCTAVES = 1.0  # on either side: narrower shows as a step over light, wider leaves W in bright pictures

# Factors from the noise variance of the reconstructed colours to their squared error. The error is larger, because each
# colour is sampled at one pixel in four, and pixels that are alike in W may differ in colour. The first factor counts
# in the substituted luminance and in the matrix, the second where the colour is the surroundings'
# (docs/decisions/0015).
COLOUR_ERROR = 10.0
SMOOTH_COLOUR_ERROR = 3.0


def green_snr(raw: RawImage, estimate: NDArray[np.floating]) -> float:
    """SNR of the frame's green: median over unsaturated pixels of reconstructed green over the noise of a sample there.

    Every seventh of them counts. From the raw image alone, and one number a frame: a rule per pixel would flicker. The
    noise is that of one green sample at the reconstructed level, shot noise and dark noise. NaN where all is saturated.

    Parameters
    ----------
    estimate : (h, w, channel) array
        Of `isp.interleaved.reconstruction.reconstruct` [e-].
    """
    kept = estimate[..., raw.channels.index("G")][~raw.saturated][::MEDIAN_STEP]
    green = np.asarray(kept, dtype=np.float64)
    noise = raw.noise_of("G")
    ratios = green / np.sqrt(noise.shot * np.maximum(green, 0.0) + noise.dark_noise_e**2)
    return float(np.median(ratios)) if ratios.size else float("nan")


def substitution_weight(snr: float, threshold: float) -> float:
    """Share of W in the luminance, 0 to 1: smoothstep in log2(snr / threshold); over 0.5 counts as on.

    Parameters
    ----------
    snr : float
        Of `green_snr`; NaN (all saturated) gives 0; no signal, 0 or less, gives 1.
    threshold : float
        SNR at a weight of one half; 0 never substitutes, inf always does.

    Raises
    ------
    InputError
        For a threshold that is negative or NaN.
    """
    if not threshold >= 0.0:  # written so that NaN fails
        raise InputError(f"substitution_snr: {threshold!r} is not allowed; give 0 or more")
    if np.isnan(snr) or threshold == 0.0:
        return 0.0
    if np.isinf(threshold) or snr <= 0.0:
        return 1.0
    t = float(np.clip(0.5 - 0.5 * np.log2(snr / threshold) / OCTAVES, 0.0, 1.0))
    return t * t * (3.0 - 2.0 * t)


def matrix_with_white(fit: ColourFit, noise: NDArray[np.float64], weight: float) -> NDArray[np.float64]:
    """Matrix from balanced R, G, B and W to linear sRGB, with its luminance substituted by `weight`.

    W joins the colours by weights that minimise the expected error at the noise; a plain matrix leaves it out of them,
    and W as it is gives the luminance.

    Parameters
    ----------
    noise : (4,) float64
        Variance of the balanced channels, as `isp.colour.colour_fit.relative_noise`.
    weight : float
        Of `substitution_weight`.

    Returns
    -------
    (3, 4) float64
        Rows sum to 1, where those of a plain matrix do.
    """
    colours = fit.matrix("RGBW", noise * SMOOTH_COLOUR_ERROR)
    noisy = noise * [*[COLOUR_ERROR] * 3, 1.0]
    white = np.eye(4)[3] if fit.plain is not None else luminance_of_srgb(fit.matrix("RGBW", noisy).T)
    return np.asarray(colours + weight * (white - luminance_of_srgb(colours.T)))
