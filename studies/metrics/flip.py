"""FLIP: the difference that is seen when two pictures alternate on a display, by its authors' own program."""

import flip_evaluator  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_range
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

    Raises
    ------
    InputError
        Where the shapes differ, a value is outside [0, 1], or `pixels_per_degree` outside 1 to 10 000.
    """
    require_range("pixels_per_degree", pixels_per_degree, 1.0, 1e4, "give those of a display: 67 at arm's length")
    if picture.shape != truth.shape or picture.ndim != 3 or picture.shape[2] != 3:
        raise InputError(f"picture: shape {picture.shape} beside {truth.shape} is not allowed; give (h, w, 3) twice")
    for name, values in (("picture", picture), ("truth", truth)):
        if not ((values >= 0) & (values <= 1)).all():
            raise InputError(f"{name}: {values.min()} to {values.max()} is outside 0 to 1; give encoded sRGB")
    first, second = (np.ascontiguousarray(values, dtype=np.float32) for values in (truth, picture))
    error, _, _ = flip_evaluator.evaluate(
        first, second, "LDR", applyMagma=False, computeMeanError=False, parameters={"ppd": float(pixels_per_degree)}
    )
    return np.asarray(error[..., 0], dtype=np.float64)
