"""Gain between pixel and converter: mean, variance, rounding and clip in closed form, and what follows from them."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from loop import loop
from refusal import refusal
from scipy.special import ndtr

from sensor.capture import expose
from sensor.config import SensorConfig, with_readings
from sensor.config_file import read_sensor
from sensor.device import draw_device
from sensor.emva1288.characterise import characterise
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W, exposed_by_rule
from sensor.photodiodes import binned, with_gain
from sensor.pixel import Reading
from sensor.presets import low_noise, preset, preset_file
from sensor.raw import noise_at_sites
from sensor.readout import noise_sources, noise_variance

SHAPE, TIME_S = (128, 128), 0.01
READ_E, CONVERTER_DN, WELL_E, BITS, BLACK_DN = 2.0, 0.7, 6000.0, 10, 64
GAINS = (1.0, 2.0, 4.0, 8.0, 16.0)


def camera(gain: float = 1.0, **pixel: float) -> SensorConfig:
    """A phone's pixel with a coarse converter, without fixed patterns."""
    terms = {"full_well_e": WELL_E, "read_noise_e": READ_E, "dsnu_e": 0.0, "prnu": 0.0, **pixel}
    one = replace(low_noise("bayer"), pixel=replace(low_noise().pixel, **terms))
    one = replace(one, bits=BITS, black_level_dn=BLACK_DN, converter_noise_dn=CONVERTER_DN)
    return with_gain(one, gain)


def frame(sensor: SensorConfig, light_e: float, seed: int, exact: bool = False, shape: tuple[int, int] = SHAPE):
    device = draw_device(sensor, shape, np.random.default_rng([seed, 0]))
    return expose(np.full(shape, light_e), sensor, TIME_S, device, np.random.default_rng([seed, 1]), exact=exact)


@loop("exact", [False, True])
@loop("gain", GAINS)
def test_mean_variance_rounding_and_clip_at_a_gain_are_the_closed_form(gain: float, exact: bool) -> None:
    """Mean and variance of 16 384 samples within 4.5 standard errors: 7e-6 a figure, of 20."""
    sensor, top_e = camera(gain), WELL_E / gain
    step_e = top_e / (2**BITS - 1 - BLACK_DN)
    light_e = 0.4 * top_e
    variance = light_e + READ_E**2 + (CONVERTER_DN**2 + 1 / 12) * step_e**2
    raw = frame(sensor, light_e, 1, exact)
    assert (raw.gain_e_per_dn, raw.full_well_e) == pytest.approx((step_e, top_e), rel=1e-12)
    size = raw.dn.size
    assert abs(raw.electrons.mean() - light_e) < 4.5 * np.sqrt(variance / size)
    assert raw.electrons.var() == pytest.approx(variance, rel=4.5 * np.sqrt(2 / size))
    assert noise_variance(np.full((1, 1), light_e), sensor, TIME_S)[0, 0] == pytest.approx(variance, rel=1e-12)
    assert noise_at_sites(raw, np.full((2, 2), light_e))[0, 0] == pytest.approx(variance, rel=1e-9)
    # A full well reads the top but for the noise behind it; what a well holds beyond the top reads the top.
    beyond = frame(sensor, 1.5 * top_e, 2, exact)
    at_the_top = ndtr(0.5 / hypot(READ_E / step_e, CONVERTER_DN)) if gain == 1 else 1.0
    assert (beyond.dn == 2**BITS - 1).mean() == pytest.approx(at_the_top, abs=4.5 * 0.5 / size**0.5)
    assert beyond.saturated.all()
    assert not frame(sensor, 0.6 * top_e, 3, exact).saturated.any()


