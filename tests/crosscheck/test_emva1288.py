"""The sensor as a stranger measures it: EMVA Standard 1288 by the independent `emva1288` package (PyPI, LGPL-3.0)."""

import logging
import warnings

import numpy as np
import pytest

from sensor.emva1288.characterise import measure_camera, plan_for
from sensor.emva1288.photon_transfer import light_bench
from sensor.presets import preset

SHAPE = (240, 320)
EXPOSURE_S = 0.01

PRESETS = ("table1_pixel", "table1_output", "low_noise")


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


def number(result):
    return float(np.ravel(result() if callable(result) else result)[0])


@pytest.mark.thorough
@pytest.mark.parametrize("name", PRESETS)
def test_our_procedure_finds_what_the_stranger_finds_in_the_same_frames(name, emva):
    data_1288, results_1288, sums = emva
    sensor = preset(name)
    chip, taken = light_bench(sensor, SHAPE, 2), {}

    def expose(light_e, exposure_s):
        taken.setdefault((light_e, exposure_s), []).append(chip(light_e, exposure_s))
        return taken[light_e, exposure_s][-1]

    plan = plan_for(sensor, EXPOSURE_S)
    own = measure_camera(expose, plan, sensor)
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
