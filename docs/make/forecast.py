"""What `rodcone expect` tells of mosaics beside pictures of drawn scenes: `docs/make/forecast.py HASH:SCENES ...`.

So many scenes are drawn from a commit's hash, rendered, lit by D65 at five levels, photographed through each mosaic and
developed by `ple`. For every sensor, level and mosaic it prints the gain over Bayer as expected (with blur) and as
simulated, with half the 95 % interval over scenes; then the root mean square of their differences, and in brackets
that of an exact forecast, which the simulation's own noise leaves. A scene takes 50 seconds of the processor. Rows are
kept in out/forecast, so that a second call, after a change of the forecast alone, takes seconds.

A forecast is changed by what scenes of one hash show, and judged by those of another.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import product
from math import sqrt
from pathlib import Path

import numpy as np
from design import BAYER, FIGURES, LEVELS, SENSORS, decibels, scene_rows, transport_of
from scipy.special import stdtrit

from sensor.presets import preset, vary
from studies.design.expect import expect

FOLDER = Path("out/forecast")
# Beside Bayer; R and B of the second and the fifth are an eighth of the pixels.
MOSAICS = ("rgbw", "rgbw_4x4", "rgbw_sparse", "RBWB/GRGR/RWBB/BGRG", "WRWG/GWBW", "BRBR/RGRG/BRBR/RGWG")
Key = tuple[str, str, str, str]  # sensor, mosaic, level, figure
Gains = dict[Key, np.ndarray]  # of each scene


def simulated(scenes: Sequence[str]) -> Gains:
    """Return the gain over Bayer of each scene [dB]."""
    errors = defaultdict(list)
    for name, mosaic, level in product(scenes, (BAYER, *MOSAICS), LEVELS):
        path = FOLDER / f"{name}-{mosaic.replace('/', '_')}-{level}.json"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(list(scene_rows(name, transport_of(name, FOLDER), mosaic, level, "ple"))))
        by_figure = defaultdict(list)
        for row, figure in product(json.loads(path.read_text()), FIGURES):
            by_figure[row["sensor"], figure].append(decibels(figure, row[figure]))
        for (sensor, figure), seeds in by_figure.items():
            errors[sensor, mosaic, level, figure].append(np.mean(seeds))
    return {
        (sensor, mosaic, *rest): np.subtract(found, errors[sensor, BAYER, *rest])
        for (sensor, mosaic, *rest), found in errors.items()
        if mosaic != BAYER
    }


def expected() -> dict[Key, float]:
    """Return the gain over Bayer that the closed form tells [dB]."""
    told = {}
    for sensor in SENSORS:
        cameras = {m: expect(vary(preset(sensor), m), list(LEVELS.values()), blur=True) for m in (BAYER, *MOSAICS)}
        for mosaic, (index, level), figure in product(MOSAICS, enumerate(LEVELS), FIGURES):
            of, beside = (decibels(figure, getattr(cameras[m][index], figure)) for m in (mosaic, BAYER))
            told[sensor, mosaic, level, figure] = of - beside
    return told


def rms_text(told: Mapping[Key, float], found: Gains, keys: Sequence[Key]) -> str:
    """Return the root mean square of the differences, and that of an exact forecast."""
    off = [told[key] - found[key].mean() for key in keys]
    exact = [found[key].var(ddof=1) / len(found[key]) for key in keys]
    return f"{sqrt(np.mean(np.square(off))):.2f} ({sqrt(np.mean(exact)):.2f})"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drawn", nargs="+", help="HASH:SCENES, a commit's whole hash and how many are drawn from it")
    parts = [text.partition(":") for text in parser.parse_args().drawn]
    scenes = [f"generated-{int(commit, 16) + k:x}" for commit, _, count in parts for k in range(int(count))]
    found, told = simulated(scenes), expected()
    half = float(stdtrit(len(scenes) - 1, 0.975)) / sqrt(len(scenes))
    for sensor, figure in product(SENSORS, FIGURES):
        print(f"\n{sensor}, {figure}: gain over Bayer, expected / simulated ± half the interval [dB]")
        print(f"{'':20s}" + "".join(f"{f'{level} {value:g}':>20s}" for level, value in LEVELS.items()))
        for mosaic in MOSAICS:
            cells = [(told[key], found[key]) for key in ((sensor, mosaic, level, figure) for level in LEVELS)]
            texts = [f"{a:+.2f} / {b.mean():+.2f} ± {b.std(ddof=1) * half:.2f}" for a, b in cells]
            print(f"{mosaic:20s}" + "".join(f"{text:>20s}" for text in texts))
        by_level = [rms_text(told, found, [(sensor, m, level, figure) for m in MOSAICS]) for level in LEVELS]
        whole = rms_text(told, found, [(sensor, m, level, figure) for m in MOSAICS for level in LEVELS])
        print(f"{'RMS (if exact)':20s}" + "".join(f"{text:>20s}" for text in by_level) + f"; all {whole}")


if __name__ == "__main__":
    main()
