"""Dynamic range of developed pictures, measured on even fields: brightest value in proportion over the dark's noise.

As ISO 15739 has it of a camera's pictures: the least luminance is the dark's temporal noise over the slope there. The
noise is that which a processor leaves of an even field, so that one that averages even fields has a larger range.
"""

from collections.abc import Callable
from math import log2, log10

import numpy as np

from rodcone.types import Plane

MIDDLE = 0.5  # reflectance at which the picture's ratio to light is measured
MOST = 16.0  # largest reflectance that is tried; a perfect white is 1
BEHIND = 0.99  # share of the proportional value below which a picture counts as saturated
STEP_OCTAVES = 0.005  # octaves to which the saturation is found
RISE = 3.0  # multiple of the camera's own noise: the light by which the slope at black is measured
LEAST_SLOPE = 1e-3  # slope that is assumed where a picture doesn't show that light


def picture_range(shoot: Callable[[float, int], Plane], noise: float) -> float:
    """Return the range [dB] of pictures that `shoot` takes with one chip.

    Parameters
    ----------
    shoot : callable
        Function of an even field's reflectance, 1 for a perfect white, and of a frame's number; returns the picture's
        luminance.
    noise : float
        Noise of the camera's own dark, as a reflectance.
    """
    # The least luminance: noise that changes between frames, over the slope from black to a little light.
    dark = [shoot(0.0, frame) for frame in (0, 1)]
    left = max(float(np.std(dark[0] - dark[1], ddof=1)) / 2**0.5, 1e-9)
    black = float(np.mean(dark))
    lit = float(np.mean([shoot(RISE * noise, frame) for frame in (0, 1)]))
    least = left / max((lit - black) / (RISE * noise), LEAST_SLOPE)
    # The brightest luminance, by bisection on frames whose noise is the same in proportion to the light.
    slope = (float(shoot(MIDDLE, 2).mean()) - black) / MIDDLE
    low, high = log2(MIDDLE), log2(MOST)
    while high - low > STEP_OCTAVES:
        level = 2 ** ((low + high) / 2)
        shown = (float(shoot(level, 2).mean()) - black) / slope
        low, high = (log2(level), high) if shown >= BEHIND * level else (low, log2(level))
    return 20 * log10(BEHIND * 2 ** ((low + high) / 2) / least)
