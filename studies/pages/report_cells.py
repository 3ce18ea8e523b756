"""The report's axes and cells: one cell for each combination, with means where there are several seeds."""

from collections.abc import Mapping, Sequence
from itertools import product
from math import isfinite
from typing import Any, NamedTuple

from rodcone.errors import InputError, require_keys, require_range
from studies.metrics.confidence import mean_with_confidence
from studies.pages.report_text import METRICS, duration
from studies.study.study import AUTO, OWN, parse_exposure

# What seeds scatter: every figure of a cell but its exposure and its electrons, which noise doesn't touch.
SCATTERED = (*(metric.key for metric in METRICS), "snr_db", "saturated", "mc_share")
Cell = Mapping[str, Any]


class Place(NamedTuple):
    """Where a cell stands, but for its seed; `level` counts from 0."""

    scene: str
    spectrum: str
    sensor: str
    exposure: str
    level: int
    camera: str


def scenes(results: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return name and size of each scene; results that list none have one."""
    return list(results.get("scenes", [{"name": results["scene"], "size": results["size"]}]))


def spectra(results: Mapping[str, Any]) -> list[str]:
    """Return the spectra by name; results that name none have the scene's own."""
    return list(results.get("spectra", [OWN]))


def exposures(results: Mapping[str, Any]) -> list[str]:
    """Return the exposures by name: ``auto`` or a time; results that name none have the automatic one."""
    return list(results.get("exposures", [AUTO]))


def seeds(results: Mapping[str, Any]) -> list[int]:
    """Return the seeds of the cells, in the order in which they come; a cell that names none has the study's."""
    return list(dict.fromkeys(cell.get("seed", results["seed"]) for cell in results["cells"]))


def views(results: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return each scene under each spectrum: what has a truth of its own."""
    return list(product((scene["name"] for scene in scenes(results)), spectra(results)))


def view_names(results: Mapping[str, Any]) -> list[str]:
    """Return a title for each scene under each spectrum, of what varies; all are empty where there is one alone."""
    several = len(scenes(results)) > 1, len(spectra(results)) > 1
    return [
        ", ".join(part for part, named in zip((scene, spectrum_name(spectrum)), several, strict=True) if named)
        for scene, spectrum in views(results)
    ]


def group_names(results: Mapping[str, Any]) -> list[str]:
    """Return a title for each sensor and exposure; the exposure is named where there are several."""
    times = exposures(results)
    named = [f", exposure {exposure_name(time)}" if len(times) > 1 else "" for time in times]
    return [sensor["name"] + name for sensor, name in product(results["sensors"], named)]


def groups(results: Mapping[str, Any]) -> list[str]:
    """Return a title for each view, sensor and exposure: the sensor, and whatever else varies."""
    return [name + (f", {view}" if view else "") for view, name in product(view_names(results), group_names(results))]


def exposure_name(exposure: str) -> str:
    """Write an exposure as prose does: ``auto`` as "automatic", ``10ms`` as "10 ms"."""
    seconds = parse_exposure(exposure)
    return "automatic" if seconds is None else duration(seconds)


def spectrum_name(spectrum: str) -> str:
    """Write a spectrum as prose does."""
    return "own light" if spectrum == OWN else f"under {spectrum}"


def ordered_cells(results: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one cell for each scene, spectrum, sensor, exposure, level and camera, in this order, over its seeds.

    Raises
    ------
    InputError
        For a cell that is missing, comes twice, or names something unknown.
    """
    found = _by_place(results)
    axes = _axes(results)
    titles = dict(zip(product(*axes[:4]), groups(results), strict=True))
    cells = []
    for place in map(Place._make, product(*axes)):
        of_seeds = [_found(found, place, seed) for seed in seeds(results)]
        level = results["levels"][place.level]
        known = {"luminance_cd_m2": level["luminance_cd_m2"], "illuminance_lux": level["illuminance_lux"]}
        cells.append({**known, **over_seeds(of_seeds), "group": titles[place[:4]]})
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


def _axes(results: Mapping[str, Any]) -> tuple[list[Any], ...]:
    """Return the values of `Place`'s six axes."""
    return (
        [scene["name"] for scene in scenes(results)],
        spectra(results),
        [sensor["name"] for sensor in results["sensors"]],
        exposures(results),
        list(range(len(results["levels"]))),
        list(results["cameras"]),
    )


def _by_place(results: Mapping[str, Any]) -> dict[tuple[Place, int], Cell]:
    """Sort the cells in, each of which may be there once."""
    axes = _axes(results)
    found: dict[tuple[Place, int], Cell] = {}
    for cell in results["cells"]:
        place = Place(
            cell.get("scene", axes[0][0]),
            cell.get("spectrum", axes[1][0]),
            cell["sensor"],
            cell.get("exposure", axes[3][0]),
            cell["level"],
            cell["camera"],
        )
        for name in ("scene", "spectrum", "sensor", "exposure", "camera"):
            require_keys(f"cell's {name}", [getattr(place, name)], axes[Place._fields.index(name)])
        require_range("cell's level", cell["level"], 0, len(results["levels"]) - 1, "give the level's place in levels")
        seed = cell.get("seed", results["seed"])
        if (place, seed) in found:
            raise InputError(f"cells: {_words(place, seed)} comes twice; give each of them once")
        found[place, seed] = cell
    return found


def _found(found: Mapping[tuple[Place, int], Cell], place: Place, seed: int) -> Cell:
    if (place, seed) not in found:
        raise InputError(f"cells: {_words(place, seed)} is missing; give one for each combination")
    return found[place, seed]


def _words(place: Place, seed: int) -> str:
    where = ", ".join(f"{name} {value!r}" for name, value in place._asdict().items())
    return f"{where}, seed {seed}"
