"""A frame through the Dr.Jit form: expected electrons and noise beside the NumPy form and the exact laws."""

from dataclasses import replace

import numpy as np
import pytest
from builders import EVERY_TERM, even_device
from exact_law import assert_moments, exact_probabilities
from loop import loop
from scipy import stats
from scipy.special import ndtri

from rodcone.jit import arrays, backend, dr
from sensor.cfa import MOSAICS
from sensor.config import LensConfig, SensorConfig
from sensor.device import Device, draw_device
from sensor.kernel.kernel import expected_electrons_single, normal_pair, read_frame
from sensor.kernel.kernel import philox_single as kernel_philox
from sensor.kernel.poisson import EXACT_BELOW_E, LARGEST_ERROR, TABLE_ERROR, alias_table, poisson_single
from sensor.optics import SpectralIrradiance
from sensor.pixel import PixelConfig
from sensor.presets import preset
from sensor.random import NoiseTerm, philox
from sensor.readout import read_out
from sensor.response import electrons_per_irradiance, expected_electrons

pytestmark = pytest.mark.skipif(backend() == "numpy", reason="Dr.Jit has neither LLVM nor CUDA here")

NM = np.arange(385.0, 780.0, 10.0)
PIXEL = PixelConfig(2.2, 0.9, full_well_e=60_000.0, read_noise_e=0.0, dsnu_e=0.0, prnu=0.0)
COUNTS = SensorConfig(replace(PIXEL, full_well_e=65_535.0), LensConfig(2.8), bits=16, black_level_dn=0.0)  # 1 e-/DN
NOISY = replace(PIXEL, **EVERY_TERM | {"full_well_e": 900.0, "column_gain_spread": 0.03})
CAMERA = SensorConfig(NOISY, LensConfig(2.8), bits=12)


def read(mean_e, sensor=COUNTS, shape=(1000, 1000), device=None, exposure_s=0.01, key=1):
    light = np.ascontiguousarray(np.broadcast_to(np.float32(mean_e), shape))
    return read_frame(light, sensor, even_device(shape) if device is None else device, exposure_s, key)


# Expected electrons


def irradiance(shape, order="planar", dtype=np.float32, bands=NM.size):
    planes = np.random.default_rng(1).random((bands, *shape)).astype(dtype)
    values = np.moveaxis(planes, 0, -1)
    return values if order == "planar" else np.ascontiguousarray(values)


@loop("order", ["planar", "interleaved"])
@loop("dtype", [np.float32, np.float64])
@loop("mosaic", sorted(MOSAICS))
def test_expected_electrons_are_the_double_precision_ones_to_single_precision(mosaic, dtype, order):
    sensor = preset("low_noise", mosaic)
    image = SpectralIrradiance(irradiance((33, 50), order, dtype), NM, 2.2)
    weights = electrons_per_irradiance(sensor, NM, image.widths_nm, 0.01)
    exact = expected_electrons(replace(image, values=image.values.astype(np.float64)), sensor, 0.01)
    made = expected_electrons_single(image.values, weights, sensor)
    assert made.dtype == np.float32
    np.testing.assert_allclose(made, exact, rtol=2e-6)


@loop("shape", [(2, 2), (3, 5), (16, 16), (64, 64), (61, 47)])
@loop("shift", [0, 1, 3, 4, 16])
def test_memory_of_any_alignment_gives_the_same_bits(shape, shift):
    memory = np.zeros(NM.size * shape[0] * shape[1] + 32, dtype=np.float32)
    planes = memory[shift : shift + NM.size * shape[0] * shape[1]].reshape(NM.size, *shape)
    planes[:] = np.moveaxis(irradiance(shape), -1, 0)
    sensor = preset("low_noise")
    weights = electrons_per_irradiance(sensor, NM, np.full(NM.size, 10.0), 0.01)
    made = expected_electrons_single(np.moveaxis(planes, 0, -1), weights, sensor)
    np.testing.assert_array_equal(made, expected_electrons_single(irradiance(shape, "interleaved"), weights, sensor))


