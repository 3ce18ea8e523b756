"""Truth, metrics, exposure and budget: closed forms and independent implementations."""

from dataclasses import replace

import numpy as np
import pytest
from builders import transport_of
from outside_truth import colour_science

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.scene import LightGroup
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths, flat
from sensor.optics import form_image
from sensor.presets import low_noise
from sensor.readings.resolve import chip_readings
from sensor.readout import noise_variance
from sensor.response import channel_electrons, expected_electrons
from studies.metrics.appearance import picture_quality, psnr_db
from studies.metrics.truth import light_in_bands, named_light, neutral_electrons, shown_white_cd_m2, true_srgb
from studies.study.render_noise import monte_carlo_bound, monte_carlo_share

NM = DEFAULT_WAVELENGTH_NM
WIDTH = band_widths(NM)


def neutral_scene(luminance_cd_m2: float, light: str = "D65", shape: tuple[int, int] = (16, 16)) -> SpectralRadiance:
    values = illuminant(light).band_average(NM, WIDTH)
    scene = SpectralRadiance(np.broadcast_to(values, (*shape, NM.size)).astype(np.float64), NM, light=illuminant(light))
    return replace(scene, values=scene.values * (luminance_cd_m2 / scene.luminance()[0, 0]))


def test_neutral_is_white_in_the_truth_under_any_light() -> None:
    for light in ["D65", "A", "F11"]:
        truth = true_srgb(neutral_scene(50.0, light), light_in_bands(illuminant(light), NM, WIDTH), white_cd_m2=50.0)
        assert truth == pytest.approx(np.ones((16, 16, 3)), abs=1e-6), light


def test_known_scale_is_green_electrons_per_luminance() -> None:
    sensor, light = low_noise(), light_in_bands(illuminant("A"), NM, WIDTH)
    electrons = channel_electrons(form_image(neutral_scene(20.0, "A"), sensor), sensor, 0.01)
    assert 20.0 * neutral_electrons(sensor, light, 0.01) == pytest.approx(electrons[0, 0], rel=1e-9)


@pytest.mark.parametrize(("window_nm", "ends_nm"), [((380.0, 780.0), (380, 780)), ((350.2, 1000.7), (350, 1001))])
def test_a_named_light_is_in_whole_nanometres_side_by_side(
    window_nm: tuple[float, float], ends_nm: tuple[int, int]
) -> None:
    """Illuminant A by CIE 15's formula in each of them, and nothing of it lies half a nanometre off."""
    light = named_light("A", window_nm)
    edges_nm = np.arange(ends_nm[0], ends_nm[1] + 1.0)
    np.testing.assert_array_equal(light.wavelength_nm, (edges_nm[1:] + edges_nm[:-1]) / 2)
    np.testing.assert_array_equal(light.width_nm, np.diff(edges_nm))
    nm = light.wavelength_nm[(light.wavelength_nm > 380.0) & (light.wavelength_nm < 780.0)]
    by_formula = (560.0 / nm) ** 5 / np.expm1(1.435e7 / (2848.0 * nm))
    ratio = light.spectrum[np.searchsorted(light.wavelength_nm, nm)] / by_formula
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=1e-3)


def test_psnr_closed_form() -> None:
    assert psnr_db(np.full((4, 4, 3), 0.6), np.full((4, 4, 3), 0.5)) == pytest.approx(20.0)
    assert psnr_db(np.ones((2, 2, 3)), np.ones((2, 2, 3))) == np.inf


def test_delta_e_agrees_with_colour_science() -> None:
    rng, colour = np.random.default_rng(1), colour_science()
    first, second = rng.uniform(0.1, 0.9, (2, 16, 16, 3))
    d65 = np.array([0.3127, 0.3290])
    labs = [colour.XYZ_to_Lab(colour.sRGB_to_XYZ(picture), d65) for picture in (first, second)]
    theirs = colour.delta_E(*labs, method="CIE 2000")
    assert picture_quality(first, second).delta_e_median == pytest.approx(float(np.median(theirs)), rel=2e-3)
    assert picture_quality(first, second).delta_e_p95 == pytest.approx(float(np.percentile(theirs, 95)), rel=2e-3)


