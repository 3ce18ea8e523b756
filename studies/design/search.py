"""Search for the tile of the least expected error over several levels of light."""

from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from render.spectrum import Floats
from sensor.cfa import MOSAICS, Tile
from sensor.config import SensorConfig, with_tile
from sensor.exposure import AUTO_INFORMATION
from studies.design.expect import expect

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


def tile_db(goal: Goal, tile: Tile) -> Floats:
    """Expected error of a tile's pictures at each level, component known, shape (3, level) [dB, more is better].

    Of encoded sRGB, as PSNR; of encoded luminance; of a* and b*, over 1 in Lab.
    """
    sensor = with_tile(goal.sensor, tile, goal.sensor.responses)
    errors = expect(sensor, goal.levels_cd_m2, goal.light, goal.exposure, goal.prior)
    return np.array([(x.psnr_db, x.luminance_db, -20 * np.log10(x.colour)) for x in errors]).T


def standing_for(tile: Tile) -> Tile:
    """One of the tiles that a tile turns into by turning, mirroring and shifting: the first by the alphabet."""
    cells = np.array([list(row) for row in tile])
    turned = [np.rot90(mirrored, turns) for mirrored in (cells, cells.T) for turns in range(4)]
    moved = (np.roll(cell, shift, (0, 1)) for cell in turned for shift in np.ndindex(cell.shape))
    return min(tuple("".join(row) for row in cell) for cell in moved)


def best_tile(goal: Goal, side: int, steps: int, seed: int, known: Known, progress: Progress) -> Tile:
    """Tile of the best score: of all where `side` is 2, else by annealing with several starts.

    Parameters
    ----------
    goal : Goal
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
    reference_db = tile_db(goal, goal.reference)

    def score(tile: Tile) -> float:
        if (key := "/".join(tile)) not in known:
            known[key] = (tile_db(goal, tile) - reference_db).tolist()
        return goal.score(np.array(known[key]))

    best = standing_for(goal.reference)
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
        tiles = sorted({standing_for(("".join(t[:2]), "".join(t[2:]))) for t in product(goal.letters, repeat=4)})
        for index, tile in enumerate(tiles):
            look_at(tile, (index + 1) / len(tiles))
        return best
    starts = [tile for tile in MOSAICS.values() if len(tile) in (2, 4) and set("".join(tile)) <= set(goal.letters)]
    starts = starts or [(goal.letters[0],)]
    starts = sorted({standing_for(_whole(tile, side)) for tile in starts}, key=score, reverse=True)[:4]
    steps_per_start = steps // len(starts)
    for number, start in enumerate(starts):
        rng = np.random.default_rng([seed, number])
        tile, value = start, look_at(start, number / len(starts))
        for step in range(steps_per_start):
            changed = standing_for(_changed(tile, goal.letters, rng))
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
