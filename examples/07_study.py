"""A study: every combination of light, sensor and processor, measured against the noise-free truth.

    python examples/07_study.py [SIZE]

Writes the folder dusk with its pictures and report.html. Ended by Ctrl-C it goes on where it was.

New here: a sweep that goes on where it stopped, a plan of what may be left out, a report of one page.
Expect: RGBW ahead of Bayer in the dark and level or behind at 5 cd/m2.
"""

import sys
from collections import defaultdict
from functools import partial
from statistics import mean

import rodcone


def main(size: int) -> None:
    """Plan, sweep, report."""
    study = rodcone.Study(
        scenes=(rodcone.SceneChoice("still_life"),),
        levels=("0.05cd/m2", "5cd/m2"),
        sensors=("low_noise",),
        processors=("ple_rgbw", "ple_bayer"),  # one method on both mosaics
        seeds=(0, 1),
        name="dusk",
        title="Does the white pixel help at dusk?",
        render=rodcone.RenderLimits(size=size, spp=128),
    )
    # `plan` compares each approximation's error with the sensor's noise, and leaves out what is too small to matter.
    plan = rodcone.plan(study)
    whole = rodcone.reference_plan(study)  # leaves nothing out
    for name, of in (("planned", plan), ("with everything", whole)):
        (model,) = of.renders.values()
        print(f"{name}: {model.spp} samples a pixel, {len(model.wavelength_nm)} bands")
    # Each worker is a process that imports this file: hence the main guard below.
    done = rodcone.sweep(study, "dusk", plan, runner=partial(rodcone.run_in_processes, workers=2))
    print(f"{done.cells} pictures, {done.made} of them made now, {done.seconds:.0f} s")

    psnr_db = defaultdict(list)
    for row in rodcone.read_rows("dusk"):
        psnr_db[row.level, row.processor].append(row.psnr_db)
    for (level, processor), values in psnr_db.items():
        print(f"{level:>10}  {processor:12}  {mean(values):.1f} dB")

    print("open", rodcone.report("dusk", "dusk/report.html"))


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 128)
