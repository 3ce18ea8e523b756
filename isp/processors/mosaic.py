"""White balance of a mosaic before demosaicking, and conversion of its planes to a picture after it."""

from collections.abc import Mapping

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.colour.highlights import clip_highlights, highlight_level, saturated_nearby
from isp.colour.white_balance import BalanceSource, WhiteBalance
from isp.planes import bilinear
from rodcone.types import Floats, Image, Mosaic, Plane
from sensor.cfa import channel_map
from sensor.raw import RawImage


def balance_mosaic(
    raw: RawImage, electrons: Mosaic, balance: WhiteBalance
) -> tuple[Plane, Floats, Mapping[str, BalanceSource]]:
    """Balance a mosaic before it is demosaicked, as raw converters do.

    Demosaicking that carries detail from one colour to another presupposes that their differences are smooth. That is
    true only if a neutral gives the same signal in all of them.

    Parameters
    ----------
    raw : RawImage
        The exposure, over whose bilinear planes Gray World averages.
    electrons : (h, w) float64
        Its mosaic [e-], perhaps denoised.
    balance : WhiteBalance

    Returns
    -------
    (h, w) float64
        Mosaic in which a neutral has the electrons of green in every channel [e-]. Beside a saturated colour sample
        colours are limited to `isp.colour.highlights.highlight_level`, so that a neutral highlight is already neutral
        in the mosaic.
    (channel,) float64
        Gain of each channel.
    mapping of str to str
        Origin of each channel's gain, as in `Picture.balance`.
    """
    gains, sources = balance.gains(raw, bilinear(raw))
    sites = channel_map(raw.cfa, raw.shape)
    factors = np.zeros(raw.shape)
    for name, factor in zip(raw.channels, gains, strict=True):
        factors[sites == name] = factor
    values = electrons * factors
    clipped = saturated_nearby(raw, "RGB", 1) & (sites != "W")
    return np.where(clipped, np.minimum(values, highlight_level(raw, gains)), values), gains, sources


def to_rgb(raw: RawImage, planes: Image, gains: Floats, colours: ColourFit, reach: int) -> Image:
    """Limit highlights of balanced planes of three colours, and convert the planes to linear sRGB.

    `reach` is the reach of the filter that made the planes [pixels].
    """
    return np.asarray(clip_highlights(raw, planes, gains, reach) @ colours.matrix().T)
