"""How quickly `rodcone dataset` makes samples: crops of 128x128 with RGB truth from drawn scenes, render included.

The command runs whole and again, where nothing is missing, on the clock and in processor time of all its processes;
then by each of `WORKERS`, from the scenes' files, after `FEW` shards and after all were taken away: what the latter
takes more is the samples' alone, without start-up. Run it on a quiet machine.

    python benchmarks/bench_dataset.py            (minutes)
    python benchmarks/bench_dataset.py --scenes 1 --spp 32
"""

import argparse
import tempfile
from itertools import product
from pathlib import Path

from bench_sweep import seconds_of_command
from environment import print_environment

WORKERS = (1, 2, 4)
SHARDS, FEW = 16, 4  # each of the workers has one of the few
STUDY = """
scenes = ["generated"]
levels = ["0.036cd/m2", "0.1cd/m2", "0.5cd/m2", "2cd/m2", "6cd/m2", "25cd/m2", "100cd/m2"]
sensors = ["low_noise", "table1_output"]
processors = ["bayer", "interleaved"]
seeds = {seeds}
render = {{ size = 256, spp = {spp} }}
"""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scenes", type=int, default=4)
    options.add_argument("--seeds", type=int, default=4)
    options.add_argument("--spp", type=int, default=256)
    given = options.parse_args()
    print_environment()
    with tempfile.TemporaryDirectory() as folder:
        study, out = Path(folder) / "study.toml", Path(folder) / "out"
        study.write_text(STUDY.format(**vars(given)))
        command = ("dataset", str(study), "-o", str(out), "--truth", "rgb", "--crop", "128", "--shards", str(SHARDS))
        command += ("--generated", str(given.scenes - 1))
        seconds = {"all, render included": seconds_of_command(*command)}
        seconds["nothing missing: start-up"] = seconds_of_command(*command)
        shards = list((out / "set").glob("*.tar"))
        size = sum(path.stat().st_size for path in shards) / 1e9
        for workers, count in product(WORKERS, (FEW, SHARDS)):
            for path in shards[:count]:
                path.unlink()
            again = seconds_of_command(*command, "--workers", str(workers))
            seconds[f"{count} of {SHARDS} shards, {workers} workers"] = again
    samples = given.scenes * 4 * 7 * 2 * 2 * given.seeds
    print(f"{samples} crops of 128x128, {size:.2f} GB, {given.scenes} scenes of 256x256, {given.spp} samples a pixel")
    for words, (wall, processor) in seconds.items():
        print(f"{words:32} {wall:7.1f} s, processor {processor:7.1f} s")
    wall, processor = seconds["all, render included"]
    print(f"render included: {samples / wall:.1f} crops a second, {size / wall * 3600:.2f} GB an hour")
    for workers in WORKERS:
        few, whole = (seconds[f"{count} of {SHARDS} shards, {workers} workers"] for count in (FEW, SHARDS))
        wall, processor = (SHARDS / (SHARDS - FEW) * (y - x) / samples for x, y in zip(few, whole, strict=True))
        print(f"{workers} workers: {1 / wall:.0f} crops a second, {1e3 * processor:.2f} ms of the processor a crop")


if __name__ == "__main__":
    main()
