"""Relighting, on small transports written by hand: linearity to the bit, levels, errors. Nothing is rendered."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from builders import transport_of
from loop import loop
from refusal import refusal

from render.error_estimates import Halves, SharedPaths
from render.illuminants import illuminant, spectral_luminance
from render.level import Irradiance, SceneMeans
from render.scene import LightGroup
from render.spectrum import Spectrum, flat, luminance
from studies.study.lit_scene import asked_spectra

NM, WIDTH_NM = np.arange(400.0, 701.0, 50.0), np.full(7, 50.0)
SIZE = (5, 6)
RAMP = Spectrum(np.array([300.0, 900.0]), np.array([0.1, 2.0]))


def transport(radiance=None, *, seed=0, seen=None, irradiance=..., **changes):
    """Two groups of random radiance, half differences that leave both halves positive, no light in view."""
    rng = np.random.default_rng(seed)
    drawn = rng.lognormal(0.0, 2.0, (2, NM.size, *SIZE)).astype(np.float32)
    radiance = drawn if radiance is None else radiance.astype(np.float32)
    made = transport_of(
        radiance,
        {"sky": LightGroup(("sky",), illuminant("D65"), 100.0), "lamp": LightGroup(("lamp",), RAMP, 0.3)},
        NM,
        WIDTH_NM,
        light=Halves(radiance, (radiance * rng.uniform(-0.5, 0.5, radiance.shape)).astype(np.float32)),
        variance=(radiance * rng.uniform(0.0, 0.1, radiance.shape)).astype(np.float32) ** 2,
        seen=seen,
        irradiance=rng.uniform(1.0, 4.0, (2, NM.size)) if irradiance is ... else irradiance,
    )
    return replace(made, **changes)


def ulps(a, b):
    """Largest distance in units of the last place of float32."""
    return float((np.abs(a.astype(np.float64) - b) / np.spacing(np.abs(b).astype(np.float32))).max())


POWERS_OF_TWO = [2.0**-20, 0.5, 2.0, 2.0**15]


@loop("factor", POWERS_OF_TWO)
def test_a_level_higher_by_a_power_of_two_gives_bit_equal_radiance(factor):
    made = transport()
    one = made.relight(luminance_cd_m2=3.7).values
    assert np.array_equal(made.relight(luminance_cd_m2=3.7 * factor).values, one * np.float32(factor))
    lux = made.relight(illuminance_lux=11.0).values
    assert np.array_equal(made.relight(illuminance_lux=11.0 * factor).values, lux * np.float32(factor))


def test_relit_radiance_is_emission_times_transport_rounded_once():
    made = transport()
    emission = np.stack([factor * RAMP.band_average(NM, WIDTH_NM) for factor in (700.0, 0.3)])
    expected = np.einsum("gb,gbhw->hwb", emission, made.radiance.astype(np.float64))
    assert ulps(made.relight({"sky": RAMP * 7.0}).values, expected) <= 0.5 + 1e-6


def test_a_spectrum_given_replaces_the_groups_own_and_a_name_stands_for_a_light():
    made = transport()
    by_name = made.relight({"sky": "A"}, powers={"lamp": 0.0}).values
    by_value = made.relight({"sky": illuminant("A")}, powers={"lamp": 0.0}).values
    assert np.array_equal(by_name, by_value)
    ratio = by_name / made.relight(powers={"lamp": 0.0}).values
    expected = illuminant("A").band_average(NM, WIDTH_NM) / illuminant("D65").band_average(NM, WIDTH_NM)
    assert ratio == pytest.approx(np.broadcast_to(expected, ratio.shape), rel=1e-6)


@loop("level", [0.036, 25.0, 1e5])
def test_the_mean_luminance_asked_for_is_that_of_what_is_no_light(level):
    """A lamp fills two pixels and an eighth of a third, in which the wall goes on: the wall's light over its area."""
    seen = np.zeros((2, *SIZE), np.float32)
    seen[1, 1:3, 4], seen[1, 3, 4] = 1.0, 0.125
    wall = 1e-4 * transport().radiance * (1 - seen.sum(axis=0))
    made = transport(wall + seen[:, None], seen=seen)
    lit = made.relight(luminance_cd_m2=level)
    uncovered = 1 - made.coverage.mean
    assert uncovered.sum() == 30 - 2.125
    assert made.scattered_luminance(luminance_cd_m2=level).sum() / uncovered.sum() == pytest.approx(level, rel=1e-5)
    assert lit.luminance()[uncovered == 1].sum() < level * uncovered.sum()  # the third pixel's wall belongs to it
    assert lit.luminance()[1, 4] > 1000 * level


