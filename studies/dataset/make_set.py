"""From a study to shards: what is asked for, whether there is room, the scenes' files, the samples, the shards."""

import re
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from isp.processors.own import processor_of
from rodcone.digests import digest
from rodcone.errors import InputError
from rodcone.files import is_half_written, write_files
from rodcone.progress import Step, progress_bar, render_words
from scenes.diorama import PICTURES_LICENCE
from studies.budget.ledger import as_stated
from studies.dataset.card import CARD, card
from studies.dataset.order import SetOrder, bytes_needed, check_cameras, require_room
from studies.dataset.sample import VERSION, Sample, frame_labels
from studies.dataset.shards import MANIFEST, Lines, Shard, make_shard, read_manifest, shards_of, stands, write_manifest
from studies.dataset.truth_files import Facts, code_digests, plane_files, scene_facts
from studies.study.lit_scene import OpenedScene, open_all
from studies.study.study import Study, label
from studies.sweep.cells import Cell
from studies.sweep.database import open_results
from studies.sweep.prepare import SET, Job, scene_cells
from studies.sweep.provenance import versions
from studies.sweep.run_sweep import at_work

SPLITS = {"train": 0.8, "validation": 0.9, "test": 1.0}  # up to which share of the hashes
PREPARED = 0.5  # of the progress bar, for the scenes' files
_NOT_IN_KEYS = re.compile(r"[^A-Za-z0-9_-]")
_SHARD = re.compile(rf"({'|'.join(SPLITS)})-\d{{6}}\.tar")

Runner = Callable[..., Generator[Any, None, None]]


@dataclass(frozen=True)
class SetMade:
    """What was done: the folder of the set, its samples and shards, and how many of these this run made."""

    folder: Path
    samples: int
    shards: int
    made: int


def make_set(
    study: Study, out: Path, order: SetOrder, command: str, runner: Runner, step: Step | None = None
) -> SetMade:
    """Make the shards of a set that are missing, their manifest and card, in the folder ``set`` of a sweep's folder.

    After Ctrl-C, a kill or a full disk the next call goes on. The processors of the study stand for their mosaics.

    Parameters
    ----------
    study : Study
    out : Path
        Folder; renders and frames stay in it, where a sweep of the same study finds them.
    order : SetOrder
    command : str
        That makes the set, for manifest and card.
    runner : callable
        Takes shards and ``make``, gives what `studies.dataset.shards.make_shard` returns as it comes.
    step : callable, optional
        Called with what is being done and the share that is done.

    Raises
    ------
    InputError
        For cameras whose raw frames a sample can't hold, parts that don't fit, too little room on the disk, foreign
        files in the folder, or another set in it.
    OSError
        Where a file can't be written.
    """
    check_cameras(study, order)
    scenes, folder = open_all(study), out / SET
    with at_work(out), progress_bar(step) as show, open_results(out) as base:
        folder.mkdir(exist_ok=True)
        earlier = _earlier(folder)
        job = Job(study, as_stated(study), out, base)
        require_room(bytes_needed(study, job.plan.renders, scenes, order), out)
        # the files that samples are cut from
        samples, scene_lines = list[Sample](), list[dict[str, Any]]()
        for index, opened in enumerate(scenes.values()):
            rendering = partial(_show_render, show, index, len(scenes))
            cells = scene_cells(job, opened, rendering)
            facts = scene_facts(job, opened, cells, rendering)
            samples += _samples_of(job, opened, cells, facts, order)
            scene_lines.append(_scene_line(opened, facts))
        key, count = Counter(sample.key for sample in samples).most_common(1)[0]
        if count > 1:
            raise InputError(f"study: two frames would be named {key!r}; allowed: names that differ; rename one")
        # the shards
        shards = into_shards(samples, order.shards, folder)
        head = [_head(study, order, samples, command), *scene_lines]
        if earlier and earlier[0]["identity"] != head[0]["identity"]:
            raise InputError(
                f"out: {folder} holds another set, {earlier[0]['command']!r}; allowed: a new folder or that of the "
                "same set; choose another with --out"
            )
        wanted = {shard.key for shard in shards}
        standing = {made.key: made for made in shards_of(earlier) if made.key in wanted and stands(folder, made)}
        missing = [shard for shard in shards if shard.key not in standing]
        write_manifest(folder, head, standing.values())
        for count, made in enumerate(runner(missing, make=make_shard), start=1):
            standing[made.key] = made
            write_manifest(folder, head, standing.values())
            show(f"shard {count} of {len(missing)}", PREPARED + (1 - PREPARED) * count / len(missing))
        write_files({folder / CARD: card(read_manifest(folder))})
    return SetMade(folder, len(samples), len(shards), len(missing))


