"""Search for the tile of the least expected error over several levels of light."""

from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from isp.design.choice import Projected, picked, projected
from isp.design.expected_error import Noise, expected_error, sampled
from isp.design.spectral_prior import PATCH, PRIORS, SpectralPrior, load_prior
from render.spectrum import Floats
from rodcone.errors import unknown
from sensor.cfa import MOSAICS, Tile, channels
from sensor.config import SensorConfig, with_tile
from sensor.exposure import AUTO_INFORMATION, exposure_of_electrons_s
from studies.design.expect import (
    LitPrior,
    drawn_pixels,
    metric_rows,
    middle_pixels,
    noise_at,
    responses_e,
    sites_of,
    spread_of,
    view_of,
)

BEHIND = 100.0  # what the square of a decibel beyond the bound costs, in decibels of mean gain
COOLING_DB = 0.05  # temperature of the first step
Known = MutableMapping[str, list[list[float]]]  # gains of the tiles that were tried, by their rows
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Goal:
    """What a mosaic is sought for.

    Attributes
    ----------
    sensor : SensorConfig
        Pixel, lens and responses of the letters; its own mosaic doesn't count.
    levels_cd_m2 : (level,) float64
        Mean luminances of scenes.
    weights : (level,) float64
        Of the levels in the mean gain; sum 1.
    reference : tuple of str
        Tile that gains are over.
    behind_db : (3,) float64
        How far a design may fall behind the reference at any level in PSNR, in luminance, and in a* and b*.
    letters : str
        Channels to choose from.
    light, exposure, prior
        As `studies.design.expect.expect` takes them.
    """

    sensor: SensorConfig
    levels_cd_m2: Floats
    weights: Floats
    reference: Tile
    behind_db: Floats
    letters: str = "RGBW"
    light: str = "D65"
    exposure: str = AUTO_INFORMATION
    prior: str = "drawn"

    def behind(self, gains_db: Floats) -> Floats:
        """How far gains lie beyond the bound; `gains_db` of shape (3, level), as `tile_db` has them."""
        return np.maximum(0.0, -gains_db - self.behind_db[:, None])

    def score(self, gains_db: Floats) -> float:
        """Mean gain in PSNR, less what lies behind the bound."""
        return float(self.weights @ gains_db[0] - BEHIND * (self.behind(gains_db) ** 2).sum())


@dataclass(frozen=True, eq=False)
class Search:
    """A goal with what all its tiles share.

    Attributes
    ----------
    goal : Goal
    letters : str
        Channels to choose from, and the reference's.
    responses : (letter, coefficient) float64
        Electrons in a second from a coefficient of 1, reflectance 1 having 1 cd/m^2.
    every : tuple of Projected
        For each of the prior's reflectances.
    """

    goal: Goal
    letters: str
    responses: Floats
    every: tuple[Projected, ...]


def search_for(goal: Goal) -> Search:
    """Sample every channel at every pixel.

    Raises
    ------
    InputError
        For a letter without a curve, or an unknown light or prior.
    """
    if goal.prior not in PRIORS:
        raise unknown("prior", goal.prior, PRIORS)
    prior, seen = load_prior(goal.prior), view_of(goal.prior, goal.light)
    letters = "".join(dict.fromkeys(goal.letters + "".join(goal.reference)))
    # A tile of one row lists its channels in an order of its own.
    sensor = with_tile(goal.sensor, (letters,), goal.sensor.responses)
    responses = responses_e(sensor, seen)[[channels(sensor.cfa).index(letter) for letter in letters]]
    sampling = np.einsum("nc,sp->nspc", responses, np.eye(PATCH**2)).reshape(-1, PATCH**2, responses.shape[1])
    samples = sampled(prior.patches, sampling, middle_pixels())
    scenes = [rows_of(prior, seen, reflectance) for reflectance in prior.reflectances]
    return Search(goal, letters, responses, tuple(projected(samples, *rows) for rows in scenes))


def rows_of(prior: SpectralPrior, seen: LitPrior, reflectance: float) -> tuple[Floats, ...]:
    """R of encoded sRGB, of encoded luminance, and of a* and b*."""
    srgb, luminance, _, colour = metric_rows(prior, seen, reflectance)
    return srgb, luminance, colour


def moments(goal: Goal, sensor: SensorConfig, responses: Floats) -> list[tuple[float, Noise]]:
    """Luminance times exposure of reflectance 1 [cd s m^-2], and the noise, at each level by the goal's rule.

    `responses` are those of the sensor's channels, shape (channel, coefficient).
    """
    per_second_e = np.maximum(drawn_pixels(goal.prior) @ responses.T, 0.0)
    result = []
    for white_cd_m2 in goal.levels_cd_m2 / load_prior(goal.prior).reflectances.mean():
        time_s = exposure_of_electrons_s(goal.exposure, per_second_e * white_cd_m2, sensor)
        light = float(white_cd_m2 * time_s)
        result.append((light, noise_at(sensor, time_s, per_second_e * light)))
    return result


