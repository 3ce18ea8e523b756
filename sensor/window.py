"""What a camera's window lets in, and what of it a scene's bands hold: bands that are absent count as dark."""

import warnings

import numpy as np

from render.photometry import photons_per_joule
from render.spectrum import VISIBLE_NM, Floats
from rodcone.errors import InputError
from sensor.cfa import channels
from sensor.config import SensorConfig

MOST_LOST = 0.5  # of a channel's response: a picture of less than half of it is none of that channel
LEAST_TOLD = 5e-3  # of a channel's response
_STEP_NM = 1.0  # finer than responses bend


def inside_nm(window_nm: tuple[float, float], wavelength_nm: Floats, width_nm: Floats) -> Floats:
    """Width of each band's part inside the window, shape (band,)."""
    low, high = window_nm
    first, last = wavelength_nm - width_nm / 2, wavelength_nm + width_nm / 2
    return np.asarray(np.clip(np.minimum(last, high) - np.maximum(first, low), 0.0, None))


def check_window(window_nm: tuple[float, float], wavelength_nm: Floats, width_nm: Floats) -> None:
    """Raise `InputError` where a camera's window opens beyond 380-780 nm and the bands don't reach there.

    Bands that are absent count as dark. Within 380-780 nm that is a choice of the scene; beyond, it would hide that a
    W pixel may collect 16-35 % of its electrons there. Less than one more band may be missing.
    """
    first, last = wavelength_nm - width_nm / 2, wavelength_nm + width_nm / 2
    beyond = ((window_nm[0], min(VISIBLE_NM[0], window_nm[1]), 0), (max(VISIBLE_NM[1], window_nm[0]), window_nm[1], -1))
    for low, high, outermost in beyond:
        seen = inside_nm((low, high), wavelength_nm, width_nm).sum()
        if high - low - seen >= width_nm[outermost]:
            raise InputError(
                f"window_nm: {window_nm!r} asks for light at {low:g} to {high:g} nm and the scene's bands, "
                f"{first[0]:g} to {last[-1]:g} nm, hold {seen:g} nm of it; narrow the window or render those bands"
            )


def lost_shares(sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats) -> dict[str, float]:
    """Share of each channel's electrons, of light of equal energy in the camera's window, that absent bands leave out.

    Parameters
    ----------
    sensor : SensorConfig
    wavelength_nm, width_nm : (band,) float64
        Of the scene.

    Returns
    -------
    dict of str to float
        0 to 1 by the channel's letter.
    """
    low, high = sensor.window_nm
    edges = np.linspace(low, high, max(2, round((high - low) / _STEP_NM) + 1))
    nm, step = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    first, last = (wavelength_nm + sign * width_nm / 2 for sign in (-1, 1))
    held_nm = np.clip(np.minimum(last, edges[1:, None]) - np.maximum(first, edges[:-1, None]), 0.0, None).sum(axis=1)
    letters = channels(sensor.cfa)
    electrons = sensor.responses.band_average(letters, nm, step) * photons_per_joule(nm) * step
    lost = electrons @ np.clip(1 - held_nm / step, 0.0, 1.0)
    whole = electrons.sum(axis=1)
    return {letter: float(a / b) if b else 0.0 for letter, a, b in zip(letters, lost, whole, strict=True)}


def check_covered(sensor: SensorConfig, wavelength_nm: Floats, width_nm: Floats) -> None:
    """Tell by a `UserWarning` what each channel loses where a scene doesn't cover the camera's window.

    Raises
    ------
    InputError
        Where a channel loses more than half.
    """
    if inside_nm(sensor.window_nm, wavelength_nm, width_nm).sum() >= (1 - 1e-9) * np.ptp(sensor.window_nm):
        return
    shares = lost_shares(sensor, wavelength_nm, width_nm)
    most = max(shares.values())
    if most <= LEAST_TOLD:
        return
    first, last = (wavelength_nm + sign * width_nm / 2 for sign in (-1, 1))
    low, high = sensor.window_nm
    told = (
        f"radiance: its bands, {first.min():g} to {last.max():g} nm, don't fill the camera's window, {low:g} to "
        f"{high:g} nm; of light of equal energy there, they leave out "
        f"{', '.join(f'{share:.1%} of {letter}' for letter, share in shares.items())}"
    )
    if most > MOST_LOST:
        raise InputError(f"{told}; allowed: half; give those bands, or narrow the camera's window_nm")
    warnings.warn(f"{told}; give those bands, or narrow the camera's window_nm", UserWarning, stacklevel=2)
