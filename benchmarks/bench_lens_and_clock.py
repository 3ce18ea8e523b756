"""What a real lens and a real clock cost for a picture of 1 Mpx: processor time and memory, each in its own process.

    python benchmarks/bench_lens_and_clock.py           (the table of docs/how_to/what_a_picture_costs.md)
    python benchmarks/bench_lens_and_clock.py --side 256

The picture has 20 bands and is even light with a grain, so that no transform is spared. Each line states the step by
itself, in processor seconds, and the most memory that its process holds, the picture's own included.
"""

import argparse
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import repeat
from time import process_time

import numpy as np
from environment import print_environment

from render.error_estimates import Halves
from render.illuminants import illuminant
from render.level import SceneMeans
from render.radiance import SpectralRadiance
from render.scene import LightGroup
from render.transport import Transport
from sensor.flicker.rows import flickering
from sensor.flicker.waveform import waveform
from sensor.lens.table import shipped, with_lens
from sensor.optics import form_image
from sensor.presets import low_noise
from sensor.shake import held_lens, shaken
from studies.photograph.moments import rolling_average, rolling_moments, time_average

NM, EXPOSURE_S, ROW_US, TIMES = np.arange(390.0, 780.0, 20.0), 0.066, 10.0, 4


def picture(side: int) -> SpectralRadiance:
    """Return even light with a grain of 10 %."""
    grain = np.random.default_rng(0).normal(1.0, 0.1, (side, side, NM.size)).astype(np.float32)
    return SpectralRadiance(np.abs(grain), NM, width_nm=np.full(NM.size, 20.0), horizontal_view_deg=40.0)


def transport(side: int) -> Transport:
    """Return such a picture as a render's light."""
    values = np.abs(np.random.default_rng(0).normal(1.0, 0.1, (1, NM.size, side, side))).astype(np.float32)
    empty, plane = np.zeros_like(values), np.zeros((side, side), np.float32)
    means = SceneMeans(values.mean(axis=(2, 3), dtype=np.float64), 1.0, np.zeros((NM.size + 1,) * 2))
    return Transport(
        light=Halves(values, empty),
        variance=empty.copy(),
        coverage=Halves(plane, plane),
        seen=(Halves(plane[None], plane[None]),),
        scene_means=means,
        counts=np.full((side, side), 64, np.uint32),
        groups={"lamp": LightGroup((), illuminant("D65"))},
        wavelength_nm=NM,
        width_nm=np.full(NM.size, 20.0),
        meter=None,
        stopped_by="samples",
        seconds=0.0,
        integrator="none",
        variant="none",
    )


def cases(side: int) -> dict[str, tuple[str, Callable[[], Callable[[], object]]]]:
    """Return by name what a line says, and what makes its step ready."""
    sensor = low_noise()
    rolling = replace(sensor, row_time_us=ROW_US)

    def imaged(camera: object) -> Callable[[], Callable[[], object]]:
        def ready() -> Callable[[], object]:
            light = picture(side)
            return lambda: form_image(light, camera)  # type: ignore[arg-type]

        return ready

    def held(camera: object) -> Callable[[], Callable[[], object]]:
        def ready() -> Callable[[], object]:
            in_hand = replace(camera, lens=held_lens(sensor.lens, "hand"))  # type: ignore[type-var]
            electrons = np.random.default_rng(0).uniform(50.0, 100.0, (side, side, 4))
            return lambda: shaken(electrons, in_hand, EXPOSURE_S, np.random.default_rng(1))  # type: ignore[arg-type]

        return ready

    def lit() -> Callable[[], object]:
        electrons = np.random.default_rng(0).uniform(50.0, 100.0, (side, side))
        lamp = waveform("fluorescent@100Hz")
        return lambda: flickering(electrons, [(lamp, electrons)], rolling, EXPOSURE_S, 0.0)

    def averaged(shares: object) -> Callable[[], Callable[[], object]]:
        def ready() -> Callable[[], object]:
            one = transport(side)
            if shares is None:
                return lambda: time_average(repeat(one, TIMES))
            return lambda: rolling_average(repeat(one, TIMES), shares)  # type: ignore[arg-type]

        return ready

    return {
        "ideal": ("an ideal lens, diffraction alone", imaged(sensor)),
        "glare": ("glare with wings", imaged(replace(sensor, lens=replace(sensor.lens, scatter=0.03)))),
        "hand": ("a hand's shake, all rows together", held(sensor)),
        "rolling hand": (f"a hand's shake, rows {ROW_US:g} µs apart", held(rolling)),
        "flicker": ("flicker of one frame, rows that roll", lit),
        "moments": (f"the mean of {TIMES} times, without their renders", averaged(None)),
        "rolling moments": (
            f"the mean of {TIMES} times, rows that roll",
            averaged(rolling_moments(rolling, side, EXPOSURE_S, TIMES)[1]),
        ),
        **{lens: (f"a lens by data, `{lens}`", imaged(with_lens(sensor, lens))) for lens in shipped()},
    }


def main() -> None:
    """Print the table, or measure one case."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--side", type=int, default=1024)
    options.add_argument("--case")
    given = options.parse_args()
    named = cases(given.side)
    if given.case:
        step = named[given.case][1]()
        begun = process_time()
        step()
        seconds = process_time() - begun
        print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        return
    print_environment()
    print(f"\n{given.side} x {given.side} pixels, {NM.size} bands\n\n| step | processor time | memory |\n|---|---|---|")
    for name, (text, _) in named.items():
        words = [sys.executable, __file__, "--side", str(given.side), "--case", name]
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        seconds, mebibytes = map(float, done.stdout.split())
        print(f"| {text} | {seconds:.2g} s | {mebibytes:.0f} MB |", flush=True)


if __name__ == "__main__":
    main()
