"""Sums over windows that overlap, sharing what they have in common: how patches are compared in `isp.kernel`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

Add = Callable[[Any, Any], Any]


def window_sums(values: Mapping[int, Any], starts: Sequence[int], size: int, first: Any, add: Add) -> list[Any]:
    """Sum `size` values from each start on.

    Windows that all hold the same middle share it: to the middle come sums that grow towards either side, one addition
    a value, and each window is one sum of the left with one of the right. No value is ever subtracted, so nothing
    cancels; the order of the additions depends on the window's place among `starts`.

    Parameters
    ----------
    values : mapping of int
        Arrays by place.
    starts : sequence of int
        First places of the windows, rising.
    size : int
        Values a window.
    first : callable
        Sum that holds one value: its square, for a sum of squares.
    add : callable
        A sum and one value more.
    """
    lowest, highest = starts[0], starts[-1]
    if highest >= lowest + size:
        half = len(starts) // 2
        parts = starts[:half], starts[half:]
        return [total for part in parts for total in window_sums(values, part, size, first, add)]
    total = first(values[highest])
    for i in range(highest + 1, lowest + size):
        total = add(total, values[i])
    left = {highest: total}
    for i in range(highest - 1, lowest - 1, -1):
        total = left[i] = add(total, values[i])
    right = {}
    for i in range(lowest + size, highest + size):
        total = right[i + 1] = first(values[i]) if i == lowest + size else add(total, values[i])
    return [left[start] + right[start + size] if start + size in right else left[start] for start in starts]
