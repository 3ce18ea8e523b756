"""The best estimate from several readings, and its noise, against closed forms worked out on paper."""

from dataclasses import replace

import numpy as np
import pytest
from builders import REAL_PIXEL
from loop import loop
from refusal import refusal

from sensor.burst import merged_raw, merged_sensor
from sensor.capture import expose
from sensor.config import with_readings
from sensor.config_file import read_sensor
from sensor.device import draw_device
from sensor.exposure import exposure_of_electrons_s
from sensor.pixel import Reading
from sensor.presets import low_noise, preset, preset_file
from sensor.readings.best_estimate import (
    best_weights,
    collected_share,
    covariances,
    merged_noise_steps,
    merged_variance,
    merged_variances,
    seams,
)
from sensor.readings.resolve import chip_readings, resolve
from sensor.readout import noise_sources, noise_variance, unclipped_variance
from studies.photograph.snr import electrons_at_snr, snr

HDR = ("dual_gain", "split_pixel", "staggered")


def sensor_of(*readings, **pixel):
    own = low_noise()
    return with_readings(replace(own, pixel=replace(own.pixel, **pixel)), readings)


def switched(sensor):
    return replace(sensor, chip=replace(sensor.chip, readout="switched"))


def dual(high=2.0, low=6.0, **pixel):
    """Two gains without PRNU, DSNU or coarse converters."""
    return replace(
        sensor_of(Reading(high, 0.0, 2000.0), Reading(low, 0.0, 16_000.0), **{"prnu": 0.0, **pixel}), bits=16
    )


@loop("name", HDR)
def test_each_reading_s_own_variance_is_that_of_a_chip_that_is_read_once(name):
    sensor = preset(name)
    sensor = replace(sensor, pixel=replace(sensor.pixel, **REAL_PIXEL | {"crosstalk": 0.0}))
    light = np.array([0.0, 0.3, 40.0, 5000.0])
    total = sum(covariances(light, chip_readings(sensor, 0.02)).values())
    for index, reading in enumerate(sensor.chip.readings):
        own = chip_readings(sensor, 0.02)[index].sensor
        alone = unclipped_variance(light * reading.share, chip_readings(own, 0.02))
        np.testing.assert_allclose(total[:, index, index] * reading.share**2, alone, rtol=1e-12)


def test_what_two_readings_have_in_common_is_written_out_by_source():
    """Two gains of photodiode a, of half the light, and one of b, of a quarter; a column's offset is common to all."""
    terms = {"prnu": 0.02, "column_offset_e": 3.0, "column_gain_spread": 0.01, "dark_current_e_per_s": 1000.0}
    hot = {"hot_pixel_share": 0.01, "hot_pixel_dark_current_e_per_s": 1e4}
    gains = (Reading(2.0, 1.0, 2000.0, 0.5, 1.0, "a"), Reading(6.0, 2.0, 8000.0, 0.5, 1.0, "a"))
    readings = chip_readings(sensor_of(*gains, Reading(4.0, 3.0, 5000.0, 0.25, 1.0, "b"), **terms, **hot), 0.1)
    found = {name: matrix[0] for name, matrix in covariances(np.array([1000.0]), readings).items()}
    share = np.array([0.5, 0.5, 0.25])
    charge = np.array([[2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 4.0]])
    photodiode = (charge > 0) * 1.0
    collected = {
        "shot noise": 1000.0 * charge,
        "dark current": 100.0 * charge,
        "hot pixels": 0.01 * 1e3 * charge + 0.01 * 0.99 * 1e6 * photodiode,
        "PRNU": 20.0**2 * photodiode,
    }
    wanted = collected | {
        "column gains": 0.01**2 * (sum(collected.values()) + (1000.0 + 100.0 + 10.0) ** 2),
        "column offsets": 9.0 / np.outer(share, share),
        "DSNU": np.diag([1.0, 4.0, 9.0] / share**2),
        "read noise": np.diag([4.0, 36.0, 16.0] / share**2),
        "converter noise": np.zeros((3, 3)),
        "quantisation": np.diag([x.sensor.gain_e_per_dn**2 / 12 for x in readings] / share**2),
    }
    assert found.keys() == wanted.keys()
    for name, matrix in wanted.items():
        np.testing.assert_allclose(found[name], matrix, rtol=1e-12, err_msg=name)


