"""What a picture costs: processor time and memory of a render, a capture and a development, by size.

    python benchmarks/bench_picture.py                     (the table of docs/how_to/what_a_picture_costs.md: minutes)
    python benchmarks/bench_picture.py --sides 256 512
    python benchmarks/bench_picture.py --stored 1 2    (captures by megapixels, and a development)

Each command runs in a process of its own, whose processor time and peak memory the system tells. A render is made with
two numbers of samples: their difference is the cost of a sample, and the table's render of 64 samples is computed from
both. Every command has run once before at a small size, so that no kernel is compiled. The last line, of 12 Mpx, is
computed: times by the pixel from the largest size measured, memory by the formula that commands refuse by.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from environment import print_environment
from PIL import Image

from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.spectrum import VISIBLE_NM, even_bands
from rodcone.memory import WRITTEN, memory

SIDES = 256, 512, 1024  # 0.07, 0.26 and 1 Mpx
LARGE = 3464  # 12 Mpx
SAMPLES = 64  # of the table's render
FEW = 2, 10  # samples of the two renders
BANDS = 20
BOX = Path(__file__).with_name("box.xml")
COMMAND = "from studies.commands.cli import main; raise SystemExit(main())"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="still_life")
    options.add_argument("--sides", type=int, nargs="+", default=SIDES)
    options.add_argument("--stored", type=float, nargs="+", help="megapixels of stored pictures")
    given = options.parse_args()
    print_environment()
    if given.stored:
        stored(given.stored)
        return
    print(f"\n{given.scene}, {BANDS} bands, processor seconds; memory is the most that one of the commands holds\n")
    print(f"| size | render, {SAMPLES} samples per pixel | capture | develop | memory |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        costs(given.scene, 64, Path(folder))
        for side in given.sides:
            found = costs(given.scene, side, Path(folder))
            print(row(side, *found), flush=True)
    times = (seconds * (LARGE / side) ** 2 for seconds in found[:3])
    print(row(LARGE, *times, memory(LARGE**2, BANDS, 1, spp=SAMPLES, light=WRITTEN).total) + " computed")


def stored(megapixels: list[float]) -> None:
    """Print the table of captures of a scene file, a photograph and a file of radiance, and of a development.

    The scene is a box that is rendered in 20 bands by 4 samples per pixel, `BOX`.
    """
    print("\n| size | scene: capture | photograph: capture | 20 bands: capture | develop |\n|---|---|---|---|---|")
    for size in megapixels:
        height = round((size * 1e6 * 3 / 4) ** 0.5) // 4 * 4
        shape = height, height * 4 // 3 // 4 * 4
        with tempfile.TemporaryDirectory() as folder:
            photograph, light, raw = (str(Path(folder) / name) for name in ("photograph.png", "light.exr", "shot.dng"))
            # In a process of its own: Linux counts this one's peak as that of those that it starts.
            writer = get_context("spawn").Process(target=write_pictures, args=(shape, photograph, light))
            writer.start()
            writer.join()
            box = "capture", str(BOX), "--width", str(shape[1]), "--height", str(shape[0]), "--spp", "4", "-o", raw
            cells = [run(*box), run("capture", photograph, "-o", raw), run("capture", light, "-o", raw)]
            cells.append(run("develop", raw))
        words = " | ".join(f"{seconds:.3g} s, {most / 1e9:.2g} GB" for seconds, most in cells)
        print(f"| {shape[1]} x {shape[0]}, {shape[0] * shape[1] / 1e6:.2g} Mpx | {words} |", flush=True)


def write_pictures(shape: tuple[int, int], photograph: str, light: str) -> None:
    """Write a photograph, and radiance in 20 bands, of waves and some noise."""
    rng = np.random.default_rng(1)
    y, x = (axis.astype(np.float32) for axis in np.ogrid[: shape[0], : shape[1]])

    def wave(number: int) -> np.ndarray:
        noise = rng.standard_normal(shape, dtype=np.float32)
        return 0.5 + 0.4 * np.sin(x / (37 + number) + number) * np.cos(y / (53 + number)) + 0.02 * noise

    pixels = np.stack([np.clip(255 * wave(9 * channel), 0, 255).astype(np.uint8) for channel in range(3)], axis=-1)
    Image.fromarray(pixels).save(photograph)
    nm, width = even_bands(VISIBLE_NM, BANDS)
    planes = np.stack([0.02 * np.maximum(wave(band), 0.01) for band in range(BANDS)])
    write_exr(SpectralRadiance(np.moveaxis(planes, 0, -1), nm, width_nm=width), light, scene="waves")


def costs(scene: str, side: int, folder: Path) -> tuple[float, float, float, float]:
    """Processor seconds of a render of `SAMPLES`, a capture and a development; the most memory [bytes]."""
    light, raw, picture = (str(folder / name) for name in ("light.exr", "shot.dng", "shot.png"))
    size = ("--width", str(side), "--height", str(side), "--bands", "380:780:20", "-o", light)
    few, more = (run("render", scene, *size, "--spp", str(spp)) for spp in FEW)
    capture, develop = run("capture", light, "--level", "25cd/m2", "-o", raw), run("develop", raw, "-o", picture)
    each_s = (more[0] - few[0]) / (FEW[1] - FEW[0])
    most = max(cost[1] for cost in (few, more, capture, develop))
    return few[0] + each_s * (SAMPLES - FEW[0]), capture[0], develop[0], most


def run(*words: str) -> tuple[float, float]:
    """Processor seconds and peak memory [bytes] of a rodcone command."""
    process = subprocess.Popen([sys.executable, "-c", COMMAND, *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"rodcone {' '.join(words)}: status {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024.0


def row(side: int, render_s: float, capture_s: float, develop_s: float, most: float) -> str:
    """Line of the table."""
    return (
        f"| {side} x {side}, {side**2 / 1e6:.2g} Mpx | {render_s:.3g} s | {capture_s:.2g} s | {develop_s:.2g} s "
        f"| {most / 1e9:.2g} GB |"
    )


if __name__ == "__main__":
    main()