def test_noise_after_the_amplifier_falls_as_the_gain_rises_and_noise_before_it_stays() -> None:
    told = [noise_sources(0.0, camera(gain), TIME_S) for gain in GAINS]
    step_e = WELL_E / (2**BITS - 1 - BLACK_DN)
    assert [x["read noise"] for x in told] == [READ_E] * len(GAINS)
    assert [x["converter noise"] for x in told] == pytest.approx([CONVERTER_DN * step_e / gain for gain in GAINS])
    assert [x["quantisation"] for x in told] == pytest.approx([step_e / 12**0.5 / gain for gain in GAINS])
    noise_e = [camera(gain).read_noise_e for gain in GAINS]
    assert noise_e == pytest.approx([hypot(READ_E, CONVERTER_DN * step_e / gain) for gain in GAINS])


def test_a_black_level_that_is_left_out_holds_five_standard_deviations_of_the_dark_at_every_gain() -> None:
    for gain in GAINS:
        sensor = replace(camera(gain), black_level_dn=None)
        dark_dn = hypot(READ_E / sensor.gain_e_per_dn, CONVERTER_DN)
        assert 5 * dark_dn <= sensor.black_dn < 5 * dark_dn * 1.1 + 1


@pytest.mark.thorough
def test_a_laboratory_measures_read_noise_and_dsnu_at_gain_8_and_says_that_a_step_hides_them_at_1() -> None:
    """Each of two figures within 4 of its own standard errors: 6e-5."""
    quiet = camera(1.0, read_noise_e=1.2, dsnu_e=0.8)
    quiet = replace(quiet, converter_noise_dn=0.1)
    at_1, at_8 = (characterise(with_gain(quiet, gain), (192, 192), 3) for gain in (1.0, 8.0))
    assert any("rounding hides" in note for note in at_1.notes)
    assert not any("rounding hides" in note for note in at_8.notes)
    figures = {figure.name: figure for figure in at_8.figures}
    for name in ("dark noise", "DSNU"):
        figure = figures[name]
        assert abs(figure.measured - figure.configured) < 4 * figure.error, name
    assert figures["full well"].measured == pytest.approx(WELL_E / 8, rel=0.01)


@loop("way", ["charge", "digital"])
@loop("gain", (1.0, 4.0))
def test_four_photodiodes_that_bin_have_the_gain_of_their_converter(gain: float, way: str) -> None:
    """Variance of 4096 samples of a binned frame within 4.5 standard errors of what is stated: 7e-6."""
    quad = replace(camera(), cfa=low_noise("quad_bayer").cfa)
    sensor = with_gain(binned(quad, way), gain)
    assert sensor == binned(with_gain(quad, gain), way)
    light_e = 0.3 * sensor.top_e
    raw = frame(sensor, light_e / 4, 5, exact=True)
    stated = float(noise_variance(np.full((1, 1), light_e), sensor, TIME_S)[0, 0])
    assert raw.electrons.mean() == pytest.approx(light_e, abs=4.5 * np.sqrt(stated / raw.dn.size))
    assert raw.electrons.var() == pytest.approx(stated, rel=4.5 * np.sqrt(2 / raw.dn.size))


def test_an_automatic_exposure_raises_the_gain_once_its_time_is_the_longest() -> None:
    """Of light of 100 e-/s the well asks for 48 s; in a second it fills 1/48: gains in thirds of a stop, to a limit."""
    sensor = replace(camera(), gain_limit=64.0)
    per_second = np.broadcast_to(np.array([50.0, 100.0, 50.0]), (8, 8, 3))
    for longest_s, gain in ((100.0, 1.0), (48.0, 1.0), (24.0, 2.0), (1.0, 2 ** (16 / 3)), (0.1, 64.0)):
        time_s, taken = exposed_by_rule(AUTO, per_second, sensor, longest_s)
        assert time_s == pytest.approx(min(longest_s, 48.0))
        assert taken.gain == pytest.approx(gain)
        bright_e = 100.0 * time_s
        assert bright_e <= 0.8 * taken.top_e * (1 + 1e-9)
        if 1 < gain < 64:
            assert bright_e > 0.8 * taken.top_e / 2 ** (1 / 3)
    dark_s, dark = exposed_by_rule(AUTO, 0 * per_second, sensor, 0.5)
    assert (dark_s, dark.gain) == (0.5, 64.0)
    fixed_s, fixed = exposed_by_rule(AUTO, per_second, with_gain(sensor, 4.0), 1e3)
    assert (fixed_s, fixed.gain) == (pytest.approx(12.0), 4.0)
    assert exposed_by_rule(AUTO, per_second, with_gain(sensor, 4.0), 1.0)[1].gain == 4.0


