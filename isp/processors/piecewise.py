"""Piecewise linear estimation for any mosaic of R, G, B and W, by the prior of the project's own curves.

G. Yu, G. Sapiro, S. Mallat, "Solving inverse problems with piecewise linear estimators: from Gaussian mixture models to
structured sparsity", IEEE Trans. Image Process. 21(5), 2012, with a prior that is fixed beforehand as in D. Zoran, Y.
Weiss, "From learning models of natural image patches to whole image restoration", ICCV 2011. Ours: the mosaic's own
patch in units of its noise, light as a factor, coarser scales, and full samples as lower bounds
(docs/decisions/0036).
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
from isp.ple.prior import LETTERS, Prior, mixed_prior, own_prior
from isp.ple.pyramid import reconstruct
from isp.processors.any_mosaic import rgb_of_channels
from isp.processors.demosaic import require_bayer
from isp.strips import strips
from rodcone.errors import InputError
from rodcone.types import Floats, Singles
from sensor.cfa import RGBW, Tile, channels, is_rgbw
from sensor.raw import RawImage

# Share of the posterior variance that counts in the colour matrix. The estimate is a posterior mean, which is greyer
# than the truth by what noise hides; a matrix that counts all of the variance takes colours off a second time. To count
# none would cost strong colours 0.1 dB. It was chosen on pictures that judge nothing (docs/decisions/0062).
INDEPENDENT = 0.25
STRIP_ROWS = 128  # of planes that become a picture together
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
            f"raw: mosaic {raw.cfa} is not R, G, B and W in 2x2; allowed here: {RGBW} in any order; use ple_bayer for "
            "Bayer, ple for any mosaic"
        )
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def picture_ple_bayer(
    raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None
) -> Picture:
    """Develop a Bayer raw image; as `picture_ple_rgbw`."""
    require_bayer(raw.cfa)
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def picture_ple(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance, prior: Prior | None = None) -> Picture:
    """Develop a raw image of any tile of R, G, B and W that is 1, 2 or 4 pixels high and wide; as `picture_ple_rgbw`.

    Without R, G and B the matrix takes all channels; of one or two it makes a grey picture.
    """
    if not takes(raw.cfa) or min(raw.shape) < STRIDE:
        raise InputError(
            f"raw: mosaic {raw.cfa} of {raw.shape} pixels; allowed here: R, G, B and W in a tile of 1, 2 or 4 pixels a "
            "side, on 2x2 pixels or more; use any_mosaic"
        )
    return develop_planes(raw, colours, balance, prior or own_prior()).picture


def takes(tile: Tile) -> bool:
    """Whether `picture_ple` develops a tile: of R, G, B and W, 1, 2 or 4 pixels high and wide."""
    return {len(tile), len(tile[0])} <= set(SIDES) and set(channels(tile)) <= set(LETTERS)


@dataclass(frozen=True)
class PiecewisePicture:
    """A picture, and the planes that it was made of.

    Attributes
    ----------
    picture : Picture
    planes : (h, w, channel) float32
        Of every channel at every pixel [e-].
    gains : (channel,) float64
        White balance.
    """

    picture: Picture
    planes: Singles
    gains: Floats


def develop_planes(raw: RawImage, colours: ColourFit, balance: WhiteBalance, prior: Prior) -> PiecewisePicture:
    """Develop a raw image as `picture_ple`, whose tile the caller has checked."""
    names, unit = raw.channels, raw.unit_channel
    index = [LETTERS.index(name) for name in names]
    prior = _as_it_reads(raw, prior, balance.neutral)
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
    # Where pixels exchange charge, W tells how much of it is in the colours.
    used = 3 if coloured and not (raw.crosstalk and colours.plain is None) else len(names)
    matrix = colours.matrix(names[:used], noise[:used]) if coloured else None
    highlights = Highlights.of(raw, gains)
    rgb = np.empty((*raw.shape, 3))
    for rows in strips(len(rgb), STRIP_ROWS):
        balanced = highlights.held(planes[rows, :, :used].astype(np.float64) * gains[:used], rows)
        rgb[rows] = rgb_of_channels(raw, balanced, colours, noise) if matrix is None else balanced @ matrix.T
    return PiecewisePicture(Picture(rgb, sources), planes, gains)


def _as_it_reads(raw: RawImage, prior: Prior, neutral: Floats | None) -> Prior:
    """Prior of the channels as crosstalk mixes them, under the light of the calibrated neutral."""
    if not raw.crosstalk:
        return prior
    index = [LETTERS.index(name) for name in raw.channels]
    mixing = np.eye(len(LETTERS))
    mixing[np.ix_(index, index)] = raw.channel_mixing
    white_e = mixing @ prior.neutral_e
    if neutral is not None:
        white_e[index] = neutral / neutral[raw.channels.index(raw.unit_channel)]
    return mixed_prior(prior, mixing, white_e)


def curves_differ(prior: Prior, neutral: Floats, index: Sequence[int]) -> bool:
    """Whether a calibrated neutral lies far from those of the prior's curves, under any mix of two known lights.

    Of channels `index` among R, G, B and W; G counts as sure, or the last one where there is none.
    """
    sure = index.index(LETTERS.index("G")) if LETTERS.index("G") in index else -1
    prior_log = np.log(prior.neutrals_e[:, index] / prior.neutrals_e[:, index[sure], None])
    camera_log = np.log(neutral / neutral[sure])
    along = prior_log[:, None] - prior_log
    share = ((camera_log - prior_log) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-12)
    nearest = prior_log + np.clip(share, 0.0, 1.0)[..., None] * along
    return bool(np.abs(nearest - camera_log).max(axis=-1).min() > OTHER_CURVES)
