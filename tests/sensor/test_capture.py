"""A photograph: its exact form is its three steps bit for bit, its quick form is independent of strips and threads."""

from dataclasses import replace

import numpy as np
import pytest
from loop import loop
from refusal import refusal
from scipy import stats

from render.radiance import SpectralRadiance
from rodcone.jit import backend
from sensor.capture import expose, photograph_radiance
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import preset, preset_names
from sensor.readout import read_out
from sensor.response import expected_electrons

NM = np.arange(385.0, 780.0, 10.0)


def scene(dtype=np.float32, shape=(33, 48)):
    return SpectralRadiance(np.random.default_rng(1).uniform(0, 0.006, (*shape, NM.size)).astype(dtype), NM)


@loop(
    ("name", "cfa", "dtype"),
    [*((name, "rgbw", np.float32) for name in preset_names()), ("low_noise", "bayer", np.float64)],
)
def test_an_exact_capture_is_the_chain_of_its_parts_bit_for_bit(name, cfa, dtype):
    radiance, sensor = scene(dtype), preset(name, cfa)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(2))
    raw = photograph_radiance(radiance, sensor, 0.02, device, np.random.default_rng(3), exact=True)
    expected_e = expected_electrons(form_image(radiance, sensor), sensor, 0.02)
    parts = read_out(expected_e, sensor, device, 0.02, np.random.default_rng(3))
    np.testing.assert_array_equal(raw.dn, parts.dn)
    assert raw.engine == "numpy"
    for field in ("cfa", "black_dn", "white_dn", "gain_e_per_dn", "read_noise_e", "dsnu_e", "prnu", "exposure_s"):
        assert getattr(raw, field) == getattr(parts, field), field
    assert 0.001 < np.mean(expected_e / sensor.pixel.full_well_e) < 0.9  # a picture, neither black nor white


@loop("exact", [False, True])
def test_expected_electrons_are_read_out_as_a_capture_reads_them(exact):
    """Exact: to the bit; Dr.Jit forms its electrons in single precision."""
    sensor = preset("low_noise")
    radiance = SpectralRadiance(np.full((16, 24, NM.size), 0.0078125, np.float32), NM)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(2))
    expected_e = expected_electrons(form_image(radiance, sensor), sensor, 0.02)
    raw = expose(expected_e, sensor, 0.02, device, np.random.default_rng(3), exact=exact)
    whole = photograph_radiance(radiance, sensor, 0.02, device, np.random.default_rng(3), exact=exact)
    assert raw.engine == whole.engine == ("numpy" if exact else backend())
    if exact:
        np.testing.assert_array_equal(raw.dn, whole.dn)
    else:  # the electrons differ by some parts in 1e7, which moves few of the draws
        assert np.mean(raw.dn != whole.dn) < 0.01


@loop("exact", [False, True])
def test_one_capture_takes_one_key_from_the_generator(exact):
    radiance, sensor = scene(), preset("low_noise")
    rng, twin = np.random.default_rng(4), np.random.default_rng(4)
    photograph_radiance(
        radiance, sensor, 0.02, draw_device(sensor, radiance.shape, np.random.default_rng(2)), rng, exact=exact
    )
    twin.integers(0, 2**64, dtype=np.uint64)
    assert rng.bit_generator.state == twin.bit_generator.state


@loop("samples", [0, -1])
def test_a_number_of_samples_that_is_none_is_refused(samples):
    refusal(
        photograph_radiance, scene(), preset("low_noise"), 0.02, samples_per_pixel=samples, match="samples_per_pixel: "
    )


@loop("exact", [False, True])
def test_a_chip_of_another_size_is_refused_in_one_line(exact):
    sensor = preset("low_noise")
    device = draw_device(sensor, (33, 47), np.random.default_rng(2))
    refusal(
        photograph_radiance,
        scene(),
        sensor,
        0.02,
        device,
        np.random.default_rng(0),
        exact=exact,
        words=("expected_e: shape (33, 48) is not the device's (33, 47)", "draw the device with the frame's shape"),
    )


def shoot(radiance, sensor, seed=3, exact=False, **options):
    device = draw_device(sensor, (33, 48), np.random.default_rng(2))
    return photograph_radiance(radiance, sensor, 0.02, device, np.random.default_rng(seed), exact=exact, **options)


def mean_electrons(radiance, sensor, frames, **options):
    raws = (shoot(radiance, sensor, seed, **options) for seed in range(frames))
    return np.mean([raw.electrons for raw in raws], axis=0)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "lens", [{}, {"horizontal_view_deg": 70.0}, {"diffraction": 1.0, "veiling_glare": 0.1, "defocus_um": 5.0}]
)
@pytest.mark.parametrize("samples", [1, 2])
def test_both_forms_see_the_light_that_the_lens_gives(samples, lens):
    sensor = preset("low_noise")
    sensor = replace(sensor, lens=replace(sensor.lens, **lens))
    few = scene(shape=(33 * samples, 48 * samples)).values[..., 4::8]  # bands of 80 nm
    radiance = SpectralRadiance(few * np.float32(0.25), NM[4::8])
    device = draw_device(sensor, (33, 48), np.random.default_rng(2))
    expected_e = expected_electrons(form_image(radiance, sensor, samples), sensor, 0.02) * device.photo_response
    assert expected_e.max() < sensor.pixel.full_well_e * 0.8
    for exact in (False, True):
        mean_e = mean_electrons(radiance, sensor, 25, exact=exact, samples_per_pixel=samples) - device.dark_offset_e
        z = (mean_e - expected_e) / np.sqrt((expected_e + 1.5**2 + sensor.gain_e_per_dn**2 / 12) / 25)
        # 1584 pixels: the sum of squares within its 1e-5 quantiles
        assert stats.chi2.ppf(1e-5, z.size) < np.sum(z**2) < stats.chi2.isf(1e-5, z.size)


@pytest.mark.skipif(backend() != "llvm", reason="threads are LLVM's")
def test_the_number_of_threads_does_not_change_a_bit():
    from rodcone.jit import dr

    frames, before = [], dr.thread_count()
    try:
        for threads in (1, 2, 3):
            dr.set_thread_count(threads)
            frames.append(shoot(scene(), preset("low_noise")).dn)
    finally:
        dr.set_thread_count(before)
    np.testing.assert_array_equal(frames[0], frames[1])
    np.testing.assert_array_equal(frames[0], frames[2])
