"""A photograph is its three steps, bit for bit."""

import numpy as np
import pytest

from render.errors import InputError
from render.radiance import SpectralRadiance
from sensor.capture import capture
from sensor.device import draw_device
from sensor.optics import form_image
from sensor.presets import names, preset
from sensor.readout import read_out
from sensor.response import expected_electrons

NM = np.arange(385.0, 780.0, 10.0)


def scene(dtype=np.float32, shape=(33, 48)):
    return SpectralRadiance(np.random.default_rng(1).uniform(0, 0.006, (*shape, NM.size)).astype(dtype), NM)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("cfa", ["rgbw", "bayer"])
@pytest.mark.parametrize("name", names())
def test_capture_is_the_chain_of_its_parts_bit_for_bit(name, cfa, dtype):
    radiance, sensor = scene(dtype), preset(name, cfa)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(2))
    raw = capture(radiance, sensor, 0.02, device, np.random.default_rng(3))
    expected_e = expected_electrons(form_image(radiance, sensor), sensor, 0.02)
    parts = read_out(expected_e, sensor, device, 0.02, np.random.default_rng(3))
    np.testing.assert_array_equal(raw.dn, parts.dn)
    for field in ("cfa", "black_dn", "white_dn", "gain_e_per_dn", "read_noise_e", "dsnu_e", "prnu", "exposure_s"):
        assert getattr(raw, field) == getattr(parts, field), field
    assert 0.001 < np.mean(expected_e / sensor.pixel.full_well_e) < 0.9  # a picture, neither black nor white


def test_one_capture_takes_one_key_from_the_generator():
    radiance, sensor = scene(), preset("low_noise")
    rng, twin = np.random.default_rng(4), np.random.default_rng(4)
    capture(radiance, sensor, 0.02, draw_device(sensor, radiance.shape, np.random.default_rng(2)), rng)
    twin.integers(0, 2**64, dtype=np.uint64)
    assert rng.bit_generator.state == twin.bit_generator.state


@pytest.mark.parametrize(
    ("exposure_s", "chip", "seed", "message"),
    [
        (-0.02, (33, 48), 0, r"exposure_s: -0\.02 is outside 0 to"),
        (0.02, (33, 47), 0, r"expected_e: shape \(33, 48\) is not the device's \(33, 47\)"),
        (0.02, (33, 48), None, r"rng: 0 is not a NumPy Generator"),
    ],
)
def test_bad_input_is_refused_in_one_line_before_anything_is_taken(exposure_s, chip, seed, message):
    sensor = preset("low_noise")
    device = draw_device(sensor, chip, np.random.default_rng(2))
    rng = 0 if seed is None else np.random.default_rng(seed)
    with pytest.raises(InputError, match=message) as error:
        capture(scene(), sensor, exposure_s, device, rng)
    assert "\n" not in str(error.value)


def test_a_radiance_with_nan_never_becomes_a_picture():
    values = scene().values.copy()
    values[7, 9, 11] = np.nan
    with pytest.raises(InputError, match=r"radiance: nan at row 7, column 9, band 11; allowed: finite numbers >= 0"):
        SpectralRadiance(values, NM)
