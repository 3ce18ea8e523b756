"""Expected gains of mosaics beside those of simulation: `docs/make/design.py HASH`, a quarter of an hour on a core.

HASH is a commit's: ten scenes are drawn from it that no setting was chosen on. Each is lit by D65, photographed by each
mosaic at five levels of light, in the dark several times, and developed by `ple`, whose prior is trained anew where a
mosaic's curves need it.
Radiance, priors and rows are kept in out/design; the page's table and docs/results/design.csv are written from them.
Without HASH simulated gains are those of docs/results/design.csv, and expected ones are computed anew: half a minute.
"""

import csv
import json
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product
from math import log10, sqrt
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray
from page_parts import RESULTS, csv_text, fill
from skimage.color import rgb2lab

from isp.ple.prior import Prior, load_prior, own_prior, save_prior
from isp.processors.catalogue import NAMED, Processor
from isp.processors.piecewise import picture_ple
from render.engine import render
from render.illuminants import illuminant
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from scenes.catalog import load
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.presets import preset
from sensor.variations import vary
from studies.design.expect import expect
from studies.metrics.confidence import half_width
from studies.metrics.truth import light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import capture, colour_fit, develop_to_scale
from studies.training.train import train_prior

PAGE = Path(__file__).resolve().parents[1] / "design.md"
FOLDER, TABLE = Path("out/design"), RESULTS / "design.csv"
SCENES, SIDE, SPP = 10, 96, 256
T = float(scipy.special.stdtrit(SCENES - 1, 0.975))  # half a 95 % interval over scenes, over the standard error
SENSORS = ("low_noise", "table1_output")
SEEDS = {"moonlight": 2}  # of chip and noise; 1 at other levels
LEVELS = {level.name: level.luminance_cd_m2 for level in DEMO_LEVELS[:5]}  # by day the exposures are the same
BAYER = "bayer"
# Mosaics by name or rows. `ple` knows R, G, B and W: other curves stand in their places, with a prior of their own.
MOSAICS: Mapping[str, Mapping[str, str]] = {
    **{name: {} for name in (BAYER, "rgbw", "rgbw_sparse", "rgbw_4x4", "rgbw_nd", "quad_bayer", "quad_rgbw")},
    **{rows: {} for rows in ("RBWB/GRGR/RWBB/BGRG", "WRWG/GWBW", "GRGB/GBGR")},
    "rccb": {"C": "W"},
    "ryyb": {"Y": "G"},
    "BRBR/RGRG/BRBR/RGWG": {},  # found by `rodcone design low_noise`
    "cyym": {"C": "R", "Y": "G", "M": "B"},
    "cygm": {"C": "R", "M": "B", "Y": "W"},
    "cmyw": {"C": "R", "M": "G", "Y": "B"},
}
FIGURES = ("psnr_db", "luminance_db", "colour")


def in_places(sensor: SensorConfig, places: Mapping[str, str]) -> SensorConfig:
    """Sensor whose channels have the letters of `ple`."""
    curves = {places.get(name, name): sensor.responses.curves[name] for name in sensor.channels}
    if "W" not in curves:
        curves["W"] = preset("low_noise").responses.curves["W"]
    tile = tuple("".join(places.get(letter, letter) for letter in row) for row in sensor.cfa)
    return replace(sensor, cfa=tile, responses=Responses({**preset("low_noise").responses.curves, **curves}))


@cache
def prior_of(mosaic: str) -> Prior:
    """`ple`'s prior for a mosaic's curves."""
    if set(MOSAICS[mosaic]) <= {"C"}:
        return own_prior()
    path = FOLDER / f"{mosaic}.npz"
    if not path.exists():
        sensor = in_places(vary(preset(SENSORS[0]), mosaic), MOSAICS[mosaic])
        save_prior(train_prior(replace(sensor, cfa=("RG", "BW")), f"{mosaic}.toml", 1), path)
    return load_prior(path)


def scene_rows(name: str, transport: Transport, mosaic: str, level: str) -> Iterator[dict[str, str | float]]:
    """Errors of each sensor and seed of a mosaic in one scene at a level."""
    for sensor_name in SENSORS:
        sensor = in_places(vary(preset(sensor_name), mosaic), MOSAICS[mosaic])
        processor = replace(NAMED["ple"], picture=partial(picture_ple, prior=prior_of(mosaic)))
        for seed in range(SEEDS.get(level, 1)):
            rng = np.random.default_rng([int(name.split("-")[1], 16) % 2**32, list(MOSAICS).index(mosaic), seed])
            pictures = developed(transport, LEVELS[level], sensor, processor, rng)
            shown, truth = (encode_srgb(picture) for picture in pictures)
            off = rgb2lab(shown) - rgb2lab(truth)
            yield {
                "scene": name, "seed": seed, "sensor": sensor_name, "level": level, "mosaic": mosaic,
                "psnr_db": -10 * log10(np.mean((shown - truth) ** 2)),
                "luminance_db": -10 * log10(np.mean(luminance_of_srgb(shown - truth) ** 2)),
                "colour": sqrt(np.mean(off[..., 1:] ** 2) * 2),
            }  # fmt: skip


