"""A chip characterised: every term found where it was put, and faults of 5 % caught."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from loop import loop
from refusal import refusal

from sensor.cfa import MOSAICS
from sensor.config import LensConfig, SensorConfig
from sensor.emva1288 import estimators as emva
from sensor.emva1288.characterise import ExposurePlan, characterise, configured, measure_camera, plan_for
from sensor.emva1288.photon_transfer import light_bench
from sensor.photodiodes import binned
from sensor.pixel import PixelConfig

# Every term at once, each large enough to be measured on a small chip.
PIXEL = PixelConfig(
    pitch_um=2.2,
    fill_factor=0.9,
    full_well_e=12_000.0,
    read_noise_e=4.0,
    dsnu_e=6.0,
    prnu=0.02,
    dark_current_e_per_s=400.0,
    column_gain_spread=0.01,
    column_offset_e=5.0,
    hot_pixel_share=0.02,
    hot_pixel_dark_current_e_per_s=4000.0,
    crosstalk=0.05,
)
# Black and gain are fixed, so that a fault in a noise term doesn't move them.
SENSOR = SensorConfig(PIXEL, LensConfig(2.8), bits=14, black_level_dn=200.0)
MEASURED = ("gain", "dark noise", "DSNU", "PRNU", "column offsets", "column gains", "dark current", "hot pixels")
MEASURED += ("their dark current", "full well")


def off(figure):
    """Difference in standard errors."""
    return (figure.measured - figure.configured) / figure.error


def test_every_term_is_found_where_it_was_put():
    found = characterise(SENSOR, (96, 320), seed=1)
    # ten comparisons within 4.5 standard errors: false-alarm rate 7e-5
    assert {figure.name: off(figure) for figure in found.figures if figure.error and abs(off(figure)) > 4.5} == {}
    assert {figure.name for figure in found.figures if figure.error} >= set(MEASURED)
    assert found.figure("linearity error").measured < 5e-4
    # the level of the peak lies under the well by what PRNU and shot noise spread, 2-7 % (design), on a grid of 2 %
    assert 0.9 < found.saturation_e / PIXEL.full_well_e < 1.0
    assert found.figure("dynamic range").measured == pytest.approx(found.figure("dynamic range").configured, abs=1.0)
    assert found.figure("greatest SNR").measured == pytest.approx(found.figure("greatest SNR").configured, abs=0.5)
    bright = np.argmin(np.abs(found.transfer.light_e - 6000.0))
    expected = found.transfer.light_e[bright] / np.sqrt(found.transfer.light_e[bright] + 4.0**2 + 4.8)
    assert found.snr[bright] == pytest.approx(expected, rel=0.05)


def test_a_dark_frames_electrons_are_added_to_the_well(monkeypatch):
    """400 and 2 % of 4000 e-/s in 50 ms: 24 e- that the dark frame takes from the full one's mean."""
    told = []
    well = emva.well
    monkeypatch.setattr(emva, "well", lambda *given: told.append(given[4]) or well(*given))
    characterise(SENSOR, (64, 96), seed=2, exposure_s=0.05)
    assert told == [pytest.approx(24.0, rel=0.1)]  # 6144 pixels tell the share of the hot ones to 9 %, of 4 e-


def test_configured_values_follow_the_exposure_time():
    at = configured(SENSOR, 0.1)
    assert at["gain"] == pytest.approx((2**14 - 1 - 200) / 12_000, rel=1e-12)
    assert at["dark noise"] == pytest.approx(np.sqrt(16 + 40 + 0.02 * 400), rel=1e-12)
    # DSNU, column offsets, hot pixels' spread of 400 e- in 2 %, and column gains on 48 dark electrons
    assert at["DSNU"] == pytest.approx(np.sqrt(36 + 25 + 0.02 * 0.98 * 400**2 + 0.48**2), rel=1e-12)
    assert at["PRNU"] == pytest.approx(np.hypot(0.02, 0.01), rel=1e-12)
    assert at["dynamic range"] == pytest.approx(20 * np.log10(12_000 / at["threshold"]), rel=1e-12)


def test_under_the_rounding_the_dark_noise_is_told_to_be_hidden():
    sensor = SensorConfig(PixelConfig(2.2, 0.9, 15_000.0, 1.5, 1.0, 0.01), LensConfig(2.8), bits=10)
    notes = characterise(sensor, (32, 32)).notes
    assert any("rounding hides the dark noise" in note for note in notes)
    assert not any("rounding" in note for note in characterise(SENSOR, (32, 32)).notes)


