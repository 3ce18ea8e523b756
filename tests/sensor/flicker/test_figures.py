"""IEEE 2020's flicker figures against the definitions, taken over many starts."""

import numpy as np
import pytest

from sensor.flicker.figures import flicker_figures
from sensor.flicker.waveform import Waveform, pwm

LAMPS = {
    "sodium": Waveform(100.0, 0.95),
    "fluorescent": Waveform(120.0, 0.284),
    "pwm": pwm(100.0, 0.3),
    "triangle": Waveform(90.0, places=(0.0, 0.3, 1.0), levels=(0.2, 2.0, 0.2)),
    "sawtooth": Waveform(50.0, places=(0.0, 1.0), levels=(0.0, 2.0)),
}


@pytest.mark.parametrize("name", LAMPS)
@pytest.mark.parametrize("exposure_s", [0.0007, 0.003, 0.0083, 0.0141, 0.05])
@pytest.mark.parametrize("tolerance", [0.1, 0.35])
def test_closed_forms_are_the_definitions_over_all_starts(name, exposure_s, tolerance):
    lamp = LAMPS[name]
    light = lamp.mean(np.linspace(0, lamp.period_s, 200_001)[:-1], exposure_s)
    figures = flicker_figures(lamp, exposure_s, tolerance)
    index = (light.max() - light.min()) / (light.max() + light.min())
    assert figures.modulation_index == pytest.approx(index, abs=1e-5)
    share = (np.abs(light - 1) <= tolerance + 1e-9).mean()
    assert figures.mitigation_probability == pytest.approx(share, abs=2e-4)


def test_a_pulse_on_paper():
    """1 ms of a lamp lit for 3 ms of 10: full (10/3 of the mean) or dark, and between these for 1 ms at each edge."""
    figures = flicker_figures(pwm(100.0, 0.3), 0.001)
    assert figures.modulation_index == pytest.approx(1.0)
    # Within 0.9 to 1.1 of the mean for 0.2 / (10/3) of each edge's millisecond.
    assert figures.mitigation_probability == pytest.approx(2 * 0.06 * 0.1, rel=1e-9)


def test_whole_periods_are_mitigated():
    for lamp in LAMPS.values():
        figures = flicker_figures(lamp, 2 * lamp.period_s)
        assert (figures.modulation_index, figures.mitigation_probability) == (0.0, 1.0)
