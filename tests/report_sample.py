"""Made-up results and noise pictures for the report's tests; ``python tests/report_sample.py FILE`` writes it."""

import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

LEVELS = (
    ("moonlight", 0.036, 0.21, "Parmar & Wandell 2009: 10 photons per µm² per second at f/5.6"),
    ("street light", 0.5, 3.1, "EN 13201: residential roads"),
    ("living room", 8.0, 50.0, "a lamp in the evening"),
    ("paper's figure 6", 25.0, 155.0, "Parmar & Wandell 2009, figure 6"),
    ("office", 80.0, 500.0, "EN 12464-1: writing, reading"),
    ("overcast", 800.0, 5000.0, "CIE overcast sky"),
    ("daylight", 5000.0, 31000.0, "sun and clear sky"),
)
SENSORS = (
    {"name": "table1_output", "read_noise_e": 19.1, "dsnu_e": 25.1},
    {"name": "low_noise", "read_noise_e": 1.5, "dsnu_e": 1.0},
)


def sample_cell(level: int, sensor: int, camera: str) -> dict[str, Any]:
    """Return numbers of the size that a real run gives: the interleaved camera is ahead in the dark."""
    rgbw = camera == "interleaved"
    name = str(SENSORS[sensor]["name"])
    psnr = min(7 + 6 * sensor + 3.6 * level + (3.2 - 0.9 * level if rgbw else 0.0), 38.0)
    electrons = [round(min(4.0 * 9**level, 9000.0) * share, 1) for share in (0.4, 1.0, 0.5, 3.0)]
    return {
        "level": level,
        "sensor": name,
        "camera": camera,
        "exposure_s": 0.066 if level < 4 else 0.066 / 8 ** (level - 3),
        "psnr_db": round(psnr, 3),
        "ssim": min(0.04 + 0.02 * psnr + (0.05 if rgbw else 0), 0.97),
        "delta_e_median": 120 / psnr + (0.4 if rgbw and level > 3 else 0),
        "delta_e_p95": 380 / psnr,
        "s_cielab_median": 60 / psnr,
        "s_cielab_p95": 190 / psnr,
        "flip_mean": 4 / psnr,
        "pu21_psnr_db": psnr + 3,
        "mtf50_cy_per_px": None,
        "chart_delta_e_mean": None,
        "patch_snr_db": None,
        "mc_share": 2e-4 * 3.1**level * (1.6 if rgbw else 1) * (1 + 3 * sensor),
        "snr_db": None if level == 0 else psnr - 4,
        "substitution": (level < 3 - sensor) if rgbw else None,
        "balance": {
            "R": "calibrated" if level == 0 and sensor == 0 else "gray world",
            "G": "gray world",
            "B": "gray world",
        },
        "saturated": 0.0 if level < 4 else 0.012,
        "mean_electrons": dict(zip("RGBW" if rgbw else "RGB", electrons, strict=False)),
        "seconds": {"capture": 0.021, "develop": 0.11 if rgbw else 0.03, "measure": 0.2},
        "picture": f"{level}/{name}/{camera}",
    }


def sample_results() -> dict[str, Any]:
    """Return results as the demo writes them."""
    common = {"full_well_e": 15000, "prnu": 0.017, "pitch_um": 2.2, "f_number": 2.8, "bits": 14}
    cameras = ["interleaved", "bayer"]
    return {
        "rodcone": "0.1.0",
        "seed": 0,
        "scene": "still_life",
        "size": [256, 256],
        "environment": {
            "python": "3.11.7", "mitsuba": "3.9.1", "drjit": "1.5.0", "numpy": "2.4.6", "llvm": "libLLVM.so.23.1",
            "variant": "llvm_ad_spectral", "engine": "llvm", "threads": 2, "platform": "Linux x86_64",
        },
        "render": {
            "integrator": "path + specfilm", "variant": "llvm_ad_spectral", "seconds": 41.2, "spp": 256, "passes": 16,
            "stopped_by": "seconds", "relative_mc_error": 0.031, "bands": 40, "first_nm": 385.0, "last_nm": 775.0,
            "width_nm": 10.0, "brightest_share": 0.42,
        },
        "exposure_rule": "99th percentile of expected G at 80 % of the well, at most 66 ms",
        "display_white": "White is the luminance of a perfect diffuser in the scene's brightest light.",
        "levels": [
            {"name": name, "luminance_cd_m2": luminance, "illuminance_lux": lux, "source": source}
            for name, luminance, lux, source in LEVELS
        ],
        "sensors": [{**sensor, **common} for sensor in SENSORS],
        "cameras": cameras,
        "cells": [
            sample_cell(level, sensor, camera)
            for level in range(len(LEVELS)) for sensor in range(len(SENSORS)) for camera in cameras
        ],
        "stages": [
            {"name": "render", "seconds": 41.2}, {"name": "captures", "seconds": 1.9},
            {"name": "develop interleaved", "seconds": 4.4}, {"name": "develop bayer", "seconds": 1.2},
            {"name": "metrics", "seconds": 9.8},
        ],
        "left_out": ["diffraction", "cos^4 falloff", "veiling glare"],
        "notes": ["No GPU answered: the LLVM engine ran on 2 threads."],
    }  # fmt: skip


