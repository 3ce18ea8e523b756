"""Prepare a study's cells: a render per scene, the files that a scene's cells share, and a cell per combination."""

import sqlite3
import warnings
from collections import defaultdict
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Protocol

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.processors.catalogue import Processor
from isp.processors.own import own_version, processor_of, user_file
from render.bands.error import WideBandsWarning
from render.geometry import horizontal_view_deg
from render.transport import Transport
from rodcone.digests import digest_bytes, digest_inputs
from rodcone.jit import backend
from rodcone.types import Progress
from sensor.burst import merged_sensor
from sensor.config import LensConfig, SensorConfig
from sensor.flicker.rows import steady_exposure_s
from sensor.flicker.waveform import waveform
from sensor.lens.illumination import framed
from sensor.presets import preset, vary
from studies.budget.ledger import Plan
from studies.metrics.truth import light_in_bands
from studies.photograph.clock import Clock
from studies.study.levels import parse_exposure
from studies.study.lit_scene import (
    OpenedScene,
    level_luminance,
    lux_per_cd_m2,
    make_transport,
    photographed,
    under,
    white_spectrum,
)
from studies.study.render_facts import render_facts
from studies.study.render_noise import render_share
from studies.study.study import Condition, Study, conditions, label, study_mosaics
from studies.sweep.cells import Cell, RenderRecord, cell_keys
from studies.sweep.database import note_render, render_record
from studies.sweep.frames import UnitFrame, colours_under, frame_key, kept_exposures, load_frame, make_frames
from studies.sweep.moving import MovingLight, part_of
from studies.sweep.provenance import provenance, versions

# Folders beside the results database: the fourth holds a plan's renders, the last two a data set's planes and shards.
FOLDERS = RENDERS, FRAMES, PICTURES, PILOTS, PLANES, SET = "renders", "frames", "pictures", "pilots", "planes", "set"
FELL_BACK = ("Neither LLVM nor CUDA answered: captures and the reconstruction ran their NumPy forms.",)


@dataclass(frozen=True)
class Job:
    """Study that is swept, with its plan, the folder and database of its results, and the clock of the run."""

    study: Study
    plan: Plan
    out: Path
    base: sqlite3.Connection
    clock: Clock = field(default_factory=Clock)

    @cached_property
    def own(self) -> dict[str, dict[str, str]]:
        """Return the `own_version` of each processor, found once as the sweep begins.

        A processor whose file changes during the sweep is therefore refused.
        """
        return {name: own_version(name) for name in self.study.processors}

    @cached_property
    def software(self) -> dict[str, Processor]:
        """Return each processor by its name, loaded once."""
        return {name: processor_of(name, user_versions) for name, user_versions in self.own.items()}


class StageClock(Protocol):
    """Clock that notes the seconds of stages."""

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Add the seconds of the ``with`` block to a stage."""


# What identifies a frame: spectrum, sensor, modelled lens, exposure of a scene that moves (else empty), and mosaic.
Imaged = tuple[str, str, LensConfig, str, str]
Sensors = tuple[SensorConfig, SensorConfig]


def known_cells(job: Job, opened: OpenedScene) -> list[Cell] | None:
    """Return the cells of one scene in the study's order; None before its render, or where a shared file is damaged.

    They lack the colours that `coloured` adds, because cells whose results are stored need none.
    """
    record = render_record(job.base, _request(job, opened))
    return None if record is None else _cells(job, opened, record)


def coloured(job: Job, opened: OpenedScene, cells: Sequence[Cell]) -> list[Cell]:
    """Add to those cells of a scene that lack them the colours of their processors under its light."""
    sensors = _imaged(job, opened) if cells else {}
    software = {_portable(name): software for name, software in job.software.items()}
    fits: dict[tuple[Imaged, str], ColourFit] = {}

    def fit(cell: Cell) -> ColourFit:
        imaged = *_image_of(job, cell.condition), software[cell.processor].mosaic
        if (imaged, cell.processor) not in fits:
            light = white_spectrum(opened, cell.condition.spectrum)
            fits[imaged, cell.processor] = colours_under(sensors[imaged][1], software[cell.processor], light)
        return fits[imaged, cell.processor]

    return [cell if cell.colours is not None else replace(cell, colours=fit(cell)) for cell in cells]


def _image_of(job: Job, condition: Condition) -> tuple[str, str, LensConfig, str]:
    """Return what identifies a frame but for the mosaic: spectrum, sensor, modelled lens, a moving scene's exposure."""
    exposure = "" if condition.scene.moments is None else condition.exposure
    return condition.spectrum, condition.sensor, job.plan.images[condition].lens, exposure


