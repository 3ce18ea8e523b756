r"""Train the network of `isp.processors.corrected` on its mosaics at once (needs torch, for this alone).

    pip install rodcone[train-net]
    python benchmarks/net_frames.py out/net --photographs out/photographs --groups 100 --held 8
    python benchmarks/train_net.py out/net --steps 8000             (--control: the network that sees one pixel)
    python benchmarks/train_net.py out/net --write "Trained on ..."  (network.npz)

Three of each batch's eight crops are RGBW, three Bayer, and two have another tile of R, G, B and W. It resumes where it
was stopped; ``--steps`` may change then. Each line of the log is JSON: steps, processor seconds, and the gain over
`ple` [dB of encoded sRGB against the frames' targets], of the last crops and of held frames by mosaic, by one pass
(`isp.processors.corrected` takes the mean of two).
"""

import argparse
import copy
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from isp.processors.corrected import INPUTS, LEAK, STEPS, pack, unpack

SEED, SIDE, RATE, WARM = 0, 96, 6e-4, 300
LEAST_MSE, LEAST_STEP_MSE = 1e-5, 1e-5  # 50 dB: beyond it a crop counts no more
STRUCTURE = 0.5  # weight of the error of differences between neighbours, so that stripes count more than tints
LUMINANCE = 0.25  # weight of the error of luminance, which an eye sees finest
PATTERN = 0.1  # weight of the error that repeats with the tile, over WINDOW tiles, so that even surfaces have no grid
WINDOW, LEAST_PATTERN_MSE = 8, 1e-7
BT709 = (0.2126, 0.7152, 0.0722)
WIDTHS = (48, 64, 96)  # features at a half, a quarter and an eighth of the pixels
ONE_PIXEL = [0, 1, 2, 4, 7]  # of `correction_inputs`: the picture, the noise, the plane of W or green
HALF = bool(torch.cpu.get_capabilities().get("avx512_bf16", False))
CARD = "card"
MOSAICS = {"rgbw": 3, "bayer": 3, "RGWB": 2}  # with the crops of a step
SYMMETRIC = ("bayer",)  # mosaics whose tile equals its transpose
NAMES = ("network", "control")


