"""Light that a lens or an eye scatters: the veil around a lamp by its angle, padded with darkness, not mirrored.

A lamp that gives the illuminance E at the aperture is seen within a veil of the luminance E P(theta) at the angle
theta from it. P [1/sr] is

- of a lens, the generalised form that Harvey and Shack found for polished surfaces (J. E. Harvey, "Light-scattering
  characteristics of optical surfaces", Proc. SPIE 107, 1977), about a lamp in the middle of the view:
  P = P0 (1 + (sin theta / l)^2)^(-s / 2), l being the sine of a shoulder angle and s the slope of the wings. A slope of
  2 is what the wings of stars have through telescopes (King, "The profile of a star image", PASP 83, 1971). P0 follows
  from the share of the light that is scattered, which is in closed form the integral of P over all directions behind
  the lens, each counted by its cosine;
- of an eye of A years and the pigmentation p, the CIE's general equation of disability glare (CIE 146:2002, about
  which CIE 180:2010 goes on), with theta in degrees from 0.1 to 100:
  P = 10 / theta^3 + (5 / theta^2 + 0.1 p / theta) (1 + (A / 62.5)^4) + 0.0025 p.

The veil is that of a picture in a plane at right angles to the view, of the same shape for all lamps; of a lamp at an
angle a off the middle it is too bright by 1 / cos(a)^3. Light from outside of the picture isn't known, and brings none.
"""

from collections.abc import Callable
from functools import lru_cache
from math import cos, log, pi, radians, sin, tan

import numpy as np
import scipy

from rodcone.types import Floats, Plane
from sensor.config import LensConfig
from sensor.lens.illumination import view_deg

EYE_FROM_DEG = 0.1  # the equation's least angle: within it the eye's light counts as not scattered
# Squares along each side of a pixel, over which the veil is averaged: of the lamp's own pixel, and out to a distance.
_OWN, _NEAR, _NEAR_PX = 256, 16, 6


def scatters(lens: LensConfig) -> bool:
    """Return whether a lens, or an eye in its place, scatters light by angle."""
    return lens.scatter > 0 or lens.eye_age_years > 0


def veil_per_sr(angle_deg: Floats, lens: LensConfig) -> Floats:
    """Return the veil's luminance at angles from a lamp, over the lamp's illuminance at the aperture [1/sr]."""
    angle = np.asarray(angle_deg, dtype=np.float64)
    if not lens.eye_age_years:
        shoulder = sin(radians(lens.scatter_shoulder_deg))
        sine = np.sin(np.radians(np.minimum(angle, 90.0)))
        return np.asarray(_peak_per_sr(lens) * (1 + (sine / shoulder) ** 2) ** (-lens.scatter_slope / 2))
    theta = np.maximum(angle, EYE_FROM_DEG)
    p = lens.eye_pigmentation
    ageing = 1 + (lens.eye_age_years / 62.5) ** 4
    glare = 10 / theta**3 + (5 / theta**2 + 0.1 * p / theta) * ageing + 0.0025 * p
    return np.asarray(np.where(angle < EYE_FROM_DEG, 0.0, glare))


def _peak_per_sr(lens: LensConfig) -> float:
    """Return P of a lens at the lamp itself [1/sr], with l the sine of the shoulder angle and s the slope.

    It is the scattered share over the integral of 2 pi b (1 + (b / l)^2)^(-s / 2) db from 0 to 1.
    """
    shoulder2 = sin(radians(lens.scatter_shoulder_deg)) ** 2
    left = 1 - lens.scatter_slope / 2
    rise = log(1 + 1 / shoulder2)
    integral = rise if abs(left) < 1e-9 else ((1 + 1 / shoulder2) ** left - 1) / left
    return lens.scatter / (pi * shoulder2 * integral)


@lru_cache(maxsize=64)
def scattered_share(lens: LensConfig) -> float:
    """Return the share of the light that is scattered, over all directions."""
    if not lens.eye_age_years:
        return lens.scatter

    def per_degree(degrees: float) -> float:
        angle = radians(degrees)
        return 2 * pi * sin(angle) * cos(angle) * pi / 180 * float(veil_per_sr(np.array(degrees), lens))

    parts = ((EYE_FROM_DEG, 1.0), (1.0, 10.0), (10.0, 90.0))
    return float(sum(scipy.integrate.quad(per_degree, *part)[0] for part in parts))


def scatterer(lens: LensConfig, shape: tuple[int, int], horizontal_view_deg: float | None) -> Callable[[Plane], Plane]:
    """Return a function from the light behind an ideal lens to the light behind one that scatters.

    Parameters
    ----------
    lens : LensConfig
    shape : (int, int)
        Height and width of the picture.
    horizontal_view_deg : float or None
        Angle of view of the scene's camera across the picture's width, for a lens that states none.

    Raises
    ------
    InputError
        Where the angle of view isn't known.
    """
    (height, width), step = shape, tan(radians(view_deg(lens, horizontal_view_deg, "scatter") / 2)) / (shape[1] / 2)
    sides = [scipy.fft.next_fast_len(2 * side - 1, real=True) for side in shape]
    down, across = (np.arange(side) - side * (np.arange(side) >= of) for side, of in zip(sides, shape, strict=True))
    transfer = scipy.fft.rfft2(_veil_by_pixel(down, across, step, lens))
    kept = 1 - scattered_share(lens)

    def scattered(light: Plane) -> Plane:
        spectrum = scipy.fft.rfft2(light, s=sides)
        spectrum *= transfer
        return np.asarray(kept * light + scipy.fft.irfft2(spectrum, s=sides, overwrite_x=True)[:height, :width])

    return scattered


def _veil_by_pixel(down: Floats, across: Floats, step: float, lens: LensConfig) -> Floats:
    """Return the veil of a lamp in one pixel, at whole offsets from it, relative to the lamp's light.

    `step` is the tangent of the angle that a pixel covers.
    """

    def mean_over(rows: Floats, columns: Floats, squares: int) -> Floats:
        inner = (np.arange(squares) + 0.5) / squares - 0.5
        away = np.hypot((rows[:, None] + inner)[:, None, :, None], (columns[:, None] + inner)[None, :, None, :])
        return np.asarray(veil_per_sr(np.degrees(np.arctan(away * step)), lens).mean(axis=(2, 3)))

    veil = veil_per_sr(np.degrees(np.arctan(np.hypot(down[:, None], across) * step)), lens)
    rows, columns = (np.flatnonzero(np.abs(x) <= _NEAR_PX) for x in (down, across))
    veil[np.ix_(rows, columns)] = mean_over(down[rows], across[columns], _NEAR)
    veil[0, 0] = mean_over(down[:1], across[:1], _OWN).item()
    return veil * step**2
