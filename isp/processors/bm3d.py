"""BM3D of several planes at once, by its authors' library.

K. Dabov, A. Foi, V. Katkovnik, K. Egiazarian, "Image denoising by sparse 3-D transform-domain collaborative filtering",
IEEE Trans. Image Process. 16(8), 2007, by the library `bm3d` (Y. Makinen, L. Azzari, A. Foi, IEEE TIP 29, 2020). Its
licence allows informational and non-commercial use alone, so it is an extra of its own.
"""

from collections.abc import Sequence

import numpy as np

from isp.picture import Image
from rodcone.optional import optional_library

EXTRA = "bm3d"
_SMALLEST = 32  # pixels along a side: the library fails on planes not much larger than its 8x8 blocks


def bm3d(planes: Image, sigma: Sequence[float]) -> Image:
    """Denoise planes that show the same scene, shape (h, w, plane).

    Parameters
    ----------
    planes : (h, w, plane) float64
        White noise in each, independent between planes. Blocks are matched on the first plane alone, for all.
    sigma : sequence of float
        Standard deviation of each plane's noise.

    Raises
    ------
    InputError
        Without the library `bm3d`.
    """
    library = optional_library("bm3d", EXTRA)
    height, width = planes.shape[:2]
    sides = [(0, max(_SMALLEST - size, 0)) for size in (height, width)]
    profile = library.BM3DProfile()  # its authors' "normal" one
    profile.num_threads = 1  # with more, the order of its sums, and so the last bits, change from run to run
    padded = np.pad(planes, [*sides, (0, 0)], mode="reflect")
    return np.asarray(library.bm3d(padded, list(sigma), profile), dtype=np.float64)[:height, :width]
