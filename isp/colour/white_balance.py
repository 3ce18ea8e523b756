"""White balance of a developed frame, and highlights: what every pipeline shares between planes and matrix."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from isp.colour.camera_colour import Balance, gray_world, neutral_response
from rodcone.errors import InputError
from sensor.cfa import channels, letter_map
from sensor.raw import RawImage

Image = NDArray[np.float64]


def white_balance(raw: RawImage, planes: Image, neutral: ArrayLike | None, given: ArrayLike | None) -> Balance:
    """White balance as given, or else by Gray World.

    Parameters
    ----------
    planes : (h, w, channel) float64
        The pipeline's own linear planes [e-], channels in the order of `sensor.cfa.channels`.
    neutral : (channel,) array_like or None
        Calibrated response to a neutral, for pictures too dark for Gray World; None: the project's curves under D65.
    given : (channel,) array_like or None
        Response to what shall come out neutral, in place of Gray World's means.

    Raises
    ------
    InputError
        For a response that is not one positive number a channel.

    Notes
    -----
    Gray World takes colours over the pixels without a saturated colour sample nearby, W over those it leaves as well.
    W saturates first; taking its pixels out of the colours' means too would leave them the dark part of the scene.
    """
    letters = channels(raw.cfa)
    if given is not None:
        response = _response("balance", given, letters)
        return Balance(response[letters.index("G")] / response, tuple("given" for _ in letters))
    calibrated = neutral_response(letters) if neutral is None else _response("neutral", neutral, letters)
    colours = ~saturated_nearby(raw, "RGB")
    balance = _gray_world(raw, planes, calibrated, "RGB", colours)
    if "W" not in letters:
        return balance
    white = _gray_world(raw, planes, calibrated, "GW", colours & ~saturated_nearby(raw, "W"))
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


def saturated_nearby(raw: RawImage, letters: str, reach: int | None = None) -> NDArray[np.bool_]:
    """Pixels with a saturated sample of one of `letters` within `reach` pixels along either axis, shape (h, w).

    Left out, the reach is one tile.
    """
    hit = raw.saturated & np.isin(letter_map(raw.cfa, raw.shape), list(letters))
    return np.asarray(maximum_filter(hit, size=2 * (len(raw.cfa) - 1 if reach is None else reach) + 1))


def full_e(raw: RawImage) -> float:
    """Electrons of a full well."""
    return float((raw.white_dn - raw.black_dn) * raw.gain_e_per_dn)


def clip_highlights(raw: RawImage, balanced: Image, reach: int | None = None) -> Image:
    """Hold every balanced colour at green's full well near a saturated colour sample: highlights stay neutral.

    `reach` as in `saturated_nearby`: that of the filter which made the planes.
    """
    clipped = saturated_nearby(raw, "RGB", reach)
    return np.where(clipped[..., None], np.minimum(balanced, full_e(raw)), balanced)
