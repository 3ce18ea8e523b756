"""Steps between light levels, and a frame in which W tells nothing."""

import numpy as np
import pytest

from isp.similarity.guide import saturated_fraction
from sensor.cfa import mask
from studies.paper.early import colour_noise, gathered, range_db
from studies.paper.levels import LEVELS_CD_M2, largest_step, without_white
from studies.paper.patches import noisy_edge
from studies.paper.setup import sensor_of


def test_largest_step_is_the_surest_one_and_counts_in_its_direction() -> None:
    values = np.zeros((40, 3))
    values[10:] = -2.0  # a fall of 2 for certain
    values[20:] += [9.0, -3.0, 0.0]  # a rise of 2 on average, which scatters
    level, step = largest_step(values, -1.0)
    assert level == LEVELS_CD_M2[10]
    assert step == pytest.approx(2.0)
    assert largest_step(values, 0.0)[0] == LEVELS_CD_M2[10]
    assert largest_step(values, 1.0)[1].mean() < 2.0 + 1e-12


def test_a_frame_without_white_has_alpha_1_and_its_colours() -> None:
    raw = noisy_edge("table1_output")
    bare = without_white(raw)
    sites = mask(raw.cfa, "W", raw.shape)
    np.testing.assert_array_equal(saturated_fraction(bare), 1.0)
    np.testing.assert_array_equal(bare.dn[~sites], raw.dn[~sites])


@pytest.mark.sample(1)
@pytest.mark.parametrize("mosaic", ["rgbw", "rgbw_nd", "cmyw"])
def test_dynamic_range_read_out_is_that_of_the_closed_form(mosaic: str) -> None:
    closed, measured = range_db(sensor_of("table1_output", mosaic))
    # SNR from 256^2 pixels at an SNR of 1: its error is 0.5 %, 5 of them 0.22 dB.
    assert measured == pytest.approx(closed, abs=0.3)


@pytest.mark.thorough
def test_matching_w_to_g_costs_just_what_w_gathers_more() -> None:
    rgbw, matched = (range_db(sensor_of("table1_pixel", mosaic))[0] for mosaic in ("rgbw", "rgbw_nd"))
    assert rgbw - matched == pytest.approx(20 * np.log10(4.88), abs=0.02)  # W over G under D65


@pytest.mark.parametrize("processor", ["cmyw_yamagami_published", "rgbw_sato_published"])
def test_colour_noise_read_out_is_that_of_the_closed_form(processor: str) -> None:
    closed, measured = colour_noise("table1_output", processor, 2.5)
    # variance of 2^16 pixels of three channels: relative error of the deviation under 0.4 %, 5 of them
    assert measured == pytest.approx(closed, rel=0.02)


def test_light_of_combined_samples_is_their_number_times_the_colours_share() -> None:
    for closed, measured in gathered(("RG", "BW")).values():
        # neighbours share samples: 2^16 pixels are worth about a fiftieth; 5 standard errors of a variance
        assert measured == pytest.approx(closed, rel=5 * np.sqrt(2 / (2**16 / 50)))
    assert gathered(("RG", "BW"))["R"][0] == pytest.approx(0.86, abs=0.02)
