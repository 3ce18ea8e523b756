"""The two cameras' pipelines: raw image in, scene-linear RGB out."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.balance import clip_highlights, saturated_nearby, white_balance
from isp.bayer import bilinear
from isp.interleaved import reconstruct_with_noise
from isp.picture import Picture, checked_matrix, finish, require_letters
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S
from isp.substitution import SUBSTITUTION_SNR, green_snr, substitute_luminance
from sensor.raw import RawImage

Image = NDArray[np.float64]


def develop_interleaved(
    raw: RawImage,
    matrix: ArrayLike,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | None = None,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    substitution_snr: float = SUBSTITUTION_SNR,
) -> Image:
    """Develop an interleaved RGBW raw image; `picture_interleaved` gives the decisions beside the picture.

    Parameters
    ----------
    raw : RawImage
        Mosaic with R, G, B and W.
    matrix : (3, 3) array_like
        From balanced R, G, B to linear sRGB (`isp.colour.fit_matrix`).
    neutral : (channel,) array_like, optional
        Calibrated response to a neutral, in the order of `sensor.cfa.channels`: the white balance of pictures that are
        too dark for Gray World. The project's own curves under D65 by default.
    balance : (channel,) array_like, optional
        Response to what shall come out neutral, such as a file's as-shot neutral, in place of Gray World's means.
    neighbourhood, patch, sigma_d, sigma_s
        Of `isp.interleaved.reconstruct`.
    substitution_snr : float
        W replaces the luminance where the frame's green SNR is under it; 0 never, inf always.

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
    ).rgb


def picture_interleaved(
    raw: RawImage,
    matrix: ArrayLike,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | None = None,
    neighbourhood: int = NEIGHBOURHOOD,
    patch: int = PATCH,
    sigma_d: float = SIGMA_D,
    sigma_s: float = SIGMA_S,
    substitution_snr: float = SUBSTITUTION_SNR,
) -> Picture:
    """As `develop_interleaved`, with the decisions: eqs. (1)-(6), Gray World, matrix, luminance substitution."""
    letters, colours = require_letters(raw, ("R", "G", "B", "W")), checked_matrix(matrix)
    result = reconstruct_with_noise(raw, neighbourhood=neighbourhood, patch=patch, sigma_d=sigma_d, sigma_s=sigma_s)
    planes = np.asarray(result.estimate, dtype=np.float64)
    white = white_balance(raw, planes, neutral, balance)
    balanced = clip_highlights(raw, planes * white.gains)
    rgb = balanced[..., :3] @ colours.T
    snr = green_snr(raw, planes)
    substituted = snr < substitution_snr
    if substituted:
        rgb = substitute_luminance(rgb, balanced[..., 3], ~saturated_nearby(raw, "W"))
    return Picture(rgb, dict(zip(letters, white.sources, strict=True)), snr, substituted, result.engine)


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
