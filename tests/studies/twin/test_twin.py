"""A camera's twin: frames drawn by independent code, measured, photographed again, and told apart where they differ."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from PIL import Image

from sensor.cameras.frame_sets import FrameSet, LightFrames
from sensor.config_file import read_sensor
from studies.twin.twin import twin_of

SHAPE, K_DN_PER_E, OFFSET_DN, READ_DN = (64, 96), 0.25, 40, 2.0
LIGHTS_E = (1500.0, 4000.0, 6500.0, 9000.0)


def frame(light_e, response, rng, row_dn):
    """Draw a frame with white PRNU, Gaussian noise, and noise of whole rows."""
    signal = K_DN_PER_E * rng.poisson(light_e * response) + rng.normal(0, READ_DN, SHAPE)
    return np.round(np.clip(OFFSET_DN + signal + rng.normal(0, 1, (SHAPE[0], 1)) * row_dn, 0, 4095)).astype(np.uint16)


def frames_of(row_dn=0.0):
    rng = np.random.default_rng(614)
    response = 1 + 0.006 * rng.standard_normal(SHAPE)
    taken = [[frame(light_e, response, rng, row_dn) for _ in range(4)] for light_e in (*LIGHTS_E, 0.0)]
    lights = [LightFrames(tuple(stack), True, 1e-3 * number) for number, stack in enumerate(taken[:-1], 1)]
    return FrameSet((*lights, LightFrames(tuple(taken[-1]), False)), 4095.0)


def test_a_plain_cameras_twin_has_its_noise_under_each_light():
    found = twin_of(frames_of(), "plain")
    noise = [one for one in found.comparisons if one.name == "temporal noise"]
    assert len(noise) == len(LIGHTS_E)
    # Standard error of a ratio 0.5 sqrt(2 * 2 / (3 * 6144)) = 0.74 %, that of K 1 %: 5 % is four of both.
    assert all(one.ratio == pytest.approx(1.0, abs=0.05) for one in noise)
    assert all(one.low < one.ratio < one.high for one in found.comparisons)
    assert found.sensor.pixel.prnu == pytest.approx(0.006, rel=0.15)
    assert found.sensor.gain_e_per_dn * K_DN_PER_E == pytest.approx(1.0, abs=0.06)


@pytest.mark.thorough
def test_noise_of_whole_rows_which_no_preset_has_is_named():
    """A row's mean has 0.2 DN of white noise; 1 DN of row noise is five times that: the twin shows a fifth."""
    found = {(one.name, one.place): one for one in twin_of(frames_of(row_dn=1.0), "rows").comparisons}
    row = found["row noise", "in dark frames"]
    assert not row.alike
    assert row.ratio == pytest.approx(0.2, abs=0.08)
    assert "told apart at 1%" in row.verdict
    plain = {(one.name, one.place): one for one in twin_of(frames_of(), "plain").comparisons}
    assert plain["row noise", "in dark frames"].alike


def test_the_command_writes_a_preset_that_opens_and_a_page(tmp_path: Path) -> None:
    frames = frames_of()
    rows = ["file,kind,exposure_s"]
    for number, light in enumerate(frames.lights):
        for copy, dn in enumerate(light.frames):
            name = f"{number}_{copy}.raw.png"
            Image.fromarray(dn).save(tmp_path / name)
            rows.append(f"{name},{'flat' if light.lit else 'dark'},{0.001 * (number + 1)}")
    (tmp_path / "frames.csv").write_text("\n".join(rows), "utf-8")
    out = tmp_path / "camera.toml"
    code, printed, err = call(["twin", str(tmp_path), "-o", str(out), "--json"])
    assert code == 0, err
    assert len(json.loads(printed)["comparisons"]) == len(LIGHTS_E) + 10
    sensor = read_sensor(out)
    assert sensor.black_dn == OFFSET_DN
    assert sensor.gain_e_per_dn * K_DN_PER_E == pytest.approx(1.0, abs=0.06)
    page = out.with_suffix(".html").read_text("utf-8")
    assert page.count("<li>temporal noise: ") == len(LIGHTS_E)
    assert page.count("data:image/svg+xml") == 3
    assert "nan" not in page.split("<h2")[-1]
    assert call(["twin", str(tmp_path), "-o", str(out)])[0] == 2