@loop(
    ("arguments", "words"),
    [
        ({"shape": (8, 64)}, "height: 8"),
        ({"shape": (64, 2)}, "width: 2"),
        ({"seed": -1}, "seed: -1"),
        ({"exposure_s": -1.0}, "exposure_s: -1.0"),
    ],
)
def test_what_cannot_be_measured_is_refused(arguments, words):
    refusal(characterise, SENSOR, match=words, **arguments)


@loop(
    "sensor",
    [
        SensorConfig(PixelConfig(2.2, 0.9, 15_000.0, 1.5, 1.0, 0.01), LensConfig(2.8), bits=1),
        SensorConfig(PixelConfig(2.2, 0.9, 10.0, 500.0, 1.0, 0.01), LensConfig(2.8)),
    ],
)
def test_a_camera_that_shows_no_shot_noise_is_refused_in_one_line_and_warns_of_nothing(sensor):
    refusal(characterise, sensor, (32, 32), match="shows no shot noise")


# Faults of 5 %


STRONG = replace(
    PIXEL, dsnu_e=12.0, column_offset_e=10.0, column_gain_spread=0.02, hot_pixel_share=0.2, read_noise_e=8.0
)
CHIP = replace(SENSOR, pixel=STRONG)
WIDE = (12, 12_288)  # column noise is known to 1 / sqrt(2 columns): 0.64 %
TERMS = ("full_well_e", "read_noise_e", "dsnu_e", "prnu", "dark_current_e_per_s", "column_gain_spread")
TERMS += ("column_offset_e", "hot_pixel_share", "hot_pixel_dark_current_e_per_s")
SEEDS = 20


def run(sensor, seed):
    """Characterise a chip of `sensor`, with CHIP's numbers as those that should be there."""
    plan = ExposurePlan(np.linspace(0, 1.1 * STRONG.full_well_e, 13)[1:], 0.001, 8, plan_for(CHIP).dark_times_s)
    return measure_camera(light_bench(sensor, WIDE, seed), plan, CHIP)


def wrong(found):
    return {figure.name for figure in found.figures if figure.error and abs(off(figure)) > 4}


@pytest.mark.slow
def test_a_fault_of_5_per_cent_in_each_term_is_caught_in_20_chips(capsys):
    faulty = replace(CHIP, pixel=replace(STRONG, **{name: 1.05 * getattr(STRONG, name) for name in TERMS}))
    caught = dict.fromkeys(MEASURED, 0)
    for seed in range(SEEDS):
        names = wrong(run(faulty, seed))
        for name in MEASURED:
            caught[name] += name in names
    with capsys.disabled():
        print(f"\n  caught of {SEEDS} chips: {caught}")
    # each term's own figure: 5 % are 6 standard errors or more, so that a chip is missed once in 40 times or less; 3 of
    # 20 are once in 70 runs with fresh seeds, and these are fixed
    assert min(caught.values()) >= SEEDS - 2


@pytest.mark.slow
def test_chips_without_a_fault_are_let_pass_in_20_chips():
    # 200 comparisons within 4 standard errors: one would fail in 80 runs with fresh seeds
    assert [wrong(run(CHIP, seed)) for seed in range(SEEDS)] == [set()] * SEEDS


@pytest.mark.thorough
@pytest.mark.parametrize("binning", ["charge", "digital"])
def test_every_term_of_a_chip_that_bins_is_found_where_four_pixels_put_it(binning):
    pixel = replace(PIXEL, hot_pixel_share=0.002)  # as few as real: then a sum holds hardly ever two
    quad = binned(replace(SENSOR, pixel=pixel, cfa=MOSAICS["quad_bayer"], bits=12), binning)
    found = characterise(quad, (160, 320), seed=1)
    # ten comparisons within 4.5 standard errors: false-alarm rate 7e-5
    assert {figure.name: off(figure) for figure in found.figures if figure.error and abs(off(figure)) > 4.5} == {}
    assert found.figure("full well").configured == 4 * PIXEL.full_well_e
    assert found.figure("PRNU").measured < 0.8 * hypot(PIXEL.prnu, PIXEL.column_gain_spread)
    assert any("2x2" in note and binning in note for note in found.notes)
