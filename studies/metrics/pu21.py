"""PU21: luminance on a scale of equally visible steps, and the PSNR on it, for pictures in cd/m^2.

Source: Mantiuk & Azimi, "PU21: A novel perceptually uniform encoding for adapting existing quality metrics for HDR",
Picture Coding Symposium 2021; constants as the authors publish them with the paper (gfxdisp/pu21).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rodcone.errors import InputError
from studies.metrics.quality import require_finite

LEAST_CD_M2, MOST_CD_M2 = 0.005, 10_000.0  # the encoding's range: luminance outside counts as its end
PEAK = 256.0  # the authors' peak for PSNR: about the value of a 100 cd/m^2 display's white, as 255 is in 8 bits
# Fit "banding_glare", the authors' own choice: steps in smooth gradients are seen, through the glare of the eye.
_P = (0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627, 0.09150303166, 0.9099517204, 596.3148142)


def pu21_encode(luminance_cd_m2: ArrayLike) -> NDArray[np.float64]:
    """Perceptually uniform value, 0 to 595.4, of luminance [cd/m^2] of any shape; 100 cd/m^2 give 256.4.

    Luminance outside 0.005 to 10 000 cd/m^2, noise below 0 included, counts as the nearer end.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    luminance = np.asarray(luminance_cd_m2, dtype=np.float64)
    require_finite(luminance_cd_m2=luminance)
    power = np.clip(luminance, LEAST_CD_M2, MOST_CD_M2) ** _P[3]
    return np.maximum(_P[6] * (((_P[0] + _P[1] * power) / (1 + _P[2] * power)) ** _P[4] - _P[5]), 0.0)


def pu21_psnr_db(picture_cd_m2: ArrayLike, truth_cd_m2: ArrayLike) -> float:
    """PSNR [dB] of luminance on PU21's scale, peak 256 (the authors' PSNRY); inf where pictures look the same.

    Parameters
    ----------
    picture_cd_m2, truth_cd_m2 : (h, w) array_like
        Absolute luminance, not clipped at white: the same error counts for less in daylight than at dusk.

    Raises
    ------
    InputError
        Where the shapes differ, or a value is NaN or infinite.
    """
    first, second = pu21_encode(picture_cd_m2), pu21_encode(truth_cd_m2)
    if first.shape != second.shape:
        raise InputError(f"picture_cd_m2: shape {first.shape} is not allowed; give the truth's, {second.shape}")
    mean_square = float(np.mean((first - second) ** 2))
    return float(10 * np.log10(PEAK**2 / mean_square)) if mean_square > 0 else float("inf")
