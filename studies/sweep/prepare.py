"""From a study to its cells: one render a scene, what its cells share as files, and a cell for every combination."""

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.processors.catalogue import PROCESSORS
from render.transport import Transport
from rodcone.digests import digest, digest_bytes
from rodcone.jit import backend
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.budget.budget import render_share
from studies.budget.model_plan import Plan
from studies.metrics.truth import light_in_bands
from studies.photograph.clock import Clock
from studies.study.lit_scene import (
    OpenedScene,
    level_luminance,
    make_transport,
    render_facts,
    under,
    white_spectrum,
)
from studies.study.model import ImageModel
from studies.study.study import Condition, Study, conditions, parse_exposure
from studies.sweep.cells import Cell, RenderRecord, cell_key, coordinates
from studies.sweep.database import note_render, render_record
from studies.sweep.frames import (
    Frame,
    colours_under,
    frame_key,
    make_frames,
    read_frame,
)
from studies.sweep.provenance import provenance, versions

Progress = Callable[[float, float], None]
RENDERS, FRAMES, PICTURES = "renders", "frames", "pictures"  # folders beside the ledger
FELL_BACK = (
    "Neither LLVM nor CUDA answered: stock path + specfilm rendered in scalar_spectral, captures and the "
    "reconstruction ran their NumPy forms.",
)


@dataclass(frozen=True)
class Job:
    """A study being swept: with which plan, into which folder, noted in which ledger, its time taken by which clock."""

    study: Study
    plan: Plan
    out: Path
    base: sqlite3.Connection
    clock: Clock = field(default_factory=Clock)


Sensors = tuple[SensorConfig, SensorConfig]


class Variant(NamedTuple):
    """What a scene is imaged with."""

    spectrum: str
    sensor: str
    processor: str
    model: ImageModel


def known_cells(job: Job, opened: OpenedScene) -> list[Cell] | None:
    """Cells of one scene in the study's order; None where it isn't rendered yet, or what they share isn't whole."""
    record = render_record(job.base, _request(job, opened))
    return None if record is None else _cells(job, opened, record)


def scene_cells(job: Job, opened: OpenedScene, progress: Progress) -> list[Cell]:
    """Cells of one scene in the study's order; renders only where something that they share is missing.

    Raises
    ------
    InputError
        As `make_transport`, and for a processor that can't develop what a sensor gives.
    OSError
        Where a file can't be written.
    """
    cells = known_cells(job, opened)
    if cells is not None:
        return cells
    with job.clock.stage("renders"):
        model = job.plan.renders.get(opened.choice)
        share = partial(_brightest_share, job, opened)
        transport, assumed = make_transport(opened, job.study, model, job.out / RENDERS, progress, share)
    with job.clock.stage("what cells share"):
        record = RenderRecord(
            content=digest_bytes(np.ascontiguousarray(transport.radiance).data),
            facts=render_facts(transport, transport.relight(luminance_cd_m2=1.0)),
            brightest_share=None if job.study.render.noise_share is None else share(transport),
            notes=(*opened.notes, *assumed, *(FELL_BACK if backend() == "numpy" else ())),
        )
        _make_files(job, opened, record, transport)
        note_render(job.base, _request(job, opened), record)
        cells = _cells(job, opened, record)
    if cells is None:
        raise OSError(None, "files just written are gone", str(job.out / FRAMES))
    return cells


def _brightest_share(job: Job, opened: OpenedScene, transport: Transport) -> float:
    """Largest `render_share` of the study's sensors in its brightest light: where a render's noise shows most."""
    study, shares = job.study, []
    for variant in _variants(job, opened):
        lit = under(transport, variant.spectrum)
        lux = lit.illuminance_lux(1.0)
        brightest = max(level_luminance(level, lux) for level in study.levels)
        _, sensor = _sensors(variant)
        shares += [
            render_share(lit, sensor, brightest, study.longest_exposure_s, parse_exposure(exposure))
            for exposure in study.exposures
        ]
    return max(shares)


def _request(job: Job, opened: OpenedScene) -> str:
    asked = [opened.identity, job.plan.renders.get(opened.choice), job.study.render]
    return digest([*asked, backend(), versions()])


