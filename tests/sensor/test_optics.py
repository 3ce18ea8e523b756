"""The camera equation in closed form, and what `form_image` leaves alone."""

import re
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from sensor.config import LensConfig, SensorConfig
from sensor.diffraction import diffraction_otf
from sensor.lens.illumination import falloff
from sensor.optics import SpectralIrradiance, camera_equation, form_image, least_samples, left_out, mtf50_error
from sensor.pixel import PixelConfig
from sensor.presets import preset, preset_names
from studies.metrics.mtf import edge_response

ISET_NM = np.arange(400.0, 701.0, 10.0)  # samples 10 nm apart, summed as rectangles


def camera(**lens):
    pixel = PixelConfig(pitch_um=2.2, fill_factor=0.9, full_well_e=15_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
    return SensorConfig(pixel, LensConfig(**lens))


@loop("f_number", [0.5, 1.4, 2.8, 16.0])
@loop("magnification", [0.0, 0.00323, 1.0])
@loop("transmittance", [0.0, 0.8, 1.0])
def test_irradiance_is_pi_t_l_over_1_plus_4_n_squared_1_plus_m_squared(f_number, magnification, transmittance):
    lens = LensConfig(f_number, transmittance, magnification)
    cone = 1 / (2 * f_number * (1 + magnification))  # tangent of the exit pupil's half angle
    half_angle_sine_squared = cone**2 / (1 + cone**2)  # a disc of radiance L gives pi L sin^2
    assert camera_equation(lens) == pytest.approx(pi * transmittance * half_angle_sine_squared, rel=1e-13)


def test_each_value_is_scaled_by_the_camera_equation_and_nothing_is_mixed():
    rng = np.random.default_rng(1)
    radiance = SpectralRadiance(rng.random((5, 7, 31)), ISET_NM)
    sensor = camera(f_number=4.0, transmittance=0.5)
    image = form_image(radiance, sensor)
    np.testing.assert_allclose(image.values, radiance.values * (0.5 * pi / 65), rtol=1e-15)
    np.testing.assert_array_equal(image.wavelength_nm, ISET_NM)
    np.testing.assert_array_equal(image.widths_nm, 10.0)
    assert image.pitch_um == 2.2


def test_photons_and_lux_of_one_green_line_are_in_closed_form():
    # 555 nm, 1 W m^-2 in a band of 2 nm: V is 1 to 1e-4, and a photon carries h c / lambda
    image = SpectralIrradiance(np.full((2, 2, 1), 0.5), np.array([555.0]), 2.2, np.array([2.0]))
    np.testing.assert_allclose(image.illuminance(), 683.0, rtol=5e-4)
    np.testing.assert_allclose(image.photons(), 1e-12 * 555e-9 / (6.62607015e-34 * 299792458.0), rtol=1e-12)


@loop("shape", [(2, 2, 30), (2, 31)])
def test_an_irradiance_without_one_value_a_band_is_refused(shape):
    with pytest.raises(InputError, match=r"irradiance: shape .* is not \(h, w, 31\); give one value a band"):
        SpectralIrradiance(np.ones(shape), ISET_NM, 2.2)


@loop("value", [np.nan, -1e-9, np.inf])
def test_an_irradiance_that_cannot_be_is_refused_where_it_stands(value):
    values = np.ones((3, 4, 31))
    values[1, 2, 5] = value
    with pytest.raises(InputError, match=r"irradiance: .* at row 1, column 2, band 5; allowed: finite numbers >= 0"):
        SpectralIrradiance(values, ISET_NM, 2.2)


# What a camera's optics leave out, and that the costs stated are those that `form_image` shows when it is put in.


def preset_camera(pitch_um=2.2, diffraction=0.0, **lens):
    sensor = preset("low_noise")
    return replace(
        sensor,
        pixel=replace(sensor.pixel, pitch_um=pitch_um),
        lens=replace(sensor.lens, diffraction=diffraction, **lens),
    )


def line(sensor, start):
    return next(text for text in left_out(sensor) if text.startswith(start))


def numbers(text):
    return [float(x) for x in re.findall(r"\d+\.\d+", text)]


@loop("name", preset_names())
def test_every_preset_says_in_one_line_each_what_it_leaves_out(name):
    lines = left_out(preset(name))
    starts = [text.split(":")[0] for text in lines]
    assert starts == [
        "diffraction" if name.startswith("table1") else "detail finer than a pixel",
        "cos^4 falloff",
        "veiling glare",
        "defocus",
        "camera shake",
        "aberrations, distortion, flare, polarisation",
    ]
    assert not any("\n" in text for text in lines)


def test_a_complete_lens_leaves_out_what_lies_within_a_pixel_and_is_not_modelled():
    whole = preset_camera(diffraction=1.0, horizontal_view_deg=40.0, veiling_glare=0.02, defocus_um=5.0, shake_um=5.0)
    starts = [text.split(":")[0] for text in left_out(whole)]
    assert starts == ["detail finer than a pixel", "aberrations, distortion, flare, polarisation"]


def test_diffraction_at_f_2_8_and_2_2_um_costs_what_the_design_says():
    assert numbers(line(preset_camera(), "diffraction"))[-2:] == [0.64, 0.36]
    assert numbers(line(preset_camera(f_number=16.0), "diffraction"))[-1] == 0.0  # beyond the lens's limit


def test_a_pixel_wide_blur_costs_2_j1_x_over_x_at_half_pi():
    assert numbers(line(preset_camera(), "defocus"))[-1] == pytest.approx(0.6366 * 0.7217, abs=0.006)


def test_the_falloff_stated_is_that_of_a_picture_s_corners():
    lost = float(re.search(r"lose (\d+) %|lose (\d+)%", line(preset_camera(), "cos^4"))[0].split()[1].strip("%"))
    corner = falloff(replace(preset_camera().lens, horizontal_view_deg=40.0), (1500, 2000))[0, 0]
    assert lost == pytest.approx(100 * (1 - corner), abs=0.6)


@loop("f_number", [1.4, 2.8, 16.0])
def test_the_mtf_lost_within_pixels_is_what_gratings_lose(f_number):
    sensor = preset_camera(diffraction=1.0, f_number=f_number)
    nm, width, size = np.array([550.0]), np.array([10.0]), 64
    lost = []
    for waves in range(0, size, 4):
        phase = np.pi * waves / size * (np.arange(size) + 0.5)
        grating = np.ones((4, 1, 1)) * (1 + np.cos(phase))[None, :, None]
        made = form_image(SpectralRadiance(grating, nm, width_nm=width), sensor).values[0, :, 0]
        made = made / camera_equation(sensor.lens)
        contrast = (made * np.cos(phase)).sum() / (np.cos(phase) ** 2).sum()
        s = min(waves / (2 * size * 2.2) * 0.55 * f_number, 1.0)
        lens = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
        lost.append((lens - contrast) * np.sinc(waves / 2 / size))
    assert numbers(line(sensor, "detail finer than a pixel"))[0] == pytest.approx(max(lost), abs=1e-3)
    assert max(lost) < 0.05


def test_a_disc_of_a_few_pixels_alone_is_told_too():
    assert "detail finer than a pixel" in line(preset_camera(defocus_um=4.0), "detail")


def test_a_disc_within_the_airy_disc_is_called_a_guess():
    assert "rough guess" in line(preset_camera(diffraction=1.0, defocus_um=1.0), "defocus")
    assert not any(text.startswith("defocus") for text in left_out(preset_camera(diffraction=1.0, defocus_um=5.0)))


def edge_radiance(samples, size=160, degrees=5.0):
    """Area averages of an edge through the middle, in closed form: the second integral of a step, four times."""
    across, along = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    row, column = np.indices((size * samples, size * samples)) - (size * samples - 1) / 2
    distance, a, b = column * across + row * along, across / 2, along / 2
    ramp = lambda x: np.maximum(x, 0.0) ** 2 / 2  # noqa: E731
    corners = ramp(distance + a + b) - ramp(distance + a - b) - ramp(distance - a + b) + ramp(distance - a - b)
    return SpectralRadiance((0.15 + 0.45 * corners / (4 * a * b))[..., None], np.array([550.0]), width_nm=np.ones(1))


@loop("f_number", [2.0, 2.8, 5.6])
def test_an_edge_imaged_by_the_rules_samples_has_the_lenss_mtf50_and_by_one_the_error_stated(f_number):
    sensor = preset_camera(diffraction=1.0, f_number=f_number)
    frequency = np.linspace(0.01, 0.6, 2000)
    mtf = diffraction_otf(frequency / 2.2, 550.0, sensor.lens) * np.sinc(frequency)
    true = float(np.interp(-0.5, -mtf, frequency))

    def found(samples):
        image = form_image(edge_radiance(samples), sensor, samples).values[..., 0]
        return edge_response(image / image.max()).mtf50_cycles_per_px

    assert least_samples(sensor) == {2.0: 3, 2.8: 2, 5.6: 2}[f_number]
    assert found(least_samples(sensor)) == pytest.approx(true, rel=0.01)
    assert found(1) == pytest.approx(true * (1 + mtf50_error(sensor)), rel=0.012)
    assert mtf50_error(sensor) < -0.03
