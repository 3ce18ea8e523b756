"""Every column of a row counted another way: from the cell, the raw frame drawn again, and the pictures on the disk."""

import json
import platform
from dataclasses import asdict, replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab
from skimage.metrics import peak_signal_noise_ratio

from isp.processors.catalogue import NAMED
from render.illuminants import illuminant
from render.spectrum import fine_bands
from sensor.burst import merged_raw
from sensor.capture import expose
from sensor.device import draw_device
from studies.metrics.flip import flip
from studies.metrics.truth import light_in_bands, neutral_electrons
from studies.photograph.camera import develop_to_scale
from studies.sweep.cells import device_stream, exposure_stream
from studies.sweep.database import COLUMNS
from studies.sweep.run_cell import run_cell

TIMES = {"capture_s", "develop_s", "measure_s", "first_s"}
UNKNOWN = ("mtf50_cy_per_px", "chart_delta_e_mean", "patch_snr_db", "illuminance_lux")  # of a picture file


def test_every_column_of_a_row_is_counted_another_way(tmp_path: Path) -> None:
    """A burst of two at twice the gain, in light that fills some pixels; a new column has to be named here."""
    asked: dict[str, Any] = {"levels": ("90cd/m2",), "exposures": ("8ms",), "processors": ("interleaved",)}
    study = SAMPLE.small_study(tmp_path, **asked, seeds=(4,), frames=(2,), gains=(2.0,))
    (cell,) = SAMPLE.made_cells(tmp_path, study)
    row = run_cell(replace(cell, budget_share=0.0625))
    sensor = cell.frame.sensor

    # The raw frame once more, and what it holds
    electrons = np.load(cell.frame.electrons) * 90.0 * 0.008
    device = draw_device(sensor, electrons.shape, device_stream("low_noise", "rgbw", 4))
    stream = exposure_stream(cell.condition, "rgbw", 4)
    exact = cell.made_by.readout_engine == "numpy"
    raw = merged_raw([expose(electrons, sensor, 0.008, device, stream, exact=exact) for _ in range(2)])
    tile = {"R": np.s_[::2, ::2], "G": np.s_[::2, 1::2], "B": np.s_[1::2, ::2], "W": np.s_[1::2, 1::2]}
    assert sensor.cfa == ("RG", "BW")
    neutral = neutral_electrons(sensor, cell.frame.light, 0.016)
    processor = NAMED["interleaved"]
    _, picture = develop_to_scale(raw, processor, cell.colours, sensor, neutral, cell.white_cd_m2, balance=neutral)

    # Pictures as anybody reads them: of 8 bits
    shown, truth = (np.asarray(Image.open(tmp_path / "pictures" / name)) / 255 for name in (row.picture, row.truth))
    apart = deltaE_ciede2000(rgb2lab(shown), rgb2lab(truth))
    # saturation-based speed: 78 lux s over the exposure that fills green's range, twice at twice the gain
    d65 = illuminant("D65")
    per_cd_m2 = neutral_electrons(sensor, light_in_bands(d65, *fine_bands([d65])), 1.0)[sensor.channels.index("G")]
    lens = sensor.lens
    lux_per_cd_m2 = pi * lens.transmittance / (1 + 4 * lens.f_number**2 * (1 + lens.magnification) ** 2)
    fills = sensor.pixel.full_well_e / 2 / per_cd_m2 * lux_per_cd_m2

    exact_columns = {
        "key": cell.key, "scene": "scene.exr", "spectrum": "own", "level": "90cd/m2", "exposure": "8ms",
        "sensor": "low_noise", "white_balance": "as-shot", "frames": 2, "gain": "2", "processor": "interleaved",
        "seed": 4, "luminance_cd_m2": 90.0, "exposure_s": 0.008, "gain_factor": 2.0, "bands": 10,
        "spp": cell.render.facts.spp, "lens": json.dumps(asdict(sensor.lens)), "budget_share": 0.0625, "mc_share": 0.0,
        "snr_db": picture.snr_db, "substitution": None if picture.substituted is None else int(picture.substituted),
        "saturated": raw.saturated.mean(), "balance": json.dumps(dict.fromkeys("RGBW", "given")),
        "variant": cell.made_by.variant, "readout_engine": raw.engine, "development_engine": picture.engine,
        "versions": cell.made_by.versions, "render_s": cell.render.facts.seconds, "host": platform.node(),
        **dict.fromkeys(UNKNOWN),
    }  # fmt: skip
    near = {
        "iso": (78 / fills, 1e-3), "psnr_db": (peak_signal_noise_ratio(truth, shown, data_range=1.0), 0.003),
        "delta_e_median": (np.median(apart), 0.05), "delta_e_p95": (np.percentile(apart, 95), 0.05),
        "flip_mean": (flip(shown, truth).mean(), 0.02),
    }  # fmt: skip
    for name, value in exact_columns.items():
        assert getattr(row, name) == value, name
    for name, (value, relative) in near.items():
        assert getattr(row, name) == pytest.approx(value, rel=relative), name
    assert 0 < row.saturated < 0.5
    assert row.balance_delta_e == pytest.approx(0.0, abs=1e-3)
    means = {name: pytest.approx(electrons[at].mean(), rel=1e-6) for name, at in tile.items()}
    assert json.loads(row.mean_electrons) == means
    facts = json.loads(row.render)
    assert (facts["integrator"], facts["brightest_share"]) == ("file", None)
    assert facts["first_nm"] == pytest.approx(405.0)
    assert facts["last_nm"] == pytest.approx(765.0)
    assert facts["width_nm"] == pytest.approx(40.0)

    # What differs from one measure to another: each is that of its own metric, in the order that it must have
    assert row.s_cielab_median < row.s_cielab_p95
    assert 0 < row.ssim < 1
    assert abs(row.pu21_psnr_db - row.psnr_db) < 15
    elsewhere = {"s_cielab_median", "s_cielab_p95", "ssim", "pu21_psnr_db"}  # test_run_cell writes these out
    told = set(exact_columns) | set(near) | elsewhere | TIMES | {"balance_delta_e", "mean_electrons", "render"}
    told |= {"picture", "truth", "threads", "finished", "machine", "worker"}
    assert told == set(COLUMNS)
