"""Denoising of a mosaic by BM3D: sub-images, one per site of the tile, are denoised together in units of noise.

As in S. H. Park, H. S. Kim, S. Lansel, M. Parmar, B. A. Wandell, "A case for denoising before demosaicking color filter
array data", Asilomar 2009, and H. Akiyama, M. Tanaka, M. Okutomi, "Pseudo four-channel image denoising for noisy CFA
raw data", ICIP 2015: the sub-images are mixed by an orthonormal matrix. Noise remains independent and of variance 1,
and most of what the sub-images have in common is in the first mixture. Anscombe's transform before, and its exact
inverse after, are this project's.

BM3D: K. Dabov, A. Foi, V. Katkovnik, K. Egiazarian, "Image denoising by sparse 3-D transform-domain collaborative
filtering", IEEE Trans. Image Process. 16(8), 2007, by the library `bm3d` (Y. Makinen, L. Azzari, A. Foi, IEEE TIP 29,
2020). Its licence allows only informational and non-commercial use, so that it is a separate extra.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from isp.anscombe import stabilise_raw, unstabilise_raw, without_prnu
from rodcone.optional import optional_library
from rodcone.types import Image, Plane
from sensor.raw import RawImage

Mix = Callable[[Image], NDArray[np.float64]]


def hadamard(sites: Image) -> NDArray[np.float64]:
    """Return a fixed orthonormal matrix for four pictures: half their sum and half of three differences."""
    return np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2.0


def principal_components(sites: Image) -> NDArray[np.float64]:
    """Return the orthonormal rows along which the pictures (h, w, site) vary most, in falling order.

    Noise of equal variance in all pictures adds a multiple of the unit matrix to their covariance, which doesn't change
    the rows.
    """
    _, rows = np.linalg.eigh(np.cov(sites.reshape(-1, sites.shape[-1]), rowvar=False))
    return rows[:, ::-1].T


def bm3d_mosaic(raw: RawImage, mix: Mix) -> Plane:
    """Denoise the mosaic of a 2x2 tile by BM3D, shape (h, w) [e-].

    Parameters
    ----------
    raw : RawImage
    mix : callable
        Function that chooses the mixing matrix from sub-images (h, w, site) [standard deviations of noise]: `hadamard`
        or `principal_components`.

    Raises
    ------
    InputError
        If the library `bm3d` isn't installed.
    """
    plain = without_prnu(raw)  # if pixels have several readings, it keeps the noise of each range of light
    odd = [(0, size % 2) for size in raw.shape]
    stable = np.pad(stabilise_raw(raw.electrons, plain), odd, mode="reflect")
    sites = np.stack([stable[row::2, column::2] for row in (0, 1) for column in (0, 1)], axis=-1)
    matrix = mix(sites)
    mixed = bm3d(sites @ matrix.T, [1.0] * len(matrix))
    quiet = np.empty_like(stable)
    for site, plane in enumerate(np.moveaxis(mixed @ matrix, -1, 0)):
        quiet[site // 2 :: 2, site % 2 :: 2] = plane
    return unstabilise_raw(quiet[: raw.shape[0], : raw.shape[1]], plain)


EXTRA = "bm3d"
_SMALLEST = 32  # least side [pixels], because the library fails on planes hardly larger than its 8x8 blocks


def bm3d(planes: Image, sigma: Sequence[float]) -> Image:
    """Denoise planes that show the same scene, shape (h, w, plane).

    Parameters
    ----------
    planes : (h, w, plane) float64
        Planes with white noise, independent between planes. Blocks are matched on the first plane for all of them.
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
