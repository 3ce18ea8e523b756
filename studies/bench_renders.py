"""The render's choices measured: numbers of bands, and samples a pixel."""

from functools import partial

import numpy as np

from render.engine import render
from render.scene import Scene
from render.transport import Transport
from sensor.config import SensorConfig
from studies.bench_points import Point, Stage, timed
from studies.bench_setup import MOST_BANDS, Bench, exposure_s_of, mosaic_e, noise_e_of, rms_e
from studies.plan_bands import fine_bands, groups_of


def by_bands(bench: Bench, scene: Scene, sensor: SensorConfig) -> tuple[Transport, Stage]:
    """Renders of the same paths in ever more bands; the finest first, for the others are measured against it."""
    nm, width_nm = fine_bands(group.spectrum for group in scene.groups.values())
    made: dict[int, tuple[Transport, float, float]] = {}
    for count in sorted({*bench.bands, MOST_BANDS}, reverse=True):
        groups = groups_of(width_nm, count)
        first = np.array([nm[group[0]] - width_nm[group[0]] / 2 for group in groups])
        widths = np.array([width_nm[group].sum() for group in groups])

        one = partial(
            render,
            scene,
            (bench.size, bench.size),
            wavelength_nm=first + widths / 2,
            width_nm=widths,
            max_spp=bench.samples[0],
            seed=bench.seed,
        )
        made[count] = timed(one, bench.repeats)
    finest, _, finest_s = made[MOST_BANDS]
    exposure_s = exposure_s_of(bench, sensor, finest)
    truth = mosaic_e(bench, sensor, finest, exposure_s)
    points = [
        Point(f"{count} bands", first_s, seconds, rms_e(mosaic_e(bench, sensor, transport, exposure_s), truth, sensor))
        for count, (transport, first_s, seconds) in sorted(made.items())
    ]
    question = f"How many bands? {bench.scene}, {bench.size}x{bench.size}, {bench.samples[0]} samples a pixel"
    noise_e = noise_e_of(truth, sensor, exposure_s)
    words = f"{MOST_BANDS} bands of the same paths"
    return finest, Stage("bands", question, words, noise_e, tuple(points), finest_s)


def by_samples(bench: Bench, scene: Scene, sensor: SensorConfig) -> Stage:
    """One render that goes on and on, against another one of four times its samples."""
    edges = np.linspace(380.0, 780.0, 9)
    centres, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)

    def made(spp: int, seed: int, resume: Transport | None) -> Transport:
        size = (bench.size, bench.size)
        # 1 ms: two passes of 16 samples are made in any case, and later calls go on with passes of 16
        limit = {"max_spp": spp} if resume is not None else {"max_seconds": 1e-3}
        return render(scene, size, wavelength_nm=centres, width_nm=widths, seed=seed, resume=resume, **limit)

    reference: Transport | None = None
    for spp in (1, 4 * bench.samples[-1]):
        reference = made(spp, bench.seed + 1, reference)
    assert reference is not None
    exposure_s = exposure_s_of(bench, sensor, reference)
    truth = mosaic_e(bench, sensor, reference, exposure_s)
    points, transport = [], made(1, bench.seed, None)
    for spp in bench.samples:
        transport = made(spp, bench.seed, transport)
        error_e = rms_e(mosaic_e(bench, sensor, transport, exposure_s), truth, sensor)
        points.append(Point(f"{transport.spp} samples", transport.seconds, transport.seconds, error_e))
    return Stage(
        "samples",
        f"How many samples a pixel? {bench.scene}, {bench.size}x{bench.size}, 8 bands",
        f"{reference.spp} samples of another seed, whose own noise is in the errors",
        noise_e_of(truth, sensor, exposure_s),
        tuple(points),
        reference.seconds,
    )
