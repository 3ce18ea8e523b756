"""Expected gains of mosaics beside those of simulation: `docs/make/design.py HASH NETWORK`, 25 minutes on a core.

HASH is a commit's: ten scenes are drawn from it that no setting was chosen on. Each is lit by D65, photographed by each
mosaic at five levels of light, in the dark several times, and developed by `ple`, whose prior is trained anew where a
mosaic's curves need it; Bayer and RGBW by `OTHERS` too, NETWORK being the wheel of demosaicnet.
Radiance, priors and rows are kept in out/design; the page's tables and docs/results/design.csv are written from them.
Without arguments simulated gains are those of docs/results/design.csv, and expected ones are computed anew, and the
order of Bayer, random tiles and the optimum where photons are the only noise (`known_order`): two minutes.
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
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from page_parts import RESULTS, csv_text, run, unstamped, write_page
from skimage.color import rgb2lab

from isp.design.expected_error import expected_error, sampled
from isp.design.spectral_prior import PRIORS, load_spectral_prior
from isp.ple.prior import Prior, load_prior, save_prior
from isp.processors.catalogue import NAMED, Processor, require_libraries
from isp.processors.own import processor_of
from isp.processors.piecewise import picture_ple
from render.engine import render
from render.illuminants import illuminant
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb, xyz_to_srgb
from scenes.catalogue import load
from scenes.levels import DEMO_LEVELS
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.device import draw_device
from sensor.presets import preset, vary
from sensor.readings.resolve import chip_readings
from studies.design.expect import MIDDLE, expect, lens_of, noise_of, responses_e, sampling_of, view_of
from studies.metrics.confidence import half_width
from studies.metrics.truth import light_in_bands, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.photograph.camera import capture, colour_fit, develop_to_scale
from studies.training.train import train_prior

PAGE = RESULTS.parent / "design.md"
FOLDER = Path("out/design")
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
    "BRBR/RGRG/BRBR/RGWG": {},  # found by `benchmarks/design_mosaic.py`
    "cyym": {"C": "R", "Y": "G", "M": "B"},
    "cygm": {"C": "R", "M": "B", "Y": "W"},
    "cmyw": {"C": "R", "M": "G", "Y": "B"},
}
NETWORK = "bayer_net_bm3d"
# Processors beside `ple`, the first by BM3D; behind the first sensor, one seed.
OTHERS = {"bayer": ("bayer_residual_bm3d", NETWORK), "rgbw": ("rgbw_park", "interleaved")}
FIGURES = ("psnr_db", "luminance_db", "colour")


def in_places(sensor: SensorConfig, places: Mapping[str, str]) -> SensorConfig:
    """Sensor whose channels have the letters of `ple`."""
    curves = {places.get(name, name): sensor.responses.curves[name] for name in sensor.channels}
    if "W" not in curves:
        curves["W"] = preset("low_noise").responses.curves["W"]
    tile = tuple("".join(places.get(letter, letter) for letter in row) for row in sensor.cfa)
    return replace(sensor, cfa=tile, responses=Responses({**preset("low_noise").responses.curves, **curves}))


def trained(sensor: SensorConfig, name: str, path: Path) -> Prior:
    """`ple`'s prior for a sensor's curves, kept in a file."""
    if not path.exists():
        save_prior(train_prior(replace(sensor, cfa=("RG", "BW")), name, 1), path)
    return load_prior(path)


@cache
def ple_of(mosaic: str) -> Processor:
    """`ple` with its prior for a mosaic's curves."""
    if set(MOSAICS[mosaic]) <= {"C"}:
        return NAMED["ple"]
    sensor = in_places(vary(preset(SENSORS[0]), mosaic), MOSAICS[mosaic])
    return with_prior(trained(sensor, f"{mosaic}.toml", FOLDER / f"{mosaic}.npz"))


def with_prior(prior: Prior) -> Processor:
    """`ple` with another prior than its own."""
    return replace(NAMED["ple"], picture=partial(picture_ple, prior=prior))


def transport_of(name: str, folder: Path) -> Transport:
    """Light of a drawn scene."""
    return render(load(name, light="D65"), (SIDE, SIDE), spp=SPP, cache=folder / "renders")


