"""Pairs of surfaces that look alike under D65 and apart under other lights, on a chart."""

from functools import cache

import numpy as np

from render.illuminants import illuminant
from render.scene import Scene
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths, colour_matching_functions
from rodcone.types import Floats
from scenes.color_checker import chart_scene
from scenes.reflectances import color_checker_reflectances, grey

TWINS_UNDER = "D65"
OTHER_LIGHT = "A"  # the light under which the two of a pair are made to differ most
PAIRS = 12
LOW, HIGH = 0.02, 0.95  # range of the made reflectances: soot to white paper
SHARE = 0.5  # a curve goes at most this share of the way from its base to `LOW` or `HIGH`, as curves of dyes do
BUMP_NM = 30.0  # standard deviation of the bumps in a difference; the bands of dyes are no narrower
# Bases by their index in the ColorChecker: muted colours, which leave room on both sides.
_BASES = (0, 1, 2, 4, 5, 9, 19, 20, 21, 7, 3, 10)


def metamers(light: str = TWINS_UNDER) -> Scene:
    """Build a chart of 12 pairs of patches, 0 and 1, 2 and 3, ..., side by side; each pair is one colour under D65.

    Parameters
    ----------
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    curves = [curve for pair in pairs() for curve in pair]
    return chart_scene("metamers", curves, grey(0.2), light)


@cache
def pairs() -> tuple[tuple[Spectrum, Spectrum], ...]:
    """Return both reflectances of each pair: a base plus and minus a metameric black (Wyszecki & Stiles 1982, 3.8.4).

    The black is a sum of smooth bumps whose XYZ is zero under D65 for the CIE 1931 observer. Of all such sums it is the
    one of unit size whose XYZ under `OTHER_LIGHT` is the largest.
    """
    nm = grey(0.0).wavelength_nm
    black = _black(nm)
    return tuple(_pair(nm, base.values, black) for base in (color_checker_reflectances()[index][1] for index in _BASES))


def _pair(nm: Floats, base: Floats, black: Floats) -> tuple[Spectrum, Spectrum]:
    room = np.minimum(np.clip(base - LOW, 0.0, None), np.clip(HIGH - base, 0.0, None))
    seen = np.abs(black) > 1e-3 * np.abs(black).max()
    size = SHARE * float(np.min(room[seen] / np.abs(black[seen])))
    return Spectrum(nm, base + size * black), Spectrum(nm, base - size * black)


def _black(nm: Floats) -> Floats:
    """Return a metameric black on a grid of reflectances, its largest value 1."""
    bumps = np.exp(-0.5 * ((nm[:, None] - np.arange(400.0, 721.0, 20.0)) / BUMP_NM) ** 2)
    # Colours of every bump, computed at fine resolution and also by products of averages over 10 nm. The black is one
    # by both, so that the pairs look alike also to a program that multiplies averages.
    fine_nm = np.arange(380.5, 780.0)
    one_nm = np.ones(400)
    bands = (fine_nm, one_nm), (DEFAULT_WAVELENGTH_NM, band_widths(DEFAULT_WAVELENGTH_NM))
    twin = np.vstack([_colours(nm, bumps, TWINS_UNDER, *at_nm) for at_nm in bands])
    other = _colours(nm, bumps, OTHER_LIGHT, fine_nm, one_nm)
    free = np.linalg.svd(twin)[2][np.linalg.matrix_rank(twin) :].T  # weights of the bumps that leave no colour
    strongest = np.linalg.svd(other @ free)[2][0]
    black = bumps @ (free @ strongest)
    return np.asarray(black / black[np.argmax(np.abs(black))])


def _colours(nm: Floats, curves: Floats, light: str, at_nm: Floats, width_nm: Floats) -> Floats:
    """Return XYZ of curves (nm, curve) under a light, summed over bands: shape (3, curve)."""
    # A signed curve is no `Spectrum`: take the matrix that averages a grid over the bands instead.
    averages = np.array([Spectrum(nm, row).band_average(at_nm, width_nm) for row in np.eye(nm.size)]).T
    observer = np.array([x.band_average(at_nm, width_nm) for x in colour_matching_functions()]) * width_nm
    return np.asarray(observer @ (illuminant(light).band_average(at_nm, width_nm)[:, None] * (averages @ curves)))
