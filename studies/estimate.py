"""What a run will take, before anything is computed: cells, renders, time and memory, as orders of magnitude."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from render.radiance_source import is_radiance_file
from scenes.catalog import load
from scenes.levels import DEMO_LEVELS
from studies.camera import CAMERAS
from studies.demo import WAVELENGTH_NM, Demo
from studies.lit_scene import OpenedScene
from studies.memory import Memory
from studies.model import Plan
from studies.study import SceneChoice, Study, conditions

# Measured on two shared cores of a server (AVX-512): `benchmarks/bench_sweep.py` prints them for another machine.
RENDER_S = 1e-7  # a pixel, sample, band and light group
CELL_S = 6e-6  # a pixel: capture, development, metrics and file together, mean of the interleaved and Bayer cameras
CELL_LEAST_S = 0.05  # a cell of any size
START_S = 4.0  # a worker's imports
# Bytes a pixel, counted from the arrays held at once; `tests/test_studies_memory.py` compares them with measured peaks.
_TRANSPORT_ARRAYS = 3  # radiance, half difference, variance, float32, each by group and band
_VIEW_ARRAYS = 7  # one pass's planes and their copies; later relit radiance, its halves, and an image forming
_RENDER_BYTES = 120  # whatever the bands: the render's marks, a preview
_CELL_BYTES = 800  # mosaic, planes, patches' packed planes, picture, and two truths with their CIELABs
_PICTURE_BYTES = 50  # of each picture kept until the report: floats, its place on the overview, its file
PROCESS_BYTES = 350e6  # libraries and compiled kernels
_FILE_BANDS = 40  # of a picture file
_FILE_PACKING = 1.5  # its bytes of float32 over those on disk: 1.2 with the noise of a render, more without


@dataclass(frozen=True)
class Estimate:
    """Sizes of a sweep.

    Attributes
    ----------
    cells, kept, renders, workers : int
        `kept` cells stand in the ledger from an earlier run; `renders` counts scenes, files of radiance left out.
    seconds : float
        With so many workers, renders done before or `kept` cells not taken off.
    bytes : float
        Memory of all processes together, at most.
    largest_bytes : float
        Memory of the process that needs most.
    """

    cells: int
    kept: int
    renders: int
    workers: int
    seconds: float
    bytes: float
    largest_bytes: float


def memory(pixels: int, bands: int, groups: int, workers: int = 0, pictures: int = 0) -> Memory:
    """Memory that a render of so many light groups needs, and what comes after it.

    Parameters
    ----------
    pixels, bands, groups : int
        No groups for a picture file, which needs no render.
    workers : int
        Processes that develop cells; 1: the process that renders does, 0: no cells are made here.
    pictures : int
        Kept until all are made.
    """
    arrays = _TRANSPORT_ARRAYS * groups + _VIEW_ARRAYS
    rendering = PROCESS_BYTES + pixels * (4.0 * arrays * bands + _RENDER_BYTES + _PICTURE_BYTES * pictures)
    if workers <= 1:
        own = rendering + workers * _CELL_BYTES * pixels
        return Memory(own, own)
    worker = PROCESS_BYTES + _CELL_BYTES * pixels
    return Memory(rendering + workers * worker, max(rendering, worker))


def file_extent(path: str | Path) -> tuple[int, int, int]:
    """Pixels, bands and light groups that a picture file counts as, by its bytes: its header isn't read yet."""
    values = Path(path).stat().st_size * _FILE_PACKING / 4
    return round(values / _FILE_BANDS), _FILE_BANDS, 0


def demo_memory(demo: Demo) -> Memory:
    """Memory that a demo needs."""
    if is_radiance_file(demo.scene):
        pixels, bands, groups = file_extent(demo.scene)
    else:
        pixels, bands, groups = demo.size**2, len(WAVELENGTH_NM), len(load(demo.scene).groups)
    levels = len(DEMO_LEVELS if demo.levels is None else demo.levels)
    return memory(pixels, bands, groups, workers=1, pictures=levels * len(demo.sensors) * len(CAMERAS))


def estimate(study: Study, plan: Plan, scenes: Mapping[SceneChoice, OpenedScene], workers: int, kept: int) -> Estimate:
    """Estimate a sweep."""
    cells = len(conditions(study)) * len(study.processors) * len(study.seeds)
    per_scene = cells / len(scenes)
    seconds = START_S if workers > 1 else 0.0
    needs = []
    for choice, opened in scenes.items():
        if opened.scene is None:
            pixels, bands, groups = file_extent(choice.source)
        else:
            model, pixels, groups = plan.renders[choice], opened.size[0] * opened.size[1], len(opened.scene.groups)
            bands = len(model.wavelength_nm)
            seconds += RENDER_S * pixels * bands * groups * model.spp
        seconds += per_scene * max(CELL_LEAST_S, CELL_S * pixels) / max(workers, 1)
        needs.append(memory(pixels, bands, groups, workers))
    renders = sum(opened.scene is not None for opened in scenes.values())
    total, largest = max(need.total for need in needs), max(need.largest for need in needs)
    return Estimate(cells, kept, renders, workers, seconds, total, largest)


def as_facts(found: Estimate) -> dict[str, Any]:
    """Estimate as JSON holds it."""
    return dict(vars(found))
