"""Piecewise linear estimation for RGBW and for Bayer, by the prior of the project's own curves.

G. Yu, G. Sapiro, S. Mallat, "Solving inverse problems with piecewise linear estimators: from Gaussian mixture models to
structured sparsity", IEEE Trans. Image Process. 21(5), 2012, with a prior that is fixed beforehand as in D. Zoran, Y.
Weiss, "From learning models of natural image patches to whole image restoration", ICCV 2011. Ours: the mosaic's own
patch in units of its noise, light as a factor, coarser scales, and full samples as lower bounds
(docs/decisions/0036).
"""

import warnings

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture, finish
from isp.ple.prior import LETTERS, own_prior
from isp.ple.pyramid import reconstruct
from isp.substitution import COLOUR_ERROR
from rodcone.errors import InputError
from sensor.cfa import channels, is_bayer, is_rgbw
from sensor.raw import RawImage

OTHER_CURVES = 0.25  # of a channel's ratio to green, by which a neutral may differ from the prior's under D65


def picture_piecewise(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop an RGBW or Bayer raw image, whose tile is 2x2, with the prior of the project's own curves.

    Raises
    ------
    InputError
        For another tile.

    Warns
    -----
    UserWarning
        Where the calibrated neutral shows other curves than the prior's.
    """
    if not (is_rgbw(raw.cfa) or is_bayer(raw.cfa)):
        raise InputError(f"raw: mosaic {raw.cfa} is not allowed; allowed: 2x2 with R, G, B and W, or Bayer's; use another")
    prior = own_prior()
    names = channels(raw.cfa)
    own = prior.neutral_e[[LETTERS.index(name) for name in names]]
    if balance.neutral is not None:
        off = np.abs(np.log(balance.neutral / balance.neutral[names.index("G")] / own))
        if off.max() > OTHER_CURVES:
            warnings.warn(
                f"curves: a neutral reads {np.round(balance.neutral / balance.neutral[names.index('G')], 3).tolist()} "
                f"in {names}, the prior's {np.round(own, 3).tolist()}; train another: rodcone train --sensor NAME",
                UserWarning,
                stacklevel=2,
            )
    planes, variance = reconstruct(raw, prior)
    gain = np.broadcast_to(variance[:3] / COLOUR_ERROR, (*raw.shape, 3))
    return finish(raw, planes[..., :3].astype(np.float64), colours, balance=balance, noise_gain=gain)
