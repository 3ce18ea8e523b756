"""Colours that know what was measured of a processor's planes: closed forms, and the table against bilinear's."""

import numpy as np
import pytest
from builders import mosaic_of, raw_image

from isp.colour.colour_fit import LEAST_SIGNAL, ColourFit, fit_colours
from isp.colour.noise_gains import TABLE, NoiseGains, colours_in_noise, mean_snr, measured_gains
from isp.colour.white_balance import WhiteBalance
from isp.processors.catalogue import PROCESSORS
from isp.processors.network import NAMES
from render.illuminants import illuminant
from render.spectrum import DEFAULT_WAVELENGTH_NM
from rodcone.toml_file import read_toml
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import BAYER
from sensor.curves import rgbw
from sensor.raw import RawImage

NM = DEFAULT_WAVELENGTH_NM
LIGHT = illuminant("D65").band_average(NM, np.full(NM.size, 10.0))
SURFACES = np.array([np.interp(NM, curve.wavelength_nm, curve.values) for _, curve in color_checker_reflectances()])
NEUTRAL = np.array([0.5, 1.0, 0.4])  # of R, G, B
DARK2 = 1.0 + 1.0 + 1 / 12  # of `raw_image` [e-^2]
FLAT = NoiseGains(np.array([0.0]), np.array([[0.5, 0.6, 0.7]]))


@pytest.fixture(scope="module")
def fit() -> ColourFit:
    names = ("R", "G", "B", "W")
    return fit_colours(names, rgbw().band_average(names, NM, np.full(NM.size, 10.0)), NM, LIGHT, SURFACES)


def grey(green_e: float) -> RawImage:
    """Noise-free Bayer exposure of a grey whose green collects `green_e`; white lies at 15 000 e-."""
    levels = dict(zip("RGB", np.rint(green_e * NEUTRAL), strict=True))
    return raw_image(mosaic_of(levels, BAYER, (16, 16)) + 100, BAYER)


def test_gains_are_linear_in_decibels_and_hold_at_the_ends() -> None:
    gains = NoiseGains(np.array([0.0, 20.0]), np.array([[1.0, 2.0, 4.0], [3.0, 2.0, 0.0]]))
    assert gains.at(np.sqrt(10.0)) == pytest.approx([2.0, 2.0, 2.0])
    assert gains.at(0.0) == pytest.approx([1.0, 2.0, 4.0])
    assert gains.at(1e9) == pytest.approx([3.0, 2.0, 0.0])


def test_the_matrix_is_wieners_at_the_noise_of_a_grey_frame(fit: ColourFit) -> None:
    raw = grey(200.0)
    assert mean_snr(raw, "G") == pytest.approx((200.0, 200.0 / np.sqrt(200.0 + DARK2)))
    white_e = 200.0 / fit.mean[1]
    noise = (200.0 * NEUTRAL + DARK2) / NEUTRAL**2 * [0.5, 0.6, 0.7] / white_e**2
    for balance in (WhiteBalance(neutral=NEUTRAL), WhiteBalance(neutral=np.ones(3), given=NEUTRAL)):
        found = colours_in_noise(raw, fit, balance, "G", FLAT)
        assert found.matrix() == pytest.approx(fit.matrix(noise=noise), rel=1e-9)
        assert np.abs(found.matrix() - fit.matrix()).max() > 0.05


def test_no_gain_is_the_plain_matrix_and_a_matrix_of_numbers_stays(fit: ColourFit) -> None:
    none = NoiseGains(np.array([0.0]), np.zeros((1, 3)))
    balance = WhiteBalance(neutral=NEUTRAL)
    np.testing.assert_array_equal(colours_in_noise(grey(200.0), fit, balance, "G", none).matrix(), fit.matrix())
    np.testing.assert_array_equal(
        colours_in_noise(grey(200.0), ColourFit.of(np.eye(3)), balance, "G", FLAT).matrix(), np.eye(3)
    )


def test_a_frame_without_light_is_all_noise_and_finite(fit: ColourFit) -> None:
    for offset in [0, -5]:
        raw = raw_image(np.full((16, 16), 100 + offset), BAYER)
        found = colours_in_noise(raw, fit, WhiteBalance(), "G", FLAT)
        noise = np.diag(found.moments - fit.moments)
        assert noise.max() == pytest.approx(LEAST_SIGNAL**-2, rel=1e-6), offset
        assert found.matrix().sum(axis=1) == pytest.approx(1.0, abs=1e-6), offset
        # all channels alike but for their noise: one weight for each, whatever the colour
        assert np.ptp(found.matrix(), axis=0) == pytest.approx(0.0, abs=1e-3), offset


def test_the_table_holds_what_bilinear_interpolation_leaves_of_noise_in_the_dark() -> None:
    # R and B: of four sites one keeps its sample's variance, two halve it, one quarters it. G: half of the sites keep
    # it, half quarter it. In the dark blur is nothing beside noise; PRNU and the device's patterns stay within 5 %.
    errors = read_toml(TABLE)["processors"]["bayer_bilinear"]["errors"][0]
    assert errors == pytest.approx([0.5625, 0.625, 0.5625], rel=0.05)


def test_the_table_is_in_order_and_of_processors_that_are_there() -> None:
    for name, gains in measured_gains().items():
        assert name in NAMES or PROCESSORS[name].noise_gains is not None
        assert gains.gains.shape == (len(gains.snr_db), 3)
        assert (np.diff(gains.snr_db) > 0).all()
        assert (gains.gains >= 0).all()


def test_the_processor_takes_the_gains_and_the_papers_reference_does_not(fit: ColourFit) -> None:
    rng = np.random.default_rng(3)
    raw = raw_image(rng.poisson(20.0, (32, 32)) + 100, BAYER)
    plain, fair = (
        PROCESSORS[name].develop(raw, fit, neutral=NEUTRAL, balance=NEUTRAL) for name in ("bayer", "bayer_bilinear")
    )
    colours = colours_in_noise(raw, fit, WhiteBalance(NEUTRAL, NEUTRAL), "G", measured_gains()["bayer_bilinear"])
    # the matrix is the last step: back through one and on through the other
    expected = plain.rgb @ np.linalg.inv(fit.matrix()).T @ colours.matrix().T
    assert fair.rgb == pytest.approx(expected, abs=1e-9)
    assert fair.rgb.std() < 0.7 * plain.rgb.std()
