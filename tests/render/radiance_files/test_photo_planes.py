"""A photograph's bands made one at a time hold the bits of all of them together."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from render.illuminants import illuminant
from render.radiance import BandRadiance, SpectralRadiance, check_values
from render.radiance_files import radiance_source
from render.radiance_files.photo import read_photo, read_upsampled
from render.radiance_files.radiance_source import as_transport, load_picture
from render.transport import Transport, halves_by_band, relight_by_band
from rodcone.errors import InputError

NM = np.arange(430.0, 780.0, 100.0)


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """Random colours, many of which no cluster's surfaces reach, and a black row; two strips of pixels and a part."""
    pixels = np.random.default_rng(1).integers(0, 256, (233, 300, 3), dtype=np.uint8)
    pixels[7] = 0
    Image.fromarray(pixels).save(tmp_path / "a.png")
    return tmp_path / "a.png"


@pytest.mark.filterwarnings("ignore:.*of the pixels have colours")
def test_a_band_at_a_time_is_the_photograph_to_the_bit(photo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = load_picture(photo, illuminant("A"))
    monkeypatch.setattr(radiance_source, "MOST_WHOLE_BYTES", 0)
    made = load_picture(photo, illuminant("A"))
    assert not isinstance(made.light.mean, np.ndarray)
    assert np.array_equal(made.scene_means.radiance, whole.scene_means.radiance)
    lit, by_band = whole.relight(luminance_cd_m2=3.0), relight_by_band(made, luminance_cd_m2=3.0)
    assert np.array_equal(by_band.whole().values, lit.values)
    assert by_band.mean_luminance == pytest.approx(float(lit.luminance().mean()), rel=1e-12)
    assert np.array_equal(made.radiance, whole.radiance)  # and whoever asks for all of it gets it
    assert np.array_equal(made.relight("F11").values, whole.relight("F11").values)


@pytest.mark.filterwarnings("ignore:.*of the pixels have colours")
def test_what_colours_take_of_the_basis_is_kept(photo: Path) -> None:
    upsampled, shape = read_upsampled(photo)
    assert 0.1 < np.mean(upsampled.share > 0) < 0.9  # both ways are tried
    values = read_photo(photo).values
    planes = [upsampled.plane(band).reshape(shape) for band in (0, 17, 39)]
    assert np.array_equal(planes, np.moveaxis(values[..., [0, 17, 39]], -1, 0))


def _render() -> Transport:
    values = np.random.default_rng(2).uniform(0.0, 1.0, (12, 10, NM.size)).astype(np.float32)
    return as_transport(SpectralRadiance(values, NM, relative_mc_error=0.1))


def test_light_by_band_is_relight_and_its_halves_to_the_bit() -> None:
    transport = _render()
    difference = np.random.default_rng(3).normal(0.0, 0.1, transport.light.mean.shape).astype(np.float32)
    transport.light.__dict__["difference"] = difference
    whole, by_band = transport.relight(luminance_cd_m2=2.0), relight_by_band(transport, luminance_cd_m2=2.0)
    assert np.array_equal(by_band.whole().values, whole.values)
    assert by_band.relative_mc_error == whole.relative_mc_error > 0
    halves = zip(
        transport.relight_halves(luminance_cd_m2=2.0), halves_by_band(transport, luminance_cd_m2=2.0), strict=True
    )
    assert all(np.array_equal(half.values, made.whole().values) and made.signed for half, made in halves)


def test_a_wrong_value_is_named_with_its_band() -> None:
    planes = np.ones((4, 2, 3), np.float32)
    planes[2, 1, 0] = np.nan
    made = BandRadiance(lambda band: planes[band], (2, 3), NM, np.full(4, 100.0))
    with pytest.raises(InputError, match="nan at row 1, column 0, band 2"):
        made.mean_luminance  # noqa: B018
    check_values("radiance", planes[:1])