def test_read_only_memory_is_read_and_left_alone():
    values = irradiance((8, 16))
    values.flags.writeable = False
    weights = np.ones((4, NM.size))
    np.testing.assert_allclose(
        expected_electrons_single(values, weights, preset("low_noise")), values.sum(-1), rtol=1e-6
    )


# Shot noise


@loop("mean_e", [0.01, 0.05, 0.3, 1.0, 3.0, 10.0, 29.0, 31.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4])
@loop("gain_e_per_dn", [1.0, 1.7])
def test_totals_and_variances_of_a_megapixel_are_the_exact_law_s_after_rounding(mean_e, gain_e_per_dn):
    sensor = COUNTS
    if gain_e_per_dn != 1:
        well_e = gain_e_per_dn * (65_535 - 10)
        sensor = replace(COUNTS, pixel=replace(PIXEL, full_well_e=well_e), black_level_dn=10)
    # 56 comparisons within 4 standard errors: false-alarm rate 3.5e-3 for fresh keys
    dn = read(mean_e, sensor, key=int(mean_e * 100))
    assert_moments(dn, exact_probabilities(float(np.float32(mean_e)), sensor))


# The order of the terms, beside the NumPy form


def test_without_shot_and_read_noise_the_dns_are_the_numpy_form_s_bit_for_bit():
    sensor = replace(CAMERA, pixel=replace(NOISY, read_noise_e=0.0))
    device = draw_device(sensor, (64, 48), np.random.default_rng(1))
    for light in (0.0, 1e7):  # dark at exposure 0, and every well full
        light_e = np.full((64, 48), light)
        numpy_form = read_out(light_e, sensor, device, 0.0, np.random.default_rng(2))
        dn = read(light, sensor, (64, 48), device, exposure_s=0.0)
        assert dn.dtype == np.uint16
        np.testing.assert_array_equal(dn, numpy_form.dn)
    assert len(np.unique(dn)) > 20


def test_every_pixel_has_the_mean_and_variance_of_the_numpy_form():
    shape, frames = (32, 40), 100
    device = draw_device(CAMERA, shape, np.random.default_rng(1))
    light_e = np.random.default_rng(2).uniform(0, 500, shape)
    light_e[:4] = 2000.0  # full wells
    light_e[4:8] = 0.0
    rng = np.random.default_rng(3)
    exact = np.array([read_out(light_e, CAMERA, device, 0.05, rng).dn for _ in range(frames)], dtype=np.float64)
    made = np.array([read(light_e, CAMERA, shape, device, 0.05, key) for key in range(frames)], dtype=np.float64)
    clipped = np.median(exact, axis=0) == CAMERA.white_dn
    assert (made[:, clipped] == CAMERA.white_dn).mean() > 0.5
    assert 0.01 < clipped.mean() < 0.1  # full wells behind a strong column
    exact, made = exact[:, ~clipped], made[:, ~clipped]
    variances = exact.var(axis=0, ddof=1), made.var(axis=0, ddof=1)
    difference = (made.mean(axis=0) - exact.mean(axis=0)) ** 2 / ((variances[0] + variances[1]) / frames)
    freedom = 2 * frames - 2
    # a squared t has mean f / (f - 2) and variance 2 at large f; 1280 of them within 4.5 standard errors: 7e-6
    assert abs(difference.mean() - freedom / (freedom - 2)) < 4.5 * np.sqrt(2.1 / difference.size)
    ratio = np.log(variances[1] / variances[0])  # variance about 4 / f' with f' = 99
    assert abs(ratio.mean()) < 4.5 * np.sqrt(4 / (frames - 1) / ratio.size)
    assert difference.max() < stats.f.isf(1e-6 / difference.size, 1, freedom)


