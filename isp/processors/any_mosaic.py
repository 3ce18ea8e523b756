"""Interleaved reconstruction for mosaics of any channels: RCCB, RCCC, RYYB, quads, monochrome, or a user's own."""

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
    """Develop a raw image of any mosaic: eqs. (1)-(5), Gray World, and a noise-aware matrix over all channels.

    With three channels or more the picture has colours, as far as the channels distinguish them; with one or two it is
    a grey picture of luminance. Every sample guides the similarity, once it is converted to W or to the mosaic's unit
    channel, such as C of RCCB.

    Parameters
    ----------
    raw : RawImage
    colours : ColourFit
        Fit of the mosaic's channels.
    balance : WhiteBalance
    mosaic : str, optional
        Name in `sensor.cfa.MOSAICS`, whose channels the raw image must have.

    Returns
    -------
    Picture
        Picture in which a neutral has the electrons of `sensor.cfa.unit_channel`.
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
    """Convert balanced planes of a mosaic's channels to linear sRGB (h, w, 3) by a noise-aware matrix."""
    names = raw.channels
    if colours.plain is None:
        return np.asarray(balanced @ colours.matrix(names, noise).T)
    # A plain matrix is applied to three colours, and doesn't depend on noise.
    unit = names.index(raw.unit_channel)
    three = balanced[..., :3] if len(names) >= 3 else np.repeat(balanced[..., unit : unit + 1], 3, axis=-1)
    return np.asarray(three @ colours.plain.T)
