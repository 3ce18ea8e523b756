"""The two cameras' pipelines: raw image in, scene-linear RGB out."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from isp.bayer import bilinear
from isp.colour import Balance, BalanceSource, gray_world, neutral_response
from isp.interleaved import reconstruct_with_noise
from isp.settings import NEIGHBOURHOOD, PATCH, SIGMA_D, SIGMA_S
from isp.substitution import SUBSTITUTION_SNR, green_snr, substitute_luminance
from render.errors import InputError
from render.jit import Backend
from sensor.cfa import channels, letter_map
from sensor.raw import RawImage

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Picture:
    """A developed picture, and what was decided on the way.

    Attributes
    ----------
    rgb : (h, w, 3) float64
        Linear sRGB, not clipped to the display; a neutral reads the electrons of a green pixel.
    balance : mapping of str to str
        Where each channel's gain comes from: ``gray world``, ``calibrated`` or ``given``.
    snr : float or None
        Frame SNR of green, on which substitution is decided; None for the Bayer camera.
    substituted : bool or None
        Whether W replaced the luminance; None for the Bayer camera.
    engine : "cuda", "llvm" or "numpy"
        What ran the reconstruction.
    """

    rgb: Image
    balance: Mapping[str, BalanceSource]
    snr: float | None
    substituted: bool | None
    engine: Backend


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
    letters, colours = _require(raw, ("R", "G", "B", "W")), _checked(matrix)
    result = reconstruct_with_noise(raw, neighbourhood=neighbourhood, patch=patch, sigma_d=sigma_d, sigma_s=sigma_s)
    planes = np.asarray(result.estimate, dtype=np.float64)
    white = _balance(raw, planes, neutral, balance)
    balanced = _clip_highlights(raw, planes * white.gains)
    rgb = balanced[..., :3] @ colours.T
    snr = green_snr(raw, planes)
    substituted = snr < substitution_snr
    if substituted:
        rgb = substitute_luminance(rgb, balanced[..., 3], ~_saturated_nearby(raw, "W"))
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
    letters = _require(raw, ("R", "G", "B"))
    planes = bilinear(raw)
    white = _balance(raw, planes, neutral, balance)
    rgb = _clip_highlights(raw, planes * white.gains) @ _checked(matrix).T
    return Picture(rgb, dict(zip(letters, white.sources, strict=True)), None, None, "numpy")


def _require(raw: RawImage, letters: tuple[str, ...]) -> tuple[str, ...]:
    if channels(raw.cfa) != letters:
        raise InputError(
            f"raw: mosaic {raw.cfa} holds {channels(raw.cfa)}; allowed here: {letters}; use the other camera's pipeline"
        )
    return letters


def _checked(matrix: ArrayLike) -> Image:
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape != (3, 3) or not np.all(np.isfinite(array)):
        raise InputError(
            f"matrix: shape {array.shape} is not allowed; give 3x3 finite numbers, as fit_matrix makes them"
        )
    return array


def _balance(raw: RawImage, planes: Image, neutral: ArrayLike | None, given: ArrayLike | None) -> Balance:
    """White balance as given, or else by Gray World.

    Gray World takes colours over the pixels without a saturated colour sample nearby, W over those it leaves as well.
    W saturates first; taking its pixels out of the colours' means too would leave them the dark part of the scene.
    """
    letters = channels(raw.cfa)
    if given is not None:
        response = _response("balance", given, letters)
        return Balance(response[letters.index("G")] / response, tuple("given" for _ in letters))
    calibrated = neutral_response(letters) if neutral is None else _response("neutral", neutral, letters)
    colours = ~_saturated_nearby(raw, "RGB")
    balance = _gray_world(raw, planes, calibrated, "RGB", colours)
    if "W" not in letters:
        return balance
    white = _gray_world(raw, planes, calibrated, "GW", colours & ~_saturated_nearby(raw, "W"))
    return Balance(np.append(balance.gains, white.gains[1]), (*balance.sources, white.sources[1]))


def _response(name: str, values: ArrayLike, letters: tuple[str, ...]) -> Image:
    response = np.asarray(values, dtype=np.float64)
    if response.shape != (len(letters),) or not np.all((response > 0) & np.isfinite(response)):
        raise InputError(
            f"{name}: {response.tolist()!r} is not allowed; give a positive response for each of {letters}"
        )
    return response


def _gray_world(raw: RawImage, planes: Image, calibrated: Image, letters: str, usable: NDArray[np.bool_]) -> Balance:
    """Gray World among some of the channels."""
    index = [channels(raw.cfa).index(letter) for letter in letters]
    sites = letter_map(raw.cfa, raw.shape)
    samples = np.array([max((usable & (sites == letter)).sum(), 1) for letter in letters])
    means = planes[usable].mean(axis=0) if usable.any() else np.zeros(planes.shape[-1])
    errors = np.sqrt((np.maximum(means[index], 0.0) + raw.dark_noise_e**2) / samples)
    return gray_world(planes[..., index], usable, errors, calibrated[index], letters.index("G"))


def _saturated_nearby(raw: RawImage, letters: str) -> NDArray[np.bool_]:
    """Pixels with a saturated sample of one of `letters` within one tile, shape (h, w)."""
    hit = raw.saturated & np.isin(letter_map(raw.cfa, raw.shape), list(letters))
    return np.asarray(maximum_filter(hit, size=2 * len(raw.cfa) - 1))


def _clip_highlights(raw: RawImage, balanced: Image) -> Image:
    """Hold every colour at green's full well where a colour sample is saturated: clipped highlights stay neutral."""
    full_e = (raw.white_dn - raw.black_dn) * raw.gain_e_per_dn
    clipped = _saturated_nearby(raw, "RGB")
    return np.where(clipped[..., None], np.minimum(balanced, full_e), balanced)
