"""The command `rodcone dataset`."""

import sys
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from shlex import join

from rodcone.errors import require_absent, require_whole
from rodcone.progress import progress
from studies.commands.console import print_result
from studies.commands.sweep import MOST_WORKERS, check_memory, local_runner, saying_what_is_kept
from studies.dataset.make_set import make_set
from studies.dataset.order import SetOrder, generated_scenes
from studies.dataset.sample import PLANES
from studies.study.study_file import read_study
from studies.sweep.cluster import on_cluster
from studies.sweep.workers import cores


def dataset(
    study: Path,
    /,
    *,
    out: Path = Path("out/dataset"),
    set: list[str] | None = None,
    generated: int = 0,
    seed: int = 0,
    truth: str = ",".join(PLANES),
    shards: int = 64,
    crop: int | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    force: bool = False,
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
        Number of drawn scenes, beside the file's own.
    seed
        From which the drawn scenes' hashes are counted.
    truth
        Planes of truth in a sample, joined by commas; raw frame and facts are always there.
    shards
        Number of tar files.
    crop
        Side of the parts that frames are cut into, in pixels; whole frames by default.
    workers
        Processes on this machine, one for each core by default.
    cluster
        Address of a dask scheduler whose workers do it instead, such as tcp://127.0.0.1:8786.
    force
        Run even where the estimate needs more memory than is free.
    json
        Print one JSON object instead of the folder.
    """
    order = SetOrder(planes=tuple(name.strip() for name in truth.split(",")), shards=shards, crop=crop)
    task = read_study(study, set or ())
    task = replace(task, scenes=(*task.scenes, *generated_scenes(generated, seed)))
    if cluster is not None:
        require_absent("beside --cluster, which has workers of its own", workers=workers)
    if workers is not None:
        require_whole("workers", workers, 1, MOST_WORKERS, "give processes")
    check_memory(task, out, reference=False, workers=0 if cluster else workers or cores(), force=force)
    changes = [word for change in set or () for word in ("--set", change)]
    numbers = {"--generated": generated, "--seed": seed, "--truth": truth, "--shards": shards, "--crop": crop}
    words = [word for name, value in numbers.items() if value is not None for word in (name, str(value))]
    command = join(["rodcone", "dataset", study.name, *changes, *words])
    with (
        nullcontext(local_runner(workers)) if cluster is None else on_cluster(cluster) as runner,
        saying_what_is_kept(out),
        progress(sys.stderr) as step,
    ):
        made = make_set(task, out, order, command, runner, step)
    print_result(made.folder, {**asdict(made), "folder": str(made.folder)}, json=json)
    return 0
