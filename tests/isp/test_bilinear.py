"""Bilinear demosaicking: flat fields, ramps and impulses."""

from itertools import product

import numpy as np
import pytest
from builders import BAYER_PHASES, raw_image

from isp.planes import bilinear
from sensor.cfa import BAYER, MOSAICS
from sensor.raw import RawImage


def raw(dn: np.ndarray, cfa: tuple[str, ...]) -> RawImage:
    return raw_image(dn, cfa, black_dn=0.0, white_dn=65535.0, read_noise_e=2.0)


def test_ramp_is_reproduced_in_the_interior_and_an_even_field_everywhere() -> None:
    rows, columns = np.indices((12, 14))
    ramp = 10 * rows + 4 * columns + 100
    for cfa in BAYER_PHASES:
        assert bilinear(raw(ramp, cfa))[2:-2, 2:-2] == pytest.approx(np.repeat(ramp[2:-2, 2:-2, None], 3, axis=2)), cfa
        for shape in ((2, 2), (7, 9)):
            assert bilinear(raw(np.full(shape, 1000), cfa)) == pytest.approx(np.full((*shape, 3), 1000.0), rel=1e-12)


def test_red_impulse_spreads_with_quarter_weights() -> None:
    dn = np.zeros((8, 8))
    dn[4, 4] = 800  # a red site of RG/GB
    red = bilinear(raw(dn, BAYER))[3:6, 3:6, 0]
    assert red == pytest.approx(800 * np.array([[0.25, 0.5, 0.25], [0.5, 1.0, 0.5], [0.25, 0.5, 0.25]]))


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
