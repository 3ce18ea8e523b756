"""Piecewise linear estimation for RGBW and for Bayer, by the prior of the project's own curves.

G. Yu, G. Sapiro, S. Mallat, "Solving inverse problems with piecewise linear estimators: from Gaussian mixture models to
structured sparsity", IEEE Trans. Image Process. 21(5), 2012, with a prior that is fixed beforehand as in D. Zoran, Y.
Weiss, "From learning models of natural image patches to whole image restoration", ICCV 2011. Ours: the mosaic's own
patch in units of its noise, light as a factor, coarser scales, and full samples as lower bounds
(docs/decisions/0036).
"""

import warnings
from collections.abc import Sequence

import numpy as np

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.highlights import clip_highlights
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.ple.prior import LETTERS, Prior, own_prior
from isp.ple.pyramid import reconstruct
from isp.processors.demosaic import require_bayer
from render.spectrum import Floats
from rodcone.errors import InputError
from sensor.cfa import RGBW, channels, is_rgbw
from sensor.raw import RawImage

OTHER_CURVES = 0.1  # in the logarithm of a channel over green: how far a neutral may lie from those of known lights


def picture_ple_rgbw(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop an RGBW raw image whose tile is 2x2.

    Parameters
    ----------
    raw, colours, balance
        As `isp.processors.catalogue.Processor.develop` makes them.
    prior : Prior, optional
        Of the camera's curves; that of the project's own ones where left out.

    Raises
    ------
    InputError
        For another tile.

    Warns
    -----
    UserWarning
        Where the calibrated neutral can't be that of the prior's curves.
    """
    if not is_rgbw(raw.cfa):
        raise InputError(
            f"raw: mosaic {raw.cfa} is not R, G, B and W in 2x2; allowed here: {RGBW} in any order; use another camera"
        )
    return _developed(raw, colours, balance, prior or own_prior())


def picture_ple_bayer(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop a Bayer raw image; as `picture_ple_rgbw`."""
    require_bayer(raw.cfa)
    return _developed(raw, colours, balance, prior or own_prior())


def _developed(raw: RawImage, colours: ColourFit, balance: WhiteBalance, prior: Prior) -> Picture:
    index = [LETTERS.index(name) for name in channels(raw.cfa)]
    white_e = prior.neutral_e.copy()
    if balance.neutral is not None:
        if curves_differ(prior, balance.neutral, index):
            warnings.warn(
                f"curves: a neutral reads {np.round(balance.neutral, 3).tolist()} in {''.join(channels(raw.cfa))}, as "
                "under no light that this prior knows; its pictures may be poor; train one by `rodcone train`",
                UserWarning,
                stacklevel=2,
            )
        white_e[index] = balance.neutral / balance.neutral[index.index(LETTERS.index("G"))]
    found, variance = reconstruct(raw, prior, white_e)
    planes = found.astype(np.float64)
    gains, sources = balance.gains(raw, planes)
    # The posterior variance is all of the error: no factor on it, as weighted means of samples need.
    noise = relative_noise(raw, planes, np.broadcast_to(variance, planes.shape), gains, colours)[:3]
    rgb = clip_highlights(raw, planes[..., :3] * gains[:3]) @ colours.matrix(noise=noise).T
    return Picture(rgb, sources)


def curves_differ(prior: Prior, neutral: Floats, index: Sequence[int]) -> bool:
    """Whether a calibrated neutral lies far from those of the prior's curves, under any mix of two known lights."""
    known = np.log(prior.neutrals_e[:, index])
    seen = np.log(neutral / neutral[index.index(LETTERS.index("G"))])
    along = known[:, None] - known
    share = ((seen - known) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12)
    nearest = known + np.clip(share, 0.0, 1.0)[..., None] * along
    return bool(np.abs(nearest - seen).max(axis=-1).min() > OTHER_CURVES)
