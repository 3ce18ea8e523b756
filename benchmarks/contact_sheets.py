"""Contact sheets: what five ways of developing make of ten pictures in five lights, for a person to look at.

    python benchmarks/contact_sheets.py -o FOLDER [--only NAME ...] [--size 144]

Writes FOLDER/index.html with a sheet of each picture and light, at twice the size, its middle at four times (truth,
`interleaved`, `ple_rgbw`, `ple_bayer`, `bayer`), and FOLDER/counts.csv: PSNR beside the blemishes that an eye counts
(`studies.metrics.blemishes`), so that neither hides the other. Camera `low_noise` without diffraction, exposure
`auto:information` of 66 ms at most, white balance given.
"""

import csv
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np
import skimage.data
from numpy.typing import NDArray
from PIL import Image

from isp.processors.catalogue import PROCESSORS
from render.engine import render
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.radiance_files.photo import srgb_basis
from render.spectrum import Spectrum, band_widths
from rodcone.colour_spaces import decode_srgb, encode_srgb
from scenes.catalogue import load
from sensor.capture import expose
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.exposure import exposure_by_rule_s
from sensor.optics import form_image
from sensor.presets import preset, vary
from sensor.response import expected_electrons
from studies.metrics.appearance import psnr_db
from studies.metrics.blemishes import count_blemishes
from studies.metrics.truth import light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb, white_of_pixels
from studies.photograph.camera import colour_fit, develop_to_scale

SCENES = ("night_street", "still_life", "color_checker", "siemens_star")
PHOTOGRAPHS = ("astronaut", "chelsea", "coffee", "motorcycle_left", "retina", "rocket")
LEVELS_CD_M2 = (0.05, 0.5, 5.0, 100.0, 1000.0)
WAYS = {"interleaved": "rgbw", "ple_rgbw": "rgbw", "ple_bayer": "bayer", "bayer": "bayer"}
NM = np.arange(390.0, 780.0, 20.0)
LONGEST_S, SAMPLES = 0.066, 256
Picture = NDArray[np.float64]


@dataclass(frozen=True)
class Stage:
    """What is photographed.

    Attributes
    ----------
    radiance : SpectralRadiance
        At a mean of 1 cd/m^2.
    light : Spectrum
        That a neutral reflects.
    white_cd_m2 : float
        Shown as white.
    truth : (h, w, 3) float64
        In sRGB.
    """

    radiance: SpectralRadiance
    light: Spectrum
    white_cd_m2: float
    truth: Picture


def main(arguments: Sequence[str] | None = None) -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--out", type=Path, required=True, help="folder of the page")
    parser.add_argument("--only", nargs="+", default=(*SCENES, *PHOTOGRAPHS), help="scenes or photographs by name")
    parser.add_argument("--levels", nargs="+", type=float, default=LEVELS_CD_M2, help="mean luminances [cd/m^2]")
    parser.add_argument("--size", type=int, default=144, help="pixels a side")
    asked = parser.parse_args(arguments)
    asked.out.mkdir(parents=True, exist_ok=True)
    rows = list[dict[str, object]]()
    for name in asked.only:
        stage = stage_of(name, asked.size)
        for level in asked.levels:
            shown = {way: developed(stage, way, level) for way in WAYS}
            file = f"{name}_{level:g}.png"
            sheet([stage.truth, *shown.values()]).save(asked.out / file)
            rows += [row(name, level, way, picture, stage.truth) for way, picture in shown.items()]
            print(*(f"{key} {value}" for key, value in rows[-4].items()), flush=True)
    write(asked.out, rows)


