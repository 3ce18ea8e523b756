"""What values show in a notebook: a picture that a PNG reader opens."""

from io import BytesIO

import numpy as np
import pytest
from builders import raw_image
from PIL import Image

from render.radiance import SpectralRadiance
from rodcone.colour_spaces import WHITE_AT
from rodcone.display import preview_png


def pixels(png: bytes) -> np.ndarray:
    with Image.open(BytesIO(png)) as picture:
        return np.asarray(picture)


def test_a_preview_is_srgb_in_its_own_scale() -> None:
    """An even grey is at 90 % of white whatever its unit; IEC 61966-2-1 encodes 0.9 as 243."""
    encoded = round(255 * (1.055 * WHITE_AT ** (1 / 2.4) - 0.055))
    for value in (1e-9, 1.0, 1e12):
        assert np.array_equal(pixels(preview_png(np.full((4, 6, 3), value))), np.full((256, 384, 3), encoded))
    assert pixels(preview_png(np.full((4, 6), 3.0))).shape == (256, 384)
    assert not pixels(preview_png(np.zeros((4, 6, 3)))).any()


def test_a_small_picture_is_shown_by_whole_multiples() -> None:
    for width, shown in ((64, 384), (300, 300), (500, 500)):
        checks = np.indices((8, width)).sum(axis=0) % 2 * 1.0
        picture = pixels(preview_png(checks))
        times = shown // width
        assert picture.shape == (8 * times, shown)
        assert np.array_equal(picture[::times, ::times] > 0, checks > 0)
        assert np.array_equal(picture[times - 1 :: times, times - 1 :: times], picture[::times, ::times])


def test_radiance_shows_its_colour_and_luminance() -> None:
    nm = np.arange(405.0, 780.0, 50.0)
    values = np.zeros((6, 8, nm.size))
    values[:, :4, nm > 600] = 1.0  # red on the left, blue on the right
    values[:, 4:, nm < 500] = 1.0
    radiance = SpectralRadiance(values, nm)
    shown = pixels(radiance._repr_png_())[::48, ::48]
    assert (shown[:, :4, 0] > shown[:, :4, 2]).all()
    assert (shown[:, 4:, 2] > shown[:, 4:, 0]).all()


def test_a_raw_image_shows_electrons_above_black() -> None:
    dn = np.full((8, 8), 64, np.uint16)
    dn[2, 3] = 1064
    raw = raw_image(dn, black_dn=64.0, white_dn=16383.0, gain_e_per_dn=2.0, prnu=0.01)
    shown = pixels(raw._repr_png_())[::48, ::48]
    assert shown[2, 3] == 255
    assert np.count_nonzero(shown) == 1


def test_a_transport_shows_its_own_lights() -> None:
    from render.engine import render
    from scenes.catalog import load

    made = render(load("flat_field"), (8, 8), wavelength_nm=np.arange(405.0, 780.0, 50.0), spp=2)
    assert np.array_equal(pixels(made._repr_png_()), pixels(made.relight()._repr_png_()))


def test_nothing_is_drawn_before_it_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "fromarray", lambda *_: pytest.fail("drawn"))
    radiance = SpectralRadiance(np.ones((4, 4, 3)), np.array([450.0, 550.0, 650.0]))
    assert radiance.shape == (4, 4)
