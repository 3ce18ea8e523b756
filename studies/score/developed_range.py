"""Dynamic range of developed pictures of even fields: brightest luminance over least luminance.

ISO 15739 defines it for a camera's pictures. The brightest luminance is the largest to which values are still
proportional. The least is the temporal noise in the dark, divided by the slope of the picture over light there. The
noise is what a processor leaves of it, so a processor that averages even fields has a larger range.
"""

from collections.abc import Callable
from math import log2, log10

import numpy as np

from rodcone.types import Plane

MIDDLE = 0.5  # reflectance at which the picture's ratio to light is measured
MOST = 16.0  # largest reflectance that is tried; a perfect white is 1
BEHIND = 0.99  # a picture with less than this share of the proportional value counts as saturated
STEP_OCTAVES = 0.005  # accuracy to which the saturation is found [octaves]
RISE = 3.0  # the slope at black is measured with this multiple of the light that equals the camera's own noise
LEAST_SLOPE = 1e-3  # slope that is assumed if a picture doesn't show that light


def picture_range(shoot: Callable[[float, int], Plane], noise: float) -> float:
    """Return the dynamic range [dB] of pictures that `shoot` takes with one chip.

    Parameters
    ----------
    shoot : callable
        Function of an even field's reflectance, 1 for a perfect white, and of a frame's number; returns the picture's
        luminance.
    noise : float
        Noise of the camera's own dark, as a reflectance.
    """
    # The least luminance: noise that changes between frames, divided by the slope from black to a little light.
    dark = [shoot(0.0, frame) for frame in (0, 1)]
    left = max(float(np.std(dark[0] - dark[1], ddof=1)) / 2**0.5, 1e-9)
    black = float(np.mean(dark))
    lit = float(np.mean([shoot(RISE * noise, frame) for frame in (0, 1)]))
    least = left / max((lit - black) / (RISE * noise), LEAST_SLOPE)
    # The brightest luminance, by bisection. All frames use the same random numbers, so that noise doesn't mislead it.
    slope = (float(shoot(MIDDLE, 2).mean()) - black) / MIDDLE
    low, high = log2(MIDDLE), log2(MOST)
    while high - low > STEP_OCTAVES:
        level = 2 ** ((low + high) / 2)
        shown = (float(shoot(level, 2).mean()) - black) / slope
        low, high = (log2(level), high) if shown >= BEHIND * level else (low, log2(level))
    return 20 * log10(BEHIND * 2 ** ((low + high) / 2) / least)
