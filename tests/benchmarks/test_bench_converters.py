"""The converters' benchmark: its figures on pictures whose answer is known, and files that a page says are right."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from bench_converters import COLUMNS, ROWS, Kind, Measured, chart, figures, kinds, measure, pattern_of, programs  # noqa: E402

KIND = Kind(kinds()["bayer 64 px"].sensor, 64)
SHAPE = (64, 96)


def pictured(patch_colours: np.ndarray) -> np.ndarray:
    side = KIND.height // ROWS
    return np.kron(patch_colours.reshape(ROWS, COLUMNS, 3), np.ones((side, side, 1)))


def test_the_chart_itself_has_no_error_at_any_brightness_and_crop() -> None:
    radiance, truth = chart(KIND)
    assert (radiance.shape, truth.shape) == (SHAPE, (24, 3))
    whole = pictured(truth)
    error, level, pattern, cast = figures(0.1 * whole, KIND, SHAPE, truth)
    assert error == pytest.approx(0.0, abs=1e-9)
    assert (pattern, cast < 1.0) == (0.0, True)  # its greys are those of a real chart
    cropped = figures(whole[4:-4, 4:-4], KIND, SHAPE, truth)
    assert cropped[0] == pytest.approx(0.0, abs=1e-9)
    assert cropped[1] == pytest.approx(10 * level, rel=1e-12)


def test_a_green_cast_is_an_error() -> None:
    _, truth = chart(KIND)
    error, _, _, cast = figures(pictured(truth * [1.0, 1.3, 1.0]), KIND, SHAPE, truth)
    assert error > 5
    assert cast > 10


def test_a_checkerboard_is_a_pattern_and_noise_is_none() -> None:
    # neighbours differ by 0.4 everywhere, whose standard deviation is 0.4; next but one by nothing
    board = np.tile(1.0 + 0.2 * np.array([[1, -1], [-1, 1]]), (16, 16))[..., None] * np.ones(3)
    assert pattern_of([board]) == pytest.approx(0.4, rel=0.01)
    noise = 1 + 0.1 * np.random.default_rng(1).standard_normal((200, 200, 1))
    assert abs(pattern_of([noise])) < 5 * 0.1 / 200  # five standard errors of such a deviation, about


def test_right_is_a_small_error_at_the_brightness_of_development_or_of_the_file_s_baseline() -> None:
    for over, stops, right in (
        (0.9, 0.1, True),
        (1.1, 0.0, False),
        (0.0, 0.3, False),
        (0.0, 2.1, True),
        (0.0, 2.3, False),
    ):
        assert Measured("kind", "file", 2.0, "program", 2.0, over, stops).is_right == right, (over, stops)
    assert not Measured("kind", "file", 2.0, "program", refused="cannot decode").is_right


@pytest.mark.slow
@pytest.mark.skipif(
    not set(programs()) - {"rawpy"}, reason="no raw converter is installed (darktable, rawtherapee, dcraw)"
)
def test_converters_develop_what_the_page_says_they_do() -> None:
    """docs/how_to/which_program.md: every Bayer file of whole numbers, and every file named _bayer."""
    for name in ("bayer 64 px", "bayer grbg", "bayer 10 bits", "rgbw", "white_apart", "hdr staggered bayer"):
        promised = [row for row in measure(name, kinds()[name], programs()) if row.file in for_converters(name)]
        assert promised, name
        for row in promised:
            assert row.is_right, row


def for_converters(name: str) -> tuple[str, ...]:
    """Names of the files that the page gives to converters."""
    stem = name.replace(" ", "_")
    return (stem,) if name.startswith("bayer") else (f"{stem}_bayer",)