def test_two_gains_of_one_charge_share_its_shot_noise_and_average_their_read_noise():
    sensor = dual()
    light = np.array([0.0, 1.0, 100.0, 1500.0])
    read_e2 = 1.0 / (1.0 / 2.0**2 + 1.0 / 6.0**2)
    # quantisation is 1e-3 of a variance of 4 or less
    np.testing.assert_allclose(merged_variance(light, chip_readings(sensor, 0.01)), light + read_e2, rtol=1e-3)
    weights = best_weights(np.asarray(sum(covariances(light, chip_readings(sensor, 0.01)).values())), np.array([0, 1]))
    np.testing.assert_allclose(weights[:, 0], 36 / (36 + 4), rtol=1e-3)


def test_two_charges_without_dark_noise_add_their_photons():
    split = sensor_of(Reading(0.0, 0.0, 1e6, 0.5, 1.0, "a"), Reading(0.0, 0.0, 1e6, 0.3, 1.0, "b"), prnu=0.0)
    apart = sensor_of(Reading(0.0, 0.0, 1e6), Reading(0.0, 0.0, 1e6, 1.0, 0.25), prnu=0.0)
    light = np.array([1000.0, 1e5])
    # the converter's step of 61 e- is all dark noise there is: 310 e-^2 of each over its share
    for sensor, whole in ((split, 0.8), (apart, 1.25)):
        fine = replace(sensor, bits=16)
        assert collected_share(chip_readings(fine, 0.01)) == pytest.approx(whole)
        assert merged_variance(light, chip_readings(fine, 0.01))[1] == pytest.approx(1e5 / whole, rel=1e-3)


@loop("name", HDR)
def test_sources_sum_to_the_variance_and_frames_are_interpolated_within_a_thousandth(name):
    sensor = preset(name)
    for light in (0.1, 30.0, 5000.0, 40_000.0):
        total = sum(value**2 for value in noise_sources(light, sensor, 0.01).values())
        assert total == pytest.approx(float(noise_variance(np.array([light]), sensor, 0.01)[0]), rel=1e-12)
    light = np.geomspace(0.01, sensor.pixel.full_well_e, 9000).reshape(90, 100)
    few = noise_variance(light[:, ::50], sensor, 0.01)
    np.testing.assert_allclose(noise_variance(light, sensor, 0.01)[:, ::50], few, rtol=1e-3)


def test_at_a_seam_half_of_the_pixels_have_lost_the_reading():
    sensor = dual()
    seam = float(seams(chip_readings(sensor, 0.01)).handover_e[0])
    assert seam == pytest.approx(2000.0 - 6.0 * np.sqrt(2000.0 + 4.0), rel=1e-5)
    below, at, above = merged_variance(seam * np.array([0.8, 1.0, 1.2]), chip_readings(sensor, 0.01))
    assert at == pytest.approx(seam + (below - 0.8 * seam + above - 1.2 * seam) / 2, rel=1e-6)
    assert above == pytest.approx(1.2 * seam + 36.0, rel=1e-3)


def test_a_camera_that_switches_takes_the_quietest_gain_that_holds_the_bright_end():
    sensor = switched(preset("dual_gain"))
    high, low = (x.sensor for x in chip_readings(sensor, 0.01))
    lights_e = (10.0, 1746.0, 1747.0, 8e3, 1e5)
    assert [resolve(sensor, np.array([e]), 0.01)[0].patterns for e in lights_e] == [0, 0, 1, 1, 1]
    hot = replace(sensor, pixel=replace(sensor.pixel, dark_current_e_per_s=1000.0))
    assert [resolve(hot, np.array([e]), 1.0)[0].patterns for e in (10.0, 746.0, 747.0)] == [0, 0, 1]
    frame = np.array([[5.0, 1000.0], [20.0, 3000.0]])
    np.testing.assert_array_equal(noise_variance(frame, sensor, 0.01), noise_variance(frame, low, 0.01))
    np.testing.assert_array_equal(noise_variance(frame / 10, sensor, 0.01), noise_variance(frame / 10, high, 0.01))


@loop("readout", ["merged", "switched"])
@loop("ratio", [1.0, 10.0, 40.0])
def test_the_light_for_an_snr_gives_back_the_snr(ratio, readout):
    sensor = preset("dual_gain")
    sensor = replace(sensor, chip=replace(sensor.chip, readout=readout))
    electrons = electrons_at_snr(ratio, sensor, 0.01)
    assert float(snr(np.array([electrons]), sensor, 0.01)[0]) == pytest.approx(ratio, rel=1e-4)
    assert electrons_at_snr(1e4, sensor, 0.01) == np.inf


