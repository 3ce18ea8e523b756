"""Where more light stops helping: a walker in the street at night, by exposure time, light and mosaic.

`python docs/make/motion.py` renders the scene `walker` at 16 times of half a second, each once, and keeps renders in
out/motion. An exposure's light is the mean over the times within it, so that the middle of each is at the same place.
Each picture is developed by `ple`; the walker's part of it is measured against the scene at the middle, from sixteen
times the samples. It writes docs/results/motion.csv and docs/how_to/motion.md.
"""

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
from page_parts import RESULTS, ROOT, csv_text, fill

import rodcone
from render.transport import Transport
from rodcone.errors import InputError
from rodcone.files import write_files
from studies.metrics.compare import ReferencePicture

PAGE = ROOT / "docs/how_to/motion.md"
FOLDER = Path("out/motion")
SIZE, SPP = 160, 32
LONGEST_S, TIMES = 0.5, 16
# Exposure [s], and how many of the times are in it: of the shortest the walker moves by half a pixel at most.
EXPOSURES = {"1/125": 1, "1/60": 1, "1/32": 1, "1/16": 2, "1/8": 4, "1/4": 8, "1/2": 16}
LEVELS = {"0.05": 0.05, "0.5": 0.5, "5": 5.0}  # mean luminance [cd m^-2]
MOSAICS = ("bayer", "rgbw")
SEEDS = range(4)
ROWS, COLUMNS = slice(86, 114), slice(54, 78)  # where the walker is at any of the times
BANDS = {"wavelength_nm": np.arange(390.0, 780.0, 20.0), "width_nm": np.full(20, 20.0)}


def moment(time_s: float, seed: int, spp: int) -> Transport:
    """Return the scene's light at one time."""
    scene = rodcone.load("walker", time_s=time_s)
    return rodcone.render(scene, (SIZE, SIZE), spp=spp, seed=seed, cache=FOLDER, **BANDS)


def of_the_walker(radiance: rodcone.SpectralRadiance) -> rodcone.SpectralRadiance:
    """Return the part of the picture in which the walker is."""
    return rodcone.SpectralRadiance(
        np.ascontiguousarray(radiance.values[ROWS, COLUMNS]),
        radiance.wavelength_nm,
        width_nm=radiance.width_nm,
        light=radiance.light,
        signed=True,
    )


def table() -> list[dict[str, str]]:
    """Return a row for each light, mosaic and exposure."""
    times_s = rodcone.moments_s(LONGEST_S, TIMES)
    moments = [moment(float(time_s), seed, SPP) for seed, time_s in enumerate(times_s)]
    still = moment(LONGEST_S / 2, TIMES, 16 * SPP)
    rows = []
    for level, luminance in LEVELS.items():
        powers = luminance / still.level().value
        lit = {name: powers * group.power for name, group in still.groups.items()}
        reference = rodcone.reference_picture(of_the_walker(still.relight(powers=lit)))
        for exposure, count in EXPOSURES.items():
            first = (TIMES - count) // 2
            blurred = rodcone.time_average(moments[first : first + count]).relight(powers=lit)
            for mosaic in MOSAICS:
                found = [measured(blurred, mosaic, float(Fraction(exposure)), seed, reference) for seed in SEEDS]
                psnr, flip = (np.mean([figures[name] for figures in found]) for name in ("psnr_db", "flip_mean"))
                row = {"light [cd/m2]": level, "mosaic": mosaic, "exposure [s]": exposure}
                rows += [{**row, "PSNR [dB]": f"{psnr:.1f}", "FLIP": f"{flip:.3f}"}]
    return rows


def measured(
    radiance: rodcone.SpectralRadiance, mosaic: str, exposure_s: float, seed: int, reference: ReferencePicture
) -> dict[str, float]:
    """Return the metrics of the walker's part of one developed exposure."""
    sensor = rodcone.preset("low_noise", mosaic)
    raw = rodcone.capture(radiance, sensor, exposure_s, rng=np.random.default_rng(seed))
    return rodcone.measure(rodcone.develop(raw).rgb[ROWS, COLUMNS], reference)


def page_table(rows: list[dict[str, str]]) -> str:
    """Return the table of the page: PSNR by exposure, the best of each line in bold."""
    head = "| light, mosaic | " + " | ".join(f"{name} s" for name in EXPOSURES) + " |"
    lines = [head, "| --- " * (len(EXPOSURES) + 1) + "|"]
    for level in LEVELS:
        for mosaic in MOSAICS:
            cells = [r["PSNR [dB]"] for r in rows if (r["light [cd/m2]"], r["mosaic"]) == (level, mosaic)]
            best = max(cells, key=float)
            shown = [f"**{cell}**" if cell == best else cell for cell in cells]
            lines.append(f"| {level} cd/m², {mosaic} | {' | '.join(shown)} |")
    return "\n".join(lines)


def main() -> None:
    """Write table and page."""
    rows = table()
    write_files(
        {
            RESULTS / "motion.csv": csv_text(list(rows[0]), [list(row.values()) for row in rows]),
            PAGE: fill(PAGE.read_text("utf-8"), {"motion": page_table(rows)}),
        }
    )


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"motion: {error}")