def test_a_level_and_its_error_are_those_of_a_ratio_of_means():
    """Against draws of the means' errors, which know no formula of the ratio's variance."""
    rng = np.random.default_rng(5)
    radiance, uncovered = rng.uniform(0.5, 1.0, (2, NM.size)), 0.9
    spread = rng.normal(size=(2 * NM.size + 1, 4)) * 0.004  # four causes move all means together
    spread[-1] *= 4  # and the area most, so that its part is a large one
    made = transport(scene_means=SceneMeans(radiance, uncovered, spread @ spread.T))
    emitted = np.stack([100.0 * factor * RAMP.band_average(NM, WIDTH_NM) for factor in (7.0, 0.3)])

    def mean_luminance(means, share):
        return float(luminance((emitted * means).sum(axis=0), NM, WIDTH_NM, RAMP) / share)

    level = made.level({"sky": RAMP * 7.0, "lamp": RAMP * 100.0})
    assert level.value == pytest.approx(mean_luminance(radiance, uncovered), rel=1e-12)
    drawn = []
    for cause in rng.normal(size=(4000, 4)):
        error = spread @ cause
        drawn.append(mean_luminance(radiance + error[:-1].reshape(2, -1), uncovered + error[-1]))
    # The deviation of 4000 draws is known to 1.1 %.
    assert level.relative_error == pytest.approx(np.std(drawn) / level.value, rel=0.06)
    lit = made.relight({"sky": RAMP * 7.0, "lamp": RAMP * 100.0}, luminance_cd_m2=3.0)
    assert lit.relative_level_error == level.relative_error
    assert made.relight().relative_level_error is None


@pytest.mark.thorough
def test_a_level_in_lux_is_told_with_the_scatter_of_its_meter():
    """Against draws of what the meter may have measured, which know no formula of a sum's variance."""
    rng = np.random.default_rng(6)
    mean, spread = rng.uniform(0.5, 1.0, (2, NM.size)), rng.normal(size=(2 * NM.size, 4)) * 0.004
    made = transport(meter=lambda: Irradiance(mean, spread @ spread.T))
    drawn = []
    for cause in rng.normal(size=(1000, 4)):
        measured = Irradiance(mean + (spread @ cause).reshape(mean.shape), spread @ spread.T)
        drawn.append(replace(made, meter=lambda measured=measured: measured).illuminance_lux(1.0))
    told = made.relight(illuminance_lux=300.0).relative_level_error
    # The deviation of 1000 draws is known to 2.2 %; each takes 50 ms, for the lamps' bands are worked out anew.
    assert told == pytest.approx(np.std(drawn) / made.illuminance_lux(1.0), rel=4 * 0.022)
    assert made.relight(luminance_cd_m2=3.0).relative_level_error == 0.0  # of its means, which have no errors


def test_the_illuminance_asked_for_is_reached_on_the_reference_plane():
    made = transport()
    lights = {"sky": RAMP * 7.0}
    values = made.relight(lights, illuminance_lux=500.0).values
    emission = np.stack([100.0 * factor * RAMP.band_average(NM, WIDTH_NM) for factor in (7.0, 0.003)])
    lux = luminance((emission * made.irradiance).sum(axis=0), NM, WIDTH_NM, RAMP)
    assert values / made.relight(lights).values == pytest.approx(np.full(values.shape, 500.0 / lux), rel=1e-6)


