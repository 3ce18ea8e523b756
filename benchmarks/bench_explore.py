"""The explorer under a slider, in Chromium: latency of a jump, pictures painted a second and their age during a drag.

Run ``python benchmarks/bench_explore.py`` on an idle machine that has ``chromium``; ``--scene``, ``--size``, ``--spp``,
``--changes`` and ``--drag-s`` narrow it down. Picture (`interleaved`) and truth are in view, 20 bands, kernels are
compiled: 20 random changes go before. Each slider is moved to ``--changes`` random places, one after the other has been
painted and its figures drawn; time runs in the page, from the event to the task after the frame that shows the picture.
Then it is dragged for ``--drag-s`` seconds, an event each 16 ms. It prints the environment, then for each slider median
and 95th percentile of a jump beside the target, pictures painted a second of the drag, and the age of what is seen (the
time since its values were set), in the mean over the drag; and how many kernels were compiled.

``--memory N`` makes N random changes more and prints the resident memory after 500 and after each tenth of N.
"""

import argparse
import os
import sys
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from environment import print_environment

import studies.explore.answers as ANSWERS
import studies.explore.messages as MESSAGES
from rodcone.jit import backend, dr
from studies.explore.controls import Controls
from studies.explore.source import RenderOptions, open_source

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import browser as CHROME
import explore_browser as EXPLORE

# Slider by its key, the least and largest place that it is moved to, and the targets of median and 95 % [ms].
QUICK, OPTICS = (60.0, 120.0), (150.0, float("nan"))
SLIDERS = {
    "level": (0.2, 0.8, *QUICK),
    "power sky": (0.1, 0.6, *QUICK),
    "exposure_s": (0.3, 0.8, *QUICK),
    "pixel.read_noise_e": (0.0, 0.6, *QUICK),
    "pixel.dsnu_e": (0.0, 0.6, *QUICK),
    "pixel.prnu": (0.0, 0.6, *QUICK),
    "seed": (0.0, 1.0, *QUICK),
    "lens.f_number": (0.2, 0.8, *OPTICS),
    "lens.defocus_um": (0.2, 0.8, *OPTICS),
}
MOVED = """new Promise(done => {
  const root = document.querySelector(".explore"), control = document.querySelector(`.explore [data-key="%s"]`);
  control.value = control.type === "range" ? Math.round(%r * control.max) : Math.round(%r * 1e6);
  root.addEventListener("painted", function painted() {
    if (root.dataset.painted !== root.dataset.asked) return;
    root.removeEventListener("painted", painted);
    requestAnimationFrame(() => { const after = new MessageChannel();
      after.port1.onmessage = () => done(performance.now() - start); after.port2.postMessage(0); });
  });
  const start = performance.now();
  control.dispatchEvent(new Event("input"));
})"""


class CompiledKernels:
    """Counts what the session's thread compiles; Dr.Jit notes it for each thread apart."""

    def __init__(self) -> None:
        self.count, self._facts, self._lock = 0, ANSWERS.facts, threading.Lock()
        ANSWERS.facts = self._facts_counted  # called once for each picture shown

    def _facts_counted(self, shot: Any) -> dict[str, Any]:
        if backend() != "numpy":
            dr.set_flag(dr.JitFlag.KernelHistory, True)
            with self._lock:
                self.count += sum(not kernel["cache_hit"] for kernel in dr.kernel_history([dr.KernelType.JIT]))
        return self._facts(shot)


def resident_mib() -> float:
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def latencies_ms(page: Any, key: str, low: float, high: float, changes: int) -> list[float]:
    """Milliseconds of each change of one slider."""
    rng, found = Random(key), []
    for _ in range(changes):
        place = rng.uniform(low, high)
        found.append(page.evaluate(MOVED % (key, place, place)))
        EXPLORE.settle(page, figures=True)
    return found


def drag(page: Any, key: str, low: float, high: float, seconds: float) -> tuple[float, float]:
    """Pictures painted a second while a slider is dragged, and mean age of what is seen after the first [ms]."""
    painted = np.array(page.evaluate(EXPLORE.DRAG % (key, low, high, 1000 * seconds)), dtype=float).reshape(-1, 2)
    EXPLORE.settle(page, figures=True)
    if len(painted) < 2:
        return len(painted) / seconds, np.nan
    shown_ms, middle_ms = np.diff(painted[:, 0]), (painted[1:, 0] + painted[:-1, 0]) / 2
    return len(painted) / seconds, float(np.average(middle_ms - painted[:-1, 1], weights=shown_ms))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="still_life")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--changes", type=int, default=100)
    parser.add_argument("--drag-s", type=float, default=4.0)
    parser.add_argument("--rest-s", type=float, default=60.0, help="for kernels to be compiled")
    parser.add_argument("--memory", type=int, default=0)
    asked = parser.parse_args(arguments)
    print_environment()
    kernels = CompiledKernels()
    source = open_source(asked.scene, RenderOptions(size=asked.size, spp=asked.spp))
    MESSAGES.Controls = partial(Controls, processor="interleaved")  # the page opens with it, and it answers at once
    with EXPLORE.served(source) as address, CHROME.chromium() as browser:
        page, rng = CHROME.open_page(browser, address), Random(1)
        EXPLORE.settle(page)
        for _ in range(20):
            EXPLORE.move(page, rng)
            EXPLORE.settle(page)
        page = CHROME.open_page(browser, address)  # the controls as they were
        time.sleep(asked.rest_s)
        EXPLORE.settle(page, figures=True)
        before = kernels.count
        print(f"{asked.scene}, {asked.size} x {asked.size} pixels, {asked.changes} changes each")
        print("| slider | median | 95 % | target: median | 95 % | painted a second, dragged | age |")
        print("|---|---|---|---|---|---|---|")
        for key, (low, high, median, most) in SLIDERS.items():
            if key.startswith("power") and len(source.groups) < 2:
                continue
            middle, late = np.percentile(latencies_ms(page, key, low, high, asked.changes), [50, 95])
            rate, age_ms = drag(page, key, low, high, asked.drag_s)
            jump = f"{middle:.0f} ms | {late:.0f} ms | {median:.0f} ms | {'' if np.isnan(most) else f'{most:.0f} ms'}"
            print(f"| {key} | {jump} | {rate:.1f} | {age_ms:.0f} ms |", flush=True)
        print(f"kernels compiled meanwhile: {kernels.count - before}")
        for number in range(1, asked.memory + 1):
            EXPLORE.move(page, rng)
            EXPLORE.settle(page)
            if number in (500, asked.memory) or number % max(1, asked.memory // 10) == 0:
                print(f"{number} changes: {resident_mib():.0f} MiB, {kernels.count - before} kernels", flush=True)


if __name__ == "__main__":
    main()