def test_monte_carlo_share_is_the_ratio_of_variances() -> None:
    # Halves with independent errors of 2 % make a mean with an error of 2 % / sqrt 2; the mean of 65 536 squares is
    # right to 0.6 %, so 3 % is five standard deviations.
    sensor, rng = low_noise(), np.random.default_rng(2)
    sensor = replace(sensor, lens=replace(sensor.lens, diffraction=0.0))  # which would even the errors out
    scene = neutral_scene(20.0, shape=(256, 256))
    halves = tuple(
        SpectralRadiance(scene.values * (1 + 0.02 * rng.standard_normal((256, 256, 1))), NM) for _ in range(2)
    )
    expected_e = expected_electrons(form_image(scene, sensor), sensor, 0.01)
    even, odd = (expected_electrons(form_image(half, sensor), sensor, 0.01) for half in halves)
    share = monte_carlo_share((even - odd) / 2, expected_e, sensor, 0.01)
    noise = expected_e + (0.01 * expected_e) ** 2 + 1.5**2 + 1.0 + sensor.gain_e_per_dn**2 / 12
    assert share == pytest.approx((0.02**2 / 2 * expected_e**2).mean() / noise.mean(), rel=0.03)


def test_unbiased_light_is_charged_its_mean_and_denoised_light_its_limit() -> None:
    """Half of the pixels at 400 e- whose blocks miss by 2 or 4 e-, half beyond the well."""
    sensor, exposure_s = low_noise(), 0.01
    saturated = np.arange(256) >= 128
    expected_e = np.broadcast_to(np.where(saturated, 2.0 * sensor.pixel.full_well_e, 400.0), (256, 256))
    missed_e = np.broadcast_to(np.where(np.arange(256) % 32 < 16, 2.0, 4.0), (256, 256))
    own, readings = noise_variance(expected_e, sensor, exposure_s)[0, 0], chip_readings(sensor, exposure_s)
    assert monte_carlo_bound(missed_e[None], expected_e, readings) == pytest.approx(10 / own)
    # 256 blocks: of those below the well half hold 4 and half 16, the others 0. Student's quantile of 255 is 1.651.
    blocks = np.concatenate([np.tile([4.0, 16.0], 64), np.zeros(128)]) * 2 / own
    limit = blocks.mean() + 1.651 * blocks.std(ddof=1) / 16
    both = np.stack([missed_e, missed_e])
    assert monte_carlo_bound(both, expected_e, readings) == pytest.approx(limit, rel=1e-3)
    opposed = np.stack([missed_e, -missed_e])  # never negative
    assert monte_carlo_bound(opposed, expected_e, readings) == 0.0
    assert monte_carlo_bound(both, np.full((256, 256), 1e9), readings) == 0.0


def test_a_lamp_in_the_picture_does_not_set_the_white() -> None:
    """Nor does its rim: there the surface counts, as far as it is seen."""
    scene = neutral_scene(9.0)
    coverage = np.zeros((1, 16, 16), np.float32)
    coverage[0, :4, :4], coverage[0, :4, 4] = 1.0, 0.3
    lamp = Spectrum(np.array([300.0, 1100.0]), np.array([1e4, 1e4]))
    planes = (np.moveaxis(scene.values, -1, 0) / 1e4 + coverage).astype(np.float32)[None]
    lit = transport_of(planes, {"lamp": LightGroup(("lamp",), lamp)}, NM, scene.widths_nm, seen=coverage)
    assert shown_white_cd_m2(lit, None) == pytest.approx(10.0, rel=1e-4)


def test_white_is_the_percentile_of_the_area_that_shows_no_light() -> None:
    """Hundred greys of 1 to 100 cd/m^2: the 99th percentile is 99, at 90 % of white."""
    unit = neutral_scene(1.0, shape=(10, 10))
    planes = (np.moveaxis(unit.values, -1, 0) * np.arange(1, 101).reshape(10, 10)).astype(np.float32)[None]
    lit = transport_of(planes, {"sky": LightGroup(("sky",), flat())}, NM, unit.widths_nm)
    assert shown_white_cd_m2(lit, None) == pytest.approx(99 / 0.9, rel=1e-5)
