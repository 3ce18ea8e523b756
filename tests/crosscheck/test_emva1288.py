"""The sensor as a stranger measures it: EMVA Standard 1288 by the independent `emva1288` package (PyPI, LGPL-3.0).

It is no dependency: `pip install emva1288==1.0.2` makes these tests run.
"""

import logging
import warnings

import numpy as np
import pytest

from sensor.device import draw_device
from sensor.presets import preset
from sensor.readout import read_out

SHAPE = (240, 320)
PIXELS = SHAPE[0] * SHAPE[1]
FRAMES = 32  # dark, and at half the well
LEVELS = np.linspace(0, 1.06, 41)[1:]  # of the well: saturation's peak of the variance lies inside
SIGMAS = 4.0  # twelve comparisons: false-alarm rate 8e-4 for fresh keys


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


def characterise(sensor, emva):
    """Run the package's analysis of dark and bright frames of one chip."""
    data_1288, results_1288, sums = emva
    device = draw_device(sensor, SHAPE, np.random.default_rng(1))
    rng = np.random.default_rng(2)

    def frames(level_e, count):
        return [read_out(np.full(SHAPE, level_e), sensor, device, 0.01, rng).dn for _ in range(count)]

    def totals(pair):
        return {name: np.sum(pair[name]) if name != "dmean" else pair[name] for name in ("sum", "pvar", "dmean")}

    well_e = sensor.pixel.full_well_e
    dark = np.array(frames(0.0, FRAMES), dtype=np.int64)
    # The package expects a pair for the dark variance, which every point of its line shares: the whole stack, expressed
    # as a pair's sums, makes the gain far less sensitive to it.
    pair = {"sum": 2.0 * dark.mean(axis=0).sum(), "pvar": 4.0 * dark.var(axis=0, ddof=1).sum(), "dmean": 0.0}
    temporal = {0.0: pair} | {float(x * well_e): totals(sums(frames(x * well_e, 2))) for x in LEVELS}
    spatial = {0.0: sums(list(dark)), 0.5 * well_e: sums(frames(0.5 * well_e, FRAMES))}
    raw = {"height": SHAPE[0], "width": SHAPE[1], "temporal": {1.0: temporal}, "spatial": {1.0: spatial}}
    data = data_1288(raw, loglevel=logging.WARNING).data
    # its own search for the peak starts in the flat tail of a fully clipped sensor
    return results_1288(data, index_u_ysat=int(np.argmax(data["temporal"]["s2_y"])), loglevel=logging.WARNING)


def gain_error(sensor):
    """Relative standard error of the gain: a line through 0 up to 70 % of the well, one dark variance for all."""
    level_e = LEVELS[LEVELS <= 0.7] * sensor.pixel.full_well_e
    dark = sensor.pixel.read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    common = (dark * level_e.sum()) ** 2 / (FRAMES - 1)
    return np.sqrt(2 / PIXELS * (common + np.sum((level_e * (level_e + dark)) ** 2))) / np.sum(level_e**2)


def number(result):
    return float(np.ravel(result() if callable(result) else result)[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["table1_pixel", "table1_output", "low_noise"])
def test_a_stranger_finds_the_gain_noise_and_patterns_that_were_put_in(name, emva):
    sensor = preset(name)
    pixel = sensor.pixel
    found = characterise(sensor, emva)
    of_gain = gain_error(sensor)
    # A chip's pattern holds as many draws as it has pixels; the mean of 32 frames leaves some temporal noise in it.
    dark_variance = pixel.read_noise_e**2 + sensor.gain_e_per_dn**2 / 12
    of_offset = (1 + dark_variance / FRAMES / pixel.dsnu_e**2) / np.sqrt(2 * PIXELS)
    of_read = dark_variance / pixel.read_noise_e**2 / np.sqrt(2 * PIXELS * (FRAMES - 1))
    half_well_e = 0.5 * pixel.full_well_e
    fixed = (pixel.prnu * half_well_e) ** 2
    # its PRNU is the spread at half the well less the dark's: offset and gain pattern correlate by chance
    whole = fixed + pixel.dsnu_e**2 + (half_well_e + dark_variance) / FRAMES
    of_prnu = np.sqrt(2 * whole**2 + 2 * pixel.dsnu_e**4) / (2 * fixed) / np.sqrt(PIXELS)
    for measured, true, error in (
        (found.K, 1 / sensor.gain_e_per_dn, of_gain),
        (found.sigma_d, pixel.read_noise_e, of_gain + of_read),
        (found.DSNU1288, pixel.dsnu_e, of_gain + of_offset),
        (found.PRNU1288, 100 * pixel.prnu, of_prnu),
    ):
        assert number(measured) == pytest.approx(true, rel=SIGMAS * error)
    # The standard's saturation is the peak of the variance: a level lower than the well by at most one step and three
    # spreads of the pixels there, since the converter's top cuts the variance as the first of them clip.
    spread_e = np.sqrt(pixel.full_well_e * (1 + pixel.prnu**2 * pixel.full_well_e) + dark_variance + pixel.dsnu_e**2)
    step_e = (LEVELS[1] - LEVELS[0]) * pixel.full_well_e
    assert -3 * spread_e - step_e < number(found.u_e_sat) - pixel.full_well_e < step_e
