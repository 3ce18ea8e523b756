r"""A small network trained on a set of `rodcone dataset`, and a processor that develops by it (needs torch).

It denoises and demosaicks Bayer: five planes in, the four sites of a tile in units of noise and the noise itself; three
out. The loss is the PSNR of encoded sRGB, in the mean over samples.

    pip install torch==2.13.0
    rodcone dataset benchmarks/small_network.toml -o out/drawn --generated 19 --seed 4 --crop 128
    python benchmarks/small_network.py out/drawn        (writes out/small_network.pt)
    pip download --no-deps -d out/wheels scikit-learn demosaicnet; python docs/make/white_pixel.py study out/wheels
    rodcone sweep out/wheels/study.toml -o out/small_network --as-stated --trust-code \
        --set 'scenes=["china.png", "flower.png", "grace_hopper.png", "hubble_deep_field.png", "motorcycle_left.png",
        "retina.png", "ihc.png"]' --set 'processors=["bayer_nlm", "../../benchmarks/small_network.py:small_network"]' \
        --set 'white_balances=["as-shot"]' --set 'levels=["0.05cd/m2", "5cd/m2", "100cd/m2"]'
"""

import argparse
import os
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from isp.anscombe import stabilise
from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture, finish
from isp.planes import bilinear
from isp.processors.catalogue import Processor
from sensor.cfa import channel_map, channels
from sensor.raw import RawImage
from studies.dataset.shards import read_shard

WEIGHTS = Path(os.environ.get("SMALL_NETWORK", "out/small_network.pt"))
SEED, BATCH, SIDE, RATE = 0, 8, 96, 2e-3
ANSCOMBE = 0.375
LEAST_MSE = 1e-5  # 50 dB: beyond it a sample counts no more
FINE, MIDDLE, COARSE = 24, 36, 48  # features at a half, a quarter and an eighth of the pixels


class SmallNetwork(nn.Module):
    """Five planes (n, 5, h/2, w/2) to R, G and B (n, 3, h, w), as a change of the nearest samples drawn to the mean."""

    def __init__(self) -> None:
        super().__init__()
        self.contrast = nn.Parameter(torch.tensor(0.1))  # of things beside the mean, 1: weighs samples against noise
        self.first = nn.Sequential(_filters(5, FINE), nn.ReLU(), _filters(FINE, FINE), nn.ReLU())
        self.down = nn.Sequential(_filters(FINE, MIDDLE, 2), nn.ReLU(), _filters(MIDDLE, MIDDLE), nn.ReLU())
        self.bottom = nn.Sequential(
            *(_filters(MIDDLE, COARSE, 2), nn.ReLU(), _filters(COARSE, COARSE), nn.ReLU()),
            *(_filters(COARSE, COARSE), nn.ReLU(), nn.Conv2d(COARSE, MIDDLE, 1)),
        )
        self.up = nn.Sequential(nn.ReLU(), _filters(MIDDLE, MIDDLE), nn.ReLU(), nn.Conv2d(MIDDLE, FINE, 1))
        self.last = nn.Sequential(nn.ReLU(), _filters(FINE, FINE), nn.ReLU(), _filters(FINE, 12))

    def forward(self, planes: Tensor) -> Tensor:
        """Develop planes of `packed`."""
        fine = self.first(planes)
        middle = self.down(fine)
        middle = self.up(middle + functional.interpolate(self.bottom(middle), scale_factor=2))
        change = self.last(fine + functional.interpolate(middle, scale_factor=2))
        red, green, blue = planes[:, :1], planes[:, 1:3].mean(1, keepdim=True), planes[:, 3:4]
        drawn = 1 + (torch.cat([red, green, blue], 1) - 1) / (1 + (planes[:, 4:] / self.contrast) ** 2)
        return functional.pixel_shuffle(drawn.repeat_interleave(4, 1) + change, 2)


def _filters(inputs: int, outputs: int, step: int = 1) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, 3, step, padding=1, padding_mode="replicate")


