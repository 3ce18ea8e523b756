"""Estimate what a sweep needs before anything is computed: cells, time and memory."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

from render.radiance_files.radiance_source import extent_of
from render.reference import find_reference
from rodcone.memory import Memory, memory
from rodcone.progress import duration
from sensor.presets import preset
from studies.budget.ledger import Plan
from studies.budget.starting_points import plan_from_settings, reference_plan
from studies.study.cost import START_S, TABLE_BAND_S, TABLE_S, another_s, averaged_s, cores, pace, render_seconds
from studies.study.equal_area import sensor_shapes
from studies.study.lit_scene import OpenedScene, film_of, open_all
from studies.study.study import REFERENCE, SceneChoice, Study, conditions, study_mosaics
from studies.sweep.database import FILE, made_with, read_results
from studies.sweep.provenance import versions

# All times are processor seconds on a server's cores with AVX-512, measured on 16 cells of the demo in one process.
_SHARED_S = 7e-7  # to form an image that cells share, per pixel and band
_READ_S = 3e-7  # to read a picture file, per pixel and band
_PILOT_S = 6.0  # a scene's pilot render, and the effects that a plan computes from it
_PICTURE_PILOT_S = 1.1  # the same for a picture file, which is only made smaller; measured by going on with two
_LIVE_SPP = 64  # samples per pixel of the render that is compared with a reference
_CELL_S = 5e-6, 0.03  # capture, metrics and files: per pixel, and per cell whatever its size
_FRAME_S = 5e-7, 0.02  # the same for a raw frame and its truth
# Words in a processor's name, the time in which it develops a pixel, and that of its first calls in each process.
_DEVELOP_S = (
    (("bm3d", "park"), 4e-5, 2.0),
    (("ple",), 5e-6, 2.2),
    (("residual",), 3.5e-6, 0.3),
    (("interleaved", "nlm"), 1.2e-6, 0.4),
)
_ANY_DEVELOP_S = 1e-6, 0.3
_FIRST_S = 0.7  # first captures and metrics of a process
_REPORT_S = 2.5, 0.05, 1e-4  # a report without cells, each cell whose picture it shows, and each other cell
# Most cells whose pictures a report shows. It repeats `MOST_CELLS` of `report_sweep`, which is slow to import.
SHOWN = 1000
_HALF_SIZE = 0.25  # part of the pixels that is left at half the width and height


@dataclass(frozen=True)
class Estimate:
    """Sizes of a sweep.

    Attributes
    ----------
    cells, kept, renders, workers : int
        At most `kept` cells are in the results database from a run of this code. `renders` doesn't count files of
        radiance; a scene that moves has one render per time and one for the middle.
    seconds : float
        Time with so many workers on this machine's cores, if they are idle. First calls, imports, metrics and the
        report are counted, and so are renders and cells that exist already.
    half_size_seconds, half_cells_seconds : float
        The same at half the width and height, and with half the cells.
    bytes : float
        Most memory of all processes together.
    largest_bytes : float
        Memory of the process that needs most.
    """

    cells: int
    kept: int
    renders: int
    workers: int
    seconds: float
    half_size_seconds: float
    half_cells_seconds: float
    bytes: float
    largest_bytes: float

    def words(self) -> str:
        """Return one line: what is made, its time and memory, and the time at half the size or with half the cells."""
        return (
            f"{self.cells} cells, at most {self.kept} kept from the last run; {self.renders} to render; about "
            f"{duration(self.seconds)} with {self.workers} workers, at most {self.bytes / 1e9:.1f} GB of memory, what "
            f"exists already counted too; at half the size {duration(self.half_size_seconds)}, with half the cells "
            f"{duration(self.half_cells_seconds)}"
        )

    def facts(self) -> dict[str, Any]:
        """Return the sizes by name."""
        return vars(self)


@dataclass(frozen=True)
class _Part:
    """One scene of a sweep: its pixels, bands, light groups, and samples per pixel (0 for a picture file).

    A scene that moves is rendered at `times` with so many samples each, and at its middle with as many as all of them.
    """

    pixels: int
    sensor_pixels: int
    bands: int
    groups: int
    spp: float
    denoised: bool = False
    times: int = 0

    @property
    def renders(self) -> int:
        """Return the number of renders."""
        return self.times + 1 if self.spp else 0


def estimated(
    study: Study, out: Path, workers: int, *, reference: bool = False, planned: bool = False, frames: bool = False
) -> Estimate:
    """Estimate a sweep into a folder from the study's own settings; a plan chooses at most these.

    Parameters
    ----------
    study : Study
    out : Path
    workers : int
    reference : bool
        Whether the sweep models everything, as the starting point ``reference`` does.
    planned : bool
        Whether a plan renders its pilots before the sweep.
    frames : bool
        Whether only raw frames are made, one cell per mosaic, as a data set has them.
    """
    everything = reference or study.budget.model == REFERENCE
    plan = reference_plan(study) if everything else plan_from_settings(study)
    code = versions()["rodcone"]
    kept = 0
    if (out / FILE).is_file():
        with read_results(out) as base:
            kept = sum(count for text, count in made_with(base).items() if _code_of(text) == code)
    return estimate_cost(study, plan, open_all(study), workers, kept, planned=planned, frames=frames)


def _code_of(versions_text: str) -> str | None:
    """Return rodcone's version from the versions in a row; None for a damaged row, which a sweep makes again."""
    try:
        return str(json.loads(versions_text)["rodcone"])
    except (ValueError, TypeError, LookupError):
        return None


