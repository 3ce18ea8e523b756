"""Make a data set from a study: check the order and the room on the disk, then make files, samples, shards and card."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

from isp.processors.own import processor_of
from rodcone.digests import digest
from rodcone.errors import InputError
from rodcone.files import is_half_written, write_files
from rodcone.progress import Step, progress_bar, render_words
from scenes.diorama import PICTURES_LICENCE
from studies.budget.starting_points import plan_from_settings
from studies.dataset.order import RENDERS, SetOrder, bytes_needed, check_cameras, require_room
from studies.dataset.sample import TRUTH, VERSION, Facts, Sample, frame_labels, plane_files, scene_facts
from studies.dataset.shards import MANIFEST, SPLITS, Lines, Runner, into_shards, make_shards, read_manifest, split_of
from studies.pages.page import write_out
from studies.study.lit_scene import OpenedScene, open_all
from studies.study.render_noise import noise_note
from studies.study.scene_source import open_radiance_file
from studies.study.study import Condition, Study, conditions, label, study_mosaics
from studies.sweep.cells import Cell
from studies.sweep.database import open_results
from studies.sweep.prepare import SET, Job, scene_cells
from studies.sweep.provenance import versions
from studies.sweep.run_sweep import locked_folder

CARD = "README.md"
_NOT_IN_KEYS = re.compile(r"[^A-Za-z0-9_-]")
_SHARD = re.compile(rf"({'|'.join(SPLITS)})-\d{{6}}\.tar")
# Bounds of the card's histograms.
_SNR_DB = (0.0, 10.0, 20.0, 30.0)
_NOISE = (0.01, 0.03, 0.1, 0.3, 1.0)


def make_set(
    study: Study, out: Path, order: SetOrder, command: str, runner: Runner, step: Step | None = None
) -> dict[str, Any]:
    """Make the missing shards of a set, its manifest and its card, in the folder ``set`` of a sweep's folder.

    After Ctrl-C, a kill or a full disk the next call goes on. The study's processors only say which mosaics there are.

    Parameters
    ----------
    study : Study
    out : Path
        Folder; renders and frames stay in it, where a sweep of the same study finds them.
    order : SetOrder
    command : str
        Command that makes the set, as manifest and card state it.
    runner : callable
        Function that takes shards and ``make``, and yields a result of `studies.dataset.shards.make_shard` when it is
        ready.
    step : callable, optional
        Function that is called with what is being done and the share that is done.

    Returns
    -------
    dict
        ``folder`` of the set; its numbers of ``samples`` and ``shards``; and ``made``, the shards that this call made.

    Raises
    ------
    InputError
        For cameras whose raw frames a sample can't hold, parts that don't fit, too little room on the disk, foreign
        files in the folder, or another set in it.
    OSError
        Where a file can't be written.
    """
    check_cameras(study, order)
    scenes = open_all(study)
    folder = out / SET
    for opened in scenes.values() if order.crop else ():
        file = opened.choice.source
        white = opened.white
        _windows(opened.size if opened.scene else open_radiance_file(file, white)[0].counts.shape, order.crop)
    identity = _identity(study, scenes.values(), order)
    with locked_folder(out), progress_bar(step) as show, open_results(out) as base:
        folder.mkdir(exist_ok=True)
        earlier = _earlier(folder, identity)
        job = Job(study, plan_from_settings(study), out, base)
        require_room(bytes_needed(study, job.plan, scenes.values(), order), out)
        # The files that samples are cut from.
        samples = list[Sample]()
        scene_lines = Lines()
        for index, opened in enumerate(scenes.values()):
            rendering = partial(_show_render, show, index, len(scenes))
            cells = scene_cells(job, opened, rendering)
            facts = scene_facts(job, opened, cells, rendering)
            samples += _samples_of(job, opened, cells, facts, order)
            scene_lines.append(_scene_line(opened, facts))
        shards = into_shards(samples, order.shards, folder)
        head = [_head(study, order, identity, len(samples), command), *scene_lines]
        made = make_shards(folder, shards, earlier, head, runner, show)
        write_files({folder / CARD: card(read_manifest(folder))})
    return {"folder": str(folder), "samples": len(samples), "shards": len(shards), "made": made}


def _show_render(show: Step, index: int, count: int, share: float, error: float) -> None:
    show(f"scene {index + 1} of {count}: {render_words(error, share)}", RENDERS * (index + share) / count)


def _identity(study: Study, scenes: Iterable[OpenedScene], order: SetOrder) -> str:
    """Return the hash of all that distinguishes one set from another: its scenes, its frames' names, and the order.

    Raises
    ------
    InputError
        For two frames with the same name.
    """
    alike = conditions(replace(study, white_balances=study.white_balances[:1]))  # balances share a frame
    names = [_name(*frame) for frame in product(alike, study_mosaics(study), study.seeds)]
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise InputError(f"study: two frames would be named {name!r}; allowed: names that differ; rename one")
    contents = sorted(opened.identity for opened in scenes), sorted(names)
    return digest([*contents, order.planes, order.shards, order.crop])


def _earlier(folder: Path, identity: str) -> Lines:
    """Return the manifest of the set in a folder, empty for a new one; refuse foreign files and another set."""
    for path in folder.iterdir():
        if path.name not in (MANIFEST, CARD) and not _SHARD.fullmatch(path.name) and not is_half_written(path):
            raise InputError(f"out: {folder} holds a foreign file, {path.name!r}; allowed: a set; move it away")
    lines = read_manifest(folder) if (folder / MANIFEST).exists() else []
    if lines and lines[0]["identity"] != identity:
        raise InputError(
            f"out: {folder} holds another set, {lines[0]['command']!r}, of other scenes, frames or options; allowed: a "
            "new folder or that of the same set; choose another with --out"
        )
    return lines


def _samples_of(job: Job, opened: OpenedScene, cells: Sequence[Cell], facts: Facts, order: SetOrder) -> list[Sample]:
    """Return the samples of a scene, one for each frame or part of a frame.

    Cells that differ only in how a frame is developed share its sample.
    """
    frames = {_name(x.condition, processor_of(x.processor).mosaic, x.seed): x for x in reversed(cells)}
    windows = _windows(np.load(cells[0].frame.electrons, mmap_mode="r").shape[:2], order.crop)
    return [
        Sample(
            key=f"{name}_{window[0]}-{window[1]}" if order.crop else name,
            cell=cell,
            mosaic=processor_of(cell.processor).mosaic,
            scene_hash=facts["hash"],
            split=split_of(facts["hash"]),
            files=plane_files(job, facts, cell, order.planes),
            illuminants=facts["illuminants"][cell.condition.spectrum],
            part=index if len(windows) > 1 else None,
            window=window,
        )
        for name, cell in frames.items()
        for index, window in enumerate(windows)
    ]


def _name(condition: Condition, mosaic: str, seed: int) -> str:
    """Return the name of a frame, in characters that every reader of WebDataset accepts."""
    parts = (*frame_labels(condition).values(), mosaic, f"s{seed}")
    return "_".join(_NOT_IN_KEYS.sub("-", part.removesuffix(".toml").replace(".", "p")) for part in parts)


def _windows(shape: tuple[int, ...], crop: int | None) -> list[tuple[int, int, int, int]]:
    """Return the parts of a frame as (first row, first column, height, width); raise `InputError` where none fits."""
    if crop and crop > min(shape):
        raise InputError(f"crop: {crop} exceeds the frames' side, {min(shape)}; allowed: up to that; raise render.size")
    height, width = (crop, crop) if crop else shape
    corners = product(range(0, shape[0] - height + 1, height), range(0, shape[1] - width + 1, width))
    return [(row, column, height, width) for row, column in corners]


def _scene_line(opened: OpenedScene, facts: Facts) -> dict[str, Any]:
    source = opened.choice.source
    textures = PICTURES_LICENCE if source.startswith("diorama") else "no texture of others"
    return {
        "kind": "scene",
        "name": opened.choice.label,
        "hash": facts["hash"],
        "split": split_of(facts["hash"]),
        "licence": "its owner's" if Path(source).suffix else f"MIT, as rodcone; {textures}",
        **{name: facts[name] for name in ("objects", "materials")},
    }


def _head(study: Study, order: SetOrder, identity: str, samples: int, command: str) -> dict[str, Any]:
    axes = ("levels", "spectra", "exposures", "sensors", "processors", "seeds")
    return {
        "kind": "set",
        "name": study.name,
        "rodcone": VERSION,
        "versions": versions(),
        "command": command,
        "identity": identity,
        "samples": samples,
        "planes": order.planes,
        "axes": {name: [label(value) for value in getattr(study, name)] for name in axes},
    }


def card(lines: Lines) -> str:
    """Write a set's card in Markdown from the lines of its manifest.

    It says what the set holds, how bright and noisy its frames are, and who may use it.
    """
    by_kind = {kind: [line for line in lines if line["kind"] == kind] for kind in ("scene", "shard", "sample")}
    samples = sorted(by_kind["sample"], key=lambda line: line["luminance_cd_m2"])
    noise = {name: [line["render_noise"][name] for line in samples] for name in ("mean", "of_95_percent")}
    counts = {
        "level": Counter(line["level"] for line in samples),
        "SNR, dB": _histogram([line["snr_db"] for line in samples], _SNR_DB),
        "render's variance over the sensor's, in 95 % of the pixels": _histogram(noise["of_95_percent"], _NOISE),
    }
    texts = {"planes": TRUTH, "manifest": MANIFEST, "note": noise_note(max(noise["mean"]), 0)}
    return write_out("card.md.j2", head=lines[0], **by_kind, **texts, counts=counts)


def _histogram(values: Sequence[float], edges: Sequence[float]) -> dict[str, int]:
    """Count the values between edges; the keys are the ranges in words, for the card."""
    between = (f"{low:g} to {high:g}" for low, high in pairwise(edges))
    names = (f"under {edges[0]:g}", *between, f"{edges[-1]:g} and more")
    counts = np.bincount(np.searchsorted(edges, values, side="right"), minlength=len(names))
    return dict(zip(names, counts.tolist(), strict=True))
