"""A camera's twin: frames drawn by independent code, measured, photographed again, and told apart where they differ."""

import json
import sys
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from PIL import Image

from sensor.cameras.frame_sets import FrameSet, LightFrames
from sensor.cameras.frames import measure_set
from sensor.config_file import read_sensor
from studies.twin.tails import excess_kurtosis, is_rounding, noise_histograms, tail_ratio, telegraph_of
from studies.twin.twin import response_of, twin_of

SHAPE, K_DN_PER_E, OFFSET_DN, READ_DN = (64, 96), 0.25, 40, 2.0
LIGHTS_E = (1500.0, 4000.0, 6500.0, 9000.0)


def frame(light_e, response, rng, row_dn, bend=0.0, heights_dn=0.0):
    """Draw a frame with white PRNU, a bent response, Gaussian noise, noise of whole rows, and of traps."""
    electrons = rng.poisson(light_e * response)
    electrons = electrons * (1 + bend * (1 - electrons * K_DN_PER_E / (4095 - OFFSET_DN)))
    signal = K_DN_PER_E * electrons + rng.normal(0, READ_DN, SHAPE)
    if np.any(heights_dn):
        signal = signal + heights_dn * (rng.integers(0, 2, SHAPE) - rng.integers(0, 2, SHAPE))
    return np.round(np.clip(OFFSET_DN + signal + rng.normal(0, 1, (SHAPE[0], 1)) * row_dn, 0, 4095)).astype(np.uint16)


def frames_of(row_dn=0.0, bend=0.0, lights_e=LIGHTS_E, photons_per_dn=nan, traps=(0.0, 0.0), seed=614):
    rng = np.random.default_rng(seed)
    response = 1 + 0.006 * rng.standard_normal(SHAPE)
    share, height_dn = traps
    heights_dn = np.where(rng.random(SHAPE) < share, rng.exponential(height_dn, SHAPE), 0.0) if share else 0.0
    terms = rng, row_dn, bend, heights_dn
    taken = [[frame(light_e, response, *terms) for _ in range(4)] for light_e in (*lights_e, 0.0)]
    lights = [
        LightFrames(tuple(stack), True, 1e-3 * number, photons_per_dn * (float(np.mean(stack)) - OFFSET_DN))
        for number, stack in enumerate(taken[:-1], 1)
    ]
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
def test_noise_of_whole_rows_is_measured_and_simulated():
    """The variance of 64 rows of 4 frames has an error of 10 %: their noise 5 %, and the test's own is 12 %."""
    twin = twin_of(frames_of(row_dn=1.0), "rows")
    found = {(one.name, one.place): one for one in twin.comparisons}
    assert twin.sensor.pixel.row_noise_e * K_DN_PER_E == pytest.approx(1.0, abs=0.2)
    assert found["row noise", "in dark frames"].alike
    plain = twin_of(frames_of(), "plain")
    assert plain.sensor.pixel.row_noise_e * K_DN_PER_E < 0.3


def test_tails_of_the_dark_are_measured_as_traps_and_simulated():
    """Of 24 draws of these frames the share scatters by 9 % and the height by 8 %: each within four of these."""
    twin = twin_of(frames_of(traps=(0.1, 6.0)), "tails")
    pixel = twin.sensor.pixel
    assert pixel.telegraph_share == pytest.approx(0.1, rel=0.36)
    assert pixel.telegraph_e * K_DN_PER_E == pytest.approx(6.0, rel=0.32)
    assert pixel.read_noise_e * K_DN_PER_E == pytest.approx(np.sqrt(READ_DN**2 + 0.1 * 6.0**2), rel=0.06)
    assert "95 %" in twin.numbers.pixel["telegraph_share"].source
    (tails,) = (one for one in twin.comparisons if one.name == "tails of the noise")
    assert tails.alike
    assert min(tails.camera, tails.twin) > 1.8  # pi / 2 without


