"""Shared sums over overlapping windows: equal to plain sums, with fewer additions."""

import pytest

from isp.window_sums import window_sums

CASES = [  # starts, size, additions (joins of two sums included), as counted on paper; None: see the bound below
    ([0], 1, 0),
    ([0], 5, 4),
    ([0, 1, 2, 3], 5, 1 + 3 + 2 + 3),  # in the middle, to the left, to the right, joins
    ([0, 2], 5, 2 + 2 + 1 + 1),
    ([0, 1, 2, 3], 3, None),
    (list(range(8)), 5, None),
    ([0, 2, 4, 6], 5, None),
    ([1, 3], 1, None),
    ([0, 5, 9], 2, None),
    (list(range(8)), 9, None),
]


@pytest.mark.parametrize(("starts", "size", "additions"), CASES)
def test_each_window_is_the_plain_sum_and_counts_are_shared(starts, size, additions):
    values = {i: (i * i + 3) % 101 for i in range(starts[-1] + size)}
    count = 0

    def add(total, value):
        nonlocal count
        count += 1
        return total + value

    assert window_sums(values, starts, size, lambda v: v, add) == [
        sum(values[i] for i in range(start, start + size)) for start in starts
    ]
    if additions is not None:
        assert count + len(starts) - 1 == additions
    assert count <= len(starts) * (size - 1)


def test_squares_are_formed_once_a_value():
    first = [0]

    def square(value):
        first[0] += 1
        return value * value

    values = {i: float(i) for i in range(8)}
    totals = window_sums(values, [0, 1, 2, 3], 5, square, lambda total, v: total + v * v)
    assert totals == [sum(i * i for i in range(k, k + 5)) for k in range(4)]
    assert first[0] == 2  # one in the middle, one to the right; all others join by an addition
