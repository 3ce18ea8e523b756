"""Made-up values and noise pictures for the report's tests."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from skimage import data
from sweep_sample import row

from sensor.presets import preset
from studies.metrics.flip import seen
from studies.pages.report_data import ReportCell, ReportData, ReportLevel, ReportRender, ReportScene, ReportSensor
from studies.pages.report_pictures import LOSSLESS, ReportPictures, as_webp, flip_map, opened
from studies.sweep.row import Row

LEVELS = (
    ("moonlight", 0.036, 0.21, "Parmar & Wandell 2009: 10 photons per µm² per second at f/5.6"),
    ("street light", 0.5, 3.1, "EN 13201: residential roads"),
    ("living room", 8.0, 50.0, "a lamp in the evening"),
    ("paper's figure 6", 25.0, 155.0, "Parmar & Wandell 2009, figure 6"),
    ("office", 80.0, 500.0, "EN 12464-1: writing, reading"),
    ("overcast", 800.0, 5000.0, "CIE overcast sky"),
    ("daylight", 5000.0, 31000.0, "sun and clear sky"),
)
SENSORS = (ReportSensor("table1_output", preset("table1_output")), ReportSensor("low_noise", preset("low_noise")))
CAMERAS = ("interleaved", "bayer")
RENDER = ReportRender("", 256, 40, 41.2, "path + specfilm", "seconds", 0.031)
AXES = ("scenes", "spectra", "sensors", "exposures", "balances", "cameras", "seeds")
Change = Callable[[Row], Row | None]


def sample_row(level: int, sensor: int, camera: str, seed: int = 0, **values: Any) -> Row:
    """Numbers of the size that a real run gives: the interleaved camera is ahead in the dark."""
    rgbw = camera == "interleaved"
    psnr = round(min(7 + 6 * sensor + 3.6 * level + (3.2 - 0.9 * level if rgbw else 0.0), 38.0), 3)
    electrons = [round(min(4.0 * 9**level, 9000.0) * share, 1) for share in (0.4, 1.0, 0.5, 3.0)]
    fallen = "calibrated" if level == 0 and sensor == 0 else "gray world"
    made = {
        "scene": "still_life",
        "sensor": SENSORS[sensor].name,
        "level": LEVELS[level][0],
        "exposure": "auto",
        "luminance_cd_m2": LEVELS[level][1],
        "illuminance_lux": LEVELS[level][2],
        "exposure_s": 0.066 if level < 4 else 0.066 / 8 ** (level - 3),
        "psnr_db": psnr,
        "ssim": min(0.04 + 0.02 * psnr + (0.05 if rgbw else 0), 0.97),
        "delta_e_median": 120 / psnr + (0.4 if rgbw and level > 3 else 0),
        "delta_e_p95": 380 / psnr,
        "s_cielab_median": 60 / psnr,
        "s_cielab_p95": 190 / psnr,
        "flip_mean": 4 / psnr,
        "pu21_psnr_db": psnr + 3,
        "mc_share": 2e-4 * 3.1**level * (1.6 if rgbw else 1) * (1 + 3 * sensor),
        "snr_db": None if level == 0 else psnr - 4,
        "substitution": int(level < 3 - sensor) if rgbw else None,
        "balance": json.dumps({"R": fallen, "G": "gray world", "B": "gray world"}),
        "saturated": 0.0 if level < 4 else 0.012,
        "mean_electrons": json.dumps(dict(zip("RGBW" if rgbw or "rgbw" in camera else "RGB", electrons, strict=False))),
        "variant": "llvm_ad_spectral",
        "readout_engine": "llvm",
        "capture_s": 0.021,
        "develop_s": 0.11 if rgbw else 0.03,
        "picture": f"{level}/{SENSORS[sensor].name}/{camera}",
    }
    return row(camera, seed, **made | values)


def sample_report(change: Change = lambda made: made, levels: int = len(LEVELS), **values: Any) -> ReportData:
    """Return a report of two sensors and seven levels with what `change` makes of each row.

    `values` take the place of the report's own; of its axes (scenes, spectra, sensors, exposures, cameras, seeds) too.
    """
    given = {name: values.pop(name) for name in AXES if name in values}
    axes = {
        "scenes": (ReportScene("still_life", 256, 256),),
        "spectra": ("own",),
        "sensors": SENSORS,
        "exposures": ("auto",),
        "balances": ("as-shot",),
        "cameras": CAMERAS,
        "seeds": (0,),
    } | given
    names = [scene.name for scene in axes["scenes"]], [sensor.name for sensor in axes["sensors"]]
    groups = product(names[0], axes["spectra"], axes["sensors"], axes["exposures"], axes["balances"])
    cells = []
    for scene, spectrum, sensor, exposure, balance in groups:
        for level, camera in product(range(levels), axes["cameras"]):
            made = [
                sample_row(
                    level,
                    SENSORS.index(sensor),
                    camera,
                    seed,
                    scene=scene,
                    spectrum=spectrum,
                    exposure=exposure,
                    white_balance=balance,
                )
                for seed in axes["seeds"]
            ]
            rows = tuple(change(one) for one in made)
            picture = rows[0].picture if rows[0] else None
            cells.append(ReportCell(level, camera, LEVELS[level][1], LEVELS[level][2], rows, picture))
    report = ReportData(
        rodcone="0.1.0",
        name="sample",
        title="What is seen?",
        levels=tuple(ReportLevel(name, source) for name, _, _, source in LEVELS[:levels]),
        cells=tuple(cells),
        truths=("truth",),
        renders=tuple(replace(RENDER, scene=scene) for scene in names[0]),
        stages={"render": 41.2, "captures": 1.9, "develop interleaved": 4.4, "develop bayer": 1.2, "metrics": 9.8},
        environment={"python": "3.11.7", "mitsuba": "3.9.1", "llvm": "libLLVM.so.23.1", "threads": "2"},
        configuration={"[render]": "size = 256, spp = 256"},
        exposure_rule="99th percentile of expected G at 80 % of the well, at most 66 ms",
        left_out=("diffraction", "cos^4 falloff", "veiling glare"),
        notes=("No GPU answered: the LLVM engine ran on 2 threads.",),
        **axes,
    )  # fmt: skip
    return replace(report, **values)


def sample_axes() -> ReportData:
    """Return a small report of one sensor, three levels, two exposures and three seeds.

    Seeds move PSNR by -0.1, 0 and 0.1 dB, so that its mean is the first sample's and its deviation is 0.1 dB.
    """

    def moved(made: Row) -> Row:
        loss = 3.0 if made.exposure == "10ms" else 0.0
        return replace(
            made,
            psnr_db=made.psnr_db + 0.1 * (made.seed - 6) - loss,
            exposure_s=0.01 if loss else made.exposure_s,
            picture=f"{made.picture}/{made.exposure}",
        )

    return sample_report(
        moved, 3, sensors=SENSORS[:1], exposures=("auto", "10ms"), seeds=(5, 6, 7),
        scenes=(ReportScene("still_life", 64, 64),),
    )  # fmt: skip


def sample_views() -> ReportData:
    """Return a small report of two scenes under two spectra, two sensors and two levels; one picture is left out.

    Each cell's PSNR and picture are its own; the second scene is a chart, and wider.
    """
    scenes = ReportScene("still_life", 64, 64), ReportScene("color_checker", 48, 96)

    def placed(made: Row) -> Row:
        place, sensor = int(made.scene == "color_checker"), int(made.sensor == "low_noise")
        level = [name for name, *_ in LEVELS].index(made.level)
        bayer = made.processor == "bayer"
        psnr = 10.0 + 8 * place + 4 * (made.spectrum == "A") + 2 * sensor + level + 0.5 * bayer
        picture = f"{made.scene}/{made.spectrum}/{level}/{sensor}/{made.processor}"
        return replace(made, psnr_db=psnr, chart_delta_e_mean=3.0 + sensor if place else None, picture=picture)

    report = sample_report(
        placed, 2, name="two scenes", scenes=scenes, spectra=("own", "A"),
        truths=tuple(f"truth/{scene.name}/{spectrum}" for scene in scenes for spectrum in "oA"),
        pictures_left_out="One picture is left out.",
    )  # fmt: skip
    shown = [replace(cell, picture=None) for cell in report.cells[-2:]]
    return replace(report, cells=(*report.cells[:-2], *shown))


def _encode(linear: np.ndarray) -> bytes:
    return as_webp((255 * np.clip(linear, 0, 1) ** (1 / 2.2)).round().astype(np.uint8), **LOSSLESS)


def sample_pictures(report: ReportData) -> ReportPictures:
    """Return a photograph under noise that falls with the light."""
    height, width = report.scenes[0].height, report.scenes[0].width
    scene = (data.coffee()[60 : 60 + height, 160 : 160 + width] / 255) ** 2.2
    rng = np.random.default_rng(7)
    # A truth of its own for each place has a shade of its own.
    pictures = {name: _encode(scene * (1 - 0.1 * place)) for place, name in enumerate(report.truths) if name}
    sizes = {one.name: (one.height, one.width) for one in report.scenes}
    for cell in report.cells:
        if cell.picture and cell.first:
            rows, columns = sizes[cell.first.scene]
            of_size = np.tile(scene, (1, 2, 1))[:rows, :columns]
            noise = rng.standard_normal(of_size.shape) * 10 ** (-(np.nan_to_num(cell.mean("psnr_db"))) / 20)
            pictures[cell.picture] = _encode(of_size + noise)
    truth = {
        cell.picture: opened(pictures[name])
        for cell, name in zip(
            report.cells, np.repeat(report.truths, len(report.cells) // len(report.truths)), strict=True
        )
        if cell.picture
    }
    maps = {
        name: as_webp(flip_map(opened(pictures[name]), seen(truth[name] / 255)), **LOSSLESS)
        for name in truth
        if name in pictures and opened(pictures[name]).shape == truth[name].shape
    }
    return ReportPictures(pictures, maps)
