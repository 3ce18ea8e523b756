"""A raw image developed from Python: with its own colours or given ones, by the paper's processor for its mosaic."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusal import refusal

from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from sensor.capture import capture
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.raw import RawImage
from sensor.raw_files.raw_file import write_raw
from studies.photograph.camera import calibrate
from studies.photograph.develop import develop, develop_file, mosaic_processor


def raw_of(cfa: str) -> RawImage:

    nm = np.arange(385.0, 780.0, 10.0)
    spectrum = illuminant("D65").band_average(nm, np.full(nm.size, 10.0))
    radiance = SpectralRadiance(np.broadcast_to(20 * spectrum, (24, 28, nm.size)).copy(), nm)
    sensor = low_noise(cfa)
    device = draw_device(sensor, radiance.shape, np.random.default_rng(1))
    raw = capture(radiance, sensor, 0.01, device, np.random.default_rng(2), exact=True)
    return replace(raw, colour=calibrate(sensor, illuminant("D65")))


def test_the_mosaic_chooses_the_processor_and_a_grey_wall_is_grey() -> None:
    for cfa, processor in [("rgbw", "interleaved"), ("bayer", "bayer")]:
        raw = raw_of(cfa)
        picture = develop(raw)
        assert np.array_equal(picture.rgb, develop(raw, processor=processor).rgb), (cfa, processor)
        assert np.array_equal(picture.rgb, develop(replace(raw, colour=None), raw.colour).rgb), (cfa, processor)
        mean = picture.rgb.mean(axis=(0, 1))
        assert mean == pytest.approx(np.full(3, mean[1]), rel=0.02), (cfa, processor)


def test_a_quad_of_known_colours_goes_to_the_prior_over_patches() -> None:
    quads = {"quad_rgbw": "ple", "quad_bayer": "ple", "rgbw_4x4": "interleaved", "rccb": "any_mosaic"}
    assert {cfa: mosaic_processor(raw_of(cfa)) for cfa in quads} == quads


def test_what_is_missing_or_unknown_is_said_in_one_line() -> None:
    raw = raw_of("bayer")
    for arguments, told in (
        ({"raw": replace(raw, colour=None)}, r"no colour calibration; .* calibrate\(sensor, illuminant\('D65'\)\)"),
        ({"raw": raw, "processor": "bayerr"}, "'bayerr' is unknown; .*did you mean 'bayer'"),
        ({"raw": raw, "processor": "bayer_menon_fair"}, "did you mean 'bayer_menon'"),
        ({"raw": raw, "processor": "bayer_fair"}, "is gone; .*; use bayer_bilinear"),
        ({"raw": raw, "white_balance": "none"}, "white_balance: 'none' is unknown"),
        ({"raw": raw, "calibration": raw_of("rgbw").colour}, "colour: 4 channels don't fit the mosaic's"),
    ):
        refusal(develop, **arguments, match=told)  # type: ignore[arg-type]


def test_as_shot_is_the_default_from_python_too(tmp_path: Path) -> None:
    raw = raw_of("bayer")
    raw = replace(raw, colour=calibrate(low_noise("bayer"), illuminant("A")))  # set to a lamp, taken in daylight
    default, gray = develop(raw), develop(raw, white_balance="gray-world")
    assert np.array_equal(default.rgb, develop(raw, white_balance="as-shot").rgb)
    blue, grey = (picture.rgb.mean(axis=(0, 1)) for picture in (default, gray))
    assert blue[2] > 1.5 * blue[0]
    assert grey == pytest.approx(np.full(3, grey[1]), rel=0.02)
    write_raw(raw, tmp_path / "shot.dng")
    assert set(develop_file(tmp_path / "shot.dng").facts["balance"].values()) == {"given"}
