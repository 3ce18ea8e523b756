"""The two cameras' pipelines: raw image in, scene-linear RGB out."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.balance import clip_highlights, white_balance
from isp.bayer import bilinear
from isp.colour_fit import ColourFit, relative_noise
from isp.interleaved import reconstruct_with_noise
from isp.picture import Picture, checked_matrix, finish, require_letters
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S, Settings
from isp.similarity.guide import saturated_fraction
from isp.substitution import (
    OCTAVES,
    SUBSTITUTION_SNR,
    green_snr,
    matrix_with_white,
    matrix_without_white,
    substitution_weight,
)
from sensor.raw import RawImage

Image = NDArray[np.float64]


def develop_interleaved(
    raw: RawImage,
    matrix: ArrayLike | ColourFit,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | None = None,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    substitution_snr: float = SUBSTITUTION_SNR,
    octaves: float = OCTAVES,
) -> Image:
    """Develop an interleaved RGBW raw image; `picture_interleaved` gives the decisions beside the picture.

    Parameters
    ----------
    raw : RawImage
        Mosaic with R, G, B and W.
    matrix : (3, 3) array_like or ColourFit
        From balanced R, G, B to linear sRGB (`isp.colour.fit_matrix`). A fit of all channels
        (`isp.colour_fit.fit_colours`) lets W into the colours where it isn't saturated, as far as the noise asks.
    neutral : (channel,) array_like, optional
        Calibrated response to a neutral, in the order of `sensor.cfa.channels`: the white balance of pictures that are
        too dark for Gray World. The project's own curves under D65 by default.
    balance : (channel,) array_like, optional
        Response to what shall come out neutral, such as a file's as-shot neutral, in place of Gray World's means.
    neighbourhood, patch, sigma_d, sigma_s
        Of `isp.settings.Settings`.
    substitution_snr : float
        W gives half of the luminance where the frame's green SNR is this, more under it; 0 never, inf always.
    octaves : float
        Of `isp.substitution.substitution_weight`; 0 is the paper's switch.

    Returns
    -------
    (h, w, 3) float64
        Linear sRGB, not clipped to the display; a neutral reads the electrons of a green pixel.

    Raises
    ------
    InputError
        For a mosaic without these letters, or a matrix of another shape.
    """
    return picture_interleaved(
        raw,
        matrix,
        neutral=neutral,
        balance=balance,
        neighbourhood=neighbourhood,
        patch=patch,
        sigma_d=sigma_d,
        sigma_s=sigma_s,
        substitution_snr=substitution_snr,
        octaves=octaves,
    ).rgb


def picture_interleaved(
    raw: RawImage,
    matrix: ArrayLike | ColourFit,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | None = None,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    substitution_snr: float = SUBSTITUTION_SNR,
    octaves: float = OCTAVES,
) -> Picture:
    """As `develop_interleaved`, with the decisions: eqs. (1)-(6), Gray World, matrix, luminance substitution."""
    letters = require_letters(raw, ("R", "G", "B", "W"))
    if not isinstance(matrix, ColourFit):
        matrix = checked_matrix(matrix)
    settings = Settings(neighbourhood=neighbourhood, patch=patch, sigma_d=sigma_d, sigma_s=sigma_s)
    result = reconstruct_with_noise(raw, settings)
    planes = np.asarray(result.estimate, dtype=np.float64)
    white = white_balance(raw, planes, neutral, balance)
    snr = green_snr(raw, planes)
    weight = substitution_weight(snr, substitution_snr, octaves)
    noise = (
        relative_noise(raw, planes, result.noise_gain, white.gains, matrix) if isinstance(matrix, ColourFit) else 0.0
    )
    balanced = clip_highlights(raw, planes * white.gains)
    # W leaves the colours as eq. (6) leaves it out of the similarity: by the share of saturated pixels around.
    alpha = saturated_fraction(raw)[..., None]
    rgb = (1.0 - alpha) * (balanced @ matrix_with_white(matrix, noise, weight).T)
    rgb += alpha * (balanced[..., :3] @ matrix_without_white(matrix, noise).T)
    return Picture(rgb, dict(zip(letters, white.sources, strict=True)), snr, weight > 0.5, result.engine, weight)


def develop_bayer(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Image:
    """Develop a Bayer raw image: bilinear demosaicking, Gray World, matrix; parameters as `develop_interleaved`."""
    return picture_bayer(raw, matrix, neutral=neutral, balance=balance).rgb


def picture_bayer(
    raw: RawImage, matrix: ArrayLike, *, neutral: ArrayLike | None = None, balance: ArrayLike | None = None
) -> Picture:
    """As `develop_bayer`, with the decisions."""
    require_letters(raw, ("R", "G", "B"))
    return finish(raw, bilinear(raw), matrix, neutral=neutral, balance=balance)