@loop("name", HDR)
@loop(("count", "most"), [(1, 0.065), (64, 0.13)])
def test_noise_steps_of_a_frame_and_of_a_burst_are_as_near_to_the_closed_form_as_stated(name, count, most):
    sensor, fixed = preset(name), ("PRNU", "DSNU", "column offsets", "column gains")
    readings = chip_readings(sensor, 0.02)
    whole, at = collected_share(readings), seams(readings).handover_e
    for number, step in enumerate(merged_noise_steps(readings)):
        light = np.linspace(1.05 * at[number - 1] if number else 0.0, 0.97 * at[number], 200)
        by_source = merged_variances(light, readings).items()
        found = whole**2 * sum(value * (count if source in fixed else 1) for source, value in by_source)
        electrons = whole * light
        stated = step.shot * electrons + step.read_noise_e**2
        stated += count * (step.dsnu_e**2 + (step.prnu * electrons) ** 2)
        assert np.abs(stated / found - 1).max() < most


def test_noise_steps_begin_where_a_reading_is_left_out_in_the_electrons_that_are_merged():
    """Photodiodes of half and of a quarter of the light: a step lies at three quarters of the whole pixel's light."""
    sensor = sensor_of(Reading(2.0, 0.0, 5000.0, 0.5, 1.0, "a"), Reading(2.0, 0.0, 5000.0, 0.25, 1.0, "b"))
    readings = chip_readings(sensor, 0.01)
    first, second = merged_noise_steps(readings)
    (handover_e, _) = seams(readings).handover_e
    assert (first.from_e, second.from_e) == (0.0, pytest.approx(0.75 * handover_e))
    assert 0.5 * 10_000 <= handover_e < 10_000


def test_where_dark_current_fills_every_reading_the_last_to_fill_is_what_is_left():
    """Its own law is stated from the dark on: a Poisson of a million electrons beside its read noise of 6 e-."""
    readings = chip_readings(dual(dark_current_e_per_s=1e6), 1.0)
    assert (seams(readings).handover_e < 0).all()
    of_chip, step = merged_noise_steps(readings)
    assert of_chip == step
    assert step.from_e == 0.0
    steps_e2 = readings[1].sources["quantisation"].dark_e ** 2 + readings[1].sources["converter noise"].dark_e ** 2
    assert step.read_noise_e == pytest.approx(np.sqrt(1e6 + 6.0**2 + steps_e2), rel=1e-9)
    assert (step.shot, step.prnu) == (pytest.approx(1.0), 0.0)


@loop("name", HDR)
def test_a_sensor_for_a_burst_holds_the_variance_of_its_merged_frames(name):
    one, fixed = preset(name), ("PRNU", "DSNU", "column offsets", "column gains")
    four = merged_sensor(one, 4)
    assert four.pixel.full_well_e == 4 * one.pixel.full_well_e
    for light in (50.0, 3000.0):
        sources = noise_sources(light, one, 0.01)
        expected = sum(value**2 * (16 if key in fixed else 4) for key, value in sources.items())
        # its weights know PRNU and a converter's step of four frames, which those of a frame don't
        assert float(noise_variance(np.array([4 * light]), four, 0.04)[0]) == pytest.approx(expected, rel=0.02)


def test_merged_samples_have_no_rounding_noise():
    sensor = preset("staggered")
    device = draw_device(sensor, (64, 64), np.random.default_rng(1))
    one, *rest = (expose(np.zeros((64, 64)), sensor, 0.01, device, np.random.default_rng(seed)) for seed in range(4))
    # four frames of one chip: read noise adds as a root, fixed offsets as they are
    expected_e = np.hypot(2 * one.read_noise_e, 4 * one.dsnu_e)
    assert merged_raw([one, *rest]).dark_noise_e == pytest.approx(expected_e, rel=1e-6)
    assert one.dark_noise_e == pytest.approx(np.hypot(one.read_noise_e, one.dsnu_e), rel=1e-12)


# Sensor files with several readings: what they become, and what is refused in one line.


PIXEL = "[pixel]\npitch_um = 2.2\nfill_factor = 0.9\nprnu = 0.01\n"
LENS = "[lens]\nf_number = 2.8\n"
ONE = "[[readings]]\nread_noise_e = 2\ndsnu_e = 1\nfull_well_e = 2000\n"
OTHER = "[[readings]]\nread_noise_e = 6\ndsnu_e = 3\nfull_well_e = 9000\n"
SMALL = OTHER + 'photodiode = "small"\nlight_share = 0.1\n'
LARGE = ONE + 'photodiode = "large"\nlight_share = 0.9\n'


