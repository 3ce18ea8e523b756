"""Hard cases of the image processors: settings at the ends of their ranges, on frames that strain them."""

from math import inf
from typing import Any

import numpy as np
from hard.case import Case, Situation, low_noise
from hard.light import GLINT_CD_M2, SIDE, at_level, even, times

from render.radiance import SpectralRadiance
from sensor.presets import table1_pixel


def _settings(luminance_cd_m2: float = 30.0, **develop: Any) -> Situation:
    return Situation(at_level(luminance_cd_m2), develop=develop)


def _islands() -> SpectralRadiance:
    """Squares of full wells in a frame of ordinary light: all three guides of eq. (6) occur."""
    rows, columns = np.indices((SIDE, SIDE))
    full = (rows % 21 < 5) & (columns % 23 < 6)
    return times(even(1.0), np.where(full, GLINT_CD_M2, 20.0 + columns))


def _texture() -> SpectralRadiance:
    """A random level of 1 to 1000 cd/m^2 at every pixel: no pixel has a neighbour that is like it."""
    return times(even(1.0), 10.0 ** np.random.default_rng(6).uniform(0.0, 3.0, (SIDE, SIDE)))


PICTURE_CASES = (
    Case("sigma_s_0.001", "similarity of 0.001 σ: only equals are averaged", lambda: _settings(sigma_s=1e-3)),
    Case("sigma_s_inf", "no similarity weight", lambda: _settings(sigma_s=inf)),
    Case("sigma_d_0.001", "spatial weight of 0.001 pixels: the nearest sample", lambda: _settings(sigma_d=1e-3)),
    Case("sigma_d_inf", "no spatial weight", lambda: _settings(sigma_d=inf)),
    Case("sigmas_inf", "neither weight: means over 21 × 21", lambda: _settings(sigma_d=inf, sigma_s=inf)),
    Case("sigmas_0.001", "both weights at 0.001", lambda: _settings(sigma_d=1e-3, sigma_s=1e-3)),
    Case("sigma_s_0.001_dark", "similarity of 0.001 σ, starlight", lambda: _settings(1e-4, sigma_s=1e-3)),
    Case("neighbourhood_3", "the smallest neighbourhood", lambda: _settings(neighbourhood=3)),
    Case("neighbourhood_63", "a neighbourhood as large as the frame", lambda: _settings(neighbourhood=63)),
    Case("patch_5", "patches of 5 × 5", lambda: _settings(patch=5)),
    Case("patch_9", "patches of 9 × 9", lambda: _settings(patch=9)),
    Case("saturated_islands", "squares of full wells in ordinary light", lambda: Situation(_islands())),
    Case(
        "saturated_islands_sharp",
        "the same, similarity of 0.1 σ",
        lambda: Situation(_islands(), develop={"sigma_s": 0.1}),
    ),
    Case("texture", "a random level over 10^3 at every pixel", lambda: Situation(_texture())),
    Case("texture_patch_5", "the same, patches of 5 × 5", lambda: Situation(_texture(), develop={"patch": 5})),
    Case("balance_1e6", "channels balanced over a range of 10^6", lambda: _settings(balance=(1e-3, 1.0, 1e3, 1.0))),
    Case(
        "substitution",
        "W gives the luminance of pure noise",
        lambda: Situation(at_level(0.01), table1_pixel(), develop={"substitution_snr": inf}),
    ),
    Case(
        "no_substitution",
        "no W in the luminance of pure noise",
        lambda: Situation(at_level(0.01), low_noise(), develop={"substitution_snr": 0.0}),
    ),
)
