"""The report's cells: one for each sensor, exposure, level and camera, with means where there are several seeds."""

from collections.abc import Mapping, Sequence
from itertools import product
from math import isfinite
from typing import Any

from render.errors import InputError, require_keys, require_range
from studies.confidence import mean_with_confidence
from studies.report_text import duration
from studies.study import AUTO, parse_exposure

# What seeds scatter: every figure of a cell but its exposure and its electrons, which noise doesn't touch.
SCATTERED = ("psnr_db", "ssim", "delta_e_median", "delta_e_p95", "snr_db", "saturated", "mc_share")
Cell = Mapping[str, Any]
Place = tuple[str, str, int, str]  # sensor, exposure, level, camera


def exposures(results: Mapping[str, Any]) -> list[str]:
    """Return the exposures by name: ``auto`` or a time; results that name none have the automatic one."""
    return list(results.get("exposures", [AUTO]))


def seeds(results: Mapping[str, Any]) -> list[int]:
    """Return the seeds of the cells, in the order in which they come; a cell that names none has the study's."""
    return list(dict.fromkeys(cell.get("seed", results["seed"]) for cell in results["cells"]))


def groups(results: Mapping[str, Any]) -> list[str]:
    """Return a title for each sensor and exposure; the exposure is named where there are several."""
    times = exposures(results)
    named = [f", exposure {exposure_name(time)}" if len(times) > 1 else "" for time in times]
    return [sensor["name"] + name for sensor, name in product(results["sensors"], named)]


def exposure_name(exposure: str) -> str:
    """Write an exposure as prose does: ``auto`` as "automatic", ``10ms`` as "10 ms"."""
    seconds = parse_exposure(exposure)
    return "automatic" if seconds is None else duration(seconds)


def ordered_cells(results: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one cell for each sensor, exposure, level and camera, in this order, means over its seeds.

    Raises
    ------
    InputError
        For a cell that is missing, comes twice, or names something unknown.
    """
    found = _by_place(results)
    sensors, times = [sensor["name"] for sensor in results["sensors"]], exposures(results)
    titles = dict(zip(product(sensors, times), groups(results), strict=True))
    cells = []
    for place in product(sensors, times, range(len(results["levels"])), results["cameras"]):
        of_seeds = [_found(found, place, seed) for seed in seeds(results)]
        cells.append({**over_seeds(of_seeds), "group": titles[place[:2]]})
    return cells


def over_seeds(cells: Sequence[Cell]) -> dict[str, Any]:
    """Return one cell for the same picture under several seeds.

    Each figure becomes its mean, with the 95 % interval of `mean_with_confidence` in ``intervals``; it is unknown where
    it is unknown for a seed. `substitution` becomes the share of seeds with it; a channel counts as fallen back if it
    fell back for any seed. Picture and times are the first seed's.
    """
    first = {"intervals": {}, **cells[0]}
    if len(cells) == 1:
        return first
    for key in SCATTERED:
        values = [cell[key] for cell in cells]
        if any(value is None or not isfinite(value) for value in values):
            first[key] = None
            continue
        estimate = mean_with_confidence(values)
        first[key] = estimate.mean
        first["intervals"] = {**first["intervals"], key: (estimate.low, estimate.high)}
    states = [cell["substitution"] for cell in cells]
    first["substitution"] = None if None in states else sum(states) / len(states)
    fallen = {name for cell in cells for name, how in (cell["balance"] or {}).items() if how == "calibrated"}
    first["balance"] = {**(cells[0]["balance"] or {}), **dict.fromkeys(sorted(fallen), "calibrated")}
    return first


def _by_place(results: Mapping[str, Any]) -> dict[tuple[Place, int], Cell]:
    """Sort the cells in, each of which may be there once."""
    sensors, times = [sensor["name"] for sensor in results["sensors"]], exposures(results)
    found: dict[tuple[Place, int], Cell] = {}
    for cell in results["cells"]:
        time, seed = cell.get("exposure", times[0]), cell.get("seed", results["seed"])
        require_keys("cell's sensor", [cell["sensor"]], sensors)
        require_keys("cell's exposure", [time], times)
        require_keys("cell's camera", [cell["camera"]], list(results["cameras"]))
        require_range("cell's level", cell["level"], 0, len(results["levels"]) - 1, "give the level's place in levels")
        place = (cell["sensor"], time, cell["level"], cell["camera"])
        if (place, seed) in found:
            raise InputError(f"cells: {_words(place, seed)} comes twice; give each of them once")
        found[place, seed] = cell
    return found


def _found(found: Mapping[tuple[Place, int], Cell], place: Place, seed: int) -> Cell:
    if (place, seed) not in found:
        raise InputError(f"cells: {_words(place, seed)} is missing; give one for each combination")
    return found[place, seed]


def _words(place: Place, seed: int) -> str:
    sensor, time, level, camera = place
    return f"sensor {sensor!r}, exposure {time!r}, level {level}, camera {camera!r}, seed {seed}"
