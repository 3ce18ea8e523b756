"""What values show in a notebook: a picture that a PNG reader opens, and true facts."""

from io import BytesIO

import numpy as np
import pytest
from builders import raw_image
from PIL import Image

from isp.picture import Picture
from render.radiance import SpectralRadiance
from rodcone.colour_spaces import WHITE_AT
from rodcone.notebook import SIDE, html_of, preview_png


def pixels(png: bytes) -> np.ndarray:
    with Image.open(BytesIO(png)) as picture:
        return np.asarray(picture)


def test_a_preview_is_srgb_in_its_own_scale() -> None:
    """An even grey is at 90 % of white whatever its unit; IEC 61966-2-1 encodes 0.9 as 243."""
    encoded = round(255 * (1.055 * WHITE_AT ** (1 / 2.4) - 0.055))
    for value in (1e-9, 1.0, 1e12):
        assert np.array_equal(pixels(preview_png(np.full((4, 6, 3), value))), np.full((4, 6, 3), encoded))
    assert pixels(preview_png(np.full((4, 6), 3.0))).shape == (4, 6)
    assert not pixels(preview_png(np.zeros((4, 6, 3)))).any()


def test_a_large_picture_is_shown_small() -> None:
    shown = pixels(preview_png(np.ones((2 * SIDE + 1, 30))))
    assert max(shown.shape) <= SIDE


def test_a_small_picture_is_shown_by_whole_multiples() -> None:
    for width, shown in ((64, "width:384px;image-rendering:pixelated"), (300, ""), (500, "")):
        assert f"style='{shown}'" in html_of("x", {}, preview_png(np.ones((8, width, 3)))), width


def test_a_fact_may_have_several_values() -> None:
    assert "</th><td>1</td><td>2</td></tr>" in html_of("x", {"a": ("1", "2")}, None)


def test_radiance_shows_its_colour_and_luminance() -> None:
    nm = np.arange(405.0, 780.0, 50.0)
    values = np.zeros((6, 8, nm.size))
    values[:, :4, nm > 600] = 1.0  # red on the left, blue on the right
    values[:, 4:, nm < 500] = 1.0
    radiance = SpectralRadiance(values, nm)
    shown = pixels(radiance._repr_png_())
    assert (shown[:, :4, 0] > shown[:, :4, 2]).all()
    assert (shown[:, 4:, 2] > shown[:, 4:, 0]).all()
    page = radiance._repr_html_()
    assert f"{radiance.luminance().mean():.3g} cd/m²" in page
    assert "8 over 380 to 780 nm" in page


def test_a_raw_image_shows_electrons_above_black() -> None:
    dn = np.full((8, 8), 64, np.uint16)
    dn[2, 3] = 1064
    raw = raw_image(dn, black_dn=64.0, white_dn=16383.0, gain_e_per_dn=2.0, prnu=0.01)
    shown = pixels(raw._repr_png_())
    assert shown[2, 3] == 255
    assert np.count_nonzero(shown) == 1
    assert "mosaic RG / BW" in raw._repr_html_()
    assert "10 ms" in raw._repr_html_()


def test_a_developed_picture_says_what_was_decided() -> None:
    picture = Picture(np.ones((4, 4, 3)), {"R": "gray world"}, snr=2.5, substitution=0.75)
    page = picture._repr_html_()
    assert "R: gray world" in page
    assert "2.5" in page
    assert "0.75" in page
    assert pixels(picture._repr_png_()).shape == (4, 4, 3)


def test_a_transport_shows_its_own_lights() -> None:
    from render.engine import render
    from scenes.catalog import load

    made = render(load("flat_field"), (8, 8), wavelength_nm=np.arange(405.0, 780.0, 50.0), spp=2)
    assert np.array_equal(pixels(made._repr_png_()), pixels(made.relight()._repr_png_()))
    assert all(word in made._repr_html_() for word in ("8 x 8 pixels, 8 bands", *made.groups))


def test_a_plan_shows_its_ledger() -> None:
    for empty in [True, False]:
        from studies.budget.ledger import Ledger, Plan, Term
        from studies.study.study import Condition, SceneChoice

        condition = Condition(SceneChoice("still_life"), "own", "<25cd/m2", "auto", "low_noise")
        row = Ledger(condition, "rgbw", 0.01, 10.0, (Term("diffraction", 5.0, 0.25, modelled=True),), 1.0, 0.01)
        page = Plan({}, {}, {}, () if empty else (row,))._repr_html_()
        assert ("(25%)" in page) is not empty, empty
        assert ("&lt;25cd/m2" in page) is not empty, empty


def test_nothing_is_drawn_before_it_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "fromarray", lambda *_: pytest.fail("drawn"))
    radiance = SpectralRadiance(np.ones((4, 4, 3)), np.array([450.0, 550.0, 650.0]))
    assert radiance.shape == (4, 4)


def test_names_from_outside_are_shown_and_not_run() -> None:
    name = "<script>alert(1)</script>' onerror='x"
    shown = html_of(name, {name: [name]}, preview_png(np.ones((4, 4))))
    assert "<script" not in shown
    assert "' onerror" not in shown
    assert "&lt;script&gt;" in shown