class Network(nn.Module):
    """The layers of `isp.processors.corrected.residual`."""

    def __init__(self) -> None:
        super().__init__()
        fine, half, quarter = WIDTHS
        sizes = {
            "first": (4 * INPUTS, fine),
            "fine1": (fine, fine),
            "fine2": (fine, fine),
            "half1": (fine, half),
            "half2": (half, half),
            "quarter1": (half, quarter),
            "quarter2": (quarter, quarter),
            "quarter3": (quarter, quarter),
            "quarter4": (quarter, half),
            "up1": (half, half),
            "up2": (half, half),
            "up3": (half, fine),
            "last1": (fine, fine),
            "last2": (fine, fine),
            "residual": (fine, 12),
        }
        for name, (seen, out) in sizes.items():
            side = 1 if name in ("quarter4", "up3") else 3
            self.add_module(name, nn.Conv2d(seen, out, side, STEPS[name], padding=side // 2))
        for value in self.get_submodule("residual").parameters():
            nn.init.zeros_(value)

    def through(self, values: Tensor, *names: str) -> Tensor:
        """Run layers, each after the leaky positive part."""
        for name in names:
            values = self.get_submodule(name)(functional.leaky_relu(values, LEAK))
        return values

    def forward(self, packed: Tensor) -> Tensor:
        """Return the residual (n, 12, h, w) of packed inputs."""
        fine = self.get_submodule("first")(packed)
        fine = fine + self.through(fine, "fine1", "fine2")
        half = self.through(fine, "half1", "half2")
        coarse = self.through(half, "quarter1", "quarter2", "quarter3", "quarter4")
        half = half + functional.interpolate(coarse, scale_factor=2)
        fine = fine + functional.interpolate(self.through(half, "up1", "up2", "up3"), scale_factor=2)
        fine = fine + self.through(fine, "last1", "last2")
        return self.through(fine, "residual")


class Control(nn.Module):
    """A network that sees one pixel: what it gains is a matter of colour and brightness, not of structure."""

    def __init__(self) -> None:
        super().__init__()
        sizes = (len(ONE_PIXEL), 64, 64, 64, 3)
        layers = [nn.Conv2d(seen, out, 1) for seen, out in pairwise(sizes)]
        self.layers = nn.Sequential(*(part for layer in layers for part in (layer, nn.ReLU())))[:-1]
        nn.init.zeros_(layers[-1].weight)
        nn.init.zeros_(layers[-1].bias)

    def forward(self, packed: Tensor) -> Tensor:
        """Return the residual as `Network`'s."""
        change = self.layers(functional.pixel_shuffle(packed, 2)[:, ONE_PIXEL])
        return functional.pixel_unshuffle(change, 2)


@dataclass(frozen=True)
class Frames:
    """What the network sees of frames (n, h, w, INPUTS), what it should give (n, h, w, 3), and their names."""

    seen: NDArray[np.float16]
    targets: NDArray[np.float16]
    names: tuple[str, ...]


def read_frames(folder: Path, part: str, mosaic: str) -> Frames:
    """Read the frames of a mosaic."""
    seen, targets, names = [], [], []
    for path in sorted(folder.glob(f"{part}_{mosaic}_[0-9][0-9][0-9][0-9].npz")):
        with np.load(path) as file:
            seen.append(file["seen"])
            targets.append(file["target"])
            facts = zip(file["kind"], file["lamp"], file["level_cd_m2"], strict=True)
            names += [
                f"{path.stem[-4:]}.{index} {kind} {lamp} {level:g}" for index, (kind, lamp, level) in enumerate(facts)
            ]
    return Frames(np.concatenate(seen), np.concatenate(targets), tuple(names))


def crop(
    rng: np.random.Generator, mosaic: str, seen: NDArray[Any], target: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Cut a crop, reverse it at random (transpose Bayer's too), so that its tile stays; planes of inputs and target."""
    if mosaic in SYMMETRIC and rng.integers(2):
        seen, target = seen.swapaxes(0, 1), target.swapaxes(0, 1)
    for _ in range(2):
        reverse = int(rng.integers(2))
        start = 2 * int(rng.integers((len(seen) - SIDE - reverse) // 2 + 1)) + reverse
        cut = slice(start, start + SIDE)
        seen, target = (array[cut][:: 1 - 2 * reverse].swapaxes(0, 1) for array in (seen, target))
    return tuple(pack(array.astype(np.float32)).transpose(2, 0, 1) for array in (seen, target))  # type: ignore[return-value]


def loss_of(shown: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """Return the loss, logarithms of squared errors, and each crop's squared error."""
    packed = shown - target
    repeated = functional.avg_pool2d(packed, WINDOW).unflatten(1, (3, 4))  # of each colour at each site of the tile
    pattern = repeated.var(dim=2, correction=0).mean((1, 2, 3))
    error = functional.pixel_shuffle(packed, 2)
    mse = (error**2).mean((1, 2, 3))
    steps = (error.diff(dim=2) ** 2).mean((1, 2, 3)) + (error.diff(dim=3) ** 2).mean((1, 2, 3))
    luminance = ((error * torch.tensor(BT709)[:, None, None]).sum(1) ** 2).mean((1, 2))
    logarithms = (
        torch.log10(mse + LEAST_MSE)
        + STRUCTURE * torch.log10(steps + LEAST_STEP_MSE)
        + LUMINANCE * torch.log10(luminance + LEAST_MSE)
        + PATTERN * torch.log10(pattern + LEAST_PATTERN_MSE)
    )
    return logarithms.mean(), mse.detach()


def gains_db(network: nn.Module, frames: Frames) -> list[float]:
    """Gain of each frame over `ple` [dB]."""
    found = []
    for seen, target in zip(frames.seen.astype(np.float32), frames.targets.astype(np.float32), strict=True):
        with torch.no_grad():
            change = network(torch.from_numpy(pack(seen).transpose(2, 0, 1)[None].copy()))[0].numpy()
        shown = np.clip(seen[..., :3] + unpack(change.transpose(1, 2, 0)), 0, 1)
        errors = [((picture - target) ** 2).mean() + 1e-9 for picture in (seen[..., :3], shown)]
        found.append(float(10 * np.log10(errors[0] / errors[1])))
    return found


class Run:
    """A training that can be stopped and resumed."""

    def __init__(self, path: Path, control: bool) -> None:
        torch.manual_seed(SEED)
        self.path, self.rng = path, np.random.default_rng(SEED)
        self.network = (Control() if control else Network()).to(memory_format=torch.channels_last)
        self.mean = copy.deepcopy(self.network)  # of the weights over the last steps
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=RATE, betas=(0.9, 0.99))
        self.step, self.seconds = 0, 0.0
        if path.exists():
            state = torch.load(path, weights_only=False)
            self.network.load_state_dict(state["network"])
            self.mean.load_state_dict(state["mean"])
            self.optimizer.load_state_dict(state["optimizer"])
            self.rng.bit_generator.state = state["rng"]
            self.step, self.seconds = state["step"], state["seconds"]

    def save(self) -> None:
        """Write all that going on needs."""
        part = self.path.with_suffix(".part")
        networks = {name: getattr(self, name).state_dict() for name in ("network", "mean", "optimizer")}
        torch.save({**networks, "rng": self.rng.bit_generator.state, "step": self.step, "seconds": self.seconds}, part)
        part.rename(self.path)

    def learn(self, frames: Mapping[str, Frames], steps: int) -> float:
        """Make one step, a part of the batch from each mosaic's frames; the mean gain of its crops over `ple` [dB]."""
        done = min(self.step / steps, 1.0)
        rate = RATE * (0.01 + 0.99 * (1 + np.cos(np.pi * done)) / 2) * min(1.0, (self.step + 1) / WARM)
        self.optimizer.param_groups[0]["lr"] = rate
        crops = []
        for mosaic, one in frames.items():
            chosen = self.rng.integers(len(one.seen), size=MOSAICS[mosaic])
            crops += [crop(self.rng, mosaic, one.seen[index], one.targets[index]) for index in chosen]
        packed, target = (torch.from_numpy(np.stack([one[part] for one in crops])) for part in (0, 1))
        before = packed[:, :12]
        # Half precision where the processor multiplies in it: a step takes 0.4 of its time.
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=HALF):
            change = self.network(packed.contiguous(memory_format=torch.channels_last))
        shown = before + change.float()
        loss, mse = loss_of(shown, target)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.step += 1
        keep = min(0.998, (self.step + 1) / (self.step + 20))
        with torch.no_grad():
            for slow, fast in zip(self.mean.parameters(), self.network.parameters(), strict=True):
                slow.lerp_(fast, 1 - keep)
        return float((10 * torch.log10((loss_of(before, target)[1] + 1e-9) / (mse + 1e-9))).mean())


def train(folder: Path, steps: int, control: bool, every: int) -> None:
    """Train to so many steps, and log."""
    run = Run(folder / f"{NAMES[control]}.pt", control)
    frames = {mosaic: read_frames(folder, "train", mosaic) for mosaic in MOSAICS}
    held = {mosaic: read_frames(folder, "held", mosaic) for mosaic in MOSAICS}
    count = sum(value.numel() for value in run.network.parameters())
    print(f"{NAMES[control]}: {count} weights, {len(frames['rgbw'].seen)} frames of RGBW, step {run.step}", flush=True)
    gains, start = [], time.process_time() - run.seconds
    while run.step < steps:
        gains.append(run.learn(frames, steps))
        if run.step % every == 0 or run.step == steps:
            run.seconds = time.process_time() - start
            run.save()
            found = {mosaic: gains_db(run.mean, one) for mosaic, one in held.items()}
            by_frame = {
                mosaic: dict(zip(held[mosaic].names, np.round(found[mosaic], 2), strict=True)) for mosaic in MOSAICS
            }
            line = {
                "step": run.step,
                "seconds": round(run.seconds),
                "of": steps,
                "frames": {mosaic: len(one.seen) for mosaic, one in frames.items()},
                "train": round(float(np.mean(gains[-every:])), 3),
                **{mosaic: round(float(np.mean(found[mosaic])), 3) for mosaic in MOSAICS},
                "by_frame": by_frame,
            }
            with (folder / f"{NAMES[control]}.jsonl").open("a") as log:
                log.write(json.dumps(line) + "\n")
            print({key: value for key, value in line.items() if key != "by_frame"}, flush=True)
            frames = {mosaic: read_frames(folder, "train", mosaic) for mosaic in MOSAICS}  # more may have come
            start = time.process_time() - run.seconds  # validation isn't training


def write_weights(folder: Path, card: str, control: bool) -> None:
    """Write a training's mean weights in half precision, beside it."""
    run = Run(folder / f"{NAMES[control]}.pt", control)
    weights = {name: value.numpy().astype(np.float16) for name, value in run.mean.state_dict().items()}
    facts = f"{card} {run.step} steps, {run.seconds / 3600:.2f} processor hours, seed {SEED}."
    np.savez_compressed(folder / f"{NAMES[control]}.npz", **weights, **{CARD: np.array(facts)})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of net_frames.py")
    parser.add_argument("--steps", type=int, default=8000)
    parser.add_argument("--every", type=int, default=200, help="steps between lines of the log")
    parser.add_argument("--control", action="store_true", help="the network of one pixel")
    parser.add_argument("--write", metavar="CARD", default="", help="write the weights with this text, and don't train")
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.write:
        write_weights(given.folder, given.write, given.control)
    else:
        train(given.folder, given.steps, given.control, given.every)


if __name__ == "__main__":
    main()