def _variants(job: Job, opened: OpenedScene) -> list[Variant]:
    """What the scene is imaged with, each once: levels, exposures and seeds share it."""
    made = (
        Variant(condition.spectrum, condition.sensor, name, job.plan.images[condition])
        for condition in _conditions(job, opened)
        for name in job.study.processors
    )
    return list(dict.fromkeys(made))


def _conditions(job: Job, opened: OpenedScene) -> Iterator[Condition]:
    return (condition for condition in conditions(job.study) if condition.scene == opened.choice)


def _sensors(variant: Variant) -> Sensors:
    """Preset of a variant, and the sensor that is modelled."""
    own = preset(variant.sensor)
    return own, replace(vary(own, PROCESSORS[variant.processor].mosaic), lens=variant.model.lens)


def _make_files(job: Job, opened: OpenedScene, record: RenderRecord, transport: Transport) -> None:
    """Make what is missing of the files that the scene's cells share."""
    folder = job.out / FRAMES
    folder.mkdir(parents=True, exist_ok=True)
    for spectrum in job.study.spectra:
        wanted = {
            key: sensors
            for variant, key, sensors in _keyed(job, opened, record)
            if variant.spectrum == spectrum and read_frame(folder, key, sensors[1]) is None
        }
        if wanted:
            light = light_in_bands(white_spectrum(opened, spectrum), transport.wavelength_nm, transport.width_nm)
            make_frames(folder, under(transport, spectrum), light, wanted)


def _keyed(job: Job, opened: OpenedScene, record: RenderRecord) -> Iterator[tuple[Variant, str, Sensors]]:
    """Each variant with its frame's key, its preset and the sensor as modelled."""
    for variant in _variants(job, opened):
        sensors = _sensors(variant)
        yield variant, frame_key(record.content, opened, variant.spectrum, *sensors), sensors


def _cells(job: Job, opened: OpenedScene, record: RenderRecord) -> list[Cell] | None:
    """Cells of a scene whose files stand; None where one is missing."""
    shared: dict[Variant, tuple[Frame, ColourFit]] = {}
    for variant, key, (_, sensor) in _keyed(job, opened, record):
        frame = read_frame(job.out / FRAMES, key, sensor)
        if frame is None:
            return None
        white = white_spectrum(opened, variant.spectrum)
        shared[variant] = frame, colours_under(sensor, PROCESSORS[variant.processor], white)
    return [
        _cell(job, condition, name, seed, record, *shared[Variant(condition.spectrum, condition.sensor, name, model)])
        for condition in _conditions(job, opened)
        for model in (job.plan.images[condition],)
        for name in job.study.processors
        for seed in job.study.seeds
    ]


def _cell(
    job: Job,
    condition: Condition,
    processor: str,
    seed: int,
    record: RenderRecord,
    frame: Frame,
    colours: ColourFit,
) -> Cell:
    at = coordinates(condition, processor, seed)
    luminance = level_luminance(condition.level, frame.lux_per_cd_m2)
    asked_s = parse_exposure(condition.exposure)
    exposure_s = min(job.study.longest_exposure_s, frame.auto_s / luminance) if asked_s is None else asked_s
    made_by = provenance(record.facts.variant, processor, exact=job.plan.images[condition].exact)
    return Cell(
        key=cell_key(at, frame.key, luminance, exposure_s, colours, made_by),
        at=at,
        luminance_cd_m2=luminance,
        illuminance_lux=None if frame.lux_per_cd_m2 is None else luminance * frame.lux_per_cd_m2,
        exposure_s=exposure_s,
        sensor=frame.sensor,
        made_by=made_by,
        colours=colours,
        light=frame.light,
        white_cd_m2=frame.white_cd_m2 * luminance,
        electrons=frame.electrons.resolve(),
        half_difference=frame.half_difference.resolve(),
        truth=frame.truth.resolve(),
        pictures=(job.out / PICTURES).resolve(),
        render=record,
        budget_share=job.plan.shares.get(condition),
    )
