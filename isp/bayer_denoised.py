"""Bayer opponents with a denoiser: the same non-local means as the interleaved camera, and BM3D.

BM3D: K. Dabov, A. Foi, V. Katkovnik, K. Egiazarian, "Image denoising by sparse 3-D transform-domain collaborative
filtering", IEEE Trans. Image Process. 16(8), 2007, by its authors' library `bm3d` (Y. Makinen, L. Azzari, A. Foi, IEEE
TIP 29, 2020). Its licence allows informational and non-commercial use alone, so it is an extra of its own.

A mosaic becomes four pictures of half the size, one for each site of the tile, as in H. Akiyama, M. Tanaka, M. Okutomi,
"Pseudo four-channel image denoising for noisy CFA raw data", ICIP 2015. Ours: a fixed orthonormal transform of the four
(their mean and three differences) in place of principal components, blocks matched on the mean, all in units of noise.
"""

import numpy as np
from numpy.typing import ArrayLike

from isp.anscombe import unstabilise
from isp.demosaic import MALVAR_REACH, menon, require_bayer
from isp.interleaved import reconstruct_with_noise
from isp.mosaic import as_picture, balance_mosaic, to_rgb
from isp.picture import Picture, finish
from isp.planes import Plane, stabilise
from render.optional import optional_library
from sensor.raw import RawImage

EXTRA = "bm3d"
# Rows of the orthonormal 4x4 Hadamard matrix: independent noise stays independent, its variance 1.
_MIX = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2.0
_SMALLEST = 32  # pixels of a picture of half the size: the library fails on ones not much larger than its 8x8 blocks


def picture_bayer_nlm(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop a Bayer raw image with `isp.interleaved.reconstruct`, each colour its own guide.

    With a `ColourFit` the colours know their noise, as the interleaved camera's do.
    """
    require_bayer(raw.cfa)
    result = reconstruct_with_noise(raw)
    planes = np.asarray(result.estimate, dtype=np.float64)
    return finish(
        raw,
        planes,
        matrix,
        neutral=neutral,
        balance=balance,
        engine=result.engine,
        noise_gain=result.noise_gain,
    )


def picture_bayer_bm3d(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """Develop a Bayer raw image with BM3D on the mosaic, then Menon's demosaicking."""
    require_bayer(raw.cfa)
    mosaic = balance_mosaic(raw, bm3d_mosaic(raw), neutral, balance)
    rgb = to_rgb(raw, menon(mosaic.values, raw.cfa), matrix, MALVAR_REACH)
    return as_picture(raw, rgb, mosaic.balance)


def bm3d_mosaic(raw: RawImage) -> Plane:
    """Bayer mosaic denoised by BM3D, shape (h, w) [e-].

    Raises
    ------
    InputError
        Without the library `bm3d`.
    """
    bm3d = optional_library("bm3d", EXTRA)
    sides = [max(size + size % 2, 2 * _SMALLEST) - size for size in raw.shape]
    stable = np.pad(stabilise(raw.electrons, raw.dark_noise_e, 0.0), [(0, side) for side in sides], mode="reflect")
    sites = np.stack([stable[row::2, column::2] for row in (0, 1) for column in (0, 1)], axis=-1)
    profile = bm3d.BM3DProfile()  # its authors' "normal" one
    profile.num_threads = 1  # with more, the order of its sums, and so the last bits, change from run to run
    mixed = np.asarray(bm3d.bm3d(sites @ _MIX.T, 1.0, profile), dtype=np.float64)
    quiet = np.empty_like(stable)
    for site, plane in enumerate(np.moveaxis(mixed @ _MIX, -1, 0)):
        quiet[site // 2 :: 2, site % 2 :: 2] = plane
    return unstabilise(quiet[: raw.shape[0], : raw.shape[1]], raw.dark_noise_e)
