"""Search for the tile of the least expected error over several levels of light."""

from collections.abc import MutableMapping
from dataclasses import dataclass
from itertools import product
from math import inf
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_fields, unknown
from rodcone.progress import Step
from rodcone.types import Floats
from scenes.levels import DEMO_LEVELS
from sensor.cfa import MOSAICS, Tile
from sensor.config import SensorConfig, with_tile
from sensor.exposure import AUTO_INFORMATION
from sensor.presets import vary
from studies.design.expect import ExpectedError, expect
from studies.study.levels import levels_between, parse_exposure

SIDES = {"2x2": 2, "4x4": 4}
BEHIND = 100.0  # what the square of a decibel beyond the bound costs, in decibels of mean gain
COOLING_DB = 0.05  # temperature of the first step
Known = MutableMapping[str, list[list[float]]]  # gains of the tiles that were tried, by their rows


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What a mosaic is sought for, and among which.

    Attributes
    ----------
    tile : str
        Size of the tile: 2x2, all of which are tried, or 4x4, by annealing; or its rows, such as RG/BW.
    letters : str
        Channels to choose from; the sensor has a curve of each.
    filters : bool
        Shape the filters' transmittances too, in front of a pixel of channel W.
    rounds : int
        Rounds of the filters, each at the exposures that its first filters take.
    over : str
        Named levels of light, from one to another.
    weights : tuple of float
        Weight of each level in the mean gain; equal by default.
    never_worse_than : str
        Mosaic that gains are over, by name or by rows.
    behind : float
        Decibels that the design may lose to it at any level, in PSNR, and in a* and b*; below 0: must gain.
    behind_in_luminance : float
        The same in luminance; half a decibel is the least that a person sees.
    light : str
        Illuminant; the camera knows it.
    exposure : str
        Rule of exposure, or a time such as 20ms.
    prior : str
        Prior over patches: drawn or photographs.
    steps : int
        Tiles of 4x4 to look at.
    seed : int
        Seed of the search.
    """

    tile: str = "4x4"
    letters: str = "RGBW"
    filters: bool = False
    rounds: Annotated[int, (1, 100, "give 4 or so")] = 4
    over: str = f"{DEMO_LEVELS[0].name}:{DEMO_LEVELS[-1].name}"
    weights: tuple[float, ...] = ()
    never_worse_than: str = "bayer"
    behind: Annotated[float, (-100.0, 100.0, "give decibels, such as 0.1")] = 0.1
    behind_in_luminance: Annotated[float, (-100.0, 100.0, "give decibels, such as 0.1")] = 0.5
    light: str = "D65"
    exposure: str = AUTO_INFORMATION
    prior: str = "drawn"
    steps: Annotated[int, (0, 100_000, "give 500 or so")] = 500
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0

    def __post_init__(self) -> None:
        require_fields(self)
        if not self.letters:
            raise InputError("letters: '' names no channel; allowed: some of the sensor's; give RGBW or so")
        if self.tile not in SIDES and "/" not in self.tile:
            raise unknown("tile", self.tile, SIDES)
        count = len(self.levels)
        if self.weights and (len(self.weights) != count or not 0 < sum(self.weights) < inf or min(self.weights) < 0):
            raise InputError(
                f"weights: {list(self.weights)} for {count} levels; allowed: 0 or more; give --weights once for each"
            )

    @property
    def levels(self) -> dict[str, float]:
        """Luminances [cd m^-2] by the levels' names."""
        return levels_between(self.over)

    @property
    def time_s(self) -> str | float:
        """Rule of exposure, or a time [s]."""
        return parse_exposure(self.exposure, "exposure") or self.exposure

    @property
    def shares(self) -> Floats:
        """Weights of the levels in the mean gain; sum 1."""
        weights = np.array(self.weights or [1.0] * len(self.levels))
        return np.asarray(weights / weights.sum())

    def beyond(self, gains_db: Floats) -> Floats:
        """How far gains lie beyond the bound; `gains_db` of shape (3, level), as `camera_db` has them."""
        behind_db = np.array([self.behind, self.behind_in_luminance, self.behind])
        return np.asarray(np.maximum(0.0, -gains_db - behind_db[:, None]))

    def score(self, gains_db: Floats) -> float:
        """Mean gain in PSNR, less what lies behind the bound."""
        return float(self.shares @ gains_db[0] - BEHIND * (self.beyond(gains_db) ** 2).sum())


