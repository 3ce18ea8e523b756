"""Measure how far a picture is from the truth: PSNR, SSIM and CIEDE2000 of sRGB in [0, 1]; and how far it looks to the
eye: S-CIELAB, FLIP, and PSNR of absolute luminance on PU21's scale of equally visible steps.

Source of PU21: Mantiuk & Azimi, "PU21: A novel perceptually uniform encoding for adapting existing quality metrics for
HDR", Picture Coding Symposium 2021; constants as the authors publish them with the paper (gfxdisp/pu21).
"""

from dataclasses import dataclass

import numpy as np
import skimage
from numpy.typing import ArrayLike, NDArray

from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from rodcone.errors import InputError
from rodcone.types import Image
from studies.metrics.flip import Seen, flip, seen_light
from studies.metrics.s_cielab import eye_lab_of_light
from studies.metrics.ssim import LocalMoments, local_moments, ssim


@dataclass(frozen=True)
class Quality:
    """Quality of one picture: PSNR [dB], SSIM, and the median and 95th percentile of CIEDE2000 over pixels."""

    psnr_db: float
    ssim: float
    delta_e_median: float
    delta_e_p95: float


def require_finite(**arrays: ArrayLike) -> None:
    """Raise `InputError` for the first NaN or infinity in an array; a figure of quality wouldn't say where it is."""
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
            raise InputError(
                f"{name}: {np.asarray(values)[where]} at {where}; allowed: finite numbers; mend that pixel"
            )


def psnr_db(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Return the peak signal-to-noise ratio [dB] of values in [0, 1]; inf where they equal the truth.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    require_finite(picture=picture, truth=truth)
    mean_square = float(np.mean((picture - truth) ** 2))
    return float(-10 * np.log10(mean_square)) if mean_square > 0 else float("inf")


def picture_quality(picture: NDArray[np.float64], truth: "NDArray[np.float64] | TruePicture") -> Quality:
    """Compare encoded sRGB pictures (h, w, 3) in [0, 1].

    SSIM is that of Wang et al. 2004 with its Gaussian window; the white of CIEDE2000 is D65. If many pictures are
    compared with the same truth, a `TruePicture` saves half of the work.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    psnr = psnr_db(picture, truth.encoded if isinstance(truth, TruePicture) else truth)
    lab = truth.lab if isinstance(truth, TruePicture) else skimage.color.rgb2lab(truth)
    moments = truth.moments if isinstance(truth, TruePicture) else local_moments(truth)
    delta_e = skimage.color.deltaE_ciede2000(skimage.color.rgb2lab(picture), lab)
    return Quality(psnr, ssim(picture, moments), float(np.median(delta_e)), float(np.percentile(delta_e, 95)))


@dataclass(frozen=True)
class TruePicture:
    """The noise-free picture, and quantities derived from it for comparisons, computed once for all pictures.

    Attributes
    ----------
    linear : (h, w, 3) float64
        sRGB, not clipped; white is 1.
    encoded, lab : (h, w, 3) float64
        The picture as a display shows it, and its CIELAB.
    eye_lab : (h, w, 3) float64
        CIELAB after the eye's blur.
    seen : Seen
        Quantities of the picture that FLIP compares.
    moments : LocalMoments
        Quantities of the picture that SSIM compares.
    """

    linear: Image
    encoded: Image
    lab: Image
    eye_lab: Image
    seen: Seen
    moments: LocalMoments


@dataclass(frozen=True)
class Appearance:
    """Differences between a picture and the truth as an eye sees them.

    Attributes
    ----------
    s_cielab_median, s_cielab_p95 : float
        Median and 95th percentile over pixels; 1 is about what can just be seen.
    flip_mean : float
        0 (no difference) to 1.
    pu21_psnr_db : float
        PSNR of luminance in cd/m^2, on PU21's scale.
    """

    s_cielab_median: float
    s_cielab_p95: float
    flip_mean: float
    pu21_psnr_db: float


def true_picture(linear: Image) -> TruePicture:
    """Compute a `TruePicture` from linear sRGB (h, w, 3); raise `InputError` for a value that is NaN or infinite."""
    require_finite(truth=linear)
    encoded = encode_srgb(linear)
    shown = np.clip(linear, 0.0, 1.0)
    return TruePicture(
        linear,
        encoded,
        skimage.color.rgb2lab(encoded),
        eye_lab_of_light(shown),
        seen_light(shown),
        local_moments(encoded),
    )


def appearance(linear: Image, truth: TruePicture, white_cd_m2: float) -> Appearance:
    """Compare a picture with the truth, both in the same scale; nothing is fitted to the picture.

    Parameters
    ----------
    linear : (h, w, 3) float64
        sRGB, not clipped, in which `white_cd_m2` is 1.
    truth : TruePicture
    white_cd_m2 : float
        Luminance of white. FLIP and S-CIELAB compare the pictures as a display shows them, whatever this is; PU21
        compares the scene's own luminance, adapted to D65.

    Raises
    ------
    InputError
        For a value that is NaN or infinite.
    """
    require_finite(picture=linear)
    shown = np.clip(linear, 0.0, 1.0)
    difference = skimage.color.deltaE_cie76(eye_lab_of_light(shown), truth.eye_lab)
    luminances = (luminance_of_srgb(picture) * white_cd_m2 for picture in (linear, truth.linear))
    return Appearance(
        float(np.median(difference)),
        float(np.percentile(difference, 95)),
        float(flip(seen_light(shown), truth.seen).mean()),
        pu21_psnr_db(*luminances),
    )


LEAST_CD_M2, MOST_CD_M2 = 0.005, 10_000.0  # range of PU21; luminance outside counts as the nearer end
PEAK = 256.0  # the authors' peak for PSNR: about the value of a 100 cd/m^2 display's white, as 255 is in 8 bits
# The authors' preferred fit, "banding_glare": visibility of steps in smooth gradients, with the glare of the eye.
_P = (0.353487901, 0.3734658629, 8.277049286e-05, 0.9062562627, 0.09150303166, 0.9099517204, 596.3148142)


def pu21_encode(luminance_cd_m2: ArrayLike) -> NDArray[np.float64]:
    """Return the perceptually uniform value, 0 to 595.4, of luminance [cd/m^2] of any shape; 100 cd/m^2 give 256.4.

    Luminance outside 0.005 to 10 000 cd/m^2 counts as the nearer end, and so does noise below 0.

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
    """Return the PSNR of luminance on PU21's scale, peak 256 (the authors' PSNRY) [dB]; inf for equal pictures.

    Parameters
    ----------
    picture_cd_m2, truth_cd_m2 : (h, w) array_like
        Absolute luminance, not clipped at white. The same error weighs less in daylight than at dusk.

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
