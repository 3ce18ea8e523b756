"""Strips: some rows of a frame at a time, so that what lies between two frames stays small."""

from collections.abc import Iterator


def strips(height: int, rows: int) -> Iterator[slice]:
    """Yield slices of `rows` rows, the last of as many as are left, that cover `height` rows."""
    for first in range(0, height, rows):
        yield slice(first, min(first + rows, height))
