"""One pixel's noise written out on paper, and the law that every user of it reads."""

from dataclasses import replace

import numpy as np
import pytest
from builders import EVERY_TERM

from sensor.noise_law import NoiseLaw, total
from sensor.presets import low_noise, preset
from sensor.readings.resolve import chip_readings, resolve
from sensor.readout import noise_sources, noise_variance

BUSY = replace(low_noise(), pixel=replace(low_noise().pixel, **EVERY_TERM))


def test_a_law_is_its_formula_and_laws_of_independent_noises_add() -> None:
    mean_e = np.array([0.0, 1.0, 100.0])
    one, other = NoiseLaw(1.0, 3.0, 4.0, 0.01), NoiseLaw(2.0, 12.0, 3.0, 0.02)
    assert one.variance(mean_e) == pytest.approx([25.0, 26.0001, 126.0])
    assert one.slope(mean_e) == pytest.approx([1.0, 1.0002, 1.02])
    assert total([one, other]).variance(mean_e) == pytest.approx(one.variance(mean_e) + other.variance(mean_e))
    # a sample over its share: everything the sample does, over the share's square
    assert one.over(0.25).variance(4 * mean_e) == pytest.approx(16 * one.variance(mean_e))
    assert one.variance(mean_e.astype(np.float32)).dtype == np.float32


def test_a_pixel_with_every_term_has_the_variance_that_is_written_out_here() -> None:
    """Photo-electrons, dark current and hot pixels are counted; the column's factor multiplies all of it."""
    light, time_s = 700.0, 0.1
    dark, hot, share = 200.0 * time_s, 500.0 * time_s, 0.05
    collected = light + dark + share * hot + share * (1 - share) * hot**2 + (0.02 * light) ** 2
    mean = light + dark + share * hot
    variance = collected + 0.01**2 * (collected + mean**2) + 4.0**2 + 2.0**2 + 3.0**2 + BUSY.gain_e_per_dn**2 / 12
    assert noise_variance(np.full((1, 1), light), BUSY, time_s) == pytest.approx(variance, rel=1e-12)
    assert sum(x**2 for x in noise_sources(light, BUSY, time_s).values()) == pytest.approx(variance, rel=1e-12)
    (reading,) = resolve(BUSY, np.full((1, 1), light), time_s)
    assert reading.dark_e == pytest.approx(mean - light)
    # Without Poisson's draw the counted electrons' own variance, times the column's factor, is gone.
    still = replace(reading, poisson=0.0).law.variance(np.array([light]))
    assert still == pytest.approx(variance - (1 + 0.01**2) * mean, rel=1e-12)


def test_readings_of_a_chip_are_plain_cameras_with_their_shares() -> None:
    large_high, large_low, small = chip_readings(preset("split_pixel"), 0.02)
    assert large_high.charge == large_low.charge != small.charge
    assert small.share == pytest.approx(1 / 11)
    assert small.full_well_e == pytest.approx(7900 * 11)
    assert small.headroom_e == pytest.approx(7900 * 11 - 29.8 * 0.02)
    assert small.law.shot == pytest.approx(11)
    assert [x.patterns for x in (large_high, large_low, small)] == [0, 1, 2]
    plain, white = chip_readings(preset("white_apart"), 0.02)
    assert (plain.sites, white.sites, white.time_share) == ("RGB", "W", 1.0)
