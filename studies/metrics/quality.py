"""How far a picture is from the truth: PSNR, SSIM, CIEDE2000 on sRGB in [0, 1]."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import structural_similarity

from rodcone.errors import InputError


@dataclass(frozen=True)
class Quality:
    """Quality of one picture: PSNR [dB], SSIM, and the median and 95th percentile of CIEDE2000 over pixels."""

    psnr_db: float
    ssim: float
    delta_e_median: float
    delta_e_p95: float


def require_finite(**arrays: ArrayLike) -> None:
    """Raise `InputError` for the first NaN or infinity in an array, which no figure of quality would show."""
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
            raise InputError(
                f"{name}: {np.asarray(values)[where]} at {where}; allowed: finite numbers; mend that pixel"
            )


def psnr_db(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Peak signal-to-noise ratio of values in [0, 1]; inf where they are equal.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    require_finite(picture=picture, truth=truth)
    mean_square = float(np.mean((picture - truth) ** 2))
    return float(-10 * np.log10(mean_square)) if mean_square > 0 else float("inf")


def measure(
    picture: NDArray[np.float64], truth: NDArray[np.float64], truth_lab: NDArray[np.float64] | None = None
) -> Quality:
    """Compare encoded sRGB pictures (h, w, 3) in [0, 1].

    SSIM is Wang et al. 2004 with its Gaussian window; CIEDE2000 takes D65 as the white. `truth_lab`, the
    truth's CIELAB, saves its computation where many pictures are compared with one truth.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    require_finite(picture=picture, truth=truth)
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
