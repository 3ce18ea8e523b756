"""The budget's terms against closed forms: bands, lens, noise and level on hand-made light; ledger and choice."""

from dataclasses import fields, replace
from itertools import combinations, product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builders import transport_of
from refusal import refusal

from render.error_estimates import Halves
from render.geometry import horizontal_view_deg
from render.illuminants import illuminant
from render.loader import mitsuba_module
from render.scene import LightGroup
from render.spectrum import Spectrum, emission_lines_nm, fine_bands, flat
from render.transport import Transport
from rodcone.jit import backend
from sensor.kernel.kernel import expected_electrons_single
from sensor.lens.illumination import falloff
from sensor.optics import camera_equation, form_image
from sensor.presets import low_noise
from sensor.readout import noise_variance
from sensor.response import electrons_per_irradiance, expected_electrons
from sensor.shake import held_lens
from studies.budget.bands import COUNTS, band_groups, merge_radiance, merge_transport, possible_counts
from studies.budget.costs import image_ns, render_ns
from studies.budget.effects import IMAGING_TERMS, KERNEL, Effects, find_effects, kernel_rms_e, shake_effect
from studies.budget.how_many_bands import choose
from studies.budget.ledger import LEVEL, LIGHT, MONTE_CARLO, RESPONSE, ledger, share_text
from studies.budget.scaled_effects import PilotNoise, ScaledEffects, scale_effects
from studies.study.study import BudgetShares, Condition, SceneChoice

NM, WIDTH_NM = np.arange(385.0, 780.0, 10.0), np.full(40, 10.0)
SIZE = (24, 24)
QUIET = PilotNoise(128, 16, 0.0)
CONDITION = Condition(SceneChoice("still_life"), "own", "25cd/m2", "auto", "low_noise")


def transport(planes, *, noise=0.0, spectrum=None, seed=0) -> Transport:
    """One light's transport of radiance (band, h, w). With `noise` (standard error over value) bands are off alike."""
    planes = np.asarray(planes, np.float32)
    shape = planes.shape[1:]
    drawn = np.random.default_rng(seed).normal(0.0, noise, (2, *shape))
    radiance = (planes * (1 + drawn[0]))[None].astype(np.float32)
    return transport_of(
        radiance,
        {"light": LightGroup(("light",), spectrum or illuminant("D65"))},
        NM,
        WIDTH_NM,
        light=Halves(radiance, (planes * drawn[1])[None].astype(np.float32)),
        variance=((planes * noise) ** 2)[None].astype(np.float32),
        spp=128,
    )


def even(value=0.5) -> np.ndarray:
    return np.full((40, *SIZE), value)