def test_read_noise_is_that_of_the_pixel_s_own_counter():
    sensor = replace(COUNTS, pixel=replace(COUNTS.pixel, read_noise_e=100.0), black_level_dn=1000.0)
    dn, key = read(0.0, sensor, (5, 7), key=2**40 + 3), 2**40 + 3
    for row, column in np.ndindex(5, 7):
        counter = tuple(np.array([word], np.uint64) for word in (column, row, int(NoiseTerm.EXPOSURE), 0))
        first, second = (int(word[0]) >> 1 for word in philox(counter, key)[:2])
        noise_e = 100 * np.sqrt(-2 * np.log((first + 0.5) / 2**31)) * np.cos(2 * np.pi * second / 2**31)
        assert abs(dn[row, column] - (1000 + noise_e / sensor.gain_e_per_dn)) < 0.51


# Draws by coordinates


def test_one_key_gives_one_frame_and_every_bit_of_a_key_another():
    frames = [read(1000.0, shape=(16, 16), key=key) for key in (5, 5, 4, 5 + 2**32, 5 + 2**63)]
    np.testing.assert_array_equal(frames[0], frames[1])
    for other in frames[2:]:
        assert np.mean(frames[0] == other) < 0.1


@loop("shape", [(1, 2), (10, 64), (10, 20), (63, 3)])
def test_a_crop_reads_as_the_full_frame_does_there(shape):
    sensor = replace(CAMERA, pixel=replace(NOISY, crosstalk=0.0))  # crosstalk knows the frame's border
    device = draw_device(sensor, (64, 64), np.random.default_rng(1))
    light_e = np.random.default_rng(3).uniform(0, 900, (64, 64)).astype(np.float32)
    crop = np.s_[: shape[0], : shape[1]]
    part = Device(
        device.photo_response[crop], device.dark_offset_e[crop], device.column_gain[: shape[1]], device.hot[crop]
    )
    full = read_frame(light_e, sensor, device, 0.01, 7)
    np.testing.assert_array_equal(read_frame(light_e[crop], sensor, part, 0.01, 7), full[crop])


# Ends of the range


@loop("full_well_e", [1.0, 1000.0, 1e12])
@loop("times", [1e8, np.inf])
def test_light_of_1e8_full_wells_and_more_saturates_and_nothing_more(full_well_e, times):
    sensor = replace(COUNTS, pixel=replace(PIXEL, full_well_e=full_well_e, prnu=0.5))
    device = draw_device(sensor, (64, 64), np.random.default_rng(1))
    dn = read(times * full_well_e, sensor, (64, 64), device)
    answering = device.photo_response > 1e-3
    np.testing.assert_array_equal(dn[answering], sensor.white_dn)
    np.testing.assert_array_equal(dn[device.photo_response == 0], 0)  # and no infinity times nothing


@loop("crosstalk", [0.0, 0.1, 0.25])
@loop("light", [1e30, 1e300])
def test_light_beyond_single_precision_saturates_without_a_warning(light, crosstalk):
    sensor = replace(COUNTS, pixel=replace(COUNTS.pixel, crosstalk=crosstalk))
    weights = np.full((4, 3), 1e20)
    weights[0] = 0.0  # a channel that doesn't see it
    expected_e = expected_electrons_single(np.full((6, 8, 3), light), weights, sensor)
    assert not np.isnan(expected_e).any()
    dn = read_frame(expected_e, sensor, even_device((6, 8)), 0.01, 1)
    np.testing.assert_array_equal(dn[1::2], sensor.white_dn)  # rows of B and W
    if crosstalk == 0:
        np.testing.assert_array_equal(dn[::2, ::2], 0)


def test_a_dark_current_that_fills_the_well_saturates_without_light():
    sensor = replace(COUNTS, pixel=replace(PIXEL, dark_current_e_per_s=1e12))
    np.testing.assert_array_equal(read(0.0, sensor, (4, 4), exposure_s=1e7), sensor.white_dn)


