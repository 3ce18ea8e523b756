"""Balanced mosaics: what demosaicking works on, and how its planes become a picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.camera_colour import Balance
from isp.colour.white_balance import clip_highlights, full_e, saturated_nearby, white_balance
from isp.picture import Picture, checked_matrix
from isp.planes import Plane
from isp.processors.bayer import bilinear
from sensor.cfa import channels, letter_map
from sensor.raw import RawImage

Image = NDArray[np.float64]


@dataclass(frozen=True)
class BalancedMosaic:
    """A mosaic in which a neutral reads the same electrons in every letter: green's.

    Attributes
    ----------
    values : (h, w) float64
        [e-]; beside a saturated colour sample no colour reads more than green's full well, so that a neutral highlight
        is neutral in the mosaic already.
    balance : Balance
    """

    values: Plane
    balance: Balance


def balance_mosaic(
    raw: RawImage, electrons: Plane, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> BalancedMosaic:
    """Balance a mosaic before it is demosaicked, as raw converters do.

    Demosaicking that carries detail from one colour to another supposes that their differences are smooth, which only
    holds where a neutral gives all of them the same.

    Parameters
    ----------
    raw : RawImage
        The exposure; Gray World is taken over its bilinear planes.
    electrons : (h, w) float64
        Its mosaic [e-], as it is or denoised.
    neutral, balance
        As `isp.pipeline.develop_bayer`.
    """
    white = white_balance(raw, bilinear(raw), neutral, balance)
    sites = letter_map(raw.cfa, raw.shape)
    gain = np.zeros(raw.shape)
    for letter, one in zip(channels(raw.cfa), white.gains, strict=True):
        gain[sites == letter] = one
    values = electrons * gain
    held = saturated_nearby(raw, "RGB", 1) & (sites != "W")
    return BalancedMosaic(np.where(held, np.minimum(values, full_e(raw)), values), white)


def as_picture(raw: RawImage, rgb: Image, balance: Balance) -> Picture:
    """Picture of linear sRGB, with the decisions of its balance."""
    return Picture(rgb, dict(zip(channels(raw.cfa), balance.sources, strict=True)), None, None, "numpy")


def to_rgb(raw: RawImage, planes: Image, matrix: ArrayLike, reach: int) -> Image:
    """Linear sRGB of balanced planes of R, G and B that a filter of this reach made: highlights, matrix."""
    return np.asarray(clip_highlights(raw, planes, reach) @ checked_matrix(matrix).T)