def scene_rows(name: str, transport: Transport, mosaic: str, level: str, developer: str) -> Iterator[dict[str, Any]]:
    """Errors of each sensor and seed of a mosaic in one scene at a level, developed by a processor."""
    processor = ple_of(mosaic) if developer == "ple" else processor_of(developer)
    for sensor_name in SENSORS if developer == "ple" else SENSORS[:1]:
        sensor = in_places(vary(preset(sensor_name), mosaic), MOSAICS[mosaic])
        for seed in range(SEEDS.get(level, 1) if developer == "ple" else 1):
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


def simulated(commit: str, network: str) -> list[dict[str, Any]]:
    """Rows of all scenes drawn from a commit's hash; those of finished scenes are read."""
    rows = []
    others = [(mosaic, name) for mosaic, names in OTHERS.items() for name in names]
    for _, name in others:  # before hours of `ple`
        require_libraries(name)
    wanted = [*product(LEVELS, product(MOSAICS, ("ple",))), *product(LEVELS, others)]
    for level, (mosaic, developer) in wanted:
        for number in range(SCENES):
            name = f"generated-{int(commit, 16) + number:x}"
            path = FOLDER / f"{name}-{mosaic.replace('/', '_')}-{level}{developer.removeprefix('ple')}.json"
            if not path.exists():
                software = developer.replace(NETWORK, f"{network}:{NETWORK}")
                made = scene_rows(name, transport_of(name, FOLDER), mosaic, level, software)
                path.write_text(json.dumps(list(made)))
            rows += [{**row, "developer": developer} for row in json.loads(path.read_text())]
        print(level, mosaic, developer, file=sys.stderr)
    return rows