def test_rules_that_look_at_white_raise_the_gain_for_white_alone() -> None:
    sensor = replace(low_noise(), gain_limit=16.0)
    per_second = np.broadcast_to(np.array([50.0, 100.0, 50.0, 400.0]), (8, 8, 4))
    for rule, gain in ((AUTO, 16.0), (AUTO_W, 4.0)):  # 0.8 x 15 000 over 6 s of 100 or 400 e-: 20, 5
        assert exposed_by_rule(rule, per_second, sensor, 6.0)[1].gain == pytest.approx(gain)
    assert exposed_by_rule(AUTO_INFORMATION, per_second, sensor, 6.0)[1].gain <= 6.0  # beyond 6.25 W is full


def test_a_sensor_file_states_gain_limit_and_converter_noise(tmp_path) -> None:
    path = tmp_path / "phone.toml"
    lines = "gain = 2\ngain_limit = 16\nconverter_noise_dn = 0.5\n"
    path.write_text(lines + preset_file("low_noise").read_text("utf-8"), encoding="utf-8")
    sensor = read_sensor(path)
    assert (sensor.gain, sensor.gain_limit, sensor.converter_noise_dn) == (2.0, 16.0, 0.5)
    assert sensor.top_e == 7500.0
    path.write_text("gain = 0.5\n" + preset_file("low_noise").read_text("utf-8"), encoding="utf-8")
    refusal(read_sensor, path, words=("gain: 0.5 is outside", "full well reads the converter's top"))


def test_readings_have_gains_of_their_own() -> None:
    refusal(with_gain, preset("dual_gain"), 2.0, match="gain: 2 with several readings, which have gains of their own")
    two = (Reading(1.5, 1.0, 1e4), Reading(3.0, 1.0, 1.5e4))
    refusal(with_readings, replace(low_noise(), gain_limit=8.0), two, match="gain: 8 with several readings")


@pytest.mark.thorough
def test_a_sweep_over_gains_shows_the_knee_where_the_closed_form_has_it() -> None:
    """In a simulated sweep the dark's variance falls as a + b / gain^2; at the knee, (b / a)^1/2, both are alike.

    The closed form has the converter's b and the pixel's a. 147 456 samples know a variance to 0.37 %, the knee of six
    gains to 0.6 %: 3 % are five standard errors. Beyond twice the knee a doubling brings under 0.6 dB.
    """
    gains = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    step_e = WELL_E / (2**BITS - 1 - BLACK_DN)
    knee = step_e * hypot(CONVERTER_DN, 12**-0.5) / READ_E
    swept = np.array(
        [frame(camera(gain), 0.0, 11 + n, shape=(384, 384)).electrons.var() for n, gain in enumerate(gains)]
    )
    expected = READ_E**2 * (1 + (knee / gains) ** 2)
    assert swept == pytest.approx(expected, rel=0.02)
    rows = np.column_stack([np.ones(6), gains**-2]) / expected[:, None]
    (pixel, converter), *_ = np.linalg.lstsq(rows, swept / expected, rcond=None)
    assert np.sqrt(converter / pixel) == pytest.approx(knee, rel=0.03)
    brings_db = 10 * np.log10(swept[:-1] / swept[1:])
    assert brings_db[0] > 4.0
    assert brings_db[gains[:-1] >= 2 * knee].max() < 0.6
