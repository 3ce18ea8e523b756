"""Strips cover a frame once."""

import pytest

from isp.strips import strips


@pytest.mark.parametrize("height", [0, 1, 7, 8, 9])
def test_strips_cover_every_row_once(height: int) -> None:
    parts = list(strips(height, 4))
    assert [row for part in parts for row in range(height)[part]] == list(range(height))
    assert all(part.stop - part.start == 4 for part in parts[:-1])
    assert all(part.stop <= height for part in parts)