def expected(goal: Goal, camera: SensorConfig) -> list[ExpectedError]:
    """Expected error of a camera's pictures at each level of the goal."""
    return expect(camera, list(goal.levels.values()), goal.light, goal.time_s, goal.prior)


def camera_db(goal: Goal, camera: SensorConfig) -> Floats:
    """Expected error of a camera's pictures at each level, component known, shape (3, level) [dB, more is better].

    Of encoded sRGB, as PSNR; of encoded luminance; of a* and b*, over 1 in Lab.
    """
    errors = expected(goal, camera)
    return np.array([(x.psnr_db, x.luminance_db, -20 * np.log10(x.colour)) for x in errors]).T


def standing_for(tile: Tile) -> Tile:
    """One of the tiles that a tile turns into by turning, mirroring and shifting: the first by the alphabet."""
    cells = np.array([list(row) for row in tile])
    turned = [np.rot90(mirrored, turns) for mirrored in (cells, cells.T) for turns in range(4)]
    return min(_tile(np.roll(cell, shift, (0, 1))) for cell in turned for shift in np.ndindex(cell.shape))


def best_tile(goal: Goal, sensor: SensorConfig, known: Known, progress: Step) -> Tile:
    """Tile of the best score: of all of 2x2 pixels, or of 4x4 by annealing with several starts.

    Parameters
    ----------
    goal : Goal
        Its `tile` is 2x2 or 4x4.
    sensor : SensorConfig
        Lends pixel, lens and responses; its own mosaic doesn't count.
    known : mapping
        Gains of the tiles that were tried: what is in it isn't computed again, and what is computed is put into it.
    progress : callable
        Called with the best tile and the share that is done.
    """
    side, reference = SIDES[goal.tile], vary(sensor, goal.never_worse_than)
    reference_db = camera_db(goal, reference)
    best, best_score = reference.cfa, -inf

    def look_at(tile: Tile, share: float = 0.0) -> float:
        nonlocal best, best_score
        if (key := "/".join(tile)) not in known:
            known[key] = (camera_db(goal, with_tile(sensor, tile, sensor.responses)) - reference_db).tolist()
        score = goal.score(np.array(known[key]))
        if score > best_score:
            best, best_score = tile, score
        progress(f"{'/'.join(best)} {best_score:+.2f} dB", share)
        return score

    letters = {*goal.letters, "/"}
    earlier = [tuple(key.split("/")) for key in known if key.count("/") == side - 1 and set(key) <= letters]
    for tile in [standing_for(reference.cfa), *earlier]:
        look_at(tile)
    if side == 2:
        tiles = sorted({standing_for(("".join(t[:2]), "".join(t[2:]))) for t in product(goal.letters, repeat=4)})
        for index, tile in enumerate(tiles):
            look_at(tile, (index + 1) / len(tiles))
        return best
    # Annealing from the best of the published tiles.
    published = [tile for tile in MOSAICS.values() if len(tile) in (2, 4) and set("".join(tile)) <= set(goal.letters)]
    repeated = [np.tile([list(row) for row in x], 2 * [side // len(x)]) for x in published or [(goal.letters[0],)]]
    starts = sorted(sorted({standing_for(_tile(cells)) for cells in repeated}), key=look_at, reverse=True)[:4]
    steps_per_start = goal.steps // len(starts)
    for number, start in enumerate(starts):
        rng, tile, value = np.random.default_rng([goal.seed, number]), start, look_at(start, number / len(starts))
        for step in range(steps_per_start):
            changed = standing_for(_changed(tile, goal.letters, rng))
            new = look_at(changed, (number * steps_per_start + step + 1) / (steps_per_start * len(starts)))
            if new > value or rng.random() < np.exp((new - value) / (COOLING_DB * (1 - step / steps_per_start))):
                tile, value = changed, new
    return best


def _changed(tile: Tile, letters: str, rng: np.random.Generator) -> Tile:
    """Another letter at a site, or two sites that change places."""
    cells = np.array([list(row) for row in tile])
    one, other = (tuple(rng.integers(size) for size in cells.shape) for _ in range(2))
    if rng.random() < 0.5:
        cells[one] = rng.choice(list(letters))
    else:
        cells[one], cells[other] = cells[other], cells[one]
    return _tile(cells)


def _tile(cells: NDArray[np.str_]) -> Tile:
    return tuple("".join(row) for row in cells)