def gains(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Simulated gains over Bayer of each sensor, mosaic and level, with half the 95 % interval over scenes.

    A scene's gain is the mean of its seeds. The best of several processors is that of the best mean.
    """
    errors, lines = defaultdict(list), []
    for row, figure in product(rows, FIGURES):
        key = row["sensor"], row["mosaic"], row["level"], figure, row["developer"]
        errors[key].append(decibels(figure, float(row[figure])))
    by_scene = {key: np.reshape(values, (SCENES, -1)).mean(axis=1) for key, values in errors.items()}
    ple: Mapping[str, tuple[str, ...]] = dict.fromkeys(MOSAICS, ("ple",))
    compared = [(*x, "ple", ple) for x in product(SENSORS, list(MOSAICS)[1:], LEVELS)]
    for label, names in (
        ("bm3d", {mosaic: names[:1] for mosaic, names in OTHERS.items()}),
        ("best", {mosaic: ("ple", *names) for mosaic, names in OTHERS.items()}),
    ):
        compared += [(SENSORS[0], "rgbw", level, label, names) for level in LEVELS]
    for sensor, mosaic, level, label, names in compared:
        line = {"sensor": sensor, "mosaic": mosaic, "level": level, "developer": label}
        for figure in FIGURES:
            of, beside = (
                max((by_scene[sensor, m, level, figure, name] for name in names[m]), key=np.mean)
                for m in (mosaic, BAYER)
            )
            line |= {f"{figure}_simulated": np.mean(of - beside), f"{figure}_interval": half_width(of - beside)}
        lines.append(line)
    return lines


def with_expected(lines: Sequence[dict[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """Put the expected gains of each sensor, mosaic and level into lines of simulated ones."""
    for sensor in SENSORS:
        expected = {tile: expect(vary(preset(sensor), tile), list(LEVELS.values()), blur=True) for tile in MOSAICS}
        for line, figure in product((x for x in lines if x["sensor"] == sensor), FIGURES):
            index = list(LEVELS).index(line["level"])
            of, beside = (decibels(figure, getattr(expected[m][index], figure)) for m in (line["mosaic"], BAYER))
            line[f"{figure}_expected"] = of - beside
    return lines


def decibels(figure: str, value: float) -> float:
    """Return a figure in decibels, more being better: the error of colour as -20 lg, others as they are."""
    return -20 * log10(value) if figure == "colour" else value


def write(lines: Sequence[Mapping[str, Any]]) -> None:
    """Write the table of all gains, and the page's."""
    kinds = ("expected", "simulated", "interval")
    keys = ["sensor", "mosaic", "level", "developer", *(f"{figure}_{kind}" for figure in FIGURES for kind in kinds)]
    cells = [[x if isinstance(x := line[key], str) else f"{x:.3f}" for key in keys] for line in lines]
    figures = csv_text(keys, cells)
    agreement = [f"| RMS [dB], sign | {' | '.join(FIGURES)} |", "|---|---|---|---|"]
    for sensor in SENSORS:
        cells = []
        for figure in FIGURES:
            of_sensor = [x for x in lines if (x["sensor"], x["developer"]) == (sensor, "ple")]
            expected_db, simulated_db, interval_db = np.array(
                [[x[f"{figure}_{kind}"] for x in of_sensor] for kind in kinds], float
            )
            rms, exact = (sqrt(np.mean(x**2)) for x in (expected_db - simulated_db, interval_db / T))
            alike, over = np.sign(expected_db) == np.sign(simulated_db), np.abs(simulated_db) > 0.3
            sure = over & (np.abs(simulated_db) > interval_db)
            signs = ", ".join(f"{alike[those].sum()}/{those.sum()}" for those in (over, sure))
            cells.append(f"{rms:.2f} ({exact:.2f}) {signs}")
        agreement.append(f"| `{sensor}` | {' | '.join(cells)} |")
    write_page(PAGE, {"proof": "\n".join(agreement), "order": known_order()}, "", figures)


def linear_db(prior: str, sensor: SensorConfig, time_s: float) -> float:
    """Expected PSNR of linear sRGB at 25 cd/m2, white 1, component known."""
    spectral, view, lens = load_spectral_prior(prior), view_of(prior, "D65"), lens_of(sensor, blur=False)
    patches = sampled(spectral.patches, sampling_of(sensor, responses_e(sensor, view), lens), MIDDLE, lens)
    rows, unit = xyz_to_srgb(view.xyz.T).T / sqrt(3), LEVELS["classroom"] / spectral.reflectances.mean() * time_s
    forms, noise = np.broadcast_to(rows.T @ rows, (1, *patches.within.shape)), noise_of(chip_readings(sensor, time_s))
    return -10 * log10(np.mean([m**2 * expected_error(patches, m * unit, noise, forms) for m in spectral.reflectances]))


def known_order() -> str:
    """Gains over Bayer where photons are the only noise, 1000 in W: random tiles, the best that is found."""
    from design_search import Goal, best_tile

    photons, rng = preset(PAGE.parent / "eye" / "photons.toml"), np.random.default_rng(0)
    time_s, tiles = 8.6e-3, ["/".join("".join(row) for row in rng.choice(list("RGBW"), (4, 4))) for _ in range(20)]
    lines = ["| over Bayer [dB] | random | best |", "|---|---|---|"]
    for prior in PRIORS:
        goal = Goal(over="classroom:classroom", exposure=f"{time_s}s", prior=prior, behind=100, behind_in_luminance=100)
        best = "/".join(best_tile(replace(goal, steps=200), photons, {}, lambda *_: None))
        cameras = [vary(photons, mosaic) for mosaic in (BAYER, best, *tiles)]
        encoded = [expect(x, [LEVELS["classroom"]], exposure=time_s, prior=prior)[0].psnr_db for x in cameras]
        for curve, decibels in (("sRGB", encoded), ("linear", [linear_db(prior, x, time_s) for x in cameras])):
            found, *random = np.subtract(decibels[1:], decibels[0])
            error = np.std(random, ddof=1) / sqrt(len(random))
            lines.append(f"| {prior}, {curve} | {np.mean(random):+.2f}±{error:.2f} | {found:+.2f} |")
        print(prior, best, file=sys.stderr)
    return "\n".join(lines)


def main(*commit_and_network: str) -> None:
    """Write all, with gains simulated anew where a commit and a network are given."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    kept = list(csv.DictReader(unstamped((RESULTS / "design.csv").read_text()).splitlines()))
    write(with_expected(gains(simulated(*commit_and_network)) if commit_and_network else kept))


if __name__ == "__main__":
    fix = "give a commit's hash and the wheel of demosaicnet, or neither"
    run(main, sys.argv[1:], len(sys.argv) in (1, 3), fix)
