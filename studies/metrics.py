"""How far a picture is from the truth: PSNR, SSIM, CIEDE2000 on sRGB in [0, 1]."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import structural_similarity


@dataclass(frozen=True)
class Quality:
    """Quality of one picture: PSNR [dB], SSIM, and the median and 95th percentile of CIEDE2000 over pixels."""

    psnr_db: float
    ssim: float
    delta_e_median: float
    delta_e_p95: float


def psnr_db(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Peak signal-to-noise ratio of values in [0, 1]; inf where they are equal."""
    mean_square = float(np.mean((picture - truth) ** 2))
    return float(-10 * np.log10(mean_square)) if mean_square > 0 else float("inf")


def measure(
    picture: NDArray[np.float64], truth: NDArray[np.float64], truth_lab: NDArray[np.float64] | None = None
) -> Quality:
    """Compare encoded sRGB pictures (h, w, 3) in [0, 1].

    SSIM is Wang et al. 2004 with its Gaussian window; CIEDE2000 takes D65 as the white. Who compares many pictures with
    one truth gives the truth's CIELAB too.
    """
    ssim = structural_similarity(
        picture,
        truth,
        channel_axis=2,
        data_range=1.0,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        win_size=min(11, (min(picture.shape[:2]) - 1) // 2 * 2 + 1),
    )
    delta_e = deltaE_ciede2000(rgb2lab(picture), rgb2lab(truth) if truth_lab is None else truth_lab)
    return Quality(psnr_db(picture, truth), float(ssim), float(np.median(delta_e)), float(np.percentile(delta_e, 95)))