def stage_of(name: str, size: int) -> Stage:
    """Render a scene, or open a photograph of scikit-image: halved as often as it goes, its middle cut out."""
    if name not in PHOTOGRAPHS:
        scene = load(name)
        transport = render(scene, (size, size), wavelength_nm=NM, spp=SAMPLES)
        spectrum = next(iter(scene.groups.values())).spectrum
        light = light_in_bands(spectrum, transport.wavelength_nm, transport.width_nm)
        radiance, white = transport.relight(luminance_cd_m2=1.0), shown_white_cd_m2(transport, 1.0)
    else:
        found = next(Path(skimage.data.__file__).parent.glob(f"{name}.*g"))
        image = Image.open(found).convert("RGB")
        shrink = max(1, min(image.size) // (2 * size))
        image = image.resize((image.width // shrink, image.height // shrink), Image.Resampling.BOX)
        x, y = (image.width - size) // 2, (image.height - size) // 2
        rgb = np.asarray(image.crop((x, y, x + size, y + size))) / 255.0
        light = light_in_bands(illuminant("D65"), NM, band_widths(NM))
        radiance = SpectralRadiance((decode_srgb(rgb) @ srgb_basis(NM)) * light.spectrum, NM)
        radiance = SpectralRadiance(radiance.values / radiance.luminance().mean(), NM)
        white = white_of_pixels(radiance.luminance(), np.zeros(radiance.luminance().shape))
    return Stage(radiance, light, white, shown_srgb(true_srgb(radiance, light, white)))


def shown_srgb(linear: Picture) -> Picture:
    return np.asarray(np.clip(encode_srgb(np.clip(linear, 0.0, 1.0)), 0.0, 1.0))


def camera(mosaic: str) -> SensorConfig:
    sensor = vary(preset("low_noise"), mosaic)
    return replace(sensor, lens=replace(sensor.lens, diffraction=0.0))


def developed(stage: Stage, way: str, level_cd_m2: float) -> Picture:
    """Expose the stage at a mean luminance, and develop it at the truth's scale."""
    sensor, processor = camera(WAYS[way]), PROCESSORS[way]
    image = form_image(stage.radiance, sensor)
    lit = replace(image, values=image.values * level_cd_m2)
    exposure_s = min(exposure_by_rule_s("auto:information", lit, sensor), LONGEST_S)
    device = draw_device(sensor, stage.truth.shape[:2], np.random.default_rng([0, 0]))
    electrons = expected_electrons(lit, sensor, exposure_s)
    raw = expose(electrons, sensor, exposure_s, device, np.random.default_rng([0, 1]))
    neutral, fit = neutral_electrons(sensor, stage.light, exposure_s), colour_fit(sensor, processor, stage.light)
    linear, _ = develop_to_scale(raw, processor, fit, sensor, neutral, stage.white_cd_m2 * level_cd_m2, balance=neutral)
    return shown_srgb(linear)


def sheet(pictures: Sequence[Picture]) -> Image.Image:
    """Pictures in a row at twice their size, and under each its middle half at four times."""
    size, gap = 2 * pictures[0].shape[0], 4
    page = Image.new("RGB", (len(pictures) * (size + gap) - gap, 2 * size + gap), "white")
    for column, picture in enumerate(pictures):
        quarter = picture.shape[0] // 4
        middle = picture[quarter : quarter + size // 4, quarter : quarter + size // 4]
        for line, part in enumerate((picture, middle)):
            enlarged = Image.fromarray(np.round(255.0 * part).astype(np.uint8)).resize(
                (size, size), Image.Resampling.NEAREST
            )
            page.paste(enlarged, (column * (size + gap), line * (size + gap)))
    return page


def row(name: str, level: float, way: str, picture: Picture, truth: Picture) -> dict[str, object]:
    counts = count_blemishes(picture, truth)
    return {
        "picture": name,
        "cd_m2": f"{level:g}",
        "way": way,
        "psnr_db": f"{psnr_db(picture, truth):.2f}",
        "spots": counts.spots,
        "holes": counts.holes,
        "dots": counts.dots,
        "even": counts.even,
    }


def write(folder: Path, rows: Sequence[dict[str, object]]) -> None:
    with (folder / "counts.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    (folder / "index.html").write_text("\n".join(page(rows)), encoding="utf-8")


def page(rows: Sequence[dict[str, object]]) -> Iterator[str]:
    """Lines of the page: a sheet for each picture and light, and under each column its figures."""
    yield '<!doctype html><html lang="en"><meta charset="utf-8"><title>Contact sheets</title>'
    yield "<style>img { image-rendering: pixelated } td { width: 292px; font: 14px sans-serif }</style>"
    yield "<p>Each sheet at twice the size, its middle at four times. Spots, holes and dots are counts of pixels.</p>"
    for first in range(0, len(rows), len(WAYS)):
        ways = rows[first : first + len(WAYS)]
        name, level = (escape(str(ways[0][key])) for key in ("picture", "cd_m2"))
        figures = [
            f"{one['way']}: {one['psnr_db']} dB, {one['spots']} spots, {one['holes']} holes, {one['dots']} dots"
            for one in ways
        ]
        yield f'<h2>{name}, {level} cd/m²</h2><img src="{name}_{level}.png" alt="{name} at {level} cd/m²">'
        yield "<table><tr>" + "".join(f"<td>{escape(text)}</td>" for text in ("truth", *figures)) + "</tr></table>"


if __name__ == "__main__":
    main()
