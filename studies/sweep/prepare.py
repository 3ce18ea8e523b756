"""From a study to its cells: one render a scene, what its cells share as files, and a cell for every combination."""

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
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
from studies.budget.model_plan import Plan
from studies.photograph.clock import Clock
from studies.study.lit_scene import OpenedScene, level_luminance, make_transport, under, white_spectrum
from studies.study.model import ImageModel
from studies.study.study import Condition, Study, conditions, parse_exposure
from studies.sweep.cells import Cell, cell_key, coordinates
from studies.sweep.database import RenderRecord, note_render, render_record
from studies.sweep.frames import (
    Frame,
    LitScene,
    colours_under,
    frame_key,
    lit_key,
    make_frame,
    make_lit,
    read_frame,
    read_lit,
)
from studies.sweep.provenance import provenance, versions

Progress = Callable[[float, float], None]
RENDERS, FRAMES, PICTURES = "renders", "frames", "pictures"  # folders beside the ledger


@dataclass(frozen=True)
class Job:
    """A study being swept: with which plan, into which folder, noted in which ledger, its time taken by which clock."""

    study: Study
    plan: Plan
    out: Path
    base: sqlite3.Connection
    clock: Clock = field(default_factory=Clock)


class Variant(NamedTuple):
    """What a scene is imaged with."""

    spectrum: str
    sensor: str
    processor: str
    model: ImageModel


class Shared(NamedTuple):
    """What the cells of one variant share."""

    scene: LitScene
    frame: Frame
    colours: ColourFit


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
        transport = make_transport(opened, job.study, model, job.out / RENDERS, progress)
    with job.clock.stage("what cells share"):
        record = RenderRecord(
            digest_bytes(np.ascontiguousarray(transport.radiance).data),
            transport.variant,
            transport.spp,
            transport.wavelength_nm.size,
            transport.seconds,
        )
        _make_files(job, opened, record, transport)
        note_render(job.base, _request(job, opened), record)
        cells = _cells(job, opened, record)
    if cells is None:
        raise OSError(None, "files just written are gone", str(job.out / FRAMES))
    return cells


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


def _sensors(variant: Variant) -> tuple[SensorConfig, SensorConfig]:
    """Preset of a variant, and the sensor that is modelled."""
    own = preset(variant.sensor)
    return own, replace(vary(own, PROCESSORS[variant.processor].mosaic), lens=variant.model.lens)


def _make_files(job: Job, opened: OpenedScene, record: RenderRecord, transport: Transport) -> None:
    """Make what is missing of the files that the scene's cells share."""
    folder = job.out / FRAMES
    folder.mkdir(parents=True, exist_ok=True)
    for spectrum in job.study.spectra:
        lit = under(transport, spectrum)
        views = (lit.relight(luminance_cd_m2=1.0), *lit.relight_halves(luminance_cd_m2=1.0))
        key = lit_key(record.content, opened, spectrum)
        if read_lit(folder, key) is None:
            make_lit(folder, key, opened, lit, spectrum)
        for variant in (each for each in _variants(job, opened) if each.spectrum == spectrum):
            own, sensor = _sensors(variant)
            name = frame_key(key, own, sensor)
            if read_frame(folder, name, sensor) is None:
                make_frame(folder, name, views, own, sensor)


def _cells(job: Job, opened: OpenedScene, record: RenderRecord) -> list[Cell] | None:
    """Cells of a scene whose files stand; None where one is missing."""
    shared: dict[Variant, Shared] = {}
    for variant in _variants(job, opened):
        own, sensor = _sensors(variant)
        lit = read_lit(job.out / FRAMES, lit_key(record.content, opened, variant.spectrum))
        frame = None if lit is None else read_frame(job.out / FRAMES, frame_key(lit.key, own, sensor), sensor)
        if lit is None or frame is None:
            return None
        white = white_spectrum(opened, variant.spectrum)
        shared[variant] = Shared(lit, frame, colours_under(sensor, PROCESSORS[variant.processor], white))
    return [
        _cell(job, condition, name, seed, record, shared[Variant(condition.spectrum, condition.sensor, name, model)])
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
    shared: Shared,
) -> Cell:
    scene, frame = shared.scene, shared.frame
    at = coordinates(condition, processor, seed)
    luminance = level_luminance(condition.level, scene.lux_per_cd_m2)
    asked_s = parse_exposure(condition.exposure)
    exposure_s = min(job.study.longest_exposure_s, frame.auto_s / luminance) if asked_s is None else asked_s
    made_by = provenance(record.variant, processor, exact=job.plan.images[condition].exact)
    return Cell(
        key=cell_key(at, frame.key, luminance, exposure_s, shared.colours, made_by),
        at=at,
        luminance_cd_m2=luminance,
        illuminance_lux=None if scene.lux_per_cd_m2 is None else luminance * scene.lux_per_cd_m2,
        exposure_s=exposure_s,
        sensor=frame.sensor,
        made_by=made_by,
        colours=shared.colours,
        light=scene.light,
        white_cd_m2=scene.white_cd_m2 * luminance,
        electrons=frame.electrons.resolve(),
        half_difference=frame.half_difference.resolve(),
        truth=scene.truth.resolve(),
        pictures=(job.out / PICTURES).resolve(),
        spp=record.spp,
        bands=record.bands,
        render_s=record.seconds,
        budget_share=job.plan.shares.get(condition),
    )