def halved(low=0.2, high=0.8) -> np.ndarray:
    planes = even(low)
    planes[:, :, SIZE[1] // 2 :] = high
    return planes


def found(made: Transport, counts=(40,), **lens) -> Effects:
    sensor = low_noise()
    groups = {count: band_groups(made.width_nm, count) for count in counts}
    stated = replace(sensor.lens, **({"diffraction": 0.0} | lens))
    return find_effects(made, sensor, stated, groups, np.random.default_rng(0))


def rms(pair) -> float:
    return float(np.sqrt((pair[0] * pair[1]).mean()))


def test_smooth_lights_are_referred_to_bands_of_10_nm() -> None:
    nm, width_nm = fine_bands([illuminant("D65"), illuminant("F11")])
    assert np.array_equal(nm, NM)
    assert np.allclose(width_nm, 10.0)


def test_noise_of_a_finely_measured_lamp_is_no_line() -> None:
    nm, noise = np.arange(380.0, 780.0, 0.05), np.random.default_rng(0).standard_normal((2, 8000))
    lamp = np.exp(-(((nm - 570.0) / 60.0) ** 2)) * (1 + 0.02 * noise[0]) + 0.003 * np.maximum(noise[1], 0.0)
    assert not emission_lines_nm(Spectrum(nm, lamp)).size
    lamp[1000] += 50.0  # a line of 2 % of the light
    assert emission_lines_nm(Spectrum(nm, lamp)) == pytest.approx([430.0])


def test_a_lamps_lines_get_bands_of_their_own_that_no_plan_merges() -> None:
    assert np.allclose(emission_lines_nm(illuminant("sodium_low")), [588.995, 589.592])
    nm, width_nm = fine_bands([illuminant("sodium_low")])
    line = int(np.argmin(width_nm))
    assert nm[line] == pytest.approx(589.29, abs=0.01)
    for count in COUNTS:
        groups = band_groups(width_nm, count)
        assert [group.tolist() for group in groups if line in group] == [[line]]
        assert np.array_equal(np.concatenate(groups), np.arange(width_nm.size))


def test_wide_bands_are_as_many_as_asked_for_and_as_even_as_can_be() -> None:
    for count in COUNTS:
        sizes = [len(group) for group in band_groups(WIDTH_NM, count)]
        assert (len(sizes), sum(sizes)) == (count, 40)
        assert max(sizes) - min(sizes) <= 1


def test_merged_bands_hold_means_weighted_by_width() -> None:
    made = transport(np.arange(40.0)[:, None, None] * np.ones((1, 4, 4)))
    meter: Any = SimpleNamespace()
    made = replace(made, width_nm=np.r_[5.0, np.full(39, 10.0)], wavelength_nm=np.r_[387.5, NM[1:]], meter=meter)
    merged = merge_transport(made, band_groups(made.width_nm, 20))
    assert merged.radiance[0, 0, 0, 0] == pytest.approx((0 * 5 + 1 * 10) / 15)
    assert merged.radiance[0, 1, 0, 0] == pytest.approx(2.5)
    assert merged.meter is None, "its bands are the fine ones"
    assert (merged.wavelength_nm[0], merged.width_nm[0]) == (392.5, 15.0)
    radiance = merge_radiance(made.relight(), band_groups(made.width_nm, 20))
    values = made.relight().values[0, 0]
    assert radiance.values[0, 0, 0] == pytest.approx((values[0] * 5 + values[1] * 10) / 15, rel=1e-6)


def test_light_within_bands_is_the_covariance_of_light_and_scene() -> None:
    """A ramp in the transport under a ramp of light: two bands of one are off by a quarter of both steps' product."""
    light = Spectrum(np.array([300.0, 1100.0]), np.array([0.0, 8.0]))  # rises 0.1 from band to band
    step_light, step_scene = 0.1, 0.02
    ramp = (0.1 + step_scene * np.arange(40.0))[:, None, None] * np.ones((1, *SIZE))
    made = transport(ramp, spectrum=light)
    missed = rms(found(made, counts=(20,)).bands[20].light)
    sensor = low_noise()
    groups = band_groups(WIDTH_NM, 20)
    wide = merge_transport(made, groups)
    weights = electrons_per_irradiance(sensor, wide.wavelength_nm, wide.width_nm, 1.0, light) * camera_equation(
        sensor.lens
    )
    averaged = merge_radiance(made.relight(luminance_cd_m2=1.0), groups)
    scale = 1 / made.relight().luminance().mean()
    told = averaged.luminance().mean()
    # product of means less mean of products, then brought to the level as wide bands tell it
    product = averaged.values[0, 0] / scale - step_light * step_scene / 4
    level = product * (1 / merge_transport(made, groups).relight().luminance().mean())
    expected = np.sqrt(np.mean((weights @ (level - averaged.values[0, 0] / told)) ** 2))
    assert missed == pytest.approx(expected, rel=2e-3)
    assert expected > 0


def test_jitter_is_the_variance_over_the_places_within_a_band() -> None:
    steps = np.where(np.arange(40) % 2, 0.7, 0.3)[:, None, None] * np.ones((1, *SIZE))
    made = transport(steps, spectrum=flat())
    some = found(made, counts=(20,))
    sensor = low_noise()
    halves = []
    for first in (0.3, 0.7):  # every wide band at its first place, or at its second
        radiance = made.relight(luminance_cd_m2=1.0)
        scale = radiance.values[0, 0, 0] / 0.3
        image = form_image(replace(radiance, values=np.full_like(radiance.values, first * scale)), sensor)
        halves.append(expected_electrons(image, sensor, 1.0))
    assert np.allclose(some.bands[20].jitter, (halves[1] - halves[0]) ** 2 / 4, rtol=1e-4)


def test_glare_costs_its_share_of_the_distance_from_the_mean() -> None:
    glare = 0.03
    some = found(transport(halved()), veiling_glare=glare)
    plain = found(transport(halved())).full[0]
    sensor = low_noise()
    image = form_image(transport(halved()).relight(luminance_cd_m2=1.0), sensor)
    everywhere = replace(image, values=np.broadcast_to(image.values.mean(axis=(0, 1)), image.values.shape).copy())
    mean = expected_electrons(everywhere, sensor, 1.0)
    assert list(some.lens) == ["veiling glare"]
    assert np.allclose(some.lens["veiling glare"][0], glare * (plain - mean), rtol=1e-3, atol=1e-3)


def test_falloff_costs_what_is_lost_off_the_axis() -> None:
    some = found(transport(even()), horizontal_view_deg=40.0)
    plain = found(transport(even())).full[0]
    lens = replace(low_noise().lens, horizontal_view_deg=40.0)
    assert np.allclose(some.lens["cos^4"][0], plain * (1 - falloff(lens, SIZE)), rtol=1e-5, atol=1e-5 * plain.max())


def test_shake_costs_what_the_path_takes_over_an_edge() -> None:
    """Beside an edge that the image crosses by x, a step of height h, the light changes by h times the time beyond."""
    made, sensor = transport(halved()), low_noise()
    lens = held_lens(sensor.lens, "hand")
    short, long = (shake_effect(made, sensor, lens, time_s, np.random.default_rng(0)) for time_s in (0.004, 0.1))
    full = found(made).full[0]
    assert rms(short) < 0.3 * rms(long)
    away = np.abs(np.arange(SIZE[1]) + 0.5 - SIZE[1] / 2) > 8  # 8 pixels of 2.8 um and more: 4 standard deviations
    assert np.abs(long[0][:, away]).max() < 0.01 * full.max()
    # the most that an edge can change is its height
    assert 0.05 * full.max() < np.abs(long[0][:, ~away]).max() < full.max()
    np.testing.assert_array_equal(shake_effect(made, sensor, lens, 0.0, np.random.default_rng(0)), 0.0)


def test_an_effects_rms_is_free_of_monte_carlo_noise() -> None:
    """An even picture with 5 % noise: diffraction changes nothing but the noise; 0 within 5 standard errors."""
    some = found(transport(even(), noise=0.05, seed=1), diffraction=1.0)
    product = some.lens["diffraction"][0] * some.lens["diffraction"][1]
    one = some.lens["diffraction"][0].std() ** 2
    assert abs(product.mean()) < 5 * product.std() / np.sqrt(product.size)
    assert one > 5 * abs(product.mean())


def test_monte_carlo_draws_have_the_stated_variance() -> None:
    """Draws are plus or minus one standard error, so that a plain lens shows exactly that; diffraction evens it out."""
    some = found(transport(even(), noise=0.05), diffraction=1.0)
    signal = found(transport(even())).full.mean(axis=0)
    assert np.allclose(np.abs(some.sharp), 0.05 * signal, rtol=0.02)
    assert (some.blurred**2).mean() < 0.7 * (some.sharp**2).mean()


def test_the_view_of_a_camera_is_that_of_mitsuba() -> None:
    mi = mitsuba_module()
    views: list[dict[str, Any]] = [{}, {"focal_length": "35mm"}, {"focal_length": "85"}]
    views += [{"fov": 50.0, "fov_axis": axis} for axis in ("x", "y", "smaller", "Larger", "diagonal")]
    cameras = {"type": "perspective"}, {"type": "thinlens", "aperture_radius": 0.1}
    for size, view, camera in product([(30, 40), (40, 30)], views, cameras):
        film = {"type": "hdrfilm", "width": size[1], "height": size[0]}
        sensor = mi.load_dict({**camera, **view, "film": film})
        own = np.asarray(mi.traverse(sensor)["x_fov"]).item()
        assert horizontal_view_deg({**camera, **view}, size) == pytest.approx(own, rel=1e-5), (view, size)
    assert horizontal_view_deg({"type": "orthographic"}, (100, 100)) == 0.0  # parallel rays: nothing falls off
    for wrong, words in (
        ({"focal_length": "wide"}, "focal_length 'wide'"),
        ({"fov": 40.0, "fov_axis": "z"}, "fov_axis: 'z' is unknown"),
    ):
        refusal(horizontal_view_deg, wrong, (10, 10), match=words)


@pytest.mark.skipif(backend() == "numpy", reason="needs LLVM or CUDA for the fast readout")
def test_the_kernels_bound_holds_what_single_precision_is_off() -> None:
    made = transport(np.random.default_rng(2).uniform(0.1, 1.0, (40, 64, 64)))
    sensor = low_noise()
    image = form_image(made.relight(luminance_cd_m2=5000.0), sensor)
    weights = electrons_per_irradiance(sensor, NM, WIDTH_NM, 1e-3, image.light)
    exact = expected_electrons(replace(image, values=image.values.astype(np.float64)), sensor, 1e-3)
    off = np.abs(expected_electrons_single(image.values, weights, sensor) - exact)
    bound = kernel_rms_e(exact, 40)
    rounding = bound - kernel_rms_e(exact, -2)  # without the part of the draws
    assert (off <= rounding).all()
    assert off.max() > 1e-3 * rounding.max()


def test_terms_grow_with_light_and_time_and_noise_falls_with_samples() -> None:
    sensor = low_noise()
    some = found(transport(halved(), noise=0.02), counts=(20, 40), veiling_glare=0.01)
    once = scale_effects(CONDITION, "rgbw", sensor, some, 2.0, 0.01, QUIET)
    more = scale_effects(CONDITION, "rgbw", sensor, some, 6.0, 0.01, QUIET)
    assert more.lens["veiling glare"] == pytest.approx(3 * once.lens["veiling glare"])
    assert more.bands[20][0] == pytest.approx(3 * once.bands[20][0])
    assert more.sharp == pytest.approx(9 * once.sharp)
    assert once.monte_carlo(40, 256, frozenset()) == pytest.approx(once.monte_carlo(40, 64, frozenset()) / 4)
    signal = 2.0 * 0.01 * some.full.mean(axis=0)
    assert once.noise_variance == pytest.approx(noise_variance(signal, sensor, 0.01).mean())
    levelled = scale_effects(CONDITION, "rgbw", sensor, some, 2.0, 0.01, replace(QUIET, level=1e-4))
    assert levelled.level == pytest.approx(((0.01 * signal) ** 2).mean())  # 1 % of each pixel
    # noise of one sample a pixel is the pilot's times its samples; the margin is that of the mean over pixels
    square = (0.02 * signal) ** 2 * 128
    assert square.mean() < once.sharp < square.mean() + 1.2 * 19**0.5 * square.std() / square.size**0.5


def test_saturated_pixels_are_left_out() -> None:
    sensor = low_noise()
    some = found(transport(halved(0.01, 1.0)), veiling_glare=0.01)
    bright = scale_effects(CONDITION, "rgbw", sensor, some, 500.0, 0.01, QUIET)
    below = 5.0 * some.full[0] < sensor.pixel.full_well_e
    assert 0.1 < below.mean() < 0.9
    square = (5.0 * some.lens["veiling glare"][0][below]) ** 2
    margin = 2.0 * square.std() / np.sqrt(square.size)
    assert bright.lens["veiling glare"] ** 2 == pytest.approx(square.mean() + margin, rel=1e-6)
    all_full = scale_effects(CONDITION, "rgbw", sensor, some, 1e9, 0.01, QUIET)
    assert ledger(all_full, 40, 128, frozenset(IMAGING_TERMS)).share == 0.0


def test_a_lens_that_undershoots_beside_a_lamp_leaves_every_term_a_number() -> None:
    """A lamp in the dark: what a lens out of focus takes below 0 has no light, no noise of it and no jitter."""
    planes = np.zeros((40, *SIZE))
    planes[::2, 12, 12], planes[1::2, 12, 12] = 0.5, 1.0
    sensor = low_noise()
    some = found(transport(planes, noise=0.02), counts=(20, 40), diffraction=1.0, defocus_um=2.2)
    assert (some.full.mean(axis=0) < 0).any()
    row = scale_effects(CONDITION, "rgbw", sensor, some, 1e-3, 0.01, QUIET)
    kept = 1e-5 * np.maximum(some.full.mean(axis=0), 0.0)
    assert row.noise_variance == pytest.approx(
        noise_variance(kept, sensor, 0.01)[kept < sensor.pixel.full_well_e].mean()
    )
    assert np.isfinite([row.kernel, row.level, *row.jitter.values(), *row.lens.values()]).all()
    some = found(transport(planes, noise=0.02), counts=(20, 40), diffraction=1.0)  # in focus nothing is below 0
    assert (some.full >= 0).all()
    row = scale_effects(CONDITION, "rgbw", sensor, some, 1e-3, 0.01, QUIET)
    sharp = 1e-5 * (some.full + some.lens["diffraction"]).mean(axis=0)[12, 12]  # the lamp's electrons, all in one pixel
    relative = 1e-10 * some.sharp[0, 12, 12] ** 2 * 128 / sharp**2 + 1 / 16
    values = np.zeros(planes[0].size)
    values[0] = 1e-10 * some.bands[20].jitter[12, 12] * relative
    assert row.jitter[20] == pytest.approx(values.mean() + 19**0.5 * values.std() / values.size**0.5, rel=1e-3)


def weighed(condition=CONDITION, mosaic="rgbw", noise_variance=100.0, paths=10.0, **lens) -> ScaledEffects:
    """Errors in electrons beside 10 e- of noise; bands miss 4, 1.5, 0.5 and 0 e-."""
    bands = {4: (3.0, 1.0), 12: (1.0, 0.5), 20: (0.4, 0.1), 40: (0.0, 0.0)}
    errors = {"diffraction": 5.0, "veiling glare": 1.0, "cos^4": 0.5} | lens
    jitter = dict.fromkeys(bands, 0.0)
    return ScaledEffects(
        condition, mosaic, 0.01, noise_variance, 2 * paths, paths, jitter, 0.0, bands, errors, kernel=1e-3
    )


def test_ledger_adds_effects_by_minkowski_and_noise_in_square() -> None:
    row = ledger(replace(weighed(), level=64.0), 12, 64, frozenset({"veiling glare", KERNEL}))
    rms_e = {term.name: term.rms_e for term in row.terms}
    assert rms_e[MONTE_CARLO] ** 2 == pytest.approx(20.0 / 64)  # diffraction is modelled: the blurred noise
    assert rms_e[LEVEL] ** 2 == pytest.approx(64.0 / 64)
    assert (rms_e[RESPONSE], rms_e[LIGHT]) == (1.0, 0.5)
    assert [term.name for term in row.terms if term.modelled] == ["diffraction", "cos^4"]
    assert row.rms_e**2 == pytest.approx(20.0 / 64 + 1.0 + (1.0 + 0.5 + 1.0 + 1e-3) ** 2)
    assert row.share == pytest.approx(row.rms_e**2 / 100.0)
    for term in row.terms:
        assert term.share == pytest.approx(term.rms_e**2 / 100.0)
    sharp = ledger(weighed(), 12, 64, frozenset({"diffraction"}))
    assert sharp.terms[0].rms_e ** 2 == pytest.approx(10.0 / 64)


SIZES = {4: 4, 12: 12, 20: 20, 40: 40}


def test_choice_is_the_cheapest_of_all_that_fit() -> None:
    """Every model is tried by hand: 7 % of 100 e-^2 leave sqrt(7) e- for effects."""
    other = replace(CONDITION, level="1cd/m2")
    rows = [weighed(), weighed(mosaic="bayer", **{"veiling glare": 0.2}), weighed(other, noise_variance=1e6)]
    choice = choose(rows, SIZES, BudgetShares(), 512)
    names = (*IMAGING_TERMS, KERNEL)
    subsets = [frozenset(some) for n in range(5) for some in combinations(names, n)]
    costs = {}
    for count in SIZES:
        for first in subsets:
            for second in subsets:
                chosen = {CONDITION: first, other: second}
                fits = all(
                    (sum(r.bands[count]) + sum({**r.lens, KERNEL: r.kernel}[n] for n in chosen[r.condition])) ** 2
                    <= 0.07 * r.noise_variance
                    for r in rows
                )
                if fits:
                    images = sum(image_ns(count, set(names) - out) for out in chosen.values())
                    costs[count, first, second] = images + render_ns(count, 128)
    best = min(costs.values())
    assert costs[choice.count, choice.left_out[CONDITION], choice.left_out[other]] == best
    assert choice.count == 12
    assert choice.left_out[other] == frozenset(names)
    assert "diffraction" not in choice.left_out[CONDITION]


def test_sensors_that_are_compared_have_one_lens() -> None:
    """The noisy one by itself needs no lens at all."""
    noisy = replace(CONDITION, sensor="table1_output")
    rows = [weighed(), weighed(noisy, noise_variance=1e6)]
    alone = choose(rows[1:], SIZES, BudgetShares(), 512)
    assert "diffraction" in alone.left_out[noisy]
    together = choose(rows, SIZES, BudgetShares(), 512)
    assert (
        together.left_out[noisy]
        == together.left_out[CONDITION]
        == choose(rows[:1], SIZES, BudgetShares(), 512).left_out[CONDITION]
    )


def test_samples_are_those_that_monte_carlos_share_asks_for_up_to_the_studys() -> None:
    rows = [weighed(paths=600.0)]  # blurred 1200 e-^2 a sample against 3 e-^2
    assert choose(rows, SIZES, BudgetShares(), 512).spp == 400
    assert choose(rows, SIZES, BudgetShares(), 256).spp == 256
    assert choose([weighed(paths=1.0)], SIZES, BudgetShares(), 512).spp == 128


def test_every_term_scales_as_its_kind_does_with_light_and_with_time() -> None:
    """Three times the light: errors three times, noise nine times; light for time changes nothing without dark current.

    A field that is added has to be named here.
    """
    sensor = low_noise()
    assert sensor.pixel.dark_current_e_per_s == 0
    pilot = PilotNoise(128, 16, 1e-4)
    planes = halved() * (1 + 0.3 * np.sin(np.arange(40.0)))[:, None, None]
    some = found(transport(planes, noise=0.02), counts=(20, 40), veiling_glare=0.01, diffraction=1.0)
    dim, bright, brief = (
        scale_effects(CONDITION, "rgbw", sensor, some, level, time_s, pilot)
        for level, time_s in ((2.0, 0.01), (6.0, 0.01), (20.0, 0.001))
    )
    assert min(*dim.lens.values(), dim.bands[20][0], dim.bands[20][1], dim.jitter[20]) > 0
    assert bright.lens == pytest.approx({name: 3 * x for name, x in dim.lens.items()})
    for count in (20, 40):
        assert bright.bands[count] == pytest.approx(tuple(3 * x for x in dim.bands[count]), abs=1e-9), count
        assert brief.bands[count] == pytest.approx(dim.bands[count], abs=1e-9), count
    assert bright.jitter == pytest.approx({count: 9 * x for count, x in dim.jitter.items()})
    for name in ("blurred", "sharp", "level"):
        assert getattr(bright, name) == pytest.approx(9 * getattr(dim, name)), name
    assert dim.blurred < dim.sharp
    signal = 2.0 * 0.01 * some.full.mean(axis=0)
    assert dim.kernel == pytest.approx(np.sqrt((kernel_rms_e(signal, 40) ** 2).mean()))
    named = {"lens", "bands", "jitter", "blurred", "sharp", "level", "kernel", "noise_variance"}
    for name in named - {"bands"}:
        assert getattr(brief, name) == pytest.approx(getattr(dim, name)), name
    assert (dim.exposure_s, brief.exposure_s, dim.condition, dim.mosaic) == (0.01, 0.001, CONDITION, "rgbw")
    assert named | {"exposure_s", "condition", "mosaic"} == {field.name for field in fields(ScaledEffects)}


def test_bands_are_paid_for_four_at_a_time() -> None:
    """85 ns a band and sample, and as much as 12 bands to trace a path."""
    for bands, paid in ((4, 4), (5, 8), (8, 8), (9, 12), (20, 20)):
        assert render_ns(bands, 10) == pytest.approx((paid + 12) * 10 * 85.0)


def test_errors_of_merged_bands_rise_and_fall_together() -> None:
    """Standard errors of 1 and 3 have the mean 2: a variance of 4, not 5."""
    made = transport(even())
    variance = np.where(np.arange(40) % 2, 9.0, 1.0)[None, :, None, None] * np.ones((1, 1, *SIZE))
    merged = merge_transport(replace(made, variance=variance.astype(np.float32)), band_groups(WIDTH_NM, 20))
    assert np.allclose(merged.variance, 4.0)


def test_a_picture_files_pilot_has_no_noise_and_a_renders_is_scaled_to_the_whole_picture() -> None:
    """A level's relative variance falls with pixels and samples: of one sample over the whole picture."""
    from studies.budget.pilot import _pilot_noise

    assert _pilot_noise(SimpleNamespace(rendered=False), None) == PilotNoise(0, 1, 0.0)
    lit = SimpleNamespace(
        spp=96.0, coverage=SimpleNamespace(mean=np.ones((6, 8))), level=lambda: SimpleNamespace(relative_error=0.02)
    )
    pilot = SimpleNamespace(rendered=True, opened=SimpleNamespace(size=(60, 40)))
    assert _pilot_noise(pilot, lit) == PilotNoise(96.0, 48.0, pytest.approx(0.02**2 * 96 * 48 / 2400))
    lit.level = lambda: SimpleNamespace(relative_error=None)
    assert _pilot_noise(pilot, lit).level == 0.0


def test_a_plan_may_choose_all_fine_bands_where_there_are_more_than_forty() -> None:
    assert possible_counts(WIDTH_NM) == COUNTS == (4, 8, 12, 16, 20, 28, 40)
    assert possible_counts(np.full(41, 10.0)) == (*COUNTS, 41)


def test_shares_are_written_as_per_cent_and_from_two_on_as_factors() -> None:
    told = {
        0.0: "0%", 0.0009: "<0.1%", 0.001: "0.1%", 0.0123: "1.2%", 0.0999: "10%", 0.1: "10%", 0.456: "46%",
        1.994: "199%", 2.0: "2.0x", 9.94: "9.9x", 10.0: "10x", 123.4: "123x",
    }  # fmt: skip
    assert {share: share_text(share) for share in told} == told
