"""What a camera's optics leave out, and that the costs stated are those that `form_image` shows when it is put in."""

import re
from dataclasses import replace

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from sensor.optics import camera_equation, falloff, form_image, left_out
from sensor.presets import names, preset


def camera(pitch_um=2.2, diffraction=0.0, **lens):
    sensor = preset("low_noise")
    return replace(
        sensor,
        pixel=replace(sensor.pixel, pitch_um=pitch_um),
        lens=replace(sensor.lens, diffraction=diffraction, **lens),
    )


def line(sensor, start, samples=1):
    return next(text for text in left_out(sensor, samples) if text.startswith(start))


def numbers(text):
    return [float(x) for x in re.findall(r"\d+\.\d+", text)]


@loop("name", names())
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


def test_a_complete_lens_leaves_out_what_is_not_modelled_alone():
    whole = camera(diffraction=1.0, horizontal_view_deg=40.0, veiling_glare=0.02, defocus_um=5.0, shake_um=5.0)
    assert [text.split(":")[0] for text in left_out(whole, 4)] == ["aberrations, distortion, flare, polarisation"]


def test_diffraction_at_f_2_8_and_2_2_um_costs_what_the_design_says():
    assert numbers(line(camera(), "diffraction"))[-2:] == [0.64, 0.36]
    assert numbers(line(camera(f_number=16.0), "diffraction"))[-1] == 0.0  # beyond the lens's limit


def test_a_pixel_wide_blur_costs_2_j1_x_over_x_at_half_pi():
    assert numbers(line(camera(), "defocus"))[-1] == pytest.approx(0.6366 * 0.7217, abs=0.006)


def test_the_falloff_stated_is_that_of_a_picture_s_corners():
    lost = float(re.search(r"lose (\d+) %|lose (\d+)%", line(camera(), "cos^4"))[0].split()[1].strip("%"))
    corner = falloff(replace(camera().lens, horizontal_view_deg=40.0), (1500, 2000))[0, 0]
    assert lost == pytest.approx(100 * (1 - corner), abs=0.6)


@loop("f_number", [1.4, 2.8, 16.0])
def test_the_mtf_lost_within_pixels_is_what_gratings_lose(f_number):
    sensor = camera(diffraction=1.0, f_number=f_number)
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
    assert "detail finer than a pixel" in line(camera(defocus_um=4.0), "detail")
    assert not any("finer" in text for text in left_out(camera(defocus_um=4.0), 4))


def test_four_samples_a_pixel_follow_the_lens_of_the_preset():
    assert not any("finer" in text for text in left_out(camera(diffraction=1.0), 4))


def test_samples_too_far_apart_for_the_lens_are_told_with_their_cost():
    sensor = camera(pitch_um=6.0, diffraction=1.0)
    assert 0.001 < numbers(line(sensor, "detail finer than a sample", 4))[0] < 0.03
    assert not any("finer" in text for text in left_out(sensor, 8))


def test_a_disc_within_the_airy_disc_is_called_a_guess():
    assert "rough guess" in line(camera(diffraction=1.0, defocus_um=1.0), "defocus")
    assert not any(text.startswith("defocus") for text in left_out(camera(diffraction=1.0, defocus_um=5.0)))
