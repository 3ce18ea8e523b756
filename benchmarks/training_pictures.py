"""Pictures to choose settings on: leaves, gratings and patches of random reflectances, which no page judges on."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import band_widths
from rodcone.colour_spaces import encode_srgb
from rodcone.types import Floats
from scenes.reflectances import band, edge, grey
from studies.metrics.truth import Light, light_in_bands, true_srgb

NM = np.arange(390.0, 780.0, 20.0)
TRAINING, TRAINING_SEED = 6, 20260101  # how many settings are chosen on, and their seed: two of each kind
LIGHTS = ("D65", "D65", "A", "LED-B3")  # of the pictures in turn
# How far a surface's dark end reaches down from its bright one: vivid pictures of a mean chroma of 24 in CIELAB, and
# pale ones of 10; the ColorChecker's surfaces, on which matrices are fitted, have 33.
DEPTHS = (0.97, 0.6)
FINER = 3  # samples a pixel along either axis
SMALLEST, LARGEST = 1.5, 40.0  # radius of a leaf [pixels]


@dataclass(frozen=True)
class TrainingPicture:
    """Radiance at a mean of 1 cd/m^2, its light, the luminance shown as white, and the encoded truth (h, w, 3)."""

    radiance: SpectralRadiance
    light: Light
    white_cd_m2: float
    truth: NDArray[np.float64]


def training_pictures(size: int, count: int, seed: int) -> list[TrainingPicture]:
    """Square pictures of `KINDS` in turn, first vivid ones, then pale ones, and so on."""
    made = []
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        depth = DEPTHS[index // len(KINDS) % len(DEPTHS)]
        surfaces = KINDS[index % len(KINDS)](rng, size * FINER, depth)
        pixels = surfaces.reshape(size, FINER, size, FINER, -1).mean(axis=(1, 3))
        light = light_in_bands(illuminant(LIGHTS[index % len(LIGHTS)]), NM, band_widths(NM))
        values = pixels * light.spectrum
        radiance = SpectralRadiance(values, NM)
        radiance = SpectralRadiance(values / radiance.luminance().mean(), NM)
        white = float(np.percentile(radiance.luminance(), 99.0)) / 0.9
        made.append(TrainingPicture(radiance, light, white, encode_srgb(true_srgb(radiance, light, white))))
    return made


def reflectance(rng: np.random.Generator, depth: float) -> Floats:
    """One random smooth surface in bands, under a random shade: an edge or a bump, one in six grey."""
    high = rng.uniform(0.3, 0.95)
    low = high * (1 - depth * np.sqrt(rng.uniform()))
    centre, width = rng.uniform(450.0, 620.0), rng.uniform(10.0, 40.0)
    kind = rng.integers(6)
    if kind == 0:
        curve = grey(high)
    elif kind < 4:
        curve = edge(centre, width, *((low, high) if kind < 3 else (high, low)))
    else:
        curve = band(centre, width, low, high)
    return np.asarray(curve.band_average(NM, band_widths(NM)) * rng.uniform(0.3, 1.0))


def leaves(
    rng: np.random.Generator,
    side: int,
    depth: float,
    draw: Callable[[np.random.Generator, float], Floats] = reflectance,
) -> NDArray[np.float64]:
    """Discs over each other whose areas follow a power law, so that detail is alike at every scale."""
    rows, columns = np.indices((side, side))
    picture = np.broadcast_to(draw(rng, depth), (side, side, NM.size)).copy()
    smallest, largest = SMALLEST * FINER, LARGEST * FINER
    for _ in range(1500):
        u = rng.uniform()  # radius density r^-3
        radius = 1 / np.sqrt(u / smallest**2 + (1 - u) / largest**2)
        row, column = rng.uniform(-radius, side + radius, 2)
        picture[(rows - row) ** 2 + (columns - column) ** 2 < radius**2] = draw(rng, depth)
    return picture


def gratings(rng: np.random.Generator, side: int, depth: float) -> NDArray[np.float64]:
    """Four by four fields, each a sine between two surfaces, of random direction and a period of 2.5 to 30 pixels."""
    picture = np.empty((side, side, NM.size))
    rows, columns = np.indices((side, side))
    edges = np.linspace(0, side, 5).astype(int)
    for (top, bottom), (left, right) in product(pairwise(edges), repeat=2):
        field = np.s_[top:bottom, left:right]
        angle, period = rng.uniform(0, np.pi), FINER * np.exp(rng.uniform(np.log(2.5), np.log(30.0)))
        wave = np.cos(angle) * rows[field] + np.sin(angle) * columns[field]
        share = (0.5 + 0.5 * np.sin(2 * np.pi * wave / period))[..., None]
        picture[field] = share * reflectance(rng, depth) + (1 - share) * reflectance(rng, depth)
    return picture


def patches(rng: np.random.Generator, side: int, depth: float) -> NDArray[np.float64]:
    """Five by five even fields."""
    field = np.indices((side, side)) * 5 // side
    surfaces = np.array([[reflectance(rng, depth) for _ in range(5)] for _ in range(5)])
    return np.asarray(surfaces[field[0], field[1]])


KINDS = (leaves, gratings, patches)  # what a camera meets: detail at every scale, repeating detail, and none