@loop("bits", [1, 2, 16])
def test_a_converter_gives_whole_numbers_from_0_to_its_top_and_never_wraps(bits):
    sensor = SensorConfig(
        replace(PIXEL, full_well_e=4e4, read_noise_e=1e5), LensConfig(2.8), bits=bits, black_level_dn=0.0
    )
    dn = read(np.linspace(0, 8e4, 256, dtype=np.float32), sensor, (256, 256))
    assert (dn.min(), dn.max()) == (0, 2**bits - 1)


def test_cameras_exposures_keys_and_sizes_share_one_compiled_kernel():
    def launches(sensor, shape, key):
        device = draw_device(sensor, shape, np.random.default_rng(1))
        weights = electrons_per_irradiance(sensor, NM, np.full(NM.size, 10.0), 0.001 * key)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            expected = expected_electrons_single(irradiance(shape) * 1e-3, weights, sensor)
            read_frame(expected, sensor, device, 0.001 * key, key)
            return list(dr.kernel_history([dr.KernelType.JIT]))

    launches(preset("low_noise"), (32, 32), 1)
    leaky = replace(preset("table1_output"), pixel=replace(PIXEL, dark_current_e_per_s=50.0), bits=10)
    for sensor, shape, key in ((preset("table1_pixel"), (33, 46), 2), (leaky, (64, 4), 3)):
        again = launches(sensor, shape, key)
        assert again
        assert all(launch["cache_hit"] for launch in again)


# Philox and the normal draws in Dr.Jit against the NumPy form, and the sum over bands in closed form.


def words(values):
    return arrays().UInt(np.ascontiguousarray(values, dtype=np.uint32))


@loop("key", [0, 0x0123456789ABCDEF, 2**64 - 1, 2**32, 2**31])
def test_philox_is_the_numpy_form_s_word_for_word(key):
    counter = np.random.default_rng(key % 1000).integers(0, 2**32, (4, 257), dtype=np.uint64)
    counter[:, :2] = [[0, 2**32 - 1]] * 4
    made = kernel_philox(tuple(words(c) for c in counter), (words([key & 0xFFFFFFFF]), words([key >> 32])))
    for mine, reference in zip(made, philox(tuple(counter), key), strict=True):
        np.testing.assert_array_equal(mine.numpy(), reference.astype(np.uint32))


def test_a_pair_of_normals_is_box_muller_of_31_bits():
    first, second = np.random.default_rng(1).integers(0, 2**32, (2, 4096), dtype=np.uint64)
    first[:3] = [0, 2**32 - 1, 2**31]
    sine, cosine = (x.numpy() for x in normal_pair(words(first), words(second)))
    radius = np.sqrt(-2 * np.log(((first >> np.uint64(1)) + 0.5) / 2.0**31))
    angle = 2 * np.pi * (second >> np.uint64(1)) / 2.0**31
    # an angle near 2 pi has steps of 5e-7; the smallest radius, 2.2e-5, comes out as 0
    np.testing.assert_allclose(sine, radius * np.sin(angle), rtol=0, atol=2.5e-5)
    np.testing.assert_allclose(cosine, radius * np.cos(angle), rtol=0, atol=2.5e-5)
    assert radius[0] == pytest.approx(np.sqrt(64 * np.log(2)), rel=1e-12)  # the furthest draw, 6.66


# The Dr.Jit Poisson draws against the exact law, with evenly spread random numbers in place of random ones.
#
# Where the numbers are even, the share of draws up to a count is the distribution function to one step of them: the
# errors measured here are errors, not chance.


STRATA = 1 << 21


