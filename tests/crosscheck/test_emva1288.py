"""The sensor as a stranger measures it: EMVA Standard 1288 by the independent `emva1288` package (PyPI, LGPL-3.0).

Three presets, drawn by NumPy's exact sampler, and ten chips with numbers drawn at random, drawn by the engine that
`capture` uses. What is expected is worked out here from the configuration, by models of its own.
"""

import logging
import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from sensor.chip import PixelConfig
from sensor.config import LensConfig, SensorConfig
from sensor.emva1288.characterise import measure, plan_for
from sensor.emva1288.photon_transfer import bench
from sensor.presets import preset

SHAPE = (240, 320)
PIXELS, COLUMNS = SHAPE[0] * SHAPE[1], SHAPE[1]
FRAMES = 32  # dark, and at half the well
EXPOSURE_S = 0.01
COARSE = np.linspace(0, 0.86, 23)[1:]  # of the well: the gain's line, two frames each
FINE = np.linspace(0.87, 1.06, 20)  # of the well, in steps of 1 %: the peak of the variance, eight frames each
LEVELS = np.concatenate([COARSE, FINE])
SIGMAS = 4.0  # 13 chips and some six comparisons each: false-alarm rate 5e-3 for fresh keys

PRESETS = ("table1_pixel", "table1_output", "low_noise")


def random_chip(number):
    """Camera with every number drawn; where rounding hides the dark noise, without what would blur its model."""
    rng = np.random.default_rng([1288, number])
    well_e, read_e, dsnu_e = (
        float(np.exp(rng.uniform(*np.log(limits)))) for limits in ((4e3, 4e4), (1.5, 40), (1, 40))
    )
    pixel = PixelConfig(2.2, 0.9, well_e, read_e, dsnu_e, float(rng.uniform(0.004, 0.025)))
    extra = {
        "dark_current_e_per_s": float(rng.uniform(0, 3000)),
        "column_offset_e": float(rng.uniform(0.3, 1)) * dsnu_e,
        "column_gain_spread": float(rng.uniform(0.002, 0.006)),
        "crosstalk": float(rng.uniform(0, 0.1)),
    }
    sensor = SensorConfig(pixel, LensConfig(2.8), bits=int(rng.choice([10, 12, 14])))
    return sensor if temporal_dn(sensor) < 0.7 else replace(sensor, pixel=replace(pixel, **extra))


def temporal_dn(sensor):
    return dark_noise_e(sensor) / sensor.gain_e_per_dn


def dark_noise_e(sensor):
    return np.sqrt(sensor.pixel.read_noise_e**2 + sensor.pixel.dark_current_e_per_s * EXPOSURE_S)


