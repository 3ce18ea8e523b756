"""Write the tables of docs/spectral_studies.md from its four sweeps: `python docs/make/spectral_studies.py FOLDER`.

FOLDER holds the sweeps' folders spectra, metamers, infrared_cut and responses, as `make results PART=spectral_studies`
makes them. Each table has a line for each combination of the axes, and of each figure its mean over the seeds with half
its 95 % interval.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from page_parts import RESULTS, csv_text, fill, run

from rodcone.files import write_files
from studies.sweep.export import TableLine, lines, markdown, mean_text, read_rows

PAGE = RESULTS.parent / "spectral_studies.md"
# By study: the axes and the figures of its table.
TABLES = {
    "spectra": (
        ("level", "spectrum", "processor"),
        ("electrons_W", "electrons_G", "patch_snr_db", "chart_delta_e_mean", "daylight_delta_e"),
    ),
    "metamers": (("spectrum", "sensor", "processor"), ("true_pair_delta_e", "pair_delta_e")),
    "infrared_cut": (
        ("level", "spectrum", "sensor", "processor"),
        ("electrons_W", "electrons_G", "patch_snr_db", "chart_delta_e_mean", "delta_e_median"),
    ),
    "responses": (
        ("processor", "level", "sensor"),
        ("electrons_G", "electrons_W", "patch_snr_db", "chart_delta_e_mean", "delta_e_median"),
    ),
}
SHOWN = ("electrons_W", "electrons_G", "chart_delta_e_mean", "daylight_delta_e")  # on the page, of spectra at 100 lux


def csv_of(table: Sequence[TableLine], axes: Sequence[str], figures: Sequence[str]) -> str:
    """Return a table as CSV: a column for each axis, two for each figure, its mean and its interval."""
    head = [*axes, *(name for figure in figures for name in (figure, f"{figure} ±"))]
    rows = []
    for line in table:
        cells = list(line.at)
        for mean, half in zip(line.means, line.halves, strict=True):
            shown, _, interval = mean_text(mean, half).partition(" ± ")
            cells += [shown if mean is not None else "", interval]
        rows.append(cells)
    return csv_text(head, rows)


def write(folder: str) -> None:
    """Write the four tables, and the page's part."""
    tables = {}
    for name, (axes, figures) in TABLES.items():
        swept = Path(folder) / name
        tables[RESULTS / f"{name}.csv"] = csv_of(lines(read_rows(swept), swept, axes, figures, {}), axes, figures)
    spectra = Path(folder) / "spectra"
    where = {"level": "100lux", "processor": "interleaved"}
    shown = markdown(lines(read_rows(spectra), spectra, ("spectrum",), SHOWN, where), ("spectrum",), SHOWN)
    write_files({**tables, PAGE: fill(PAGE.read_text("utf-8"), {"lux": shown})})


if __name__ == "__main__":
    run(write, sys.argv[1:], len(sys.argv) == 2, "give the folder that holds the four sweeps")