def draws(mean_e, normal=None, words=None):
    jit = arrays()
    count = next(len(x) for x in (normal, *(words or ())) if x is not None and np.ndim(x))
    normal = np.zeros(count) if normal is None else normal
    first, second = (
        jit.UInt(np.ascontiguousarray(np.broadcast_to(word, count), dtype=np.uint32)) for word in words or (0, 0)
    )
    made = poisson_single(
        dr.full(jit.Float, mean_e, count), jit.Float(normal.astype(np.float32)), (first, second), table_on_device()
    )
    return made.numpy().astype(np.int64)


def table_on_device():
    return arrays().UInt(alias_table().ravel())


def distribution_error(counts, mean_e):
    share = np.cumsum(np.bincount(counts)) / counts.size
    return np.abs(share - stats.poisson.cdf(np.arange(share.size), mean_e)).max()


def even_normals():
    return ndtri((np.arange(STRATA) + 0.5) / STRATA)


def test_the_tables_hold_the_exact_probabilities_of_every_whole_mean():
    table = alias_table()
    assert table.shape == (30, 128)
    worst = 0.0
    for mean, row in enumerate(table):
        own, other = (row >> 7) / 2.0**25, row & 127
        probability = (own + np.bincount(other, 1 - own, minlength=128)) / 128
        worst = max(worst, np.abs(np.cumsum(probability) - stats.poisson.cdf(np.arange(128), mean)).max())
    assert 1e-11 < worst < TABLE_ERROR  # 25-bit shares are neither perfect nor worse than stated


@loop("mean_e", [1.0, 7.0, 12.0, 29.0])
def test_draws_of_whole_means_are_the_table_s(mean_e):
    words = (np.arange(STRATA, dtype=np.uint64) << 11).astype(np.uint32)
    # the second word is the fraction's: with none, it draws 0 whatever it is. Each of 128 bins ends within one step.
    assert distribution_error(draws(mean_e, words=(words, 123456789)), mean_e) < 128 / STRATA


@loop("mean_e", [1e-30, 1e-3, 0.05, 0.3, 0.999])
def test_draws_of_means_under_one_invert_the_distribution_function(mean_e):
    words = (np.arange(STRATA, dtype=np.uint64) << 11).astype(np.uint32)
    assert distribution_error(draws(mean_e, words=(0, words)), np.float32(mean_e)) < 1.5 / STRATA


def test_a_photon_in_ten_thousand_million_pixels_is_drawn_where_the_words_say():
    # chance 1e-10 of one: words of (0, w) stand for a uniform number of about w / 2^64
    low = (np.array([0.5e-10, 0.99e-10, 1.01e-10, 2e-10]) * 2.0**64).astype(np.uint64)
    made = draws(1e-10, words=((low & 0xFFFFFFFF).astype(np.uint32), (low >> 32).astype(np.uint32)))
    # the upper word's last bit isn't used: steps of 2^-31 would round all four to 0 and draw a photon each
    np.testing.assert_array_equal(made[[0, 3]], [1, 0])


@loop("mean_e", [30.0, 31.7, 50.0, 100.0, 1e3, 3e4, 1e6])
def test_from_30_electrons_on_the_largest_error_is_the_stated_one_at_the_foot(mean_e):
    error = distribution_error(draws(mean_e, normal=even_normals()), np.float32(mean_e))
    print(mean_e, error)
    assert error < min(LARGEST_ERROR, LARGEST_ERROR * (30.0 / mean_e) ** 1.5 + 3e-6)
    if mean_e == 30.0:
        assert error > 0.8 * LARGEST_ERROR  # what is stated isn't slack
    assert LARGEST_ERROR < 1e-5


def test_draws_on_both_sides_of_the_seam_are_whole_and_never_negative():
    for mean_e in (np.nextafter(np.float32(EXACT_BELOW_E), np.float32(0)), EXACT_BELOW_E):
        made = draws(mean_e, normal=np.array([-6.7, 0.0, 6.7]), words=(np.array([0, 2**31, 2**32 - 1]), 2**32 - 1))
        assert made.min() >= 0
        assert made.max() < 90