def packed(stable: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """Four sites of an RG/GB mosaic in units of noise, and green's noise, over the mosaic's mean; and that mean."""
    mean = max(float(stable.mean()), 1.0)
    sites = [stable[row::2, column::2] / mean for row, column in ((0, 0), (0, 1), (1, 0), (1, 1))]
    return np.stack([*sites, np.full_like(sites[0], 1 / mean)]), mean


@dataclass(frozen=True)
class TrainingSample:
    """A sample: stabilised mosaic scaled by the roots of its gains, encoded truth, and what takes planes to sRGB.

    Attributes
    ----------
    stable : (h, w) float32
    truth : (h, w, 3) float32
    offset : (3,) float32
        Of squared planes over 4, to balanced electrons.
    matrix : (3, 3) float32
        Of these, to linear sRGB in which white is 1.
    """

    stable: NDArray[np.float32]
    truth: NDArray[np.float32]
    offset: NDArray[np.float32]
    matrix: NDArray[np.float32]


def training_sample(arrays: dict[str, NDArray[Any]], facts: dict[str, Any]) -> TrainingSample:
    """Sample of a set whose truth is rgb and channels_e; the matrix is the least squares' between them."""
    names, truth = facts["channels"], arrays["rgb"].reshape(-1, 3).astype(np.float64)
    electrons = arrays["channels_e"].reshape(-1, 3).astype(np.float64)
    to_srgb = np.linalg.lstsq(electrons, truth, rcond=None)[0].T
    neutral = np.linalg.solve(to_srgb, np.ones(3))
    gains = neutral[names.index("G")] / neutral
    dark_noise_e = np.sqrt(facts["noise"]["G"]["b"]) * facts["gain_e_per_dn"]
    raw_e = (arrays["raw"].astype(np.float64) - facts["black_dn"]) * facts["gain_e_per_dn"]
    return TrainingSample(
        stable=_balanced(raw_e, facts["tile"], names, dark_noise_e, gains),
        truth=_encoded(torch.from_numpy(np.clip(arrays["rgb"], 0, 1))).numpy().astype(np.float32),
        offset=(gains * (ANSCOMBE + dark_noise_e**2)).astype(np.float32),
        matrix=(to_srgb / gains).astype(np.float32),
    )


def _balanced(electrons: Any, tile: Any, names: Any, dark_noise_e: float, gains: Any) -> NDArray[np.float32]:
    """Mosaic in units of noise, times the roots of its gains: a neutral is even."""
    sites = channel_map(tuple(tile), electrons.shape)
    roots = np.select([sites == name for name in names], np.sqrt(gains).tolist())
    return (stabilise(electrons, dark_noise_e, 0.0) * roots).astype(np.float32)


def _encoded(linear: Tensor) -> Tensor:
    """SRGB, going on straight below black."""
    return torch.where(linear > 0.0031308, 1.055 * linear.clamp(min=1e-4) ** (1 / 2.4) - 0.055, 12.92 * linear)


def _part(sample: TrainingSample, rng: np.random.Generator) -> tuple[NDArray[Any], float, NDArray[Any]]:
    """Part of a sample, turned at random so that it begins with R; planes, their mean, and truth (3, h, w)."""
    stable, truth = sample.stable, sample.truth
    if rng.random() < 0.5:
        stable, truth = stable.T, truth.transpose(1, 0, 2)
    for _ in range(2):  # each axis: reversed, it begins at an odd place
        reverse = int(rng.integers(2))
        start = 2 * int(rng.integers((len(stable) - SIDE) // 2)) + reverse
        cut = slice(start, start + SIDE)
        stable, truth = (array[cut][:: 1 - 2 * reverse].swapaxes(0, 1) for array in (stable, truth))
    planes, mean = packed(np.ascontiguousarray(stable))
    return planes, mean, truth.transpose(2, 0, 1).copy()


def train(samples: list[TrainingSample], seconds: float) -> SmallNetwork:
    """Train for some processor seconds."""
    torch.manual_seed(SEED)
    rng, network = np.random.default_rng(SEED), SmallNetwork()
    print(f"{sum(x.numel() for x in network.parameters())} weights, {len(samples)} samples")
    optimizer = torch.optim.Adam(network.parameters(), lr=RATE)
    start, step, done, psnr_db = time.process_time(), 0, 0.0, []
    while done < 1:
        for group in optimizer.param_groups:
            group["lr"] = RATE * (0.02 + 0.98 * (1 + np.cos(np.pi * done)) / 2)
        chosen = [samples[index] for index in rng.integers(len(samples), size=BATCH)]
        parts = [_part(sample, rng) for sample in chosen]
        planes, truth = (torch.from_numpy(np.stack([part[index] for part in parts])) for index in (0, 2))
        scale = torch.tensor([part[1] for part in parts]).view(-1, 1, 1, 1)
        offset, matrix = (
            torch.from_numpy(np.stack([getattr(x, name) for x in chosen])) for name in ("offset", "matrix")
        )
        electrons = (network(planes) * scale) ** 2 / 4 - offset[:, :, None, None]
        linear = torch.einsum("nij,njhw->nihw", matrix, electrons)
        linear = torch.where(linear < 0, 0.1 * linear, torch.where(linear > 1, 1 + 0.1 * (linear - 1), linear))
        mse = ((_encoded(linear) - truth) ** 2).mean((1, 2, 3))
        loss = torch.log10(mse + LEAST_MSE).mean()
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        step, done = step + 1, (time.process_time() - start) / seconds
        psnr_db.append(-10 * loss.item())
        if step % 200 == 0:
            print(f"{step} steps, {100 * done:.0f} %, {np.mean(psnr_db[-200:]):.2f} dB", flush=True)
    return network


@cache
def _trained() -> SmallNetwork:
    torch.set_num_threads(1)
    network = SmallNetwork()
    network.load_state_dict(torch.load(WEIGHTS, weights_only=True))
    return network.eval()


def picture_small_network(raw: RawImage, colours: ColourFit, *, balance: WhiteBalance) -> Picture:
    """Develop a raw image whose tile begins with R in a row of R."""
    gains, _ = balance.gains(raw, bilinear(raw))
    stable = _balanced(raw.electrons, raw.cfa, channels(raw.cfa), raw.dark_noise_e, gains)
    padded = np.pad(stable, [(0, -size % 8) for size in stable.shape], mode="reflect")
    planes, mean = packed(padded)
    with torch.no_grad():
        roots = _trained()(torch.from_numpy(planes[None]))[0].numpy().transpose(1, 2, 0) * mean
    electrons = roots[: raw.shape[0], : raw.shape[1]].astype(np.float64) ** 2 / 4 / gains
    return finish(raw, electrons - ANSCOMBE - raw.dark_noise_e**2, colours, balance=balance)


small_network = Processor("bayer", picture_small_network, "a small network, trained on drawn scenes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of rodcone dataset")
    parser.add_argument("--seconds", type=float, default=850.0, help="of one processor")
    given = parser.parse_args()
    torch.set_num_threads(1)
    shards = sorted((given.folder / "set").glob("*.tar"))
    samples = [training_sample(*sample) for shard in shards for sample in read_shard(shard)]
    WEIGHTS.parent.mkdir(exist_ok=True)
    torch.save(train(samples, given.seconds).state_dict(), WEIGHTS)


if __name__ == "__main__":
    main()
