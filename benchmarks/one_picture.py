"""Render one picture and time it, for `bench_share.py`: in a process of its own, as another checkout can do it too.

It uses what every version since 35f5fbe has: `render(scene, size, wavelength_nm=, max_spp=, seed=)` and `relight()`.
"""

import sys
import time
from contextlib import suppress

import numpy as np

from render.engine import render
from scenes.catalogue import load

with suppress(ImportError):  # other checkouts
    from render.denoised.relight import relight_denoised

COMPILING_SPP = 128  # 35f5fbe makes other kernels for fewer


def main() -> None:
    name, size, bands, samples, seed, denoised, out = sys.argv[1:]
    scene, side = load(name), int(size)
    nm = 380.0 + 400.0 / int(bands) * (np.arange(int(bands)) + 0.5)
    options = {"wavelength_nm": nm, "seed": int(seed)} | ({"denoise": True} if denoised == "True" else {})
    render(scene, (side, side), max_spp=min(COMPILING_SPP, int(samples)), **options).relight()
    clock, processor = time.perf_counter(), time.process_time()
    made = render(scene, (side, side), max_spp=int(samples), **options)
    views = relight_denoised(made) if denoised == "True" else [made.relight()]
    seconds, processor_s = time.perf_counter() - clock, time.process_time() - processor
    radiance, *folds = (view.values for view in views)
    times = {"seconds": seconds, "processor_s": processor_s}
    np.savez(out, radiance=radiance, folds=folds, wavelength_nm=nm, samples=made.spp, **times)


if __name__ == "__main__":
    main()
