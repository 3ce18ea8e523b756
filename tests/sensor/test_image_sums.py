"""Sums over bands behind a lens are those of the image of each band, whatever the lens does."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from loop import loop

from render.radiance import SpectralRadiance
from sensor.config import LensConfig
from sensor.diffraction import diffraction_otf, sampled_otf
from sensor.optics import form_image, image_sums
from sensor.presets import low_noise
from sensor.response import channel_electrons, imaged_electrons

NM = np.arange(400.0, 701.0, 20.0)
LENSES = [
    LensConfig(2.8, diffraction=1.0),
    LensConfig(11.0, diffraction=1.0, horizontal_view_deg=60.0),
    LensConfig(4.0, defocus_um=5.0, veiling_glare=0.02),
    LensConfig(2.8, diffraction=1.0, scatter=0.03, horizontal_view_deg=40.0),
    LensConfig(2.8, horizontal_view_deg=40.0, eye_age_years=60.0),
]


def both_ways(values, lens, samples, **options):
    """Electrons by sums over bands of float32, and by the image of each band in double precision."""
    sensor = replace(low_noise(), lens=lens)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of bands that end at 700 nm
        made = imaged_electrons(SpectralRadiance(values, NM, **options), sensor, 0.01, samples)
        double = SpectralRadiance(values.astype(np.float64), NM, **options)
        return made, channel_electrons(form_image(double, sensor, samples), sensor, 0.01)


@loop("lens", LENSES)
@loop("samples", [1, 2])
def test_even_light_is_within_a_millionth_and_light_beside_a_lamp_far_closer(lens, samples):
    """The same for halves of a render, which are signed and keep their undershoot."""
    values = np.random.default_rng(3).random((24, 36, NM.size), dtype=np.float32)
    made, expected = both_ways(values, lens, samples, signed=True)
    assert made.shape == expected.shape
    assert np.all(np.abs(made - expected) <= 1e-6 * (expected + expected.mean(axis=(0, 1))))
    values[10, 12] *= 1e6
    made, expected = both_ways(values, lens, samples, signed=True)
    assert np.abs(made - expected).max() <= 1e-12 * expected.max()


def test_an_image_of_bands_is_of_double_precision_between_its_ends():
    values = np.random.default_rng(4).random((20, 20, NM.size), dtype=np.float32)
    sensor = replace(low_noise(), lens=LENSES[0])
    single, double = (form_image(SpectralRadiance(x, NM), sensor).values for x in (values, values.astype(np.float64)))
    assert single.dtype == np.float32
    np.testing.assert_array_equal(single, double.astype(np.float32))


def test_undershoot_becomes_0_in_each_sum_which_keeps_its_light():
    values = np.full((16, 16, NM.size), 1e-6)
    values[8, 8] = 1.0
    sensor, weights = (
        replace(low_noise(), lens=LensConfig(2.8, defocus_um=9.0)),
        np.random.default_rng(5).random((2, 16)),
    )
    cut, kept = (image_sums(SpectralRadiance(values, NM, signed=signed), weights, sensor) for signed in (False, True))
    assert kept.min() < 0 <= cut.min()
    np.testing.assert_allclose(cut.sum(axis=(0, 1)), kept.sum(axis=(0, 1)), rtol=1e-12)


def test_a_sum_has_equal_bits_on_any_number_of_threads_and_no_direction(monkeypatch):
    values = np.random.default_rng(6).random((24, 2**14, 2), dtype=np.float32)  # three strips of rows
    light, sensor = SpectralRadiance(values, np.array([500.0, 600.0])), replace(low_noise(), lens=LENSES[0])
    sums = []
    for threads in (1, 3):
        monkeypatch.setattr("os.cpu_count", lambda threads=threads: threads)
        sums.append(image_sums(light, np.array([[1.0, 0.5]]), sensor))
    np.testing.assert_array_equal(*sums)
    turned = SpectralRadiance(values.transpose(1, 0, 2), light.wavelength_nm)  # into other strips
    np.testing.assert_allclose(
        sums[0], image_sums(turned, np.array([[1.0, 0.5]]), sensor).transpose(1, 0, 2), rtol=3e-6
    )


@loop(("real", "bound"), [(np.float64, 5e-8), (np.float32, 2.5e-7)])
@loop("f_number", [2.8, 8.0])
def test_the_transfer_is_the_overlap_of_two_discs_at_any_frequency(real, bound, f_number):
    """Finer samples know each frequency and its copies by their sum; behind f/8 the copies are dark."""
    lens, step_um = LensConfig(f_number, diffraction=1.0), 0.4
    made = sampled_otf((40, 60), step_um, lens, folded=True, real=real)(550.0)
    down, across = ((np.arange(size) / (2 * size))[:, None, None] - [0, 1] for size in (40, 60))
    frequencies = np.hypot(down[:, :, :, None], across[:, :, None, :].transpose(1, 0, 2, 3)) / step_um
    copies = diffraction_otf(frequencies, 550.0, lens).sum(axis=(2, 3))
    assert made.dtype == real
    np.testing.assert_allclose(made, copies / copies[0, 0], atol=bound)
    np.testing.assert_array_equal(
        made[7:9], sampled_otf((40, 60), step_um, lens, folded=True, real=real)(550.0, slice(7, 9))
    )


def test_bands_without_weight_cost_nothing_and_change_nothing():
    values = np.random.default_rng(7).random((12, 12, NM.size))
    sensor, weights = replace(low_noise(), lens=LENSES[0]), np.zeros((1, NM.size))
    weights[0, 3] = 2.0
    whole = image_sums(SpectralRadiance(values, NM), weights, sensor)[..., 0]
    np.testing.assert_allclose(whole, 2 * form_image(SpectralRadiance(values, NM), sensor).values[..., 3], rtol=1e-12)
    assert image_sums(SpectralRadiance(values, NM), 0 * weights, sensor).max() == pytest.approx(0.0)