def _show_render(show: Step, index: int, count: int, share: float, error: float) -> None:
    show(f"scene {index + 1} of {count}: {render_words(error)}", PREPARED * (index + share) / count)


def split_of(scene: str) -> str:
    """Split of a scene by its hash alone, so that it never is in two."""
    place = int(scene[:12], 16) / 16**12
    return next(split for split, end in SPLITS.items() if place < end)


def into_shards(samples: Sequence[Sample], count: int, folder: Path) -> list[Shard[tuple[Sample, ...]]]:
    """Shards of each split, in proportion to its samples, which lie in the order of their keys' hashes: mixed."""
    shards = []
    for split in SPLITS:
        chosen = sorted((x for x in samples if x.split == split), key=lambda x: digest(x.key))
        number = min(len(chosen), max(1, round(count * len(chosen) / max(len(samples), 1))))
        parts = [chosen[len(chosen) * i // number : len(chosen) * (i + 1) // number] for i in range(number)]
        for index, part in enumerate(parts):
            made_from = [(x.key, x.cell.key, x.window, x.part, [path.name for path in x.files.values()]) for x in part]
            key = digest([made_from, versions(), code_digests()])
            shards.append(Shard(key, (folder / f"{split}-{index:06d}.tar").resolve(), tuple(part)))
    return shards


def _earlier(folder: Path) -> Lines:
    """Manifest of the set in a folder; nothing of a new one. Foreign files are refused."""
    for path in folder.iterdir():
        if path.name not in (MANIFEST, CARD) and not _SHARD.fullmatch(path.name) and not is_half_written(path):
            raise InputError(f"out: {folder} holds a foreign file, {path.name!r}; allowed: a set; move it away")
    return read_manifest(folder) if (folder / MANIFEST).exists() else []


def _samples_of(job: Job, opened: OpenedScene, cells: Sequence[Cell], facts: Facts, order: SetOrder) -> list[Sample]:
    """Samples of a scene; cells that differ in what is done with a frame alone are one."""
    frames = dict[tuple[str, ...], Cell]()
    for cell in cells:
        frames.setdefault((*frame_labels(cell).values(), processor_of(cell.processor).mosaic, f"s{cell.seed}"), cell)
    windows = _windows(np.load(cells[0].electrons, mmap_mode="r").shape[:2], order.crop)
    if not windows:
        raise InputError(f"crop: {order.crop} exceeds the frames' side; allowed: up to that; raise render.size")
    return [
        Sample(
            key="_".join(map(_word, (*parts, f"{window[0]}-{window[1]}") if order.crop else parts)),
            cell=cell,
            mosaic=parts[-2],
            scene_hash=facts["hash"],
            split=split_of(facts["hash"]),
            files=plane_files(job, facts, cell, order.planes),
            illuminants=facts["illuminants"][cell.condition.spectrum],
            part=index if len(windows) > 1 else None,
            window=window,
        )
        for parts, cell in frames.items()
        for index, window in enumerate(windows)
    ]


def _word(part: str) -> str:
    """Part of a sample's key, in letters that any reader takes."""
    return _NOT_IN_KEYS.sub("-", part.removesuffix(".toml").replace(".", "p"))


def _windows(shape: tuple[int, ...], crop: int | None) -> list[tuple[int, int, int, int]]:
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
        "objects": facts["objects"],
        "materials": facts["materials"],
    }


def _head(study: Study, order: SetOrder, samples: Sequence[Sample], command: str) -> dict[str, Any]:
    axes = ("levels", "spectra", "exposures", "sensors", "processors", "seeds")
    return {
        "kind": "set",
        "name": study.name,
        "rodcone": VERSION,
        "versions": versions(),
        "command": command,
        "identity": digest([sorted(sample.key for sample in samples), vars(order)]),
        "samples": len(samples),
        "planes": order.planes,
        "axes": {name: [label(value) for value in getattr(study, name)] for name in axes},
    }
