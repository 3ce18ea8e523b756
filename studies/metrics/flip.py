"""FLIP: the difference that is seen when two pictures alternate on a display, by its authors' own program."""

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from studies.metrics.s_cielab import PIXELS_PER_DEGREE


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
