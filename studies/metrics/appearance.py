"""How far a picture is from the truth to the eye: S-CIELAB, FLIP, and PSNR of absolute luminance on PU21's scale."""

from dataclasses import dataclass

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_cie76, rgb2lab

from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from studies.metrics.pu21 import pu21_psnr_db
from studies.metrics.quality import require_finite
from studies.metrics.s_cielab import PIXELS_PER_DEGREE, eye_lab


def flip(
    picture: NDArray[np.float64], truth: NDArray[np.float64], pixels_per_degree: float = PIXELS_PER_DEGREE
) -> NDArray[np.float64]:
    """LDR-FLIP of each pixel, shape (h, w), from 0 (no difference) to 1; its mean is the usual figure of a picture.

    Andersson et al., "FLIP: A difference evaluator for alternating images", Proc. ACM Comput. Graph. Interact. Tech.
    3(2), 2020. The program computes in float32 and on all processors that OpenMP gives it.

    Parameters
    ----------
    picture, truth : (h, w, 3) float64
        Encoded sRGB in [0, 1].
    pixels_per_degree : float
        Of the eye's view; the default is FLIP's own.
    """
    first, second = (np.ascontiguousarray(values, dtype=np.float32) for values in (truth, picture))
    error, _, _ = flip_evaluator.evaluate(
        first, second, "LDR", applyMagma=False, computeMeanError=False, parameters={"ppd": float(pixels_per_degree)}
    )
    return np.asarray(error[..., 0], dtype=np.float64)


Image = NDArray[np.float64]


@dataclass(frozen=True)
class TruePicture:
    """The noise-free picture, and what comparisons need of it, computed once for all pictures compared with it.

    Attributes
    ----------
    linear : (h, w, 3) float64
        sRGB, not clipped; white is 1.
    encoded, lab : (h, w, 3) float64
        As a display shows it, and its CIELAB.
    eye_lab : (h, w, 3) float64
        CIELAB after the eye's blur.
    """

    linear: Image
    encoded: Image
    lab: Image
    eye_lab: Image


@dataclass(frozen=True)
class Appearance:
    """Differences that an eye sees.

    Attributes
    ----------
    s_cielab_median, s_cielab_p95 : float
        Median and 95th percentile over pixels; 1 is about what can just be seen.
    flip_mean : float
        0 (no difference) to 1.
    pu21_psnr_db : float
        Of luminance in cd/m^2.
    """

    s_cielab_median: float
    s_cielab_p95: float
    flip_mean: float
    pu21_psnr_db: float


def true_picture(linear: Image) -> TruePicture:
    """Compute what comparisons need of linear sRGB (h, w, 3); `InputError` for a value that is NaN or infinite."""
    require_finite(truth=linear)
    encoded = encode_srgb(linear)
    return TruePicture(linear, encoded, rgb2lab(encoded), eye_lab(encoded))


def appearance(linear: Image, encoded: Image, truth: TruePicture, white_cd_m2: float) -> Appearance:
    """Compare a picture with the truth, both of one scale: nothing is fitted to the picture.

    Parameters
    ----------
    linear : (h, w, 3) float64
        sRGB, not clipped; 1 stands for `white_cd_m2`.
    encoded : (h, w, 3) float64
        The same by `rodcone.colour_spaces.encode_srgb`.
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
    difference = deltaE_cie76(eye_lab(encoded), truth.eye_lab)
    luminances = (luminance_of_srgb(picture) * white_cd_m2 for picture in (linear, truth.linear))
    return Appearance(
        float(np.median(difference)),
        float(np.percentile(difference, 95)),
        float(flip(encoded, truth.encoded).mean()),
        pu21_psnr_db(*luminances),
    )
