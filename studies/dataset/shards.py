"""Write and read the shards of a data set, tar files in WebDataset's layout, and the manifest that lists them."""

import json
import tarfile
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from platform import node
from typing import Any

import numpy as np

from rodcone.digests import digest, digest_file
from rodcone.errors import InputError, read_errors
from rodcone.files import inside, replacing, write_files
from rodcone.progress import Step
from studies.dataset.order import RENDERS
from studies.dataset.sample import Arrays, Sample, code_digests, make_sample
from studies.sweep.provenance import versions

MANIFEST = "manifest.jsonl"
# Facts of a sample that are also in its line of the manifest.
_LISTED = ("key", "scene", "scene_hash", "spectrum", "level", "luminance_cd_m2", "exposure", "sensor", "mosaic", "tile",
           "snr_db", "saturated", "render_noise")  # fmt: skip
# Keys that each kind of line of a manifest must have.
_READ = {
    "set": ("name", "rodcone", "command", "identity", "samples", "planes"),
    "scene": ("split", "licence"),
    "shard": ("name", "split", "samples", "bytes", "digest", "made_from"),
    "sample": _LISTED,
}
# Upper limit of each split for a scene's hash, read as a number from 0 to 1.
SPLITS = {"train": 0.8, "validation": 0.9, "test": 1.0}
Lines = list[dict[str, Any]]
Runner = Callable[..., Generator[Any, None, None]]  # runs tasks by `make`, as `studies.sweep.workers.run` does


@dataclass(frozen=True)
class Shard:
    """File of samples; to make it is a task for `studies.sweep.workers`.

    Attributes
    ----------
    key : str
        `shard_key` of its samples.
    path : Path
    samples : tuple of Sample
        Samples from which the shard is made; empty for a shard that exists already.
    lines : sequence of dict
        Lines of the manifest for a shard that exists: its own line, then one per sample.
    """

    key: str
    path: Path
    samples: tuple[Sample, ...] = ()
    lines: Sequence[dict[str, Any]] = ()

    @property
    def kind(self) -> tuple[object, ...]:
        """Return the name of the shard's file, because no shard shares work with another."""
        return (self.path.name,)


def split_of(scene: str) -> str:
    """Return the split that a scene belongs to, by its hash alone, so that no scene is in two splits."""
    place = int(scene[:12], 16) / 16**12
    return next(split for split, end in SPLITS.items() if place < end)