def read(folder, text):
    path = folder / "camera.toml"
    path.write_text(text, encoding="utf-8")
    return read_sensor(path)


def test_a_file_s_readings_are_the_sensor_s_and_its_pixel_tells_their_ends(tmp_path):
    sensor = read(tmp_path, PIXEL + LARGE + SMALL + LENS)
    assert sensor.chip.readings == (Reading(2, 1, 2000, 0.9, 1.0, "large"), Reading(6, 3, 9000, 0.1, 1.0, "small"))
    assert sensor.pixel.full_well_e == 90_000
    assert sensor.pixel.read_noise_e == pytest.approx(2 / 0.9)
    assert sensor.metered_well_e("G") == pytest.approx(2000 / 0.9)
    assert read(tmp_path, PIXEL + ONE + OTHER + LENS).metered_well_e("G") == 9000
    assert preset("low_noise").metered_well_e("G") == 15_000
    assert preset("low_noise").chip.readings == ()


def test_switching_and_merging_are_a_word_of_the_file(tmp_path):
    assert read(tmp_path, PIXEL + ONE + OTHER + LENS).chip.readout == "merged"
    assert read(tmp_path, 'readout = "switched"\n' + PIXEL + ONE + OTHER + LENS).chip.readout == "switched"
    text = preset_file("dual_gain").read_text("utf-8")
    assert read(tmp_path, text.replace('readout = "merged"', 'readout = "switched"')).chip.readout == "switched"


@loop(
    ("text", "parts"),
    [
        (PIXEL + ONE + LENS, ("readings: 1 is outside 2 to 8",)),
        (PIXEL + ONE * 9 + LENS, ("readings: 9 is outside 2 to 8",)),
        (PIXEL + LENS + "[readings]\nread_noise_e = 2\n", ("readings:", "no list of tables", "[[readings]]")),
        ("readings = [1, 2]\n" + PIXEL + LENS, ("readings: [1, 2] is no list of tables",)),
        (PIXEL + "read_noise_e = 2\n" + ONE + OTHER + LENS, ("pixel: read_noise_e beside [[readings]]",)),
        (PIXEL + ONE.replace("dsnu_e = 1\n", "") + OTHER + LENS, ("readings: dsnu_e is missing",)),
        (PIXEL + ONE + OTHER + "gain = 4\n" + LENS, ("readings key: 'gain' is unknown",)),
        (PIXEL + ONE + OTHER + "read_nose_e = 4\n" + LENS, ("did you mean 'read_noise_e'?",)),
        (PIXEL + ONE + OTHER + "photodiode = 3\n" + LENS, ("photodiode: 3 is not a text in quotes",)),
        (PIXEL + (ONE + "time_share = 0.5\n") * 2 + LENS, ("time_share: [0.5, 0.5]", "divide by 0.5")),
        (PIXEL + ONE + OTHER + "light_share = 0.5\n" + LENS, ("light_share: [1.0, 0.5]", "name photodiodes apart")),
        (PIXEL + LARGE + SMALL.replace("0.1", "0.2") + LENS, ("light_share: [0.9, 0.2]", "1 together")),
        ('readout = "both"\n' + PIXEL + ONE + OTHER + LENS, ("readout: 'both' is unknown", "merged, switched")),
        ('readout = "switched"\n' + PIXEL + LARGE + SMALL + LENS, ("readout: 'switched' between shares",)),
        ('readout = "switched"\n' + PIXEL + "read_noise_e = 1\ndsnu_e = 1\nfull_well_e = 9\n" + LENS, ("without",)),
        ('binning = "charge"\ncfa = "quad_bayer"\n' + PIXEL + ONE + OTHER + LENS, ("binning: 'charge' with several",)),
        ("readout = [1]\n" + PIXEL + ONE + OTHER + LENS, ("readout: [1] is not a text in quotes",)),
    ],
)
def test_readings_that_no_pixel_has_are_refused_in_one_line(tmp_path, text, parts):
    refusal(read, tmp_path, text, words=("camera.toml", *parts))


def test_auto_exposure_aims_at_the_most_sensitive_photodiode():
    per_second_e = np.full((8, 8, 4), 1e6)
    for name, well_e in (("low_noise", 15_000.0), ("staggered", 15_000.0), ("split_pixel", 24_200.0)):
        sensor = preset(name)
        filling_e = 1e6 + sensor.pixel.dark_current_e_per_s
        assert exposure_of_electrons_s("auto", per_second_e, sensor, 1.0) == pytest.approx(0.8 * well_e / filling_e)
