"""Processors before raw images some of whose channels are read apart: units of noise, flat fields, and both engines."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from loop import loop

from isp.anscombe import stabilise_raw, unstabilise_raw, without_prnu
from isp.interleaved.numpy_form import reference_with_noise
from isp.interleaved.reconstruction import reconstruct_with_noise
from isp.kriging import reconstruct_linear
from isp.ple.prior import own_prior
from isp.ple.pyramid import reconstruct as reconstruct_ple
from isp.remosaic import remosaic
from isp.settings import DEFAULTS
from sensor.cfa import RGBW, channels, mask
from sensor.config import with_channel_readings
from sensor.device import draw_device
from sensor.pixel import ChannelReading
from sensor.presets import low_noise
from sensor.raw import RawImage, channel_variance
from sensor.readout import noise_variance, read_out

TIME_S, SIDE = 0.01, 96
WAYS = (
    ChannelReading("W", time_share=0.2),
    ChannelReading("W", light_share=0.5, read_noise_e=10.0),
    ChannelReading("G", time_share=0.25),
)


@cache
def flat(reading: ChannelReading, green_e: float = 900.0) -> tuple[RawImage, np.ndarray]:
    """Even white light, and its electrons by channel."""
    plain = low_noise()
    sensor = with_channel_readings(replace(plain, pixel=replace(plain.pixel, prnu=0.0)), [reading])
    neutral = own_prior().neutral_e
    means = green_e * neutral / neutral[1]
    field = sum(mean * mask(RGBW, name, (SIDE, SIDE)) for name, mean in zip("RGBW", means, strict=True))
    device = draw_device(sensor, (SIDE, SIDE), np.random.default_rng(1))
    raw = read_out(np.asarray(field), sensor, device, TIME_S, np.random.default_rng(2))
    said = [noise_variance(np.array([mean]), sensor, TIME_S, name)[0] for name, mean in zip("RGBW", means, strict=True)]
    assert channel_variance(raw, means) == pytest.approx(said, rel=1e-9)
    return raw, means


@loop("reading", WAYS)
def test_every_channel_s_samples_have_one_unit_of_noise_and_come_back(reading):
    raw, means = flat(reading)
    plain = without_prnu(raw)
    stable = stabilise_raw(plain.electrons, plain)
    for name, mean in zip("RGBW", means, strict=True):
        values = stable[mask(RGBW, name, raw.shape)]
        assert values.std() == pytest.approx(1.0, abs=4.5 / np.sqrt(2 * values.size)), name
        level = np.where(mask(RGBW, name, raw.shape), values.mean(), stable)
        back = unstabilise_raw(level, plain)[mask(RGBW, name, raw.shape)][0]
        sample_e = np.sqrt(channel_variance(raw, means)["RGBW".index(name)] / values.size)
        assert back == pytest.approx(raw.electrons[mask(RGBW, name, raw.shape)].mean(), abs=0.1 * sample_e + 0.3), name
        assert back == pytest.approx(mean, abs=4.5 * sample_e), name


@pytest.mark.thorough
@loop("reading", WAYS)
def test_a_flat_field_comes_out_at_its_level_in_every_channel(reading):
    """Within 4.5 standard errors of a channel's samples, and 0.2 % for what a prior or a bound adds."""
    raw, means = flat(reading)
    errors_e = np.sqrt(channel_variance(raw, means) / (raw.dn.size / 4))
    white_e = own_prior().neutral_e / own_prior().neutral_e[1]
    planes = {
        "interleaved": np.asarray(reconstruct_with_noise(raw).estimate, np.float64),
        "kriging": reconstruct_linear(raw).estimate,
        "ple": reconstruct_ple(raw, own_prior(), white_e)[0],
    }
    for name, plane in planes.items():
        off = np.abs(plane.mean(axis=(0, 1)) - means)
        assert (off < 4.5 * errors_e + 2e-3 * means).all(), (name, off / means)


def test_both_engines_read_the_same():
    raw, _ = flat(WAYS[0], 2.0)
    part = replace(raw, dn=raw.dn[:32, :32])
    kernel = reconstruct_with_noise(part)
    reference = reference_with_noise(kernel.white.raw, DEFAULTS, np.float64(kernel.white.guide))
    assert np.abs(kernel.estimate - reference.estimate).max() < 2e-3 * reference.estimate.max()
    assert np.abs(kernel.noise_gain - reference.noise_gain).max() < 2e-3


def test_a_mosaic_made_of_another_keeps_what_it_has_of_channels_apart():
    raw, _ = flat(WAYS[2])
    assert remosaic(raw).channel_noise == raw.channel_noise
    assert remosaic(flat(WAYS[0])[0]).channel_noise == ()
    assert channels(remosaic(raw).cfa) == ("R", "G", "B")
