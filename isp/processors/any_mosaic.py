"""Mosaics of any channels, RCCB, RCCC, RYYB, quads, a camera without colours, one's own: interleaved."""

import numpy as np

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.highlights import clip_highlights
from isp.colour.white_balance import WhiteBalance
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.picture import Picture, require_letters
from isp.settings import DEFAULTS, Settings
from isp.substitution import COLOUR_ERROR
from rodcone.types import Floats, Plane
from sensor.cfa import channels, tile_of
from sensor.raw import RawImage


def picture_any_mosaic(
    raw: RawImage,
    colours: ColourFit,
    *,
    balance: WhiteBalance,
    mosaic: str | None = None,
    settings: Settings = DEFAULTS,
) -> Picture:
    """Develop a raw image of any mosaic: eqs. (1)-(5), Gray World, a matrix over all channels that knows their noise.

    With three channels or more the picture has colours as far as these tell them; one or two give a grey picture of
    luminance. Every sample guides the similarity, read as W, or as the mosaic's unit, such as C of RCCB.

    Parameters
    ----------
    raw : RawImage
    colours : ColourFit
        Of the mosaic's channels.
    balance : WhiteBalance
    mosaic : str, optional
        Name of `sensor.cfa.MOSAICS`; other channels than its own are refused.

    Returns
    -------
    Picture
        A neutral reads the electrons of `sensor.cfa.unit_channel`.
    """
    if mosaic is not None:
        require_letters(raw, channels(tile_of(mosaic)))

    result = reconstruct_with_noise(raw, settings, balance.expected(raw))
    planes = np.asarray(result.estimate, dtype=np.float64)
    gains, sources = balance.gains(raw, planes)
    balanced = clip_highlights(raw, planes * gains, gains)
    noise = np.zeros(len(gains))
    if colours.plain is None:
        noise = relative_noise(raw, planes, result.noise_gain, gains, colours) * COLOUR_ERROR
    return Picture(rgb_of_channels(raw, balanced, colours, noise), sources, engine=result.engine)


def rgb_of_channels(raw: RawImage, balanced: Plane, colours: ColourFit, noise: Floats) -> Plane:
    """Take balanced planes of a mosaic's channels to linear sRGB (h, w, 3), by a matrix that knows their noise."""
    names = raw.channels
    if colours.plain is None:
        return np.asarray(balanced @ colours.matrix(names, noise).T)
    # It knows three colours, and no noise.
    unit = names.index(raw.unit_channel)
    three = balanced[..., :3] if len(names) >= 3 else np.repeat(balanced[..., unit : unit + 1], 3, axis=-1)
    return np.asarray(three @ colours.plain.T)
