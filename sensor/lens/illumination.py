"""Relative illumination: how light falls off from the middle of a picture to its corners.

Two factors multiply; a lens by data states a third one (`sensor.lens.table`):

- natural falloff, a power of the cosine of the angle off the axis: 4 for a thin lens with its stop in it;
- mechanical vignetting, a rim that cuts the pupil off the axis. Seen from a place at the image height h, 1 in the
  corners, the pupil is a circle of radius 1, and the rim one of radius R whose centre lies k h beside the pupil's: the
  light is the area that they share, over the pupil's. Two numbers tell the rim: the height h0 from which on it cuts, so
  that R = 1 + k h0, and the share of the light that it takes from the corners, from which k follows.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from math import radians, tan
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.config import LensConfig
from sensor.lens.table import lens_table

# Terms of a lens that lights the whole picture evenly, and is the same everywhere in it.
EVEN_LIGHT: Mapping[str, Any] = MappingProxyType(
    {"horizontal_view_deg": 0.0, "falloff_power": 0.0, "vignetting": 0.0, "table": ""}
)
NATURAL_POWER = 4.0  # falloff power of a lens that states only its angle of view


def view_deg(lens: LensConfig, of_scene: float | None, term: str) -> float:
    """Return the angle of view across the picture [degrees]: the lens's own, or else that of the scene's camera.

    Parameters
    ----------
    lens : LensConfig
    of_scene : float or None
    term : str
        Name of the lens's term that needs the angle, for the error message.

    Raises
    ------
    InputError
        Where neither is known.
    """
    view = lens.horizontal_view_deg or of_scene
    if not view:
        raise InputError(
            f"{term}: the picture states no angle of view; allowed: a scene with a perspective camera, or a lens with "
            "its own; give horizontal_view_deg"
        )
    return view


def darkens(lens: LensConfig) -> bool:
    """Return whether the lens gives the corners less light than the middle."""
    if lens.table and lens_table(lens).darkens():
        return True
    return lens.horizontal_view_deg > 0 or lens.falloff_power > 0 or lens.vignetting > 0


def framed(lens: LensConfig, of_scene: float | None) -> LensConfig:
    """Return a lens whose falloff knows the angle of view of the scene's camera, if it needs one and states none."""
    if lens.falloff_power and not lens.horizontal_view_deg and of_scene:
        return replace(lens, horizontal_view_deg=of_scene)
    return lens


def falloff(lens: LensConfig, shape: tuple[int, int], of_scene: float | None = None) -> NDArray[np.float64]:
    """Return the irradiance of each pixel relative to that on the axis, shape `shape`.

    Parameters
    ----------
    lens : LensConfig
    shape : (int, int)
    of_scene : float, optional
        Angle of view of the scene's camera, for a lens with a `falloff_power` that states no angle.

    Raises
    ------
    InputError
        For a `falloff_power` and an angle of view that isn't known.
    """
    half_width = shape[1] / 2
    places = [np.arange(size) - (size - 1) / 2 for size in shape]
    view = view_deg(lens, of_scene, "falloff_power") if lens.falloff_power else lens.horizontal_view_deg
    tangent = tan(radians(view / 2)) / half_width
    rows, columns = (place * tangent for place in places)
    light = np.asarray((1.0 + rows[:, None] ** 2 + columns**2) ** -((lens.falloff_power or NATURAL_POWER) / 2))
    height = np.hypot(places[0][:, None], places[1]) / np.hypot(shape[0] / 2, half_width)
    if lens.vignetting:
        light *= pupil_share(height, lens)
    if lens.table:
        light *= lens_table(lens).illumination(height)
    return light


def pupil_share(height: Floats, lens: LensConfig) -> NDArray[np.float64]:
    """Return the share of the pupil's area that the rim leaves free at image heights, which are 1 in the corners."""
    return _common_area(np.asarray(height, dtype=np.float64), _shift(lens), lens.vignetting_from) / np.pi


@lru_cache(maxsize=64)
def _shift(lens: LensConfig) -> float:
    """Return the distance k of the rim's centre from the pupil's, seen from the corners.

    It is chosen so that the corners lose the share of light that the lens states.
    """

    def too_bright(shift: float) -> float:
        return float(_common_area(np.array([1.0]), shift, lens.vignetting_from)[0]) / np.pi - (1 - lens.vignetting)

    # Beyond this shift the circles have no common area.
    return float(scipy.optimize.brentq(too_bright, 0.0, 2 / (1 - lens.vignetting_from), xtol=1e-12))


def _common_area(height: Floats, shift: float, start: float) -> NDArray[np.float64]:
    """Return the area that the pupil, a unit circle, shares with the rim.

    The rim is a circle of radius 1 + k h0, whose centre lies k h beside the pupil's: `shift` is k, `start` is h0, and
    `height` is h.
    """
    radius = 1 + shift * start
    apart = np.clip(shift * height, radius - 1, radius + 1)
    within = apart > radius - 1
    d = np.where(within, apart, 1.0)
    # Four times the area of the triangle of both centres and a common point, by Heron's formula. Angles of the same
    # root keep the sum exact where the circles touch: there each angle alone errs by the root of a rounding error.
    root = np.sqrt(np.maximum((1 + radius - d) * (d + 1 - radius) * (d - 1 + radius) * (d + 1 + radius), 0.0))
    small, large = np.arctan2(root, d**2 + 1 - radius**2), np.arctan2(root, d**2 + radius**2 - 1)
    return np.asarray(np.where(within, small + radius**2 * large - root / 2, np.pi))
