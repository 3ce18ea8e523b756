"""Raw frames with their truth as a set to train on: make it by the command, load it, show a batch.

    python examples/09_training_set.py [SIZE]

Writes the folder night with the set and batch.png: raw frames above their truth. `torch_batches` is for PyTorch.

New here: thousands of raw frames with their noise-free truth, as shards that data loaders read.
Expect: a batch whose upper row is noisy and whose lower row is clean.
"""

import io
import json
import subprocess
import sys
import tarfile
from collections import defaultdict
from pathlib import Path

import numpy as np

import rodcone

STUDY = """
scenes = ["generated-1f3a"]
levels = ["0.1cd/m2", "10cd/m2"]
processors = ["bayer", "interleaved"]  # Bayer and RGBW frames
seeds = 2
render = { size = SIZE, spp = 16 }
"""


def samples(shard):
    """Yield each sample of a shard: its arrays and its facts by name."""
    found = defaultdict(dict)
    with tarfile.open(shard) as tar:
        for member in tar:
            key, kind = member.name.split(".", 1)
            content = tar.extractfile(member).read()
            found[key][kind] = json.loads(content) if kind == "json" else np.load(io.BytesIO(content))
    return list(found.values())


def torch_batches(shards, size):
    """Batches for PyTorch (pip install webdataset torch), mixed over shards."""
    import webdataset

    mixed = webdataset.WebDataset(shards, shardshuffle=100).shuffle(1000).decode()
    return mixed.to_tuple("raw.npy", "rgb.npy", "json").batched(size)


def main(size: str) -> None:
    """Make, load, show."""
    Path("night.toml").write_text(STUDY.replace("SIZE", size))
    command = ("dataset", "night.toml", "-o", "night", "--shards", "1", "--crop", "16", "--truth", "rgb,depth,shares")
    subprocess.run([sys.executable, "-m", "rodcone", *command], check=True)
    batch = [sample for shard in Path("night/set").glob("*.tar") for sample in samples(shard)]
    shown = []
    for sample in batch[:8]:
        facts = sample["json"]
        light = (sample["raw.npy"] - float(facts["black_dn"])) * facts["gain_e_per_dn"]  # electrons
        mean_e = np.mean(list(facts["mean_e"].values()))
        shown.append(np.concatenate([np.repeat(light[..., None] / mean_e / 5, 3, axis=-1), sample["rgb.npy"]]))
        print(facts["level"], facts["tile"], f"{facts['snr_db']:.0f} dB, variance of G:", facts["noise"]["G"])
    rodcone.write_picture(np.clip(rodcone.encode_srgb(np.concatenate(shown, axis=1)), 0, 1), "batch.png")


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "64")
