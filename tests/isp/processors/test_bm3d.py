"""Processors that denoise with BM3D's own library: light kept, noise gone, the same bits from any thread."""

import sys

import numpy as np
import pytest
from builders import RGBW_4X4, raw_image

from isp.processors.catalogue import PROCESSORS
from rodcone.errors import InputError
from sensor.cfa import Tile, channels, mask
from sensor.raw import RawImage

SHARES = {"R": 0.5, "G": 1.0, "B": 0.4, "W": 5.0}
NAMES = [name for name, processor in PROCESSORS.items() if processor.extra == "bm3d"]
TILES: dict[str, Tile] = {"bayer": ("GB", "RG"), "rgbw": ("GR", "WB")}


def require_library() -> None:
    pytest.importorskip("bm3d", reason="rodcone[bm3d], whose licence excludes commercial use, is not installed")
    pytest.importorskip("colour_demosaicing", reason="rodcone[opponents] is not installed")


def flat(cfa: Tile, level_e: float) -> RawImage:
    """Poisson exposure of a neutral field with 2 e- of read noise, 64 pixels a side, green at the level."""
    rng = np.random.default_rng(1)
    expected = sum(share * level_e * mask(cfa, channel, (64, 64)) for channel, share in SHARES.items())
    electrons = rng.poisson(expected) + 2.0 * rng.standard_normal((64, 64))
    return raw_image(np.rint(electrons + 100), cfa, read_noise_e=2.0, dsnu_e=0.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("level_e", [20.0, 400.0])
def test_most_of_the_noise_of_a_flat_field_goes_and_no_light(name: str, level_e: float) -> None:
    require_library()
    image = flat(TILES[PROCESSORS[name].mosaic], level_e)
    balance = [SHARES[channel] for channel in channels(image.cfa)]
    picture = PROCESSORS[name].develop(image, np.eye(3), balance=balance)
    # 4096 samples: the mean of each colour is known to sigma / sqrt(n), and 5 of these allow 1 false alarm in 3e5 for
    # each of 30 means
    for index, channel in enumerate("RGB"):
        count = mask(image.cfa, channel, image.shape).sum()
        sigma = np.sqrt(SHARES[channel] * level_e + image.dark_noise_e**2) / SHARES[channel]
        assert abs(picture.rgb[..., index].mean() - level_e) <= 5 * sigma / np.sqrt(count)
        assert picture.rgb[..., index].std() < 0.25 * sigma  # 16 samples averaged at the least


def test_a_tile_of_more_sites_is_refused_in_one_line_before_anything_is_denoised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "bm3d", None)
    raw = raw_image(np.full((16, 16), 500), RGBW_4X4)
    with pytest.raises(InputError, match=r"^cfa: .* is not 2x2 RGBW; allowed here: R, G, B and W once each") as error:
        PROCESSORS["rgbw_park"].develop(raw, np.eye(3))
    assert "\n" not in str(error.value)
