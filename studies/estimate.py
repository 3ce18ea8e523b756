"""What a sweep will take, before anything is computed: cells, renders, time and memory, as orders of magnitude."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from studies.lit_scene import OpenedScene
from studies.model import Plan
from studies.study import SceneChoice, Study, conditions

# Measured on two shared cores of a server (AVX-512): `benchmarks/bench_sweep.py` prints them for another machine.
RENDER_S = 1e-7  # a pixel, sample, band and light group
CELL_S = 6e-6  # a pixel: capture, development, metrics and file together, mean of the interleaved and Bayer cameras
CELL_LEAST_S = 0.05  # a cell of any size
START_S = 4.0  # a worker's imports
# Bytes a pixel, counted from the arrays held at once.
_TRANSPORT_ARRAYS = 3  # radiance, half difference, variance, float32, each by group and band
_VIEW_ARRAYS = 5  # relit radiance, its halves, and an image forming, float32, each by band
_CELL_BYTES = 800  # mosaic, planes, patches' packed planes, picture, and two truths with their CIELABs
WORKER_BYTES = 350e6  # libraries and compiled kernels


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
    """

    cells: int
    kept: int
    renders: int
    workers: int
    seconds: float
    bytes: float


def estimate(study: Study, plan: Plan, scenes: Mapping[SceneChoice, OpenedScene], workers: int, kept: int) -> Estimate:
    """Estimate a sweep; picture files, whose size is known only when they are read, count as a megapixel."""
    cells = len(conditions(study)) * len(study.processors) * len(study.seeds)
    per_scene = cells / len(scenes)
    seconds = START_S if workers > 1 else 0.0
    memory = 0.0
    for choice, opened in scenes.items():
        pixels = opened.size[0] * opened.size[1] or 10**6
        model, scene = plan.renders.get(choice), opened.scene
        bands = 40 if model is None else len(model.wavelength_nm)
        groups = 1 if scene is None else len(scene.groups)
        if scene is not None and model is not None:
            seconds += RENDER_S * pixels * bands * groups * model.spp
        seconds += per_scene * max(CELL_LEAST_S, CELL_S * pixels) / workers
        arrays = _TRANSPORT_ARRAYS * groups + _VIEW_ARRAYS
        memory = max(memory, 4.0 * arrays * bands * pixels + workers * (WORKER_BYTES + _CELL_BYTES * pixels))
    renders = sum(opened.scene is not None for opened in scenes.values())
    return Estimate(cells, kept, renders, workers, seconds, memory)


def as_facts(found: Estimate) -> dict[str, Any]:
    """Estimate as JSON holds it."""
    return dict(vars(found))