@pytest.fixture
def emva(monkeypatch):
    """Make the package's classes, which were written for NumPy 1 and warn where a chip has no row pattern."""
    # `np.asfarray` went with NumPy 2
    monkeypatch.setattr(np, "asfarray", lambda a, dtype=float: np.asarray(a, dtype=dtype), raising=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reason = "emva1288 is not installed: an optional cross-check, `pip install emva1288==1.0.2`"
        data = pytest.importorskip("emva1288.process.data", reason=reason)
        results = pytest.importorskip("emva1288.process.results", reason=reason)
        routines = pytest.importorskip("emva1288.process.routines", reason=reason)
        yield data.Data1288, results.Results1288, routines.get_int_imgs


def as_pair(stack):
    """The package expects a pair: a whole stack, expressed as a pair's sums, makes the variance less noisy."""
    return {"sum": 2.0 * stack.mean(axis=0).sum(), "pvar": 4.0 * stack.var(axis=0, ddof=1).sum(), "dmean": 0.0}


@dataclass(frozen=True)
class Found:
    """The package's results and data, and the bench for what it doesn't measure."""

    results: object
    data: dict
    expose: object


def characterise(sensor, emva, exact, seed):
    """Run the package's analysis of dark and bright frames of one chip."""
    data_1288, results_1288, sums = emva
    expose = bench(sensor, SHAPE, seed, exact)
    well_e = sensor.pixel.full_well_e

    def frames(level_e, count):
        return np.array([expose(level_e, EXPOSURE_S) for _ in range(count)], dtype=np.int64)

    dark = frames(0.0, FRAMES)
    temporal = {0.0: as_pair(dark)}
    temporal |= {float(x * well_e): as_pair(frames(x * well_e, 2 if x in COARSE else 8)) for x in LEVELS}
    spatial = {0.0: sums(list(dark)), 0.5 * well_e: sums(list(frames(0.5 * well_e, FRAMES)))}
    raw = {"height": SHAPE[0], "width": SHAPE[1], "temporal": {1.0: temporal}, "spatial": {1.0: spatial}}
    data = data_1288(raw, loglevel=logging.WARNING).data
    # its own search for the peak starts in the flat tail of a fully clipped sensor
    peak = int(np.argmax(data["temporal"]["s2_y"]))
    return Found(results_1288(data, index_u_ysat=peak, loglevel=logging.WARNING), data, expose)


def gain_error(sensor):
    """Relative standard error of the gain: a line through 0 up to 70 % of the well, one dark variance for all."""
    level_e = COARSE[COARSE <= 0.7] * sensor.pixel.full_well_e
    dark = dark_noise_e(sensor) ** 2 + sensor.gain_e_per_dn**2 / 12
    common = (dark * level_e.sum()) ** 2 / (FRAMES - 1)
    of_line = np.sqrt(2 / PIXELS * (common + np.sum((level_e * (level_e + dark)) ** 2))) / np.sum(level_e**2)
    return np.hypot(of_line, sensor.pixel.column_gain_spread / np.sqrt(COLUMNS))  # the chip's own mean gain


def number(result):
    return float(np.ravel(result() if callable(result) else result)[0])


def check_gain_and_prnu(sensor, results):
    pixel = sensor.pixel
    half_e, fixed = 0.5 * pixel.full_well_e, (pixel.fixed_gain * 0.5 * pixel.full_well_e) ** 2
    temporal = (half_e + dark_noise_e(sensor) ** 2 + sensor.gain_e_per_dn**2 / 12) / FRAMES
    # its PRNU is the spread at half the well less the dark's: offset and gain pattern correlate by chance
    of_pixels = (pixel.prnu * half_e) ** 2 + pixel.dsnu_e**2 + temporal
    of_columns = (pixel.column_gain_spread * half_e) ** 2 + pixel.column_offset_e**2
    error = (2 * of_pixels**2 + 2 * pixel.dsnu_e**4) / PIXELS
    error += (2 * of_columns**2 + 2 * pixel.column_offset_e**4) / COLUMNS
    assert number(results.K) == pytest.approx(1 / sensor.gain_e_per_dn, rel=SIGMAS * gain_error(sensor))
    assert number(results.PRNU1288) == pytest.approx(100 * pixel.fixed_gain, rel=SIGMAS * np.sqrt(error) / (2 * fixed))


def check_dark(sensor, results):
    """Dark noise and DSNU where the noise is wide enough for rounding to add 1/12."""
    pixel, of_gain = sensor.pixel, gain_error(sensor)
    variance = dark_noise_e(sensor) ** 2 + sensor.gain_e_per_dn**2 / 12
    of_noise = variance / dark_noise_e(sensor) ** 2 / np.sqrt(2 * PIXELS * (FRAMES - 1))
    # A chip's pattern holds as many draws as it has pixels, or columns; 32 frames leave some temporal noise in it.
    error = 2 * (pixel.dsnu_e**2 + variance / FRAMES) ** 2 / PIXELS + 2 * pixel.column_offset_e**4 / COLUMNS
    of_offset = np.sqrt(error) / (2 * pixel.fixed_dark_e**2)
    assert number(results.sigma_d) == pytest.approx(dark_noise_e(sensor), rel=SIGMAS * (of_gain + of_noise))
    assert number(results.DSNU1288) == pytest.approx(pixel.fixed_dark_e, rel=SIGMAS * (of_gain + of_offset))


def check_rounded_dark(sensor, data):
    """Temporal and spatial variance of the dark against normal noise, rounded, over a normal pattern."""
    sigma, spread = temporal_dn(sensor), sensor.pixel.dsnu_e / sensor.gain_e_per_dn
    nodes = np.linspace(-6, 6, 4001)
    weight = stats.norm.pdf(nodes) / stats.norm.pdf(nodes).sum()
    at = sensor.black_dn + spread * nodes
    whole = np.arange(np.floor(at.min() - 8 * sigma) - 1, np.ceil(at.max() + 8 * sigma) + 2)
    below = stats.norm.cdf((whole[None, :-1] + 0.5 - at[:, None]) / sigma)
    share = np.diff(below, axis=1, prepend=0.0, append=1.0)  # of each DN, at each place of the pattern
    mean = share @ whole
    away = whole[None, :] - mean[:, None]
    variance, fourth = (np.sum(share * away**power, axis=1) for power in (2, 4))
    temporal = weight @ variance
    scatter = weight @ (variance - temporal) ** 2
    scatter += weight @ (fourth - variance**2 * (FRAMES - 3) / (FRAMES - 1)) / FRAMES
    assert float(np.ravel(data["temporal"]["s2_ydark"])[0]) == pytest.approx(
        temporal, abs=SIGMAS * np.sqrt(scatter / PIXELS)
    )
    off, left = mean - weight @ mean, temporal / FRAMES
    spatial = weight @ off**2
    scatter = weight @ off**4 + 6 * spatial * left + 3 * left**2 - (spatial + left) ** 2
    found = float(np.ravel(data["spatial"]["avg_var_dark"])[0]) - left
    assert found == pytest.approx(spatial, abs=SIGMAS * np.sqrt(scatter / PIXELS))


def check_saturation(sensor, found):
    well_e = sensor.pixel.full_well_e
    # the peak of the variance, which the spread of counts and gains puts under the well
    assert 0.9 < number(found.results.u_e_sat) / well_e < 1.015
    # the well: mean of frames in which all is clipped, with the upper half of the noise behind the well cut off
    full = np.mean([found.expose(2 * well_e, EXPOSURE_S) for _ in range(2)])
    pixel = sensor.pixel
    noise_e = np.sqrt(pixel.read_noise_e**2 + pixel.fixed_dark_e**2 + (pixel.column_gain_spread * well_e) ** 2)
    read_e = (full - sensor.black_dn) * sensor.gain_e_per_dn + noise_e / np.sqrt(2 * np.pi)
    # the half normal's spread over pixels and columns, and rounding against the top, which lifts half a DN
    error = noise_e * (1 / np.sqrt(PIXELS) + (pixel.column_gain_spread > 0) / np.sqrt(COLUMNS))
    assert read_e == pytest.approx(well_e, abs=SIGMAS * error + 0.3 * sensor.gain_e_per_dn)


def check_dark_current_and_columns(sensor, found):
    pixel = sensor.pixel
    times_s = np.array([0.0, 0.02, 0.05, 0.1])
    frames = np.array([found.expose(0.0, float(time)) for time in times_s], dtype=float)
    slope = np.polyfit(times_s, frames.mean(axis=(1, 2)), 1)[0] * sensor.gain_e_per_dn
    noise_e = np.sqrt(pixel.read_noise_e**2 + 0.1 * pixel.dark_current_e_per_s + sensor.gain_e_per_dn**2 / 12)
    error = noise_e / np.sqrt(PIXELS) / np.sqrt(np.sum((times_s - times_s.mean()) ** 2))
    error += pixel.dark_current_e_per_s * pixel.column_gain_spread / np.sqrt(COLUMNS)
    assert slope == pytest.approx(pixel.dark_current_e_per_s, abs=SIGMAS * error)
    if temporal_dn(sensor) < 0.7:
        return  # no column noise in these, and rounding moves what a pixel's own offset leaves
    # the package's residual column variance of the mean dark frame: a pixel's own share of a column's mean is left in
    own = pixel.dsnu_e**2 / SHAPE[0]
    expected = pixel.column_offset_e**2 + own
    column = float(np.ravel(found.data["spatial"]["avg_var_cav_dark"])[0]) * sensor.gain_e_per_dn**2
    left = dark_noise_e(sensor) ** 2 / FRAMES / SHAPE[0]
    assert column == pytest.approx(expected, abs=SIGMAS * np.sqrt(2 / COLUMNS) * (expected + left))


@pytest.mark.slow
@pytest.mark.parametrize("chip", [*PRESETS, *range(10)])
def test_a_stranger_finds_what_was_put_in(chip, emva):
    sensor = preset(chip) if chip in PRESETS else random_chip(chip)
    found = characterise(sensor, emva, exact=chip in PRESETS, seed=1 if chip in PRESETS else chip)
    check_gain_and_prnu(sensor, found.results)
    if temporal_dn(sensor) >= 0.7:
        check_dark(sensor, found.results)
    else:
        check_rounded_dark(sensor, found.data)
    check_saturation(sensor, found)
    check_dark_current_and_columns(sensor, found)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", PRESETS)
def test_our_procedure_finds_what_the_stranger_finds_in_the_same_frames(name, emva):
    data_1288, results_1288, sums = emva
    sensor = preset(name)
    chip, taken = bench(sensor, SHAPE, 2), {}

    def expose(light_e, exposure_s):
        taken.setdefault((light_e, exposure_s), []).append(chip(light_e, exposure_s))
        return taken[light_e, exposure_s][-1]

    plan = plan_for(sensor, EXPOSURE_S)
    own = measure(expose, plan, sensor)
    half_e = 0.5 * sensor.pixel.full_well_e
    stacks = {light_e: np.array(taken[light_e, EXPOSURE_S][: plan.frames], dtype=np.int64) for light_e in (0.0, half_e)}
    pairs = {float(light_e): np.array(taken[light_e, EXPOSURE_S][-2:], dtype=np.int64) for light_e in plan.light_e}
    temporal = {light_e: as_pair(stack) for light_e, stack in {0.0: stacks[0.0], **pairs}.items()}
    spatial = {light_e: sums(list(stack)) for light_e, stack in stacks.items()}
    raw = {"height": SHAPE[0], "width": SHAPE[1], "temporal": {1.0: temporal}, "spatial": {1.0: spatial}}
    data = data_1288(raw, loglevel=logging.WARNING).data
    results = results_1288(data, index_u_ysat=int(np.argmax(data["temporal"]["s2_y"])), loglevel=logging.WARNING)
    theirs = {
        "gain": results.K,
        "dark noise": results.sigma_d,
        "DSNU": results.DSNU1288,
        "PRNU": number(results.PRNU1288) / 100,
        "saturation": results.u_p_sat,
        "dynamic range": 20 * np.log10(number(results.DR)),
        "greatest SNR": results.SNR_max_dB,
    }
    for figure, value in theirs.items():
        # It centres no pair's difference (6e-5), and its decibels hold the quantum efficiency that it measures, 0.1 to
        # 0.2 % off the 1 that our light is set with.
        bound = {"abs": 0.03} if own.figure(figure).unit == "dB" else {"rel": 2e-4}
        assert own.figure(figure).measured == pytest.approx(number(value), **bound), figure


def test_the_random_chips_hold_both_kinds_and_differ():
    chips = [random_chip(number) for number in range(10)]
    assert len({chip.pixel.full_well_e for chip in chips}) == 10
    coarse = sum(temporal_dn(chip) < 0.7 for chip in chips)
    assert 2 <= coarse <= 7
