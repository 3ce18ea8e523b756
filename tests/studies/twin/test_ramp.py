"""A ramp that columns share: found in frames that independent code draws, and not where there is none."""

import numpy as np
import pytest

from studies.twin.ramp import ramp_of

SHAPE, K, OFFSET_DN, READ_DN = (64, 1024), 0.02, 10.0, 0.3
LIGHTS_DN = np.linspace(30.0, 180.0, 12)
RNG = np.random.default_rng(77)
RESPONSE = 1 + 0.012 * RNG.standard_normal(SHAPE)


def frame(signal_dn, step_dn, rise):
    """Draw a frame whose rows are read one column after the other, from dim to bright."""
    electrons = RNG.poisson(signal_dn / K * RESPONSE)
    signals = OFFSET_DN + K * electrons + RNG.normal(0, READ_DN, SHAPE)
    order = np.argsort(signals, axis=1)
    rows = np.arange(SHAPE[0])
    read = np.empty(SHAPE)
    signal, reading = signals[rows, order[:, 0]], signals[rows, order[:, 0]]
    read[rows, order[:, 0]] = reading
    for converted in range(1, SHAPE[1]):
        after = signals[rows, order[:, converted]]
        reading = reading + (after - signal + step_dn / SHAPE[1]) / (1 + rise * converted / SHAPE[1])
        read[rows, order[:, converted]], signal = reading, after
    return np.clip(np.rint(read), 0, 255).astype(np.uint8)


def found(step_dn, rise):
    pairs = [[frame(light, step_dn, rise) for _ in range(2)] for light in LIGHTS_DN]
    flat = np.mean([frame(120.0, step_dn, rise) for _ in range(8)], axis=0)
    return ramp_of(pairs, [frame(0.0, step_dn, rise) for _ in range(2)], flat, 255.0)


def test_step_rise_and_gain_of_a_ramp_are_found():
    ramp = found(0.7, 0.25)
    assert ramp.step_dn == pytest.approx(0.7, abs=0.15)
    assert ramp.rise == pytest.approx(0.25, abs=0.04)
    assert ramp.gain_dn_per_e == pytest.approx(K, rel=0.04)
    assert ramp.left < 0.6 * ramp.before


def test_there_is_no_ramp_where_columns_convert_by_themselves():
    assert found(0.0, 0.0) is None