def test_illuminance_of_a_mean_luminance_is_the_one_that_gives_it():
    made = transport()
    lux = made.illuminance_lux(25.0)
    assert made.relight(illuminance_lux=lux).luminance().mean() == pytest.approx(25.0, rel=1e-6)
    assert transport(irradiance=None).illuminance_lux(25.0) is None


def test_the_camera_s_angle_of_view_goes_along_with_the_light():
    seen = transport(horizontal_view_deg=50.0)
    for light in (seen.relight(), *seen.relight_halves(), seen.relight_part(["sky"])):
        assert light.horizontal_view_deg == 50.0
    assert transport().relight().horizontal_view_deg is None


def test_parts_of_the_groups_sum_to_the_light_and_others_are_refused():
    made = transport()
    parts = [made.relight_part([name], luminance_cd_m2=7.0).values for name in ("sky", "lamp")]
    np.testing.assert_allclose(parts[0] + parts[1], made.relight(luminance_cd_m2=7.0).values, rtol=1e-6)
    both = made.relight_part(["lamp", "sky"], luminance_cd_m2=7.0)
    np.testing.assert_array_equal(both.values, made.relight(luminance_cd_m2=7.0).values)
    refusal(made.relight_part, ["moon"], match="groups: light group: 'moon' is unknown")
    refusal(made.relight_part, "sky", match="groups: a str is not allowed")


def test_the_mean_radiance_at_a_level_is_that_of_the_relit_picture():
    made = transport()
    values = made.relight(luminance_cd_m2=12.0).values
    assert made.mean_radiance(luminance_cd_m2=12.0) == pytest.approx(values.mean(axis=(0, 1), dtype=float), rel=1e-6)


def test_luminance_is_refused_where_every_pixel_sees_a_light():
    seen = np.zeros((2, *SIZE), np.float32)
    seen[0] = 1.0
    made = transport(np.ones((2, NM.size, *SIZE), np.float32), seen=seen)
    assert "every pixel sees a light directly" in refusal(made.relight, luminance_cd_m2=1.0)


UNLIT = {"powers": {"sky": 0.0, "lamp": 0.0}}


@loop(
    ("changes", "options", "words"),
    [
        ({}, {"luminance_cd_m2": 1.0, "illuminance_lux": 1.0}, "both given; allowed: one of them"),
        (
            {"irradiance": None},
            {"illuminance_lux": 1.0},
            "illuminance_lux: the scene states no reference plane; give luminance_cd_m2 instead",
        ),
        ({}, UNLIT | {"luminance_cd_m2": 2.0}, "level: 2.0 can't be reached, the scene gives no light"),
        (
            {},
            {"spectra": {"ski": "D65"}},
            "spectra: light group: 'ski' is unknown; allowed: lamp, sky; did you mean 'sky'",
        ),
        (
            {},
            {"powers": {"ski": 1.0}},
            "powers: light group: 'ski' is unknown; allowed: lamp, sky; did you mean 'sky'?",
        ),
        ({}, {"spectra": {"sky": "D66"}}, "illuminant: 'D66' is unknown"),
        ({}, {"spectra": "D66"}, "illuminant: 'D66' is unknown"),
        (
            {},
            {"spectra": ["A"]},
            "spectra: a list is none; allowed: Mapping; give a dict by light group, or one illuminant",
        ),
        ({}, {"lux": 1.0, "illuminance_lux": 1.0}, "illuminance_lux and lux: both given; allowed: one of them"),
        (
            {"groups": {"sky": LightGroup(("sky",), RAMP, 1.0), "lamp": LightGroup(("lamp",), RAMP, 1.0, True)}},
            {"spectra": "A"},
            "spectra: one lamp for light group 'lamp', which has colours of its own; allowed: the light that it has",
        ),
    ],
)
def test_what_cannot_be_relit_is_refused(changes, options, words):
    assert words in refusal(transport(**changes).relight, **options)


