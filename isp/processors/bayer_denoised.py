"""Bayer opponents with a denoiser: the interleaved camera's non-local means, and BM3D before or after demosaicking.

Before demosaicking, BM3D denoises the mosaic's sub-images (`isp.processors.sub_images`). Q. Jin, G. Facciolo, J.-M.
Morel, "A review of an old dilemma: demosaicking first, or denoising first?", CVPR Workshops 2020, find the other order
better: the demosaicked picture is denoised as if its noise were white and stronger than the mosaic's, by 1.5 times in
their paper and by 1.75 times here.
"""

from collections.abc import Callable, Sequence

import numpy as np

from isp.anscombe import stabilise, unstabilise
from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.picture import Picture, finish
from isp.processors.demosaic import MALVAR_REACH, picture_demosaicked, require_bayer
from isp.processors.mosaic import balance_mosaic, to_rgb
from isp.processors.sub_images import Mix, bm3d, bm3d_mosaic
from rodcone.types import Image, Plane
from sensor.cfa import Tile, channel_map
from sensor.raw import RawImage

Demosaic = Callable[[Plane, Tile], Image]
Denoise = Callable[[Image, Sequence[float]], Image]  # function of planes and each plane's standard deviation of noise
# Noise that BM3D assumes after demosaicking, over the mosaic's noise (docs/decisions/0039-the-strongest-opponents.md).
NOISE_AFTER_DEMOSAICKING = 1.75
# Orthonormal rows that turn R, G and B into their mean and two differences.
OPPONENT = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])


def picture_bayer_nlm(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a Bayer raw image with `isp.interleaved.reconstruction.reconstruct`.

    Every sample, converted to green, guides the similarity. The colour matrix follows the noise at the light
    around each pixel, as in the interleaved camera.
    """
    require_bayer(raw.cfa)
    result = reconstruct_with_noise(raw, neutral=balance.expected(raw))
    planes = np.asarray(result.estimate, dtype=np.float64)
    return finish(raw, planes, colours, balance=balance, engine=result.engine, noise_gain=result.noise_gain)


def picture_denoised_first(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, mix: Mix, demosaic: Demosaic
) -> Picture:
    """Develop a Bayer raw image with BM3D on the mosaic, then demosaicking."""
    require_bayer(raw.cfa)
    return picture_demosaicked(raw, colours, balance=balance, demosaic=demosaic, electrons=bm3d_mosaic(raw, mix))


def picture_demosaicked_first(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, demosaic: Demosaic, denoise: Denoise | None = bm3d
) -> Picture:
    """Develop a Bayer raw image by demosaicking its noisy mosaic, followed by BM3D, another denoiser or none.

    At one level of light, a balanced channel of gain g has sqrt(g) times the shot noise of green. Stabilised samples
    are multiplied by sqrt(g), so that except for dark noise a neutral has equal samples in all channels, which
    demosaicking presupposes.
    """
    require_bayer(raw.cfa)
    mosaic, gains, sources = balance_mosaic(raw, raw.electrons, balance)
    names = raw.channels
    sites = channel_map(raw.cfa, raw.shape)
    gain = np.select([sites == name for name in names], gains.tolist())
    noise = raw.plain_noise
    stable = stabilise(mosaic / (gain * noise.shot), noise.dark_noise_e / noise.shot, 0.0) * np.sqrt(gain)
    planes = demosaic(stable, raw.cfa)
    if denoise is not None:
        sigma = NOISE_AFTER_DEMOSAICKING * np.sqrt(OPPONENT**2 @ gains)
        planes = denoise(planes @ OPPONENT.T, sigma.tolist()) @ OPPONENT
    electrons = unstabilise(planes / np.sqrt(gains), noise.dark_noise_e / noise.shot) * noise.shot
    return Picture(to_rgb(raw, electrons * gains, gains, colours, MALVAR_REACH), sources)