def sample_axes() -> dict[str, Any]:
    """Return small results of one sensor, three levels, two exposures and three seeds.

    Seeds move PSNR by -0.1, 0 and 0.1 dB, so that its mean is the first sample's and its deviation is 0.1 dB.
    """
    results = sample_results()
    results["size"] = [64, 64]
    results["sensors"] = results["sensors"][:1]
    results["levels"] = results["levels"][:3]
    results["exposures"] = ["auto", "10ms"]
    cells = [cell for cell in results["cells"] if cell["level"] < 3 and cell["sensor"] == SENSORS[0]["name"]]
    results["cells"] = [
        {
            **cell, "exposure": exposure, "seed": 5 + place, "psnr_db": cell["psnr_db"] + shift - loss,
            "exposure_s": 0.01 if loss else cell["exposure_s"], "picture": f"{cell['picture']}/{exposure}",
        }
        for exposure, loss in (("auto", 0.0), ("10ms", 3.0))
        for place, shift in enumerate((-0.1, 0.0, 0.1)) for cell in cells
    ]  # fmt: skip
    return results


def sample_views() -> dict[str, Any]:
    """Return small results of two scenes under two spectra, two sensors and two levels; one picture is left out.

    Each cell's PSNR and picture are its own; the second scene is a chart, and wider.
    """
    results = sample_axes()
    results |= {
        "name": "two scenes",
        "scenes": [{"name": "still_life", "size": [64, 64]}, {"name": "color_checker", "size": [48, 96]}],
        "spectra": ["own", "A"],
        "sensors": sample_results()["sensors"],
        "levels": results["levels"][:2],
        "truths": [f"truth/{scene}/{spectrum}" for scene in ("still_life", "color_checker") for spectrum in "oA"],
        "pictures_left_out": "One picture is left out.",
    }
    del results["exposures"]
    results["cells"] = [
        {
            **sample_cell(level, sensor, camera), "scene": scene, "spectrum": spectrum,
            "psnr_db": 10.0 + 8 * place + 4 * colour + 2 * sensor + level + (0.5 if camera == "bayer" else 0.0),
            "chart_delta_e_mean": 3.0 + sensor if place else None, "file": f"{scene}/{level}/{sensor}.png",
            "picture": f"{scene}/{spectrum}/{level}/{sensor}/{camera}",
        }
        for place, scene in enumerate(("still_life", "color_checker"))
        for colour, spectrum in enumerate(("own", "A"))
        for sensor in range(2) for level in range(2) for camera in results["cameras"]
    ]  # fmt: skip
    for cell in results["cells"][-2:]:
        cell["picture"] = None
    return results


def _encode(linear: np.ndarray) -> bytes:
    file = BytesIO()
    Image.fromarray((255 * np.clip(linear, 0, 1) ** (1 / 2.2)).round().astype(np.uint8)).save(
        file, "WEBP", lossless=True, quality=0, method=0
    )
    return file.getvalue()


def sample_pictures(results: dict[str, Any]) -> dict[str, bytes]:
    """Return a coloured test scene under noise that falls with the light."""
    height, width = results["size"]
    y, x = np.mgrid[0:height, 0:width] / height
    scene = np.stack([0.15 + 0.3 * y, 0.2 + 0.2 * x, 0.35 - 0.2 * y], axis=-1)
    for column, row, radius, colour in (
        (0.3, 0.6, 0.2, (0.7, 0.15, 0.1)), (0.62, 0.5, 0.16, (0.1, 0.5, 0.2)), (0.75, 0.78, 0.13, (0.9, 0.8, 0.2)),
    ):  # fmt: skip
        distance = np.hypot(x - column, y - row) / radius
        shade = (1.1 - 0.8 * distance)[..., None] * np.array(colour)
        scene = np.where((distance < 1)[..., None], shade, scene)
    scene = np.where(((x * 32).astype(int) + (y * 32).astype(int) & 1)[..., None] * (y < 0.2)[..., None], 0.8, scene)
    rng = np.random.default_rng(7)
    # A truth of its own for each place has a shade of its own.
    names = results.get("truths", ["truth"])
    pictures = {name: _encode(scene * (1 - 0.1 * place)) for place, name in enumerate(names)}
    sizes = {one["name"]: one["size"] for one in results.get("scenes", [])}
    for cell in {cell["picture"]: cell for cell in results["cells"] if cell["picture"]}.values():
        rows, columns = sizes.get(cell.get("scene"), (height, width))
        of_size = np.tile(scene, (1, 2, 1))[:rows, :columns]
        noise = rng.standard_normal(of_size.shape) * 10 ** (-float(cell["psnr_db"] or 0) / 20)
        pictures[cell["picture"]] = _encode(of_size + noise)
    return pictures


if __name__ == "__main__":
    from studies.pages.report import render_report

    sample = sample_results()
    Path(sys.argv[1]).write_text(render_report(sample, sample_pictures(sample)), encoding="utf-8")
