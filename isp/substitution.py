"""Luminance substitution: in deep darkness W gives the picture its luminance (Parmar & Wandell 2009, 3.1.3).

The paper switches W's luminance on or off. Here its weight falls smoothly with the frame's SNR, so that a sweep over
light shows no step; a weight over a half counts as on. W isn't exactly luminance. The matrix that was fitted to
surfaces (`isp.colour.colour_fit`) corrects this as far as the noise of the colours allows.
"""

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import MEDIAN_STEP, ColourFit
from rodcone.colour_spaces import luminance_of_srgb
from rodcone.errors import InputError
from sensor.raw import RawImage

# The thresholds follow from the paper's Figure 6, where the camera of Table 1 substitutes at 25 cd/m^2 and 5 ms, but
# not at 10 and 20 ms. Each is the geometric mean of the SNR that is expected on `still_life` at 5 and 10 ms, for one of
# two interpretations of Table 1 (docs/decisions/0005).
SUBSTITUTION_SNR = 4.95  # preset `table1_output`, with SNRs of 3.59 and 6.82
SUBSTITUTION_SNR_TABLE1_PIXEL = 0.672  # preset `table1_pixel`, with SNRs of 0.476 and 0.951
OCTAVES = 1.0  # half width of the transition; if narrower, it shows as a step; if wider, W remains in bright pictures

# Ratios of the reconstructed colours' squared error to their noise variance. The error is larger, because each colour
# is sampled at one pixel in four, and pixels that are alike in W may differ in colour. The first ratio is used for the
# substituted luminance, and for the matrix of other cameras; the second for the colours of the interleaved camera,
# where noise makes them those of the surroundings (docs/decisions/0015).
COLOUR_ERROR = 10.0
SMOOTH_COLOUR_ERROR = 3.0
# Squared error of a reconstructed colour apart from noise [(signal of a surface that reflects all light)^2]. It exists
# because a colour's samples are apart, and surfaces differ from those of the fit
# (docs/decisions/0069-errors-that-are-no-noise.md).
PLANE_ERROR = 1e-4


def green_snr(raw: RawImage, estimate: NDArray[np.floating]) -> float:
    """Compute the SNR of the frame's green: the median over unsaturated pixels of green over a sample's noise.

    Every seventh of these pixels counts. The SNR depends on the raw image alone and is one number per frame, because a
    rule per pixel would flicker. The noise is the shot and dark noise of one green sample at the reconstructed level.
    If all pixels are saturated, the SNR is NaN.

    Parameters
    ----------
    estimate : (h, w, channel) array
        Result of `isp.interleaved.reconstruction.reconstruct` [e-].
    """
    kept = estimate[..., raw.channels.index("G")][~raw.saturated][::MEDIAN_STEP]
    green = np.asarray(kept, dtype=np.float64)
    noise = raw.noise_of("G")
    ratios = green / np.sqrt(noise.shot * np.maximum(green, 0.0) + noise.dark_noise_e**2)
    return float(np.median(ratios)) if ratios.size else float("nan")


def substitution_weight(snr: float, threshold: float) -> float:
    """Compute the share of W in the luminance, 0 to 1: a smoothstep in log2(snr / threshold); over 0.5 counts as on.

    Parameters
    ----------
    snr : float
        Result of `green_snr`. NaN (all is saturated) gives 0; an SNR of 0 or less (no signal) gives 1.
    threshold : float
        SNR at which the share is one half; 0 never substitutes, inf always does.

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
    """Compute the matrix from balanced R, G, B and W to linear sRGB, with luminance from W in the share `weight`.

    W contributes to the colours by weights that minimise the expected error at the given noise. The variance of R, G
    and B is `SMOOTH_COLOUR_ERROR` times their noise plus `PLANE_ERROR`, so that W has a part even without noise. A fit
    with a given 3x3 matrix (`fit.plain`) leaves W out of the colours, and the luminance is then W itself.

    Parameters
    ----------
    noise : (4,) float64
        Variance of the balanced channels from `isp.colour.colour_fit.relative_noise`.
    weight : float
        Result of `substitution_weight`.

    Returns
    -------
    (3, 4) float64
        The matrix. Its rows sum to 1, if those of a plain matrix do.
    """
    colours = fit.matrix("RGBW", noise * SMOOTH_COLOUR_ERROR + [*[PLANE_ERROR] * 3, 0.0])
    noisy = noise * [*[COLOUR_ERROR] * 3, 1.0]
    white = np.eye(4)[3] if fit.plain is not None else luminance_of_srgb(fit.matrix("RGBW", noisy).T)
    return np.asarray(colours + weight * (white - luminance_of_srgb(colours.T)))
