"""Piecewise linear estimation for any mosaic of R, G, B and W, by the prior of the project's own curves.

G. Yu, G. Sapiro, S. Mallat, "Solving inverse problems with piecewise linear estimators: from Gaussian mixture models to
structured sparsity", IEEE Trans. Image Process. 21(5), 2012, with a prior that is fixed beforehand as in D. Zoran, Y.
Weiss, "From learning models of natural image patches to whole image restoration", ICCV 2011. This project adds
patches of the mosaic in units of its noise, light as a factor of each patch, coarser scales, and full samples as lower
bounds (docs/decisions/0036).
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.highlights import Highlights
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.ple.mosaic import SIDES
from isp.ple.overlap import STRIDE
from isp.ple.prior import LETTERS, Prior, own_prior
from isp.ple.pyramid import reconstruct
from isp.processors.any_mosaic import rgb_of_channels
from isp.processors.demosaic import require_bayer
from isp.strips import strips
from rodcone.errors import InputError
from rodcone.types import Floats, Singles
from sensor.cfa import RGBW, Tile, channels, is_rgbw
from sensor.raw import RawImage

# Share of the posterior variance that counts in the colour matrix. The estimate is a posterior mean, which is greyer
# than the truth where noise hides colour. A matrix that counts the whole variance would reduce colours a second time;
# one that counts none would cost strong colours 0.1 dB. The share was chosen on pictures that no result is measured on
# (docs/decisions/0062).
INDEPENDENT = 0.25
STRIP_ROWS = 128  # rows that are converted from planes to a picture together
OTHER_CURVES = 0.1  # largest difference of a neutral from those of known lights, in the logarithm of channel over green


def picture_ple_rgbw(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop an RGBW raw image whose tile is 2x2.

    Parameters
    ----------
    raw, colours, balance
        As `isp.processors.catalogue.Processor.develop` passes them.
    prior : Prior, optional
        Prior of the camera's curves, by default that of the project's own curves.

    Raises
    ------
    InputError
        For another tile.

    Warns
    -----
    UserWarning
        If the calibrated neutral can't belong to the prior's curves.
    """
    if not is_rgbw(raw.cfa):
        raise InputError(
            f"raw: mosaic {raw.cfa} is not R, G, B and W in 2x2; allowed here: {RGBW} in any order; use ple_bayer for "
            "Bayer, ple for any mosaic"
        )
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def picture_ple_bayer(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop a Bayer raw image; parameters are those of `picture_ple_rgbw`."""
    require_bayer(raw.cfa)
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def picture_ple(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None) -> Picture:
    """Develop a raw image of any tile of R, G, B and W that is 1, 2 or 4 pixels high and wide; see `picture_ple_rgbw`.

    If the tile lacks R, G or B, the matrix is one of all channels; with one or two channels the picture is grey.
    """
    if not takes(raw.cfa) or min(raw.shape) < STRIDE:
        raise InputError(
            f"raw: mosaic {raw.cfa} of {raw.shape} pixels; allowed here: R, G, B and W in a tile of 1, 2 or 4 pixels a "
            "side, on 2x2 pixels or more; use any_mosaic"
        )
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def takes(tile: Tile) -> bool:
    """Return whether `picture_ple` accepts a tile: one of only R, G, B and W that is 1, 2 or 4 pixels high and wide."""
    return {len(tile), len(tile[0])} <= set(SIDES) and set(channels(tile)) <= set(LETTERS)


@dataclass(frozen=True)
class PiecewisePicture:
    """A picture, and the planes from which it was made.

    Attributes
    ----------
    picture : Picture
    planes : (h, w, channel) float32
        Every channel at every pixel [e-].
    gains : (channel,) float64
        White balance.
    """

    picture: Picture
    planes: Singles
    gains: Floats


def develop_planes(raw: RawImage, colours: ColourFit, balance: WhiteBalance, prior: Prior) -> PiecewisePicture:
    """Develop a raw image as `picture_ple` does; the caller has checked its tile."""
    names, unit = raw.channels, raw.unit_channel
    index = [LETTERS.index(name) for name in names]
    white_e = prior.neutral_e.copy()
    if balance.neutral is not None:
        if curves_differ(prior, balance.neutral, index):
            warnings.warn(
                f"curves: a neutral reads {np.round(balance.neutral, 3).tolist()} in {''.join(names)}, as "
                "under no light that this prior knows; its pictures may be poor; train one by `rodcone train`",
                UserWarning,
                stacklevel=2,
            )
        white_e[index] = balance.neutral / balance.neutral[names.index(unit)] * prior.neutral_e[LETTERS.index(unit)]
    planes, variance = reconstruct(raw, prior, white_e)
    gains, sources = balance.gains(raw, planes)
    noise = relative_noise(raw, planes, INDEPENDENT * variance, gains, colours)
    coloured = {"R", "G", "B"} <= set(names)
    used = 3 if coloured else len(names)
    matrix = colours.matrix(names[:used], noise[:used]) if coloured else None
    highlights = Highlights.of(raw, gains)
    rgb = np.empty((*raw.shape, 3))
    for rows in strips(len(rgb), STRIP_ROWS):
        balanced = highlights.held(planes[rows, :, :used].astype(np.float64) * gains[:used], rows)
        rgb[rows] = rgb_of_channels(raw, balanced, colours, noise) if matrix is None else balanced @ matrix.T
    return PiecewisePicture(Picture(rgb, sources), planes, gains)


def curves_differ(prior: Prior, neutral: Floats, index: Sequence[int]) -> bool:
    """Return whether a calibrated neutral is far from that of the prior's curves under any mix of two known lights.

    The channels are those of `index` among R, G, B and W. They are compared relative to G, or without it to the last.
    """
    sure = index.index(LETTERS.index("G")) if LETTERS.index("G") in index else -1
    prior_log = np.log(prior.neutrals_e[:, index] / prior.neutrals_e[:, index[sure], None])
    camera_log = np.log(neutral / neutral[sure])
    along = prior_log[:, None] - prior_log
    share = ((camera_log - prior_log) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12)
    nearest = prior_log + np.clip(share, 0.0, 1.0)[..., None] * along
    return bool(np.abs(nearest - camera_log).max(axis=-1).min() > OTHER_CURVES)