def _portable(processor: str) -> str:
    """Return a processor's name; a user's file is named by its whole path, because its worker may start elsewhere."""
    return str(Path(processor).resolve()) if user_file(processor) else processor


def scene_cells(job: Job, opened: OpenedScene, progress: Progress) -> list[Cell]:
    """Return the cells of one scene in the study's order; render the scene only if a file that they share is missing.

    Raises
    ------
    InputError
        As `make_transport`, and for a processor that can't develop what a sensor gives.
    OSError
        Where a file can't be written.
    """
    cells = known_cells(job, opened)
    if cells is None:
        record, cells = make_scene(job, opened, job.clock, progress)
        note_scene(job, opened, record)
    return coloured(job, opened, cells)


def make_scene(job: Job, opened: OpenedScene, clock: StageClock, progress: Progress) -> tuple[RenderRecord, list[Cell]]:
    """Render a scene and make the files that its cells share; return the render's record and the cells in order.

    Another thread may call this, because it doesn't touch the results database; `note_scene` stores the record there.

    Parameters
    ----------
    clock : StageClock
        Clock of the thread that makes the scene.

    Raises
    ------
    InputError, OSError
        As `scene_cells`.
    """
    moments = _moments(job, opened)
    with clock.stage("renders"):
        if moments is None:
            transport, assumed = scene_transport(job, opened, progress)
        else:
            transport, assumed = moments.middle(part_of(progress, 0, 2))
            content, seconds = moments.content(transport, part_of(progress, 1, 2))
    with clock.stage("what cells share"), warnings.catch_warnings():
        if job.plan.ledgers:  # the plan's ledgers include the error of wide bands already
            warnings.simplefilter("ignore", WideBandsWarning)
        facts = render_facts(transport, photographed(transport, 1.0))
        if moments is None:
            content = digest_bytes(np.ascontiguousarray((transport.denoised or transport).radiance).data)
        else:
            facts = replace(facts, seconds=seconds, spp=float(moments.model.spp))
        record = RenderRecord(
            content=content,
            facts=facts,
            brightest_share=None if job.study.render.noise_share is None else _brightest_share(job, opened, transport),
            notes=(*opened.notes, *assumed, *(FELL_BACK if backend() == "numpy" else ())),
        )
        _make_files(job, opened, record, transport, moments)
        cells = _cells(job, opened, record)
        if cells is None:
            raise OSError(None, "files just written are gone", str(job.out / FRAMES))
        return record, coloured(job, opened, cells)


def note_scene(job: Job, opened: OpenedScene, record: RenderRecord) -> None:
    """Store a render's record in the results database, which marks the scene's files as made."""
    note_render(job.base, _request(job, opened), record)


def scene_transport(job: Job, opened: OpenedScene, progress: Progress) -> tuple[Transport, tuple[str, ...]]:
    """Return a scene's transport, rendered now or before, and notes on what was assumed about a picture file."""
    model = job.plan.renders.get(opened.choice)
    share = partial(_brightest_share, job, opened)
    samples = job.plan.samples_a_side(opened.choice)
    return make_transport(opened, job.study, model, job.out / RENDERS, progress, share, samples)


def _moments(job: Job, opened: OpenedScene) -> MovingLight | None:
    """Return the light of a scene that moves; None for a scene that stands still."""
    if not opened.moving:
        return None
    samples = job.plan.samples_a_side(opened.choice)
    return MovingLight(opened, job.study, job.plan.renders[opened.choice], job.out / RENDERS, samples)


def _brightest_share(job: Job, opened: OpenedScene, transport: Transport) -> float:
    """Return the largest `render_share` of the study's sensors in its brightest light.

    A render's noise is largest there in comparison with the sensor's.
    """
    study = job.study
    samples = job.plan.samples_a_side(opened.choice)
    shares = []
    for (spectrum, *_), (_, sensor) in _imaged(job, opened).items():
        lit = under(transport, spectrum)
        lux = lux_per_cd_m2(lit, study.levels)
        brightest = max(level_luminance(level, lux) for level in study.levels)
        most = max(study.frames)
        for exposure in study.exposures:
            time_s = parse_exposure(exposure)
            longest_s = study.longest_exposure_s * most
            whole_s = None if time_s is None else time_s * most
            burst = merged_sensor(sensor, most)
            shares.append(render_share(lit, burst, brightest, longest_s, whole_s, samples=samples))
    return max(shares)


def _request(job: Job, opened: OpenedScene) -> str:
    samples = job.plan.samples_a_side(opened.choice)
    terms = [opened.identity, job.plan.renders.get(opened.choice), job.study.render, samples]
    return digest_inputs([*terms, backend(), versions()])


