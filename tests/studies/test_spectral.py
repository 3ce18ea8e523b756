"""Spectral studies: lights at equal illuminance, electrons per lux as an integral, the near infrared."""

from dataclasses import replace

import numpy as np
import pytest
from refusal import refusal

from isp.processors.catalogue import PROCESSORS
from render.engine import render
from render.illuminants import illuminant
from render.spectrum import VISIBLE_NM, fine_bands, photons_per_joule
from render.transport import Transport
from rodcone.types import Floats
from scenes.catalogue import load
from scenes.reflectances import color_checker_reflectances
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.optics import form_image
from sensor.presets import preset
from sensor.response import expected_electrons
from studies.budget.bands import band_groups, possible_counts
from studies.budget.starting_points import plan_from_settings
from studies.metrics.target_figures import patch_masks
from studies.study.lit_scene import level_luminance, open_choice, under
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.study.study_file import EXAMPLES
from studies.sweep.frames import colours_under

LIGHTS = ("D65", "moonlight", "A", "LED-B3", "sodium_high", "sodium_low")
SENSORS = EXAMPLES / "sensors"
LUX = 100.0


@pytest.fixture(scope="module")
def wall() -> Transport:
    """A grey wall of reflectance 0.5, in bands that hold the lines of sodium."""
    nm, width = fine_bands([illuminant(name) for name in LIGHTS])
    return render(load("flat_field"), (4, 4), wavelength_nm=nm, width_nm=width, spp=16)


def lit_to(transport: Transport, spectrum: str, lux: float) -> tuple[Transport, float]:
    """Transport under a spectrum, and the mean luminance that a study gives it for so many lux."""
    lit = under(transport, spectrum)
    return lit, level_luminance(f"{lux}lux", lit.illuminance_lux(1.0))


def test_a_level_in_lux_is_the_same_illuminance_under_every_light(wall: Transport) -> None:
    found = []
    for name in LIGHTS:
        lit, luminance = lit_to(wall, name, LUX)
        found.append(float(lit.relight(luminance_cd_m2=luminance).luminance().mean()) * np.pi / 0.5)
    # a matte wall's illuminance is pi L / 0.5, here from the picture; the level comes from the meter on its plane
    np.testing.assert_allclose(found, LUX, rtol=1e-5)  # single precision of both
    np.testing.assert_allclose(found, found[0], rtol=1e-6)


def integral_e(sensor: SensorConfig, name: str, lux: float, exposure_s: float) -> float:
    """Electrons of W on the wall, summed in steps of 1 nm: the lines of low-pressure sodium at 589.1 nm, their mean."""
    nm: Floats = np.arange(VISIBLE_NM[0] + 0.5, VISIBLE_NM[1])
    watts = illuminant(name).band_average(nm, np.ones_like(nm))
    if name == "sodium_low":
        total = watts.sum()
        nm = np.array([(2 * 588.995 + 589.592) / 3])
        watts = np.array([total])
    radiance = watts * lux / np.pi * 0.5
    curve = sensor.responses.curves["W"]
    irradiance = radiance * np.pi / (1 + 4 * sensor.lens.f_number**2)
    area_m2 = (sensor.pixel.pitch_um * 1e-6) ** 2 * sensor.pixel.fill_factor
    electrons = irradiance * np.interp(nm, curve.wavelength_nm, curve.values) * photons_per_joule(nm) * area_m2
    return float(electrons.sum() * exposure_s)


def test_ws_electrons_per_lux_are_the_integral(wall: Transport) -> None:
    for name in LIGHTS:
        sensor = preset("low_noise")
        lit, luminance = lit_to(wall, name, LUX)
        image = form_image(lit.relight(luminance_cd_m2=luminance), sensor)
        expected_e = expected_electrons(image, sensor, 0.01)
        found = expected_e[mask(sensor.cfa, "W", expected_e.shape)].mean()
        # bands of 10 nm: the luminance of a light with edges (sodium, LED) is off by up to 0.6 % in them
        assert found == pytest.approx(integral_e(sensor, name, LUX, 0.01), rel=8e-3), name


