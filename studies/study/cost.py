"""Estimate what a picture costs in time, memory and samples, before anything is computed.

The numbers are processor seconds on a server's cores with AVX-512 (`benchmarks/bench_picture.py` prints them for
another machine); `pace` says how much longer another machine takes. The time of work that all cores share is divided by
their number. Scenes differ: a sample of a chart takes a third of the time stated here.
"""

import os
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from render.limits import PILOT_FROM
from rodcone.memory import GB, VIEWED, LightMemory, Memory, memory
from rodcone.progress import duration

START_S = 1.3  # imports of a process
_RENDER_S = 1.1e-6  # per pixel, sample and light group, in 20 bands
_PATHS = 0.7  # share of `_RENDER_S` that doesn't grow with the number of bands
_COMPILE_S = 0.3  # per band, if no kernel is stored on disk
PILOT_SPP = 32  # samples per pixel of the pilot that a long render begins with
# Time of a fixed piece of work (`_work_s`) on the machine where these numbers were measured. A machine with AVX2, on
# which `make test` is measured, takes 2.2 times as long.
_WORK_S = 8.8e-3
# Time that another render of a moving scene adds, besides its samples: for loading the scene and recording its kernels
# anew, and, per pixel, band and light group, for storing and averaging the light.
_ANOTHER_S = 0.8, 1.2e-7
# Time that a lens by data adds to an exposure: per band, for its images of points, whatever the number of pixels; and
# per pixel and band, for spreading the light.
TABLE_BAND_S, TABLE_S = 0.5, 2.5e-7
KERNELS = Path.home() / ".drjit"


@dataclass(frozen=True)
class PictureCost:
    """Cost of a picture before it is made.

    Attributes
    ----------
    size : (int, int)
        Height and width in pixels; for a file, whose header isn't read yet, 1 and the number of its pixels.
    bands, groups : int
        Bands and light groups.
    spp : float or None
        Most samples per pixel of the render; 0 where the light is there already, None where a render goes on until it
        reaches an error.
    after_s : float
        Processor seconds per pixel and band of the steps after the light.
    denoised : bool
    max_seconds : float, optional
        Longest time of the render.
    through : str
        The lens that the scene is rendered through, in words; empty for a pinhole.
    times : int
        Number of renders that are averaged for a scene that moves, each with `spp` samples per pixel.
    light : LightMemory
        Memory of the light in the steps after the render, as in `rodcone.memory.memory`.
    band_s : float
        Processor seconds per band of those steps after the light that don't depend on the number of pixels.
    """

    size: tuple[int, int]
    bands: int
    groups: int
    spp: float | None
    after_s: float
    denoised: bool = False
    max_seconds: float | None = None
    through: str = ""
    times: int = 1
    light: LightMemory = VIEWED
    band_s: float = 0.0

    @property
    def pixels(self) -> int:
        """Return the number of pixels."""
        return self.size[0] * self.size[1]

    @property
    def memory(self) -> Memory:
        """Return the memory at the peak."""
        groups = self.groups if self.spp != 0 else 1
        mean = int(self.times > 1)  # the mean light of the earlier times
        return memory(
            self.pixels, self.bands, groups, spp=self.spp, denoised=self.denoised, held=mean, light=self.light
        )

    @property
    def seconds(self) -> float:
        """Return the time on this machine's cores if they are idle [s].

        For a render that goes on until it reaches an error, it is the time of 64 samples per pixel.
        """
        spp = PILOT_FROM if self.spp is None else self.spp
        render = render_seconds(self.pixels, self.bands, self.groups, spp) * (1.5 if self.denoised else 1.0)
        another = another_s(self.pixels, self.bands, self.groups)
        render = self.times * min(render, self.max_seconds or render) + (self.times - 1) * pace() * another
        compiled = _COMPILE_S * self.bands if spp and not kernels_kept() else 0.0
        after = (self.after_s * self.pixels + self.band_s) * self.bands
        return pace() * (START_S + compiled + after) + render

    def facts(self) -> dict[str, Any]:
        """Return the values that ``--dry-run --json`` prints."""
        values = {"size": list(self.size), "bands": self.bands, "samples_per_pixel": self.spp, "times": self.times}
        half = {"half_samples_seconds": self._fewer().seconds, "half_size_seconds": self._smaller().seconds}
        return values | {"seconds": self.seconds, "bytes": self.memory.total} | half

    def words(self) -> str:
        """Return one line for a reader: time, memory and samples, and the time with half the samples or the size."""
        height, width = self.size
        samples = f", {self.spp:g} samples per pixel" if self.spp else ""
        samples += f" at each of {self.times} times" if self.times > 1 else ""
        light = ", its light is there already" if self.spp == 0 else f"{samples}, {self.bands} bands"
        time = f"about {duration(self.seconds)}"
        if self.spp is None:
            time = f"about {duration(self.seconds)} for each 64 samples per pixel until the error is reached"
        small = self._smaller()
        halves = [f"at half the size {duration(small.seconds)} and {_gigabytes(small.memory)}"]
        if self.spp and self.spp > 1:
            halves.insert(0, f"with half the samples {duration(self._fewer().seconds)}")
        pixels = f"{height} x {width} pixels" if height > 1 else f"{self.pixels / 1e6:.2g} million pixels"
        light += f", {self.through}" if self.through else ""
        return f"{time}, {_gigabytes(self.memory)}: {pixels}{light}; {', '.join(halves)}"

    def _fewer(self) -> "PictureCost":
        return self if self.spp is None else replace(self, spp=self.spp / 2)

    def _smaller(self) -> "PictureCost":
        height, width = self.size
        return replace(self, size=(height // 2, width // 2) if height > 1 else (1, width // 4))


def render_seconds(pixels: int, bands: int, groups: int, spp: float) -> float:
    """Return the time of a render on this machine's cores [s]."""
    samples = spp + (PILOT_SPP if spp > PILOT_FROM else 0)
    each_s = _RENDER_S * (_PATHS + (1 - _PATHS) * bands / 20)
    return pace() * each_s * pixels * groups * samples / cores()


def another_s(pixels: float, bands: int, groups: int) -> float:
    """Return the processor time that another render of a moving scene takes, besides that of its samples [s]."""
    return _ANOTHER_S[0] + averaged_s(pixels, bands, groups)


def averaged_s(pixels: float, bands: int, groups: int) -> float:
    """Return the processor time of reading a render and averaging it with others [s]."""
    return _ANOTHER_S[1] * pixels * bands * groups


@cache
def pace() -> float:
    """Return this machine's time for a fixed piece of work over that of the machine whose numbers are stated here."""
    return min(_work_s() for _ in range(3)) / _WORK_S


def _work_s() -> float:
    """Measure the processor time of fixed work [s], about a third each of Python loops, transforms and exponentials."""
    begun = process_time()
    total = 0
    picture = np.linspace(0.1, 1.0, 1 << 16, dtype=np.float32).reshape(256, 256)
    for number in range(100_000):
        total += number * number
    for _ in range(3):
        np.fft.rfft2(picture)
    for _ in range(20):
        picture = np.sqrt(np.exp(-picture))
    return process_time() - begun


def kernels_kept() -> bool:
    """Return whether an earlier run left compiled kernels on disk."""
    return KERNELS.is_dir() and any(KERNELS.iterdir())


def cores() -> int:
    """Return how many processor cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _gigabytes(need: Memory) -> str:
    return f"{need.total / GB:.1f} GB"
