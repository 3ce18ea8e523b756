"""Strips, which are some rows of a frame, so that intermediate results of a whole frame never fill the memory."""

from collections.abc import Iterator


def strips(height: int, rows: int) -> Iterator[slice]:
    """Yield consecutive slices of `rows` rows that cover `height` rows; the last may be shorter."""
    for first in range(0, height, rows):
        yield slice(first, min(first + rows, height))
