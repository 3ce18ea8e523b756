"""Both pipelines: decisions, the balance, saturation, errors."""

import numpy as np
import pytest
from builders import mosaic_of, raw_image

from isp.colour.white_balance import WhiteBalance
from isp.interleaved import reconstruct
from isp.processors.catalogue import NAMED
from rodcone.errors import InputError
from rodcone.jit import backend
from sensor.cfa import BAYER, RGBW, Tile
from sensor.raw import RawImage

INTERLEAVED, CONVENTIONAL = NAMED["interleaved"].develop, NAMED["bayer"].develop
IDENTITY = np.eye(3)


def raw(cfa: Tile, levels_e: dict[str, float], shape: tuple[int, int] = (32, 32), noise_e: float = 0.0) -> RawImage:
    """Raw image at one electron a DN with a black level of 100."""
    electrons = mosaic_of(levels_e, cfa, shape) + noise_e * np.random.default_rng(0).standard_normal(shape)
    return raw_image(np.clip(np.rint(electrons + 100), 0, 15_100), cfa, read_noise_e=max(noise_e, 1.0))


def test_interleaved_says_which_engine_ran() -> None:
    assert INTERLEAVED(raw(RGBW, dict.fromkeys("RGBW", 100.0)), IDENTITY).engine == backend()


def test_substitution_follows_its_threshold() -> None:
    image = raw(RGBW, {"R": 10, "G": 20, "B": 8, "W": 100}, noise_e=20.0)
    picture = INTERLEAVED(image, IDENTITY)
    assert picture.snr is not None
    assert picture.snr < 4.95
    assert picture.substituted is True
    assert INTERLEAVED(image, IDENTITY, substitution_snr=0.0).substituted is False
    bright = raw(RGBW, {"R": 500, "G": 1000, "B": 400, "W": 5000})
    assert INTERLEAVED(bright, IDENTITY).substituted is False


def test_dark_frame_is_balanced_by_calibration_and_says_so() -> None:
    image = raw(RGBW, {"R": 0.0, "G": 0.1, "B": 0.0, "W": 0.5}, noise_e=20.0)
    picture = INTERLEAVED(image, IDENTITY)
    assert set(picture.balance.values()) == {"calibrated"}
    assert np.all(np.isfinite(picture.rgb))


def test_saturated_w_does_not_shift_the_colours_balance() -> None:
    # Grey on average; W saturates on the reddish half alone, which has to count all the same.
    image = raw(RGBW, {"R": 1000, "G": 3000, "B": 1500, "W": 9000})
    image.dn[:, :16] = raw(RGBW, {"R": 2000, "G": 3000, "B": 900, "W": 15_000}).dn[:, :16]
    planes = reconstruct(image)
    gains, _ = WhiteBalance.of(image, None).gains(image, planes)
    assert (planes * gains)[..., :3].mean(axis=(0, 1)) == pytest.approx([3000.0] * 3, rel=1e-4)
    # Away from the seam, whose sharpening moves the frame's mean, the picture has these gains.
    picture, half = INTERLEAVED(image, IDENTITY), (planes * gains)[..., :3]
    for columns in (slice(0, 12), slice(20, 32)):
        assert picture.rgb[:, columns] == pytest.approx(half[:, columns], rel=1e-3)


def test_a_given_balance_takes_the_place_of_gray_world() -> None:
    matrix = np.array([[1.5, -0.5, 0.0], [0.0, 1.0, 0.0], [0.25, -0.25, 1.0]])
    four = raw(RGBW, {"R": 500, "G": 1000, "B": 400, "W": 5000})
    three = raw(BAYER, {"R": 500, "G": 1000, "B": 400})
    # response 1 : 2 : 1 (: 4): R and B doubled, so that balanced signals are 1000, 1000 and 800
    expected = [1000.0, 1000.0, 800.0]
    for picture, names in (
        (INTERLEAVED(four, matrix, balance=[1, 2, 1, 4]), "RGBW"),
        (CONVENTIONAL(three, matrix, neutral=[7, 1, 7], balance=[1, 2, 1]), "RGB"),
    ):
        assert picture.rgb == pytest.approx(np.full((32, 32, 3), expected), rel=1e-5)
        assert picture.balance == dict.fromkeys(names, "given")


def test_a_picture_is_its_linear_rgb_to_numpy() -> None:
    linear = CONVENTIONAL(raw(BAYER, {"R": 500, "G": 1000, "B": 400}, (16, 18)), IDENTITY)
    assert linear.shape == (16, 18, 3)
    assert np.asarray(linear) is linear.rgb
    assert np.asarray(linear, dtype=np.float32).dtype == np.float32
    assert np.percentile(linear, 99) == pytest.approx(1000.0)
    for scale in (1000.0, np.float64(1000.0), np.full(3, 1000.0)):
        np.testing.assert_array_equal(linear / scale, linear.rgb / scale)


def test_wrong_matrix_or_neutral_is_refused() -> None:
    image = raw(BAYER, {"R": 1, "G": 1, "B": 1})
    with pytest.raises(InputError, match=r"^matrix: shape \(2, 3\)"):
        CONVENTIONAL(image, np.ones((2, 3)))
    with pytest.raises(InputError, match=r"^neutral: \[1.0, 0.0, 1.0\]"):
        CONVENTIONAL(image, IDENTITY, neutral=[1, 0, 1])
    with pytest.raises(InputError, match=r"^balance: \[1.0, inf, 1.0\]"):
        CONVENTIONAL(image, IDENTITY, balance=[1, np.inf, 1])