def developed(
    transport: Transport, luminance_cd_m2: float, sensor: SensorConfig, processor: Processor, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Picture of a scene at a level under D65, and the truth, in linear sRGB of one scale."""
    radiance = transport.relight(luminance_cd_m2=luminance_cd_m2)
    light = light_in_bands(illuminant("D65"), radiance.wavelength_nm, radiance.widths_nm)
    white_cd_m2 = shown_white_cd_m2(transport, luminance_cd_m2)
    # Another chip in each: a fixed pattern that all scenes share would lie outside the interval over scenes.
    raw = capture(radiance, sensor, device=draw_device(sensor, radiance.values.shape[:2], rng), rng=rng)
    fit, neutral = colour_fit(sensor, processor, light), neutral_electrons(sensor, light, raw.exposure_s)
    linear, _ = develop_to_scale(raw, processor, fit, sensor, neutral, white_cd_m2, balance=neutral)
    return linear, true_srgb(radiance, light, white_cd_m2)


def simulated(commit: str) -> list[dict[str, str | float]]:
    """Rows of all scenes drawn from a commit's hash; those of finished scenes are read."""
    rows = []
    for level, mosaic in product(LEVELS, MOSAICS):
        for number in range(SCENES):
            name = f"generated-{int(commit, 16) + number:x}"
            path = FOLDER / f"{name}-{mosaic.replace('/', '_')}-{level}.json"
            if not path.exists():
                transport = render(load(name, light="D65"), (SIDE, SIDE), spp=SPP, cache=FOLDER / "renders")
                path.write_text(json.dumps(list(scene_rows(name, transport, mosaic, level))))
            rows += json.loads(path.read_text())
        print(level, mosaic, file=sys.stderr)
    return rows


def gains(rows: Sequence[Mapping[str, str | float]]) -> list[dict[str, str | float]]:
    """Simulated gains over Bayer of each sensor, mosaic and level, with half the 95 % interval over scenes.

    A scene's gain is the mean of its seeds.
    """
    errors, lines = defaultdict(list), []
    for row, figure in product(rows, FIGURES):
        errors[row["sensor"], row["mosaic"], row["level"], figure].append(_decibels(figure, float(row[figure])))
    for sensor, mosaic, level in product(SENSORS, list(MOSAICS)[1:], LEVELS):
        line: dict[str, str | float] = {"sensor": sensor, "mosaic": mosaic, "level": level}
        for figure in FIGURES:  # scene by scene, seed by seed
            of, beside = (errors[sensor, m, level, figure] for m in (mosaic, BAYER))
            gain = np.subtract(of, beside).reshape(SCENES, -1).mean(axis=1)
            line |= {f"{figure}_simulated": float(gain.mean()), f"{figure}_interval": half_width(gain)}
        lines.append(line)
    return lines


def with_expected(lines: Sequence[dict[str, str | float]]) -> Sequence[Mapping[str, str | float]]:
    """Put the expected gains of each sensor, mosaic and level into lines of simulated ones."""
    for sensor in SENSORS:
        expected = {tile: expect(vary(preset(sensor), tile), list(LEVELS.values()), blur=True) for tile in MOSAICS}
        for line, figure in product((x for x in lines if x["sensor"] == sensor), FIGURES):
            index = list(LEVELS).index(line["level"])
            of, beside = (_decibels(figure, getattr(expected[m][index], figure)) for m in (line["mosaic"], BAYER))
            line[f"{figure}_expected"] = of - beside
    return lines


def _decibels(figure: str, value: float) -> float:
    return -20 * log10(value) if figure == "colour" else value


def write(lines: Sequence[Mapping[str, str | float]]) -> None:
    """Write the table of all gains, and the page's."""
    kinds = ("expected", "simulated", "interval")
    keys = ["sensor", "mosaic", "level", *(f"{figure}_{kind}" for figure in FIGURES for kind in kinds)]
    cells = [[x if isinstance(x := line[key], str) else f"{x:.3f}" for key in keys] for line in lines]
    TABLE.write_text(csv_text(keys, cells))
    agreement = [f"| RMS [dB], sign | {' | '.join(FIGURES)} |", "|---|---|---|---|"]
    for sensor in SENSORS:
        cells = []
        for figure in FIGURES:
            of_sensor = [x for x in lines if x["sensor"] == sensor]
            expected_db, simulated_db, interval_db = np.array(
                [[x[f"{figure}_{kind}"] for x in of_sensor] for kind in kinds], float
            )
            rms, exact = (sqrt(np.mean(x**2)) for x in (expected_db - simulated_db, interval_db / T))
            alike, over = np.sign(expected_db) == np.sign(simulated_db), np.abs(simulated_db) > 0.3
            sure = over & (np.abs(simulated_db) > interval_db)
            signs = ", ".join(f"{alike[those].sum()}/{those.sum()}" for those in (over, sure))
            cells.append(f"{rms:.2f} ({exact:.2f}) {signs}")
        agreement.append(f"| `{sensor}` | {' | '.join(cells)} |")
    PAGE.write_text(fill(PAGE.read_text(), {"proof": "\n".join(agreement)}))


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    lines = gains(simulated(sys.argv[1])) if sys.argv[1:] else list(csv.DictReader(TABLE.read_text().splitlines()))
    write(with_expected(lines))