def test_a_study_without_a_plan_gives_a_lamps_lines_a_band_of_their_own() -> None:
    (model,) = plan_from_settings(
        Study((SceneChoice("flat_field"),), ("1lux",), spectra=("own", "sodium_low"))
    ).renders.values()
    assert min(model.width_nm) == pytest.approx(1.6, abs=0.01)
    scenes = SceneChoice("flat_field", light="sodium_low"), SceneChoice("color_checker")
    assert [min(x.width_nm) for x in plan_from_settings(Study(scenes, ("1lux",))).renders.values()] == pytest.approx(
        [1.6, 20.0], abs=0.01
    )


def test_a_study_renders_the_range_that_it_asks_for() -> None:
    far = Study((SceneChoice("color_checker"),), ("1lux",), render=RenderLimits(range_nm=(380.0, 1070.0)))
    (model,) = plan_from_settings(far).renders.values()
    edges = np.array(model.wavelength_nm) - np.array(model.width_nm) / 2
    assert edges[0] == 380.0
    assert model.wavelength_nm[-1] + model.width_nm[-1] / 2 == pytest.approx(1070.0)
    refusal(
        open_choice,
        SceneChoice("still_life"),
        far,
        match=r"still_life: bands reach 380-1070 nm, and .* 380-780 nm alone",
    )
    assert open_choice(SceneChoice("still_life", extend="hold"), far).scene is not None


def test_a_plan_of_a_wider_range_may_choose_all_of_its_bands() -> None:
    _, width = fine_bands([], (380.0, 1070.0))
    assert width.size == 69
    assert possible_counts(width)[-1] == 69
    assert len(band_groups(width, 69)) == 69
    assert possible_counts(np.full(40, 10.0))[-1] == 40


def test_surfaces_keep_their_last_reflectance_in_the_infrared() -> None:
    nm = np.array([770.0, 900.0, 1050.0])
    made = render(load("color_checker"), (64, 64), wavelength_nm=nm, width_nm=10.0, spp=16).radiance[0]
    masks = patch_masks(load("color_checker"), (64, 64))
    for (name, curve), inside in zip(color_checker_reflectances(), masks, strict=True):
        found = made[:, inside].mean(axis=1)
        assert found[1] == pytest.approx(curve.values[-1], rel=0.02), name
        assert found[2] == pytest.approx(found[1], rel=1e-3)
    assert made[1:, 0, 0] == pytest.approx(0.2, rel=0.02)


def test_a_camera_is_calibrated_with_the_infrared_that_it_sees() -> None:
    camera = preset(SENSORS / "without_filter.toml")
    fit = colours_under(camera, PROCESSORS["interleaved"], illuminant("2856K"))
    nm = np.arange(380.5, 1068.0)
    photons = illuminant("2856K").band_average(nm, np.ones_like(nm)) * nm
    curve = np.interp(nm, camera.responses.curves["W"].wavelength_nm, camera.responses.curves["W"].values)
    # a surface black to 780 nm and white beyond would read the share of W's electrons that lie there
    share = (photons * curve)[nm > 780].sum() / (photons * curve).sum()
    assert 0.2 < share < 0.6
    seen = colours_under(replace(camera, window_nm=VISIBLE_NM), PROCESSORS["interleaved"], illuminant("2856K"))
    white = fit.channels.index("W")
    beyond = np.mean([each.values[-1] for _, each in color_checker_reflectances()])
    mixed = (1 - share) * seen.mean[white] + share * beyond
    assert fit.mean[white] == pytest.approx(mixed, rel=2e-3)


def test_bands_that_a_plan_may_choose_end_at_forty_or_at_all_of_a_wider_range() -> None:
    counts = (4, 8, 12, 16, 20, 28, 40)
    assert [possible_counts(np.full(size, 10.0)) for size in (17, 30, 40, 41)] == [counts] * 3 + [(*counts, 41)]
