"""Pipelines from a raw image to linear sRGB for the paper's two cameras: interleaved RGBW and conventional Bayer."""

import numpy as np

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.highlights import clip_highlights
from isp.colour.light_around import LIGHTS, apply_by_light, light_around
from isp.colour.white_balance import WhiteBalance
from isp.interleaved.edges import sharpen
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.interleaved.saturation import saturated_fraction
from isp.interleaved.thin import follow_samples
from isp.picture import Picture, finish, require_letters
from isp.planes import bilinear, rows_at
from isp.settings import DEFAULTS, PAPER, Settings
from isp.substitution import SMOOTH_COLOUR_ERROR, SUBSTITUTION_SNR, green_snr, matrix_with_white, substitution_weight
from rodcone.errors import InputError
from sensor.raw import RawImage


def picture_interleaved(
    raw: RawImage,
    colours: ColourFit,
    *,
    balance: WhiteBalance,
    settings: Settings = DEFAULTS,
    substitution_snr: float = SUBSTITUTION_SNR,
) -> Picture:
    """Develop an interleaved RGBW raw image: eqs. (1)-(5), Gray World, a matrix by light, substitution.

    Parameters
    ----------
    raw : RawImage
        Mosaic with R, G, B and W.
    colours : ColourFit
        A fit of all channels (`isp.colour.colour_fit.fit_colours`) uses W for the colours as far as their noise makes
        it useful; a plain matrix (`ColourFit.of`) doesn't.
    balance : WhiteBalance
        Gray World, or a response to what should become neutral, such as a file's as-shot neutral.
    settings : Settings
        Settings of `isp.interleaved.reconstruction.reconstruct`.
    substitution_snr : float
        SNR of the frame's green at which W gives half of the luminance; below it W gives more. 0 means never, inf
        always.

    Returns
    -------
    Picture
        Linear sRGB, not clipped to the display, and the decisions. A neutral has the electrons of a green pixel.

    Raises
    ------
    InputError
        For a mosaic with other channels.
    """
    require_letters(raw, ("R", "G", "B", "W"))
    result = reconstruct_with_noise(raw, settings, balance.expected(raw))
    if result.white is None:
        raise InputError("settings.distance: 'raw' isn't allowed; give 'noise', or take picture_interleaved_paper")
    gains, sources = balance.gains(raw, result.estimate)
    noise = relative_noise(raw, result.estimate, result.noise_gain, gains, colours, LIGHTS)
    snr = green_snr(raw, result.estimate)
    weight = substitution_weight(snr, substitution_snr)
    planes = follow_samples(result.white, result.estimate, result.noise_gain)
    planes = sharpen(result.white, planes, gains, result.noise_gain)
    balanced = clip_highlights(raw, planes * gains, gains)
    matrices = np.array([matrix_with_white(colours, at_light, weight) for at_light in noise])
    rgb = apply_by_light(balanced, light_around(raw, balanced[..., raw.channels.index("W")]), matrices)
    return Picture(rgb, sources, engine=result.engine, snr=snr, substitution=weight)


def picture_interleaved_paper(
    raw: RawImage,
    colours: ColourFit,
    *,
    balance: WhiteBalance,
    settings: Settings = PAPER,
    substitution_snr: float = SUBSTITUTION_SNR,
) -> Picture:
    """Develop an interleaved RGBW raw image as in the paper; parameters are those of `picture_interleaved`.

    Distances are in electrons, alpha is counted over the patch, a plain 3x3 matrix doesn't use W, and the luminance is
    switched to W. By default `settings` is `isp.settings.PAPER`, whose patch of one pixel makes it a bilateral filter;
    `PAPER_5X5` is the paper's non-local means.
    """
    require_letters(raw, ("R", "G", "B", "W"))
    colours = ColourFit.of(colours.matrix())
    result = reconstruct_with_noise(raw, settings)
    gains, sources = balance.gains(raw, result.estimate)
    noise = relative_noise(raw, result.estimate, result.noise_gain, gains, colours)
    snr = green_snr(raw, result.estimate)
    weight = float(substitution_weight(snr, substitution_snr) > 0.5)
    balanced = clip_highlights(raw, result.estimate * gains, gains)

    # Alpha of eq. (6), the share of saturated pixels around, is also the share in which W is left out of the colours.
    rgb = balanced @ matrix_with_white(colours, noise, weight).T
    alpha = saturated_fraction(raw, settings.patch)
    mixed = alpha > 0.0
    without = alpha[mixed, None]
    without_white = colours.matrix("RGB", noise[:3] * SMOOTH_COLOUR_ERROR)
    rgb[mixed] = (1.0 - without) * rows_at(rgb, mixed) + without * (rows_at(balanced, mixed)[:, :3] @ without_white.T)
    return Picture(rgb, sources, engine=result.engine, snr=snr, substitution=weight)


def picture_bayer(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a Bayer raw image: bilinear demosaicking, Gray World, matrix; see `picture_interleaved`."""
    require_letters(raw, ("R", "G", "B"))
    return finish(raw, bilinear(raw), colours, balance=balance)