def estimate_cost(
    study: Study,
    plan: Plan,
    scenes: Mapping[SceneChoice, OpenedScene],
    workers: int,
    kept: int,
    *,
    planned: bool = False,
    frames: bool = False,
) -> Estimate:
    """Estimate a sweep of opened scenes, `kept` of whose cells exist already.

    The other parameters are as in `estimated`.
    """
    cells = len(conditions(study)) * len(study.seeds) * len(study_mosaics(study) if frames else study.processors)
    parts = [_part(study, plan, opened) for opened in scenes.values()]
    need = _memory(parts, workers, ahead=workers > 1 and not frames)
    seconds = partial(_seconds, study, parts, workers, planned, frames)
    return Estimate(
        cells=cells,
        kept=kept,
        renders=sum(part.renders for part in parts),
        workers=workers,
        seconds=seconds(cells, 1.0),
        half_size_seconds=seconds(cells, _HALF_SIZE),
        half_cells_seconds=seconds(cells / 2, 1.0),
        bytes=need.total,
        largest_bytes=need.largest,
    )


def _memory(parts: Sequence[_Part], workers: int, *, ahead: bool) -> Memory:
    """Return the memory that the most demanding scene needs.

    With `ahead`, one scene's render may be in memory together with the cells of any other scene.
    """

    def of(part: _Part, workers: int) -> Memory:
        held = 2 if part.times else 0  # the middle's light, and the mean light of the earlier times
        sizes = part.pixels, part.bands, part.groups, workers
        return memory(*sizes, spp=part.spp, denoised=part.denoised, held=held)

    needs = [of(part, workers) for part in parts]
    largest = max(need.largest for need in needs)
    if not ahead:
        return Memory(max(need.total for need in needs), largest)
    renders = [of(part, 0).total for part in parts]
    cells = [need.total - render for need, render in zip(needs, renders, strict=True)]
    return Memory(max(renders) + max(cells), largest)


def _part(study: Study, plan: Plan, opened: OpenedScene) -> _Part:
    if opened.scene is None:
        pixels, bands, groups = extent_of(opened.choice.source)
        return _Part(pixels, pixels, bands, groups, 0)
    model = plan.renders[opened.choice]
    samples = plan.samples_a_side(opened.choice)
    film = film_of(opened, model, samples)
    pixels = prod(film.size)
    shapes = {} if study.equal_area is None else sensor_shapes(study.equal_area, study.sensors, opened.size)
    groups = len(opened.scene.groups)
    bands = len(model.wavelength_nm)
    found = study.render.reference and find_reference(opened.scene, film) is not None
    spp = _LIVE_SPP if found else model.spp
    largest = max(pixels, *map(prod, shapes.values()), 0)
    times = len(opened.moving)
    return _Part(pixels, largest, bands, groups, spp, model.denoise, times)


def _seconds(
    study: Study, parts: Sequence[_Part], workers: int, planned: bool, frames: bool, cells: float, scale: float
) -> float:
    """Estimate the time of a sweep on idle cores [s], with its pixels scaled by `scale`."""
    own = [(0.0, 0.0)] if frames else [_develop_s(name) for name in study.processors]
    pixel_s, least_s = _FRAME_S if frames else _CELL_S
    report_s, picture_s, row_s = (0.0, 0.0, 0.0) if frames else _REPORT_S
    first_s = _FIRST_S + sum(costs[1] for costs in own)
    images = len(study.sensors) * len(study.spectra) * len(study_mosaics(study))
    behind_tables = sum(bool(study.lens.table or preset(name).lens.table) for name in study.sensors)
    shared_s = _SHARED_S + TABLE_S * behind_tables / len(study.sensors)
    seconds = START_S * (2 if workers > 1 else 1) + first_s * max(1.0, workers / cores()) + report_s
    lights = 0.0
    for part in parts:
        pixels, of_sensor = part.pixels * scale, part.sensor_pixels * scale
        light = render_seconds(1, part.bands, part.groups, part.spp) * pixels if part.spp else 0.0
        lights += min(light, study.render.max_seconds or light) * max(1, 2 * part.times)
        exposed = len(study.exposures) if part.times else 1  # each exposure averages the times, and forms images
        of_light = pixels, part.bands, part.groups
        seconds += part.times * (another_s(*of_light) + exposed * averaged_s(*of_light))
        each = least_s + (pixel_s + sum(costs[0] for costs in own) / len(own)) * of_sensor
        at_once = max(1, min(workers, cores()))
        seconds += pixels * part.bands * (shared_s * images * exposed + _READ_S * (part.spp == 0))
        seconds += part.bands * TABLE_BAND_S * behind_tables  # all mosaics share the lens's images of points
        seconds += cells / len(parts) * each / at_once
        seconds += planned * (_PILOT_S if part.spp else _PICTURE_PILOT_S)
    seconds += picture_s * min(cells, SHOWN) + row_s * max(cells - SHOWN, 0.0)
    return lights + pace() * seconds


def _develop_s(processor: str) -> tuple[float, float]:
    """Return the processor time to develop a pixel, and that of the first calls in a process [s]."""
    for words, pixel_s, first_s in _DEVELOP_S:
        if any(word in processor for word in words):
            return pixel_s, first_s
    return _ANY_DEVELOP_S