def tile_db(search: Search, tile: Tile) -> Floats:
    """Expected error of a tile's pictures at each level, component known, shape (3, level) [dB, more is better].

    Of encoded sRGB, as PSNR; of encoded luminance; of a* and b*, over 1 in Lab.
    """
    goal, prior = search.goal, load_prior(search.goal.prior)
    sensor = with_tile(goal.sensor, tile, goal.sensor.responses)
    responses = search.responses[[search.letters.index(name) for name in channels(tile)]]
    spread = spread_of(sensor.pixel.crosstalk) if sensor.pixel.crosstalk else None
    samples = [picked(one.samples, sites_of(tile, search.letters), spread) for one in search.every]
    errors: dict[str, Floats] = {}
    result = []
    for light, noise in moments(goal, sensor, responses):
        key = f"{light:.9g} {noise}"  # at full exposure more light changes nothing
        if key not in errors:
            by_reflectance = [
                expected_error(prior.patches.weights, one, np.full(PATCH**2, mean * light), noise, every.forms)
                for one, every, mean in zip(samples, search.every, prior.reflectances, strict=True)
            ]
            errors[key] = np.mean(by_reflectance, axis=0)
        result.append(-10 * np.log10(errors[key]))
    return np.transpose(result)


def standing_for(tile: Tile) -> Tile:
    """One of the tiles that a tile turns into by turning, mirroring and shifting: the first by the alphabet."""
    cells = np.array([list(row) for row in tile])
    turned = [np.rot90(mirrored, turns) for mirrored in (cells, cells.T) for turns in range(4)]
    moved = (np.roll(cell, shift, (0, 1)) for cell in turned for shift in np.ndindex(cell.shape))
    return min(tuple("".join(row) for row in cell) for cell in moved)


def best_tile(search: Search, side: int, steps: int, seed: int, known: Known, progress: Progress) -> Tile:
    """Tile of the best score: of all where `side` is 2, else by annealing with several starts.

    Parameters
    ----------
    search : Search
    side : int
        Pixels of the tile, 2 or 4.
    steps : int
        Tiles to look at where `side` is 4.
    seed : int
    known : mapping
        Gains of the tiles that were tried: what is in it isn't computed again, and what is computed is put into it.
    progress : callable
        Called with the best tile and the share that is done.
    """
    reference_db = tile_db(search, search.goal.reference)

    def score(tile: Tile) -> float:
        if (key := "/".join(tile)) not in known:
            known[key] = (tile_db(search, tile) - reference_db).tolist()
        return search.goal.score(np.array(known[key]))

    best = standing_for(search.goal.reference)
    best_score = score(best)

    def look_at(tile: Tile, share: float) -> float:
        nonlocal best, best_score
        value = score(tile)
        if value > best_score:
            best, best_score = tile, value
        progress(f"{'/'.join(best)} {best_score:+.2f} dB", share)
        return value

    for tile in [tuple(key.split("/")) for key in known]:
        if len(tile) == side:
            look_at(tile, 0.0)
    if side == 2:
        tiles = sorted({standing_for(("".join(t[:2]), "".join(t[2:]))) for t in product(search.goal.letters, repeat=4)})
        for index, tile in enumerate(tiles):
            look_at(tile, (index + 1) / len(tiles))
        return best
    starts = [
        tile for tile in MOSAICS.values() if len(tile) in (2, 4) and set("".join(tile)) <= set(search.goal.letters)
    ]
    starts = sorted({standing_for(_whole(tile, side)) for tile in starts}, key=score, reverse=True)[:4]
    steps_per_start = steps // len(starts)
    for number, start in enumerate(starts):
        rng = np.random.default_rng([seed, number])
        tile, value = start, look_at(start, number / len(starts))
        for step in range(steps_per_start):
            changed = standing_for(_changed(tile, search.goal.letters, rng))
            new = look_at(changed, (number * steps_per_start + step + 1) / (steps_per_start * len(starts)))
            if new > value or rng.random() < np.exp((new - value) / (COOLING_DB * (1 - step / steps_per_start))):
                tile, value = changed, new
    return best


def _whole(tile: Tile, side: int) -> Tile:
    return tuple(row * (side // len(row)) for row in tile * (side // len(tile)))


def _changed(tile: Tile, letters: str, rng: np.random.Generator) -> Tile:
    """Another letter at a site, or two sites that change places."""
    cells = np.array([list(row) for row in tile])
    one, other = (tuple(rng.integers(size) for size in cells.shape) for _ in range(2))
    if rng.random() < 0.5:
        cells[one] = rng.choice(list(letters))
    else:
        cells[one], cells[other] = cells[other], cells[one]
    return tuple("".join(row) for row in cells)
