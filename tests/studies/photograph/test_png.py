"""PNG of 8 and 16 bits: read back by Pillow and by Mitsuba's bitmap, neither of which wrote it."""

from io import BytesIO

import numpy as np
from PIL import Image

from isp.colour.encoding import quantise
from render.loader import mitsuba_module
from studies.photograph.picture_file import to_png

RAMP = np.random.default_rng(5).random((7, 300, 3))
RAMP[0, 0], RAMP[0, 1] = 0.0, 1.0


def test_eight_bits_are_read_back_by_pillow() -> None:
    with Image.open(BytesIO(to_png(quantise(RAMP)))) as picture:
        assert (picture.mode, picture.size) == ("RGB", (300, 7))
        np.testing.assert_array_equal(np.asarray(picture), np.rint(RAMP * 255))
        assert "srgb" in picture.info


def test_sixteen_bits_are_read_back_by_mitsuba(tmp_path) -> None:
    (tmp_path / "picture.png").write_bytes(to_png(quantise(RAMP, 16)))
    picture = np.array(mitsuba_module().Bitmap(str(tmp_path / "picture.png")))
    assert picture.dtype == np.uint16
    np.testing.assert_array_equal(picture, np.rint(RAMP * 65535))
