"""Dead leaves: a chart of overlapping disks with a known spectrum, such as ISO/TS 19567-2 uses to measure texture.

Disks fall on one another, each with a grey of its own. Their radii lie between two limits, with a density proportional
to r^-3. Two points at a distance d see the same disk with the probability

    g(d) / (2 g(0) - g(d)),    g(d) the mean area in which a disk and itself moved by d overlap

(Matheron 1968), which times the variance of the greys is the chart's autocovariance.
"""

from functools import cache

import numpy as np

from render.geometry import camera, look_at
from render.scene import Scene
from rodcone.errors import require_whole
from rodcone.types import Floats, Plane
from scenes.materials import mixed, panel, under_sky
from scenes.reflectances import grey

LEAST_PX, MOST_PX = 1.0, 24.0  # limits of the radii, in pixels of a picture or in units of the scene's chart
DARKEST, BRIGHTEST = 0.05, 0.95  # limits of the reflectances, which are uniformly distributed
LAYERS = 5.0  # mean number of disks over a point: exp(-5) of the chart shows the ground, which has the mean grey
SIDE, SQUARES = 256, 4  # units along a side of the scene's chart, and squares along a unit
SIDE_M = 0.5  # side of the scene's chart, which fills a square picture


def dead_leaves(seed: int = 0, light: str = "D65") -> Scene:
    """Build a chart of dead leaves that fills a square picture, in a constant environment.

    The greys are those of `chart`, row by row from the upper left corner. Radii are from 1 to 24 units; the chart's
    side has 256 units.

    Parameters
    ----------
    seed : int
        Seed of the disks.
    light : str
        Illuminant of the sky, whose luminance is 100 cd/m^2.
    """
    facing = look_at((0, 0, 0), (0, 0, 1))
    share = (chart(seed) - DARKEST) / (BRIGHTEST - DARKEST)
    leaves = mixed(np.rint(255 * share).astype(np.uint8), grey(DARKEST), grey(BRIGHTEST))
    view = camera(20.0, (0, 0, SIDE_M / 2 / np.tan(np.radians(10.0))), (0, 0, 0))
    return under_sky("dead_leaves", view, {"chart": panel(facing, SIDE_M, SIDE_M, leaves)}, light, "chart")


@cache
def chart(seed: int) -> Plane:
    """Return the scene's reflectances, of 256 greys, shape (1024, 1024)."""
    require_whole("seed", seed, 0, 2**31, "give a whole number")
    drawn = draw_leaves(SIDE, SQUARES, np.random.default_rng(seed))
    steps = np.rint(255 * (drawn - DARKEST) / (BRIGHTEST - DARKEST))
    greys: Plane = DARKEST + (BRIGHTEST - DARKEST) * steps / 255
    greys.setflags(write=False)
    return greys


def draw_leaves(side_px: int, samples: int, rng: np.random.Generator) -> Plane:
    """Draw the reflectances of a chart of side_px x side_px pixels, each from `samples` x `samples` squares."""
    side, least, most = (value * samples for value in (side_px, LEAST_PX, MOST_PX))
    around = side + 2 * most
    mean_area = 2 * np.pi * np.log(most / least) / (least**-2 - most**-2)
    count = int(rng.poisson(LAYERS * around**2 / mean_area))
    radii = (least**-2 - rng.random(count) * (least**-2 - most**-2)) ** -0.5
    rows, columns = rng.uniform(-most, side + most, (2, count))
    greys = rng.uniform(DARKEST, BRIGHTEST, count)
    leaves: Plane = np.full((int(side), int(side)), (DARKEST + BRIGHTEST) / 2)
    middles = np.arange(int(side)) + 0.5
    for radius, row, column, reflectance in zip(
        radii.tolist(), rows.tolist(), columns.tolist(), greys.tolist(), strict=True
    ):
        down = slice(max(int(row - radius), 0), max(int(row + radius) + 1, 0))
        across = slice(max(int(column - radius), 0), max(int(column + radius) + 1, 0))
        inside = (middles[down, None] - row) ** 2 + (middles[across] - column) ** 2 <= radius**2
        leaves[down, across][inside] = reflectance
    return leaves


def autocovariance(distance_px: Floats) -> Floats:
    """Return the chart's autocovariance at distances in pixels."""
    radii = np.geomspace(LEAST_PX, MOST_PX, 4001)
    half = np.minimum(np.asarray(distance_px)[..., None] / (2 * radii), 1.0)
    overlap = 2 * radii**2 * (np.arccos(half) - half * np.sqrt(1 - half**2))
    shared = np.trapezoid(overlap * radii**-3, radii)
    whole = np.trapezoid(np.pi / radii, radii)
    variance = (BRIGHTEST - DARKEST) ** 2 / 12
    return np.asarray(variance * shared / (2 * whole - shared))