def _imaged(job: Job, opened: OpenedScene) -> dict[Imaged, Sensors]:
    """Return for each frame of a scene its preset, and the sensor with its mosaic and with the lens that is modelled.

    Levels and seeds share a frame, and so do exposures unless the scene moves.
    """
    sensors = {}
    view_deg = None if opened.scene is None else horizontal_view_deg(opened.scene.geometry["sensor"], opened.size)
    for condition in conditions(job.study, opened.choice):
        unmodelled = job.study.lens.behind(preset(condition.sensor))
        lens = job.plan.images[condition].lens
        for mosaic in study_mosaics(job.study):
            sensors[*_image_of(job, condition), mosaic] = (
                unmodelled,
                replace(vary(unmodelled, mosaic), lens=framed(lens, view_deg)),
            )
    return sensors


def _make_files(
    job: Job, opened: OpenedScene, record: RenderRecord, transport: Transport, moments: MovingLight | None
) -> None:
    """Make the missing ones of the files that a scene's cells share; a scene that moves has some for each exposure."""
    folder = job.out / FRAMES
    folder.mkdir(parents=True, exist_ok=True)
    samples = job.plan.samples_a_side(opened.choice)
    for spectrum in job.study.spectra:
        light = light_in_bands(white_spectrum(opened, spectrum), transport.wavelength_nm, transport.width_nm)
        absent = defaultdict[tuple[str, float], dict[str, Sensors]](dict)
        for (under_spectrum, *_, exposure, _), sensors in _imaged(job, opened).items():
            key = frame_key(record.content, opened, spectrum, job.study, *sensors, exposure)
            if under_spectrum == spectrum and load_frame(folder, key, sensors[1]) is None:
                absent[exposure, sensors[1].row_time_us if exposure else 0.0][key] = sensors
        for (exposure, _), wanted in absent.items():
            lit = under(transport, spectrum)
            still = None
            if moments is not None:
                (_, sensor), *_ = wanted.values()
                exposed = moments.exposed(sensor, parse_exposure(exposure) or 0.0, transport)
                lit, still = under(exposed, spectrum), lit
            make_frames(folder, lit, light, wanted, job.study, samples, still)


def _cells(job: Job, opened: OpenedScene, record: RenderRecord) -> list[Cell] | None:
    """Return the cells of a scene whose files are there, without their colours; None where a file is missing."""
    # Frames that the cells share, by what identifies them.
    frames = dict[Imaged, UnitFrame]()
    for imaged, sensors in _imaged(job, opened).items():
        key = frame_key(record.content, opened, imaged[0], job.study, *sensors, imaged[-2])
        frame = load_frame(job.out / FRAMES, key, sensors[1])
        if frame is None:
            return None
        frames[imaged] = frame
    # Processors, balances and seeds share exposures: each frame has one per rule, gain and level.
    exposures = dict[tuple[str, str, str], list[tuple[float, SensorConfig]]]()
    cells = []
    lamps = waveform(job.study.flicker) if job.study.flicker else None
    seeds = job.study.seeds
    pictures = (job.out / PICTURES).resolve()
    for condition in conditions(job.study, opened.choice):
        image = job.plan.images[condition]
        for name, software in job.software.items():
            frame = frames[*_image_of(job, condition), software.mosaic]
            luminance = level_luminance(condition.level, frame.lux_per_cd_m2)
            asked = frame.key, condition.exposure, condition.gain
            if asked not in exposures:
                limits = job.study.levels, job.study.longest_exposure_s
                exposures[asked] = kept_exposures(job.out / FRAMES, frame, *asked[1:], *limits)
            exposure_s, sensor = exposures[asked][job.study.levels.index(condition.level)]
            if lamps is not None and parse_exposure(condition.exposure) is None:
                exposure_s = steady_exposure_s([lamps], exposure_s)
            made_by = provenance(record.facts.variant, name, software.on_backend, job.own[name], image.exact)
            keys = cell_keys(condition, label(name), seeds, frame.key, luminance, exposure_s, made_by, lamps)
            of_sensor = replace(frame, sensor=sensor)
            processor = _portable(name)
            cells += [
                Cell(
                    key=key,
                    condition=condition,
                    processor=processor,
                    seed=seed,
                    luminance_cd_m2=luminance,
                    illuminance_lux=None if frame.lux_per_cd_m2 is None else luminance * frame.lux_per_cd_m2,
                    exposure_s=exposure_s,
                    frame=of_sensor,
                    made_by=made_by,
                    colours=None,
                    white_cd_m2=frame.white_cd_m2 * luminance,
                    pictures=pictures,
                    render=record,
                    budget_share=job.plan.shares.get(condition),
                    flicker=lamps,
                )
                for key, seed in zip(keys, seeds, strict=True)
            ]
    return cells
