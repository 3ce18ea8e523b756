"""Pipelines of the paper's two cameras, from a raw image to linear sRGB: interleaved RGBW, and conventional Bayer."""

from isp.colour.colour_fit import ColourFit, relative_noise
from isp.colour.highlights import clip_highlights
from isp.colour.white_balance import WhiteBalance
from isp.interleaved.edges import sharpen
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.interleaved.saturation import saturated_fraction
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
    """Develop an interleaved RGBW raw image: eqs. (1)-(5), Gray World, matrix, substitution.

    Parameters
    ----------
    raw : RawImage
        Mosaic with R, G, B and W.
    colours : ColourFit
        A fit of all channels (`isp.colour.colour_fit.fit_colours`) lets W into the colours as far as the noise
        asks; one of a plain matrix (`ColourFit.of`) doesn't.
    balance : WhiteBalance
        Gray World's, or a response to what should come out neutral, such as a file's as-shot neutral.
    settings : Settings
        Of `isp.interleaved.reconstruction.reconstruct`.
    substitution_snr : float
        W gives half of the luminance where the frame's green SNR is this, more under it; 0 never, inf always.

    Returns
    -------
    Picture
        Linear sRGB, not clipped to the display, and the decisions; a neutral reads the electrons of a green pixel.

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
    noise = relative_noise(raw, result.estimate, result.noise_gain, gains, colours)
    snr = green_snr(raw, result.estimate)
    weight = substitution_weight(snr, substitution_snr)
    planes = sharpen(result.white, result.estimate, gains, result.noise_gain)
    balanced = clip_highlights(raw, planes * gains, gains)
    rgb = balanced @ matrix_with_white(colours, noise, weight).T
    return Picture(rgb, sources, engine=result.engine, snr=snr, substitution=weight)


def picture_interleaved_paper(
    raw: RawImage,
    colours: ColourFit,
    *,
    balance: WhiteBalance,
    settings: Settings = PAPER,
    substitution_snr: float = SUBSTITUTION_SNR,
) -> Picture:
    """Develop an interleaved RGBW raw image as the paper writes it; parameters as `picture_interleaved`.

    Distances in electrons, alpha counted over the patch, a plain 3x3 matrix without W, and a switch to W's luminance.
    `settings` is `isp.settings.PAPER`, one pixel, the bilateral filter; `PAPER_5X5` is its non-local means.
    """
    require_letters(raw, ("R", "G", "B", "W"))
    colours = ColourFit.of(colours.matrix())
    result = reconstruct_with_noise(raw, settings)
    gains, sources = balance.gains(raw, result.estimate)
    noise = relative_noise(raw, result.estimate, result.noise_gain, gains, colours)
    snr = green_snr(raw, result.estimate)
    weight = float(substitution_weight(snr, substitution_snr) > 0.5)
    balanced = clip_highlights(raw, result.estimate * gains, gains)

    # W leaves the colours as eq. (6) leaves it out of the similarity: by the share of saturated pixels around.
    rgb = balanced @ matrix_with_white(colours, noise, weight).T
    alpha = saturated_fraction(raw, settings.patch)
    mixed = alpha > 0.0
    without = alpha[mixed, None]
    without_white = colours.matrix("RGB", noise[:3] * SMOOTH_COLOUR_ERROR)
    rgb[mixed] = (1.0 - without) * rows_at(rgb, mixed) + without * (rows_at(balanced, mixed)[:, :3] @ without_white.T)
    return Picture(rgb, sources, engine=result.engine, snr=snr, substitution=weight)


def picture_bayer(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a Bayer raw image: bilinear demosaicking, Gray World, matrix; parameters as `picture_interleaved`."""
    require_letters(raw, ("R", "G", "B"))
    return finish(raw, bilinear(raw), colours, balance=balance)
