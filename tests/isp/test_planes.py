"""Planes: kept samples, tents and the noise they leave."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, RGBW_4X4, raw_image
from numpy.polynomial.hermite_e import hermegauss
from scipy.stats import poisson

from isp.anscombe import LEAST_PRNU, stabilise, stabilise_raw, unstabilise, unstabilise_raw, without_prnu
from isp.planes import bilinear, fill, tent_radius
from sensor.calibration import ChannelNoise, NoiseStep
from sensor.capture import expose
from sensor.cfa import BAYER, MOSAICS, RGBW
from sensor.device import draw_device
from sensor.presets import preset
from sensor.raw import RawImage

SPARSE = ("RGGG", "GGGG", "GGGG", "GGGG")


def test_impulse_spreads_as_the_tent_and_samples_are_kept():
    values = np.zeros((6, 6))
    values[3, 3] = 4.0  # W of the tile
    expected = np.zeros((6, 6))
    expected[2:5, 2:5] = [[1, 2, 1], [2, 4, 2], [1, 2, 1]]
    expected[2:5, 5] = 0.0  # each is half-way between two samples, or at one
    assert np.array_equal(fill(values, RGBW, "W"), expected)


def test_tent_has_the_smallest_radius_that_reaches_a_sample():
    sites = ((RGBW, "W"), (BAYER, "G"), (RGBW_4X4, "W"), (SPARSE, "R"), (("R",), "R"))
    assert [tent_radius(*site) for site in sites] == [1, 1, 1, 2, 0]


def test_stabilised_noise_has_unit_variance() -> None:
    for mean_e, prnu in product([20.0, 300.0, 8000.0], [0.0, 0.017, 0.1]):
        rng = np.random.default_rng(7)
        response = 1.0 + prnu * rng.standard_normal((400, 400))
        electrons = rng.poisson(mean_e * np.maximum(response, 0.0)) + rng.normal(0.0, 3.0, (400, 400))
        # 160 000 samples: the variance's standard error is 0.35 %; 5 of them and 1 % for the transform's own error,
        # which a relative noise p adds to by some p^2 (the curvature of a logarithm).
        bound = 0.028 + prnu**2 * 3
        assert stabilise(electrons, 3.0, prnu).var() == pytest.approx(1.0, abs=bound), (prnu, mean_e)


def test_without_prnu_it_is_anscombes_and_a_little_changes_little() -> None:
    electrons = np.array([0.0, 5.0, 100.0, 1e4, 1e6])
    expected = 2 * np.sqrt(electrons + 0.375 + 9.0)
    assert stabilise(electrons, 3.0, 0.0) == pytest.approx(expected, rel=1e-12)
    least = stabilise(electrons, 3.0, LEAST_PRNU)  # less a constant that the distance of patches doesn't see
    assert least - least[0] == pytest.approx(expected - expected[0], rel=2e-3)


def test_single_precision_holds_its_digits() -> None:
    electrons = np.linspace(-20.0, 15000.0, 10_000)
    single = stabilise(electrons.astype(np.float32), 2.0, 0.017)
    assert single.dtype == np.float32
    assert single == pytest.approx(stabilise(electrons, 2.0, 0.017), abs=5e-5)


def test_stabilised_mosaic_is_0_far_under_black() -> None:
    for prnu in [0.0, 0.017]:
        assert np.array_equal(stabilise(np.full((2, 2), -100.0), 3.0, prnu), np.zeros((2, 2))), prnu


# Bilinear demosaicking: flat fields, ramps and impulses.


def raw(dn: np.ndarray, cfa: tuple[str, ...]) -> RawImage:
    return raw_image(dn, cfa, black_dn=0.0, white_dn=65535.0, read_noise_e=2.0)


def test_ramp_is_reproduced_in_the_interior_and_an_even_field_everywhere() -> None:
    rows, columns = np.indices((12, 14))
    ramp = 10 * rows + 4 * columns + 100
    for cfa in BAYER_PHASES:
        assert bilinear(raw(ramp, cfa))[2:-2, 2:-2] == pytest.approx(np.repeat(ramp[2:-2, 2:-2, None], 3, axis=2)), cfa
        for shape in ((2, 2), (7, 9)):
            assert bilinear(raw(np.full(shape, 1000), cfa)) == pytest.approx(np.full((*shape, 3), 1000.0), rel=1e-12)


def test_green_impulse_reaches_its_four_neighbours() -> None:
    dn = np.zeros((8, 8))
    dn[4, 3] = 800  # a green site of RG/GB
    green = bilinear(raw(dn, BAYER))[3:6, 2:5, 1]
    assert green == pytest.approx(800 * np.array([[0.0, 0.25, 0.0], [0.25, 1.0, 0.25], [0.0, 0.25, 0.0]]))


def test_samples_at_unequal_distance_weigh_by_a_tent() -> None:
    """On a tile of two by two all samples within reach lie equally far; on four by four the nearest weigh most."""
    cfa, generator = MOSAICS["rgbw_4x4"], np.random.default_rng(3)
    image = raw(generator.integers(1, 60_000, (12, 12)), cfa)
    red = bilinear(image)[..., 0]
    for row, column in product(range(4, 8), range(4, 8)):
        total = weight = 0.0
        for down, across in product(range(-2, 3), range(-2, 3)):
            if cfa[(row + down) % 4][(column + across) % 4] == "R":
                here = (3 - abs(down)) * (3 - abs(across))
                total, weight = total + here * image.electrons[row + down, column + across], weight + here
        own = cfa[row % 4][column % 4] == "R"
        assert red[row, column] == pytest.approx(image.electrons[row, column] if own else total / weight, rel=1e-12)


# The unbiased inverse against the transform's exact mean, by summing over Poisson and integrating over the normal.


NODES, WEIGHTS = hermegauss(60)
WEIGHTS = WEIGHTS / WEIGHTS.sum()


def mean_of_transform(electrons: float, noise_e: float) -> float:
    """E[2 sqrt(max(N + noise + 3/8 + noise_e^2, 0))] for N of this Poisson mean."""
    counts = np.arange(poisson.ppf(1e-14, electrons), poisson.ppf(1 - 1e-14, electrons) + 1)
    inside = counts[:, None] + noise_e * NODES + 0.375 + noise_e**2
    return float(poisson.pmf(counts, electrons) @ (2 * np.sqrt(np.maximum(inside, 0.0)) @ WEIGHTS))


def test_the_mean_comes_back() -> None:
    # The closed form is an approximation, of the Gaussian noise's part above all. A thirtieth of one sample's noise is
    # what averaging a thousand samples leaves: no denoiser here sees the difference.
    for electrons, noise_e in product((0.5, 2.0, 10.0, 100.0, 1000.0), (0.0, 1.5, 5.0, 20.0)):
        error = float(unstabilise(np.array([mean_of_transform(electrons, noise_e)]), noise_e)[0]) - electrons
        assert abs(error) <= np.hypot(np.sqrt(electrons), noise_e) / np.sqrt(1000), (electrons, noise_e)


def test_the_algebraic_inverse_would_be_a_quarter_of_an_electron_low() -> None:
    stable = mean_of_transform(200.0, 0.0)
    assert stable**2 / 4 - 0.375 == pytest.approx(199.75, abs=2e-3)
    # the closed form's own term in 1 / root is still 0.011 e- here, and is most of what it is wrong by
    assert unstabilise(np.array([stable]), 0.0)[0] == pytest.approx(200.0, abs=0.011)


def test_the_transforms_least_value_is_no_light() -> None:
    assert unstabilise(np.array([2 * np.sqrt(0.375), 0.0]), 0.0) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_pieces_of_merged_readings_meet_and_rise() -> None:
    sensor = preset("split_pixel")
    device = draw_device(sensor, (4, 4), np.random.default_rng(1))
    raw = expose(np.full((4, 4), 9.0), sensor, 0.01, device, np.random.default_rng(2))
    light = np.geomspace(0.1, 0.9 * raw.full_well_e, 20_001)
    stable = stabilise_raw(light, raw)
    assert (np.diff(stable) > 0).all()
    for step in raw.noise_steps:
        below, above = stabilise_raw(step.from_e * np.array([1 - 1e-9, 1 + 1e-9]), raw)
        assert above - below < 1e-5
    single = stabilise_raw(light.astype(np.float32), raw)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, stable, atol=2e-3)
    dark = light[light < raw.noise_steps[0].from_e]
    np.testing.assert_array_equal(stable[: dark.size], stabilise(dark, raw.dark_noise_e, raw.prnu))


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["dual_gain", "split_pixel", "staggered"])
def test_the_mean_of_merged_readings_comes_back_in_every_range_of_light(name: str) -> None:
    """What a denoiser that averages stabilised samples gives, beside the mean of the samples themselves."""
    sensor, shape = preset(name), (256, 256)
    sensor = replace(sensor, pixel=replace(sensor.pixel, prnu=0.0))
    device = draw_device(sensor, shape, np.random.default_rng(1))
    for light in np.geomspace(20.0, 0.8 * sensor.pixel.full_well_e, 12):
        raw = expose(np.full(shape, light), sensor, 0.01, device, np.random.default_rng([2, int(light)]))
        plain = without_prnu(raw)
        stable = stabilise_raw(raw.electrons, plain)
        at_a_seam = min(abs(raw.electrons.mean() / step.from_e - 1) for step in raw.noise_steps) < 0.1
        # 1.7 % is three standard errors; the steps of the noise are within a third of a decibel, 3.9 %
        assert at_a_seam or abs(stable.std() - 1) < 0.039 + 0.017
        error_e = float(unstabilise_raw(np.array([stable.mean()]), plain)[0]) - raw.electrons.mean()
        assert at_a_seam or abs(error_e) < raw.electrons.std() / np.sqrt(1000)  # as of one reading
    # sample by sample: 3/8 - 1/8 e- before the first step, k / 4 beyond one
    levels = np.geomspace(50.0, 0.9 * raw.full_well_e, 5001)
    back = unstabilise_raw(stabilise_raw(levels, plain), plain)
    most = max(0.25, *(step.shot / 4 for step in plain.noise_steps))
    assert np.abs(back - levels).max() < 1.1 * most


@pytest.mark.thorough
def test_columns_gains_on_dark_current_are_in_the_transforms() -> None:
    """Of c^2 (e + D)^2 the term 2 c^2 D e grows with the light: k = 1 + 2 c^2 D is 1.22 here."""
    spread, dark_e, count = 0.05, 44.0, 200_000
    at_black = {"read_noise_e": np.hypot(3.0, np.sqrt(dark_e)), "dsnu_e": spread * dark_e, "dark_current_e": dark_e}
    steps = (NoiseStep(400.0, 2.0, at_black["read_noise_e"], at_black["dsnu_e"], 0.02),)
    for mean_e in (25.0, 100.0):
        rng = np.random.default_rng(7)
        gain = 1.0 + spread * rng.standard_normal((2, count))  # each pixel is a column of its own
        electrons = gain * rng.poisson(mean_e + dark_e, gain.shape) - dark_e + rng.normal(0.0, 3.0, gain.shape)
        raw = raw_image(electrons + 1000.0, BAYER, black_dn=1000.0, gain_e_per_dn=1.0, prnu=spread, **at_black)
        raw = replace(raw, dn=electrons + 1000.0, column_gain_spread=spread)
        # 400 000 samples: the variance's standard error is 0.22 %; 5 of them and 1.4 % for the transform's own error
        assert stabilise_raw(raw.electrons, raw).var() == pytest.approx(1.0, abs=0.025)
        channel = ChannelNoise("G", 1e5, 1.0, at_black["read_noise_e"], at_black["dsnu_e"], spread, dark_e)
        apart = replace(raw, channel_noise=(channel,))
        assert stabilise_raw(apart.electrons, apart) == pytest.approx(stabilise_raw(raw.electrons, raw), abs=1e-12)
        plain = without_prnu(replace(raw, noise_steps=steps))
        level = np.full((2, 2), 300.0)
        assert unstabilise_raw(stabilise_raw(level, plain), plain) == pytest.approx(level + 0.25 * 1.22, abs=0.01)
        assert raw.noise_of("R").shot == pytest.approx(1.22)
        seam = [stabilise_raw(np.full((2, 2), value), plain)[0, 0] for value in (400.0 - 1e-6, 400.0)]
        assert seam[1] - seam[0] == pytest.approx(0.0, abs=1e-6)
        slopes = [np.diff([stabilise_raw(np.full((2, 2), x), plain)[0, 0] for x in (900.0, 901.0)])[0]]
        law = replace(steps[0].law, shot=2.0 + 0.22, prnu=0.0)
        assert slopes[0] == pytest.approx(law.variance(np.array(900.5 + 0.375 / 2.22)) ** -0.5, rel=1e-3)
