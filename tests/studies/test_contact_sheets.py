"""What an eye sees in developed pictures, counted: `benchmarks/contact_sheets.py`, and dots on the chart's patches."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from contact_sheets import LONGEST_S, WAYS, camera, main, stage_of
from PIL import Image
from scipy.ndimage import binary_erosion, label

from isp.processors.catalogue import PROCESSORS
from rodcone.jit import backend
from sensor.capture import expose
from sensor.cfa import mask
from sensor.device import draw_device
from sensor.exposure import exposure_by_rule_s
from sensor.optics import form_image
from sensor.response import expected_electrons
from studies.metrics.truth import neutral_electrons
from studies.photograph.camera import colour_fit

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(backend() == "numpy", reason="without Dr.Jit a picture takes minutes"),
]


def test_a_page_of_sheets_with_counts_beside_psnr(tmp_path):
    """A grey star by day: 12 % of its pixels were coloured when W's plane guided, and PSNR was 16 dB."""
    main(["-o", str(tmp_path), "--only", "siemens_star", "--levels", "5", "--size", "96"])
    with (tmp_path / "counts.csv").open(encoding="utf-8") as file:
        rows = {row["way"]: row for row in csv.DictReader(file)}
    assert list(rows) == list(WAYS)
    with Image.open(tmp_path / "siemens_star_5.png") as image:
        assert image.size == (5 * 192 + 4 * 4, 2 * 192 + 4)
    assert "interleaved: " in (tmp_path / "index.html").read_text("utf-8")
    ours, bilinear = rows["interleaved"], rows["bayer"]
    assert float(ours["psnr_db"]) > 22.0
    assert int(ours["spots"]) < 0.02 * 96 * 96 < int(bilinear["spots"])
    assert int(ours["holes"]) == 0


def even_patches(truth):
    """Parts of one colour, less three pixels along their edges."""
    numbers = np.round(200.0 * truth).astype(int) @ [1_000_000, 1000, 1]
    for number in np.unique(numbers):
        parts, count = label(numbers == number)
        for part in range(1, count + 1):
            inside = binary_erosion(parts == part, np.ones((7, 7)))
            if inside.sum() >= 80:
                yield inside


def test_even_patches_have_no_more_than_the_sensor_s_own_noise_by_day():
    """At 1000 cd/m2 the spread of a patch is 1.3 times at most what the matrix makes of single samples' noise.

    A grid of dots is the means of the four phases of the tile, which differ by less than 0.2 of that.
    """
    stage = stage_of("color_checker", 144)
    sensor, processor = camera("rgbw"), PROCESSORS["ple_rgbw"]
    image = form_image(stage.radiance, sensor)
    lit = replace(image, values=1000.0 * image.values)
    exposure_s = min(exposure_by_rule_s("auto:information", lit, sensor), LONGEST_S)
    device = draw_device(sensor, stage.truth.shape[:2], np.random.default_rng([0, 0]))
    expected = expected_electrons(lit, sensor, exposure_s)
    raw = expose(expected, sensor, exposure_s, device, np.random.default_rng([0, 1]))
    neutral, fit = neutral_electrons(sensor, stage.light, exposure_s), colour_fit(sensor, processor, stage.light)
    rgb = processor.develop(raw, fit, neutral=neutral, balance=neutral).rgb
    patches, phases = list(even_patches(stage.truth)), np.indices(raw.shape) % 2
    assert len(patches) >= 24
    for patch in patches:
        variance = []
        for name in "RGB":
            samples, noise = raw.electrons[patch & mask(raw.cfa, name, raw.shape)].mean(), raw.noise_of(name)
            gain = neutral[raw.channels.index("G")] / neutral[raw.channels.index(name)]
            variance.append(gain**2 * (noise.shot * samples + noise.dark_noise_e**2 + (raw.prnu * samples) ** 2))
        own = np.sqrt(fit.matrix("RGB") ** 2 @ variance)
        assert (rgb[patch].std(axis=0) < 1.3 * own).all()
        means = [rgb[patch & (phases[0] == i) & (phases[1] == j)].mean(axis=0) for i, j in np.ndindex(2, 2)]
        assert (np.std(means, axis=0) < 0.2 * own).all()
