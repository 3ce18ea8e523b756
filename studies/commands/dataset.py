"""The command `rodcone dataset`."""

import sys
from dataclasses import asdict, replace
from pathlib import Path
from shlex import join
from typing import Annotated

from cyclopts import Parameter

from rodcone.progress import progress
from studies.commands.console import print_result
from studies.commands.sweep import WORKERS, Workers, check_memory, saying_what_is_kept
from studies.dataset.make_set import make_set
from studies.dataset.order import SetOrder, drawn_scenes
from studies.dataset.sample import PLANES
from studies.study.study_file import read_study


def dataset(
    study: Path,
    /,
    workforce: Annotated[Workers, Parameter(name="*")] = WORKERS,
    *,
    out: Path = Path("out/dataset"),
    set: tuple[str, ...] = (),
    generated: int = 0,
    diorama: int = 0,
    seed: int = 0,
    truth: str = ",".join(PLANES),
    shards: int = 64,
    crop: int | None = None,
    json: bool = False,
) -> int:
    """Make raw frames of every scene, light, sensor and seed of a study, with the truth behind them; prints the folder.

    Tar shards in WebDataset's layout, a manifest and a card. Whatever ends it, the same command goes on.

    Parameters
    ----------
    study
        Study file (.toml); its processors stand for the mosaics that they take.
    out
        Folder of renders and frames; the set is its folder "set".
    set
        KEY=VALUE that replaces the file's own, such as render.spp=64; may be given several times.
    generated
        Number of drawn tables under a softbox, beside the file's own scenes.
    diorama
        Number of drawn streets, rooms and tables by day, dusk and night.
    seed
        Seed of the drawn scenes.
    truth
        Planes of truth in a sample, joined by commas; raw frame and facts are always there.
    shards
        Number of tar files.
    crop
        Side of the parts that frames are cut into, in pixels; whole frames by default.
    json
        Print one JSON object instead of the folder.
    """
    order = SetOrder(planes=tuple(name.strip() for name in truth.split(",")), shards=shards, crop=crop)
    task = read_study(study, set)
    drawn = (*drawn_scenes(generated, seed), *drawn_scenes(diorama, seed, "diorama"))
    task = replace(task, scenes=(*task.scenes, *drawn))
    check_memory(task, out, reference=False, workers=workforce.processes, force=workforce.force)
    changes = [word for change in set for word in ("--set", change)]
    numbers = {"--generated": generated, "--seed": seed, "--truth": truth, "--shards": shards, "--crop": crop}
    numbers |= {"--diorama": diorama or None}
    words = [word for name, value in numbers.items() if value is not None for word in (name, str(value))]
    command = join(["rodcone", "dataset", study.name, *changes, *words])
    with workforce.runner() as runner, saying_what_is_kept(out), progress(sys.stderr) as step:
        made = make_set(task, out, order, command, runner, step)
    print_result(made.folder, {**asdict(made), "folder": str(made.folder)}, json=json)
    return 0
