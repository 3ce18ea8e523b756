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

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture, finish
from isp.ple.prior import LETTERS, Prior, own_prior
from isp.ple.pyramid import reconstruct
from isp.substitution import COLOUR_ERROR
from render.spectrum import Floats
from rodcone.errors import InputError
from sensor.cfa import channels, is_bayer, is_rgbw
from sensor.raw import RawImage

OTHER_CURVES = 0.1  # in the logarithm of a channel over green: how far a neutral may lie from those of known lights


def picture_piecewise(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop an RGBW or Bayer raw image, whose tile is 2x2.

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
    if not (is_rgbw(raw.cfa) or is_bayer(raw.cfa)):
        raise InputError(
            f"raw: mosaic {raw.cfa} is not allowed here; allowed: R, G, B and W in 2x2, or Bayer's; use another processor"
        )
    prior = prior or own_prior()
    index = [LETTERS.index(name) for name in channels(raw.cfa)]
    if balance.neutral is not None:
        neutral = np.round(balance.neutral / balance.neutral[index.index(1)], 3)
        if curves_differ(prior, neutral, index):
            warnings.warn(
                f"curves: a neutral reads {neutral.tolist()} in {''.join(channels(raw.cfa))}, as under no light that the "
                "prior of ple knows; its pictures may be poor; train one for this sensor: rodcone train --sensor NAME",
                UserWarning,
                stacklevel=2,
            )
    planes, variance = reconstruct(raw, prior)
    gain = np.broadcast_to(variance[:3] / COLOUR_ERROR, (*raw.shape, 3))
    return finish(raw, planes[..., :3].astype(np.float64), colours, balance=balance, noise_gain=gain)


def curves_differ(prior: Prior, neutral: Floats, index: Sequence[int]) -> bool:
    """Whether a calibrated neutral lies far from those of the prior's curves, under any mix of two known lights."""
    known = np.log(prior.neutrals_e[:, index])
    seen = np.log(np.maximum(neutral, 1e-9))
    along = known[:, None] - known
    share = ((seen - known) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12)
    nearest = known + np.clip(share, 0.0, 1.0)[..., None] * along
    return bool(np.abs(nearest - seen).max(axis=-1).min() > OTHER_CURVES)
