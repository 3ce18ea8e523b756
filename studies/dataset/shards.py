"""Shards of a data set: plain tar files in WebDataset's layout, the manifest that lists them, and reading both."""

import json
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from rodcone.digests import digest_file
from rodcone.errors import read_errors
from rodcone.files import inside, replacing, write_files
from studies.dataset.sample import Arrays, Sample, make_sample

MANIFEST = "manifest.jsonl"
# Of a sample in a manifest.
_TOLD = ("key", "scene", "scene_hash", "spectrum", "level", "luminance_cd_m2", "exposure", "sensor", "mosaic", "tile",
         "snr_db", "saturated", "render_noise")  # fmt: skip
Lines = list[dict[str, Any]]
Content = TypeVar("Content")


@dataclass(frozen=True)
class Shard(Generic[Content]):
    """A shard to make, or to judge pictures by: a task of `studies.sweep.workers`.

    Attributes
    ----------
    key : str
        Hash of all that decides the result.
    path : Path
    content : Content
        Samples in the shard's order; or pictures by their samples' keys.
    """

    key: str
    path: Path
    content: Content

    @property
    def kind(self) -> tuple[object, ...]:
        """Its file's name: each shard is of a kind of its own."""
        return (self.path.name,)


@dataclass(frozen=True)
class LinesMade:
    """What a worker gives: a task's key, and lines; of a shard those in the manifest, its own and one a sample."""

    key: str
    lines: Lines


def make_shard(shard: Shard[tuple[Sample, ...]]) -> LinesMade:
    """Write a shard, whole or not at all; the same samples give the same bytes, whoever writes them and when.

    Raises
    ------
    OSError
        Where an array can't be read, or the file not be written.
    """
    lines: Lines = []
    with replacing(shard.path) as (place,):
        with tarfile.open(place, "w", format=tarfile.GNU_FORMAT) as tar:
            for sample in shard.content:
                arrays, facts = make_sample(sample)
                for name, array in arrays.items():
                    file = BytesIO()
                    np.save(file, array)
                    _add(tar, f"{sample.key}.{name}.npy", file.getvalue())
                _add(tar, f"{sample.key}.json", json.dumps(facts).encode())
                lines.append({"kind": "sample", **{name: facts[name] for name in _TOLD}})
        size, made = place.stat().st_size, digest_file(place)
    first = shard.content[0]
    head = {"kind": "shard", "name": shard.path.name, "split": first.split, "samples": len(shard.content)}
    return LinesMade(shard.key, [head | {"bytes": size, "digest": made, "made_from": shard.key}, *lines])


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    member = tarfile.TarInfo(name)  # of time 0 and no owner
    member.size = len(content)
    tar.addfile(member, BytesIO(content))


def write_manifest(folder: Path, head: Lines, shards: Iterable[LinesMade]) -> None:
    """Write the manifest of the shards that stand, in order of their names, as JSON lines."""
    lines = head + [line for made in sorted(shards, key=lambda made: made.lines[0]["name"]) for line in made.lines]
    write_files({folder / MANIFEST: "".join(f"{json.dumps(line)}\n" for line in lines)})


def read_manifest(folder: Path) -> Lines:
    """Lines of a set's manifest.

    Raises
    ------
    InputError
        Where there is none, or it is damaged.
    """
    path = folder / MANIFEST
    fix = "allowed: what rodcone dataset wrote; run it again"
    with read_errors(f"{path}: it is no manifest of a set", fix, (OSError, ValueError, LookupError, TypeError)):
        lines = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
        if not lines or lines[0]["kind"] != "set" or not all("kind" in line for line in lines):
            raise ValueError("its first line is not a set's")
    return lines


def shards_of(lines: Lines) -> list[LinesMade]:
    """Shards that a manifest lists, each with its samples' lines."""
    places = [place for place, line in enumerate(lines) if line["kind"] == "shard"]
    return [LinesMade(lines[at]["made_from"], lines[at:end]) for at, end in pairwise([*places, len(lines)])]


def stands(folder: Path, made: LinesMade) -> bool:
    """Whether a shard's file is what was written."""
    head = made.lines[0]
    path = inside(folder, head["name"])
    return path.is_file() and path.stat().st_size == head["bytes"] and digest_file(path) == head["digest"]


def read_shard(path: Path) -> Iterator[tuple[Arrays, dict[str, Any]]]:
    """Arrays by name and facts of each sample.

    Raises
    ------
    InputError
        For a file that is cut or damaged.
    """
    arrays: Arrays = {}
    damage = (tarfile.TarError, EOFError, ValueError, LookupError)
    fix = "run rodcone dataset again, which makes it"
    with read_errors(f"{path}: it is no whole shard", fix, damage), tarfile.open(path) as tar:
        for member in tar:
            file = tar.extractfile(member)
            assert file is not None
            name = member.name.split(".", 1)[1]
            if name == "json":
                yield arrays, json.loads(file.read())
                arrays = {}
            else:
                arrays[name.removesuffix(".npy")] = np.load(BytesIO(file.read()), allow_pickle=False)
