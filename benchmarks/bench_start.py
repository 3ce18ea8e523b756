"""Seconds from the start of a process to a picture of 16x16 pixels and one sample, for each scene.

Run ``python benchmarks/bench_start.py``; ``--scene``, ``--size``, ``--spp`` and ``--repeats`` narrow it down. Each
scene gets a home folder of its own, in which Dr.Jit keeps its compiled kernels: the first process finds it empty and
compiles, the later ones read what is there. It prints the environment, then seconds of the first process, and medians
over the later ones: from the start of the process to the picture, on the clock and of the processor; of these the
imports, the scene's dict, the render, in it Mitsuba's loading (timed again after the picture) and Dr.Jit's writing out
of its kernels; last the kernels that later processes compiled. No illuminance is asked for.

``--develop`` measures the command `rodcone develop` instead, on a raw image of 256 x 256 pixels, each time in a new
process: seconds on the clock, of the processor, and of it outside the first thread; last what the clock would show on
two idle cores, on which the first thread's seconds come one after the other and the others' two at a time.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from contextlib import redirect_stdout, suppress
from dataclasses import replace
from io import StringIO
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np


def start(name: str, size: int, spp: int, began: float) -> dict[str, Any]:
    """Render once, in a process that began at a time of the monotonic clock, and tell what took how long."""
    marks = [time.monotonic()]
    from render.engine import render  # imports are part of what is measured
    from render.loader import Film, load_groups, mitsuba_module
    from render.spectrum import DEFAULT_WAVELENGTH_NM, band_widths
    from rodcone.jit import dr
    from scenes.catalogue import load

    mitsuba_module()
    marks.append(time.monotonic())
    scene = replace(load(name), reference_plane=None)
    marks.append(time.monotonic())
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        render(scene, (size, size), spp=spp)
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
    marks.append(time.monotonic())
    processor_s = time.process_time()
    nm = DEFAULT_WAVELENGTH_NM
    load_groups(scene, Film((size, size), nm, band_widths(nm), 8))
    marks.append(time.monotonic())
    imports, scene_dict, rendering, loading = np.diff(marks).tolist()
    return {
        "whole": marks[3] - began,
        "processor": processor_s,
        "imports": imports,
        "scene": scene_dict,
        "render": rendering,
        "loading": loading,
        "code": sum(kernel["codegen_time"] for kernel in kernels) / 1e3,
        "compiling": sum(kernel["backend_time"] for kernel in kernels) / 1e3,
        "compiled": sum(not kernel["cache_hit"] for kernel in kernels),
    }


def starts(name: str, size: int, spp: int, repeats: int) -> list[dict[str, Any]]:
    """Start processes one after the other, which share one folder of kernels."""
    made = []
    with TemporaryDirectory() as home:
        for _ in range(1 + repeats):
            command = [sys.executable, __file__, "--one", name, str(size), str(spp), repr(time.monotonic())]
            done = subprocess.run(command, env=os.environ | {"HOME": home}, check=True, capture_output=True, text=True)
            made.append(json.loads(done.stdout))
    return made


def develop_once(raw: str, began: float) -> dict[str, float]:
    """Develop a raw file by the command's own function, in a process that began at a time of the monotonic clock."""
    from studies.commands.cli import main as rodcone  # imports are part of what is measured

    with redirect_stdout(StringIO()), suppress(SystemExit):
        rodcone(["develop", raw, "--out", f"{raw}.png"])
    return {"whole": time.monotonic() - began, "processor": time.process_time(), "first thread": time.thread_time()}


def develop_starts(repeats: int) -> None:
    """Print seconds of `rodcone develop` for both mosaics."""
    print(f"{'mosaic':20s}" + "".join(f"{word:>16s}" for word in ("clock", "processor", "other threads", "two cores")))
    with TemporaryDirectory() as folder:
        for mosaic in ("rgbw", "bayer"):
            raw = f"{folder}/{mosaic}.dng"
            photograph = [
                sys.executable,
                "-m",
                "rodcone",
                "capture",
                "still_life",
                "--level",
                "5cd/m2",
                "--size",
                "256",
            ]
            subprocess.run([*photograph, "--cfa", mosaic, "--out", raw], check=True, capture_output=True)
            made = []
            for _ in range(repeats):
                command = [sys.executable, __file__, "--develop-one", raw, repr(time.monotonic())]
                made.append(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))
            whole, processor, first = (float(np.median([one[key] for one in made])) for key in made[0])
            told = (whole, processor, processor - first, first + (processor - first) / 2)
            print(f"{mosaic:20s}" + "".join(f"{value:16.2f}" for value in told), flush=True)


def main() -> None:
    if sys.argv[1:2] == ["--develop-one"]:
        print(json.dumps(develop_once(sys.argv[2], float(sys.argv[3]))))
        return
    if sys.argv[1:2] == ["--one"]:
        name, size, spp, began = sys.argv[2:]
        print(json.dumps(start(name, int(size), int(spp), float(began))))
        return
    from environment import print_environment

    from scenes.catalogue import scene_names

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", action="append", help="scene by name; may be given several times")
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--spp", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--develop", action="store_true", help="measure `rodcone develop` of 256 x 256 pixels")
    given = parser.parse_args()
    print_environment()
    if given.develop:
        develop_starts(given.repeats)
        return
    head = ("scene", "first", "compiling", "later", "processor", "imports", "scene", "render", "loading", "code")
    print(f"{head[0]:20s}" + "".join(f"{word:>10s}" for word in (*head[1:], "compiled")))
    for name in given.scene or scene_names():
        first, *later = starts(name, given.size, given.spp, given.repeats)
        middle = {key: float(np.median([one[key] for one in later])) for key in first}
        told = [first["whole"], first["compiling"], middle["whole"], *(middle[key] for key in head[4:])]
        compiled = sum(one["compiled"] for one in later)
        print(f"{name:20s}" + "".join(f"{value:10.2f}" for value in told) + f"{compiled:10d}", flush=True)


if __name__ == "__main__":
    main()