def into_shards(samples: Sequence[Sample], count: int, folder: Path) -> list[Shard]:
    """Divide the samples of each split into shards; their number is proportional to the split's number of samples.

    Samples are sorted by the hash of their keys, which mixes scenes.
    """
    shards = []
    for split in SPLITS:
        chosen = sorted((x for x in samples if x.split == split), key=lambda x: digest(x.key))
        number = min(len(chosen), max(1, round(count * len(chosen) / max(len(samples), 1))))
        for index in range(number):
            part = tuple(chosen[len(chosen) * index // number : len(chosen) * (index + 1) // number])
            shards.append(Shard(shard_key(part), (folder / f"{split}-{index:06d}.tar").resolve(), part))
    return shards


def shard_key(samples: Sequence[Sample]) -> str:
    """Return the hash of all that decides a shard: its samples, and the versions and code that make it."""
    made_from = [(x.key, x.cell.key, x.window, x.part, [path.name for path in x.files.values()]) for x in samples]
    return digest([made_from, versions(), code_digests()])


def make_shards(folder: Path, shards: Sequence[Shard], earlier: Lines, head: Lines, runner: Runner, step: Step) -> int:
    """Make the shards that are missing or damaged, and list all in the manifest; return how many were made.

    Parameters
    ----------
    earlier : list of dict
        Manifest that the folder has already; empty if there is none.
    head : list of dict
        First lines of the new manifest.
    """
    wanted = {shard.key for shard in shards}
    standing = {made.key: made for made in shards_of(folder, earlier) if made.key in wanted and is_intact(made)}
    missing = [shard for shard in shards if shard.key not in standing]
    _write_manifest(folder, head, standing.values())
    for count, made in enumerate(runner(missing, make=make_shard), start=1):
        standing[made.key] = made
        _write_manifest(folder, head, standing.values())
        step(f"shard {count} of {len(missing)}", RENDERS + (1 - RENDERS) * count / len(missing))
    return len(missing)


def make_shard(shard: Shard) -> Shard:
    """Write a shard, whole or not at all; the same samples give the same bytes on any machine and at any time.

    Raises
    ------
    InputError
        If this process has another rodcone or other packages than the one that runs the sweep.
    OSError
        If an array can't be read, or the file can't be written.
    """
    if shard.key != shard_key(shard.samples):
        raise InputError(
            f"worker on {node()}: its rodcone or packages aren't the set's; allowed: the same; install them"
        )
    lines: Lines = []
    with replacing(shard.path) as (place,):
        with tarfile.open(place, "w", format=tarfile.GNU_FORMAT) as tar:
            for sample in shard.samples:
                arrays, facts = make_sample(sample)
                for name, array in arrays.items():
                    file = BytesIO()
                    np.save(file, array)
                    _add(tar, f"{sample.key}.{name}.npy", file.getvalue())
                _add(tar, f"{sample.key}.json", json.dumps(facts).encode())
                lines.append({"kind": "sample", **{name: facts[name] for name in _LISTED}})
        size = place.stat().st_size
        made = digest_file(place)
    head = {"kind": "shard", "name": shard.path.name, "split": shard.samples[0].split, "samples": len(lines)}
    head |= {"bytes": size, "digest": made, "made_from": shard.key}
    return replace(shard, samples=(), lines=[head, *lines])


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    member = tarfile.TarInfo(name)  # without time and owner, so that bytes are the same
    member.size = len(content)
    tar.addfile(member, BytesIO(content))


def _write_manifest(folder: Path, head: Lines, shards: Iterable[Shard]) -> None:
    """Write the manifest of the given shards, in the order of their names, as JSON lines."""
    lines = head + [line for shard in sorted(shards, key=lambda shard: shard.path) for line in shard.lines]
    write_files({folder / MANIFEST: "".join(f"{json.dumps(line)}\n" for line in lines)})


def read_manifest(folder: Path) -> Lines:
    """Read the lines of a set's manifest.

    Raises
    ------
    InputError
        Where there is none, or it is damaged.
    """
    path = folder / MANIFEST
    fix = "allowed: what rodcone dataset wrote; move it away and run that again"
    with read_errors(f"{path}: it is no manifest of a set", fix, (OSError, ValueError, LookupError, TypeError)):
        lines = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
        if not lines or lines[0]["kind"] != "set":
            raise ValueError("its first line is not a set's")
        for number, line in enumerate(lines, start=1):
            if lacking := [name for name in _READ[line["kind"]] if name not in line]:
                raise ValueError(f"line {number} has no {lacking[0]!r}")
    return lines


def shards_of(folder: Path, lines: Lines) -> list[Shard]:
    """Return the shards that a folder's manifest lists."""
    places = [place for place, line in enumerate(lines) if line["kind"] == "shard"]
    parts = [lines[at:end] for at, end in pairwise([*places, len(lines)])]
    return [Shard(x[0]["made_from"], inside(folder, x[0]["name"]).resolve(), lines=x) for x in parts]


def is_intact(shard: Shard) -> bool:
    """Return whether a shard's file has the content that was written."""
    path = shard.path
    head = shard.lines[0]
    return path.is_file() and path.stat().st_size == head["bytes"] and digest_file(path) == head["digest"]


def read_shard(path: Path) -> Iterator[tuple[Arrays, dict[str, Any]]]:
    """Yield each sample's arrays by name and its facts.

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