def test_normal_noise_and_noise_of_rows_have_no_tails():
    """More than 4 errors of normal noise's kurtosis: 2 of 18 000 draws."""
    for row_dn in (0.0, 1.0):
        dark = frames_of(row_dn=row_dn).lights[-1].frames
        assert telegraph_of(noise_histograms(dark)) is None
        excess, error = excess_kurtosis(noise_histograms(dark))
        assert abs(excess) < 4 * error
        ratio, of_ratio = tail_ratio(noise_histograms(dark))
        assert ratio == pytest.approx(np.pi / 2, abs=4 * of_ratio)
        assert of_ratio < 0.02


def test_pixels_that_differ_in_their_normal_noise_have_no_traps():
    """Half at 0.8 and half at 1.2 of the noise: an excess kurtosis of 0.44, which traps in nearly all pixels fit."""
    rng = np.random.default_rng(4)
    sigma = np.where(rng.random((64, 96)) < 0.5, 1.6, 2.4)
    histograms = noise_histograms([np.rint(rng.normal(40.0, sigma)).astype(np.uint16) for _ in range(16)])
    excess, error = excess_kurtosis(histograms)
    assert excess > 8 * error
    assert telegraph_of(histograms) is None


def test_noise_of_rounding_has_no_verdict_on_its_tails(monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "READ_DN", 0.3)
    frames = frames_of()
    assert is_rounding(noise_histograms(frames.lights[-1].frames))
    assert not any(one.name == "tails of the noise" for one in twin_of(frames, "quiet").comparisons)


@pytest.mark.thorough
def test_intervals_of_traps_hold_what_was_drawn():
    """Of 20 draws 95 % intervals leave out 4 or more of either number once in 60."""
    inside = []
    for seed in range(20):
        found = telegraph_of(noise_histograms(frames_of(traps=(0.1, 6.0), seed=seed).lights[-1].frames))
        share, height_dn = (found.share, found.height_dn)
        inside.append((share.low < 0.1 < share.high, height_dn.low < 6.0 < height_dn.high))
    assert np.sum(inside, axis=0).min() > 16


def test_a_bent_response_is_measured_back_unless_the_means_by_photons_deny_it():
    """K of a light has an error of 1 %: with nine lights the bend has one of 0.01."""
    lights_e = np.linspace(1000, 14_500, 9)
    bent = response_of(measure_set(frames_of(bend=0.15, lights_e=lights_e)))
    assert bent.bend == pytest.approx(0.15, abs=0.04)
    assert bent.gain_dn_per_e == pytest.approx(K_DN_PER_E, rel=0.04)
    signal = 4055 * 0.3
    e = bent.light_e(np.array([signal]), 4055.0)[0]
    assert e * bent.gain_dn_per_e * (1 + bent.bend * (1 - e * bent.gain_dn_per_e / 4055)) == pytest.approx(signal)
    denied = response_of(measure_set(frames_of(bend=0.15, lights_e=lights_e, photons_per_dn=5.0)))
    assert denied.bend == 0.0
    assert "another cause" in denied.source
    assert response_of(measure_set(frames_of())).bend == 0.0


def test_a_light_whose_photons_are_counted_wrongly_does_not_tell_a_bend():
    """Means per photon are the same under all lights but one in the middle, which counts a twelfth of its photons."""
    frames = frames_of(bend=0.15, lights_e=np.linspace(1000, 14_500, 9), photons_per_dn=5.0)
    lights = list(frames.lights)
    lights[3] = replace(lights[3], photons=lights[3].photons / 12)
    denied = response_of(measure_set(replace(frames, lights=tuple(lights))))
    assert denied.denied
    assert denied.bend == 0.0


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
    assert len(json.loads(printed)["comparisons"]) == len(LIGHTS_E) + 11
    sensor = read_sensor(out)
    assert sensor.black_dn == OFFSET_DN
    assert sensor.gain_e_per_dn * K_DN_PER_E == pytest.approx(1.0, abs=0.06)
    page = out.with_suffix(".html").read_text("utf-8")
    assert page.count("<li>temporal noise: ") == len(LIGHTS_E)
    assert page.count("data:image/svg+xml") == 3
    assert "nan" not in page.split("<h2")[-1]
    assert call(["twin", str(tmp_path), "-o", str(out)])[0] == 2
