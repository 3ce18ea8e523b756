"""Luminance substitution: in the deepest dark W gives the picture its luminance (Parmar & Wandell 2009, 3.1.3)."""

import numpy as np
from numpy.typing import NDArray

from isp.colour import luminance_of_srgb
from sensor.cfa import channels
from sensor.raw import RawImage

# Figure 6 fixes them: Table 1 at 25 cd/m^2 substitutes at 5 ms, and not at 10 and 20 ms. The geometric mean of the
# expected SNR at 5 and 10 ms on `still_life`, under each reading of the table (docs/decisions/0005).
SUBSTITUTION_SNR = 4.95  # `table1_output`: 3.59 and 6.82
SUBSTITUTION_SNR_TABLE1_PIXEL = 0.672  # `table1_pixel`: 0.476 and 0.951


def green_snr(raw: RawImage, estimate: NDArray[np.floating]) -> float:
    """SNR of the frame's green: median over unsaturated pixels of reconstructed green over the noise of a sample there.

    From the raw image alone, and one number a frame: a rule per pixel would flicker. The noise is that of one green
    sample at the reconstructed level, shot noise and dark noise. NaN where all is saturated.

    Parameters
    ----------
    estimate : (h, w, channel) array
        Of `isp.interleaved.reconstruct` [e-].
    """
    green = np.asarray(estimate[..., channels(raw.cfa).index("G")], dtype=np.float64)
    ratio = green / np.sqrt(np.maximum(green, 0.0) + raw.dark_noise_e**2)
    kept = ratio[~raw.saturated]
    return float(np.median(kept)) if kept.size else float("nan")


def substitute_luminance(
    rgb: NDArray[np.float64], white: NDArray[np.float64], usable: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Replace the luminance of linear sRGB by W's, keeping each pixel's colour differences.

    Parameters
    ----------
    rgb : (h, w, 3) float64
    white : (h, w) float64
        Balanced W plane: equal to luminance on a neutral.
    usable : (h, w) bool
        Where W is not saturated; elsewhere the picture keeps its own luminance.
    """
    change = np.where(usable, white - luminance_of_srgb(rgb), 0.0)
    return rgb + change[..., None]
