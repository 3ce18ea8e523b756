"""What a run will take, before anything is computed: cells, renders, time and memory, as orders of magnitude."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod

from render.radiance_files.radiance_source import extent_of
from rodcone.memory import memory
from studies.budget.ledger import Plan
from studies.study.equal_area import sensor_shapes
from studies.study.lit_scene import OpenedScene
from studies.study.study import SceneChoice, Study, conditions

# Measured on two shared cores of a server (AVX-512): `benchmarks/bench_sweep.py` prints them for another machine.
RENDER_S = 1e-7  # a pixel, sample, band and light group
CELL_S = 6e-6  # a pixel: capture, development, metrics and file together, mean of the interleaved and Bayer cameras
CELL_LEAST_S = 0.05  # a cell of any size
START_S = 4.0  # a worker's imports


@dataclass(frozen=True)
class Estimate:
    """Sizes of a sweep.

    Attributes
    ----------
    cells, kept, renders, workers : int
        `kept` cells are in the ledger from an earlier run; `renders` counts scenes, not files of radiance.
    seconds : float
        With so many workers; renders and cells that exist already are counted too.
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


def estimate(study: Study, plan: Plan, scenes: Mapping[SceneChoice, OpenedScene], workers: int, kept: int) -> Estimate:
    """Estimate a sweep."""
    cells = len(conditions(study)) * len(study.processors) * len(study.seeds)
    per_scene = cells / len(scenes)
    seconds = START_S if workers > 1 else 0.0
    needs = []
    for choice, opened in scenes.items():
        if opened.scene is None:
            (pixels, bands, groups), denoised = extent_of(choice.source), False
        else:
            model, pixels, groups = plan.renders[choice], opened.size[0] * opened.size[1], len(opened.scene.groups)
            bands, denoised = len(model.wavelength_nm), model.denoise
            seconds += RENDER_S * pixels * bands * groups * model.spp
            if study.equal_area is not None:
                pixels = max(pixels, *map(prod, sensor_shapes(study.equal_area, study.sensors, opened.size).values()))
        seconds += per_scene * max(CELL_LEAST_S, CELL_S * pixels) / max(workers, 1)
        needs.append(memory(pixels, bands, groups, workers, denoised=denoised))
    renders = sum(opened.scene is not None for opened in scenes.values())
    total, largest = max(need.total for need in needs), max(need.largest for need in needs)
    return Estimate(cells, kept, renders, workers, seconds, total, largest)
