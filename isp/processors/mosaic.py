"""Balanced mosaics: what demosaicking works on, and how its planes become a picture."""

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

    Demosaicking that carries detail from one colour to another supposes that their differences are smooth, which only
    holds where a neutral gives all of them the same.

    Parameters
    ----------
    raw : RawImage
        The exposure; Gray World is taken over its bilinear planes.
    electrons : (h, w) float64
        Its mosaic [e-], as it is or denoised.
    balance : WhiteBalance

    Returns
    -------
    (h, w) float64
        Mosaic in which a neutral reads the same electrons in every channel: green's [e-]. Beside a saturated colour
        sample no colour reads more than `isp.colour.highlights.highlight_level`, so that a neutral highlight is
        neutral in the mosaic already.
    (channel,) float64
        Gain of each channel.
    mapping of str to str
        Where each channel's gain comes from, as `Picture.balance` has it.
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
    """Linear sRGB of balanced planes of three colours that a filter of this reach made: highlights, matrix."""
    return np.asarray(clip_highlights(raw, planes, gains, reach) @ colours.matrix().T)
