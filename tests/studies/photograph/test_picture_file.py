"""Developed pictures as files: read back by Pillow, LittleCMS and tifffile, which didn't write them."""

from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms
from refusal import refusal

from isp.colour.encoding import ENCODINGS, encode, quantise
from studies.photograph.picture_file import icc_profile, to_png, to_tiff, write_picture

LINEAR = np.random.default_rng(5).uniform(0.05, 0.7, (7, 90, 3))


def profile(content: bytes) -> ImageCms.ImageCmsProfile:
    return ImageCms.ImageCmsProfile(BytesIO(content))


def test_littlecms_reads_the_profile_and_takes_the_picture_to_srgb() -> None:
    for name in ENCODINGS:
        made = profile(icc_profile(name))
        assert ImageCms.getProfileDescription(made).strip() == ENCODINGS[name].title, name
        assert (made.profile.version, made.profile.xcolor_space.strip()) == (4.4, "RGB"), name
        picture = Image.fromarray(np.rint(encode(LINEAR, name) * 255).astype(np.uint8))
        there = np.asarray(ImageCms.profileToProfile(picture, made, ImageCms.createProfile("sRGB")), dtype=float)
        # 8 bits before and after: up to half a level each, times at most 1.3 for a P3 number seen in sRGB
        assert np.abs(there - 255 * encode(LINEAR, "srgb")).max() <= 1.6, name


def test_a_p3_png_says_so_twice() -> None:
    content = to_png(quantise(encode(LINEAR, "display-p3"), 16), "display-p3")
    # cICP comes before the picture: primaries 12 (P3, D65), transfer 13 (sRGB), RGB, full range (ITU-T H.273)
    assert b"\0\0\0\4cICP\x0c\x0d\0\1" in content.split(b"IDAT")[0]
    assert b"sRGB\0" not in content
    with Image.open(BytesIO(content)) as picture:
        assert picture.info["icc_profile"] == icc_profile("display-p3")


def test_an_srgb_png_says_srgb_alone() -> None:
    content = to_png(quantise(encode(LINEAR, "srgb")))
    assert b"\0\0\0\1sRGB\0" in content
    assert b"iCCP" not in content
    assert b"cICP" not in content


def test_a_tiff_holds_the_numbers_and_the_profile() -> None:
    for bits, name in product([8, 16], ENCODINGS):
        encoded = encode(LINEAR, name)
        with tifffile.TiffFile(BytesIO(to_tiff(quantise(encoded, bits), name))) as file:
            page = file.pages[0]
            np.testing.assert_array_equal(page.asarray(), np.rint(encoded * (2**bits - 1)))
            assert (page.bitspersample, page.photometric.name) == (bits, "RGB"), (name, bits)
            assert page.iccprofile == icc_profile(name), (name, bits)
        if bits == 8:
            with Image.open(BytesIO(to_tiff(quantise(encoded, bits), name))) as picture:
                np.testing.assert_array_equal(np.asarray(picture), np.rint(encoded * 255))


@pytest.mark.parametrize("ending", ["png", "TIF", "tiff"])
def test_the_ending_decides_and_nothing_is_left_beside(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"picture.{ending}"
    write_picture(encode(LINEAR, "srgb"), path, 8)
    assert list(tmp_path.iterdir()) == [path]
    with Image.open(path) as picture:
        assert picture.format == ("PNG" if ending == "png" else "TIFF")


@pytest.mark.parametrize(
    ("name", "bits", "encoding", "message"),
    [
        ("a.jpg", 8, "srgb", r"out: .*a\.jpg' has another ending; allowed: \.png, \.tif, \.tiff; rename it"),
        ("a.png", 10, "srgb", r"bits: 10 is not allowed; give 8 or 16"),
        ("a.tif", 8, "p3", r"encoding: 'p3' is unknown; allowed: display-p3, srgb"),
    ],
)
def test_what_cannot_be_written_is_refused(name: str, bits: int, encoding: str, message: str, tmp_path: Path) -> None:
    refusal(write_picture, encode(LINEAR, "srgb"), tmp_path / name, bits, encoding, match=message)
    assert list(tmp_path.iterdir()) == []