@loop("lamp", ["A", illuminant("A"), illuminant("A") * 7.0])
def test_one_lamp_in_place_of_all_lights_keeps_the_luminance_of_each(lamp):
    """As ``--light A`` does; a mapping takes the illuminant's own luminance of 1."""
    made = transport()
    scene = SimpleNamespace(name="two", groups=made.groups)
    for one in (made.relight(lamp), made.relight(asked_spectra(scene, ["A"]))):
        by_group = {name: illuminant("A") * spectral_luminance(group.spectrum) for name, group in made.groups.items()}
        assert one.values == pytest.approx(made.relight(by_group).values, rel=1e-6)
    assert made.level("A").value == pytest.approx(made.level(by_group).value, rel=1e-12)


def test_lux_is_illuminance_on_the_reference_plane():
    made = transport()
    for relight in (made.relight, lambda **level: made.relight_halves(**level)[1]):
        assert np.array_equal(relight(lux=500.0).values, relight(illuminance_lux=500.0).values)


@loop("value", [-1.0, np.nan, np.inf])
@loop("name", ["powers", "luminance_cd_m2", "illuminance_lux"])
def test_a_negative_or_infinite_level_or_power_is_refused_with_its_value(name, value):
    text = refusal(transport().relight, **{name: {"lamp": value} if name == "powers" else value})
    assert text.startswith(name)
    assert f"{value!r} is outside 0 to" in text


@loop("level", [{}, {"luminance_cd_m2": 7.0}, {"illuminance_lux": 9.0}])
def test_halves_whose_noise_crosses_zero_still_average_to_the_relit_radiance(level):
    """Clipped at 0 they would differ by less than the render's noise."""
    made, options = transport(), {"spectra": {"lamp": flat(3.0)}, "powers": {"sky": 2.0}, **level}
    made = replace(made, light=Halves(made.radiance, made.radiance * np.float32(-3.0)))
    even, odd = made.relight_halves(**options)
    lit = made.relight(**options).values
    assert even.values.min() < 0
    assert (even.values.astype(np.float64) + odd.values) / 2 == pytest.approx(lit, rel=2e-6)
    assert even.values - odd.values == pytest.approx(-6 * lit, rel=2e-6)


@loop("correlation", [-1.0, -0.4, 0.7])
def test_the_variance_of_groups_that_share_paths_holds_their_covariance(correlation):
    made = transport()
    made = replace(made, shared=SharedPaths((0, 1), np.full(made.variance.shape[1:], correlation, np.float32)))
    given = np.stack([100.0 * illuminant("D65").band_average(NM, WIDTH_NM), 0.3 * RAMP.band_average(NM, WIDTH_NM)])
    level = 12.0 / made.level().value
    sky, lamp = (level * given)[:, :, None, None] * np.sqrt(made.variance.astype(np.float64))
    expected = sky**2 + lamp**2 + 2 * correlation * sky * lamp
    found = made.relight_variance(luminance_cd_m2=12.0)
    assert found.dtype == np.float32
    assert np.abs(found - expected).max() <= 1e-6 * (sky + lamp).max() ** 2
    assert found.min() >= 0
    pooled = made.relight().relative_mc_error / replace(made, shared=None).relight().relative_mc_error
    assert (pooled > 1) == (correlation > 0)


def test_relit_radiance_keeps_the_bands_and_lies_band_by_band_in_memory():
    values = transport().relight()
    assert np.array_equal(values.wavelength_nm, NM)
    assert np.array_equal(values.widths_nm, WIDTH_NM)
    assert np.moveaxis(values.values, -1, 0).flags.c_contiguous
