"""The render's choices measured: numbers of bands, and samples a pixel."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from render.engine import render
from render.scene import Scene
from render.spectrum import Floats
from render.transport import Transport
from sensor.config import SensorConfig
from studies.budget.bands import fine_bands, groups_of
from studies.speed.points import Point, Stage, Times, timed
from studies.speed.setup import MOST_BANDS, Bench, exposure_s_of, mosaic_e, noise_e_of, rms_e


def by_bands(bench: Bench, scene: Scene, sensor: SensorConfig) -> tuple[Transport, Stage]:
    """Renders of the same paths in ever more bands, against the finest."""
    nm, width_nm = fine_bands(group.spectrum for group in scene.groups.values())

    def call(count: int) -> Callable[[], Transport]:
        groups = groups_of(width_nm, count)
        first = np.array([nm[group[0]] - width_nm[group[0]] / 2 for group in groups])
        widths = np.array([width_nm[group].sum() for group in groups])
        return _render(bench, scene, first + widths / 2, widths, bench.samples[0], bench.seed)

    made = timed({f"{count} bands": call(count) for count in sorted({*bench.bands, MOST_BANDS})}, bench.repeats)
    finest, finest_times = made[f"{MOST_BANDS} bands"]
    question = f"How many bands? {bench.scene}, {bench.size}x{bench.size}, {bench.samples[0]} samples a pixel"
    words = f"{MOST_BANDS} bands of the same paths"
    return finest, _stage("bands", question, words, bench, sensor, finest, finest_times, made)


def by_samples(bench: Bench, scene: Scene, sensor: SensorConfig) -> Stage:
    """Ever more samples, against another render of four times the most."""
    edges = np.linspace(380.0, 780.0, 9)
    call = partial(_render, bench, scene, (edges[1:] + edges[:-1]) / 2, np.diff(edges))
    made = timed({f"{spp} samples": call(spp, bench.seed) for spp in bench.samples}, bench.repeats)
    most = 4 * bench.samples[-1]
    truth, truth_times = timed({"": call(most, bench.seed + 1)}, 0)[""]
    question = f"How many samples a pixel? {bench.scene}, {bench.size}x{bench.size}, 8 bands"
    words = f"{most} samples of another seed, whose own noise is in the errors"
    return _stage("samples", question, words, bench, sensor, truth, truth_times, made)


def _render(bench: Bench, scene: Scene, nm: Floats, width_nm: Floats, spp: int, seed: int) -> Callable[[], Transport]:
    size = (bench.size, bench.size)
    return partial(render, scene, size, wavelength_nm=nm, width_nm=width_nm, spp=spp, seed=seed)


def _stage(
    name: str,
    question: str,
    words: str,
    bench: Bench,
    sensor: SensorConfig,
    reference: Transport,
    reference_times: Times,
    made: Mapping[str, tuple[Transport, Times]],
) -> Stage:
    """Errors of renders against the reference's mosaic."""
    exposure_s = exposure_s_of(bench, sensor, reference)
    truth = mosaic_e(bench, sensor, reference, exposure_s)
    points = tuple(
        Point(choice, times, rms_e(mosaic_e(bench, sensor, transport, exposure_s), truth, sensor))
        for choice, (transport, times) in made.items()
    )
    return Stage(name, question, words, noise_e_of(truth, sensor, exposure_s), points, reference_times)
