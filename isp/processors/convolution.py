"""Filters of learned networks, computed by one matrix product for each block of rows."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rodcone.types import Singles

_BLOCK = 1 << 18  # largest number of floats in a product's left matrix: 1 MB, which stays in the processor's cache


def convolve(
    values: Singles,
    filters: Singles,
    bias: Singles,
    step: int = 1,
    run: Callable[[Callable[[int], None], Iterable[int]], Iterable[Any]] = map,
) -> Singles:
    """Correlate an array (h, w, in) with a layer's filters (out, in, side, side), wherever they fit into the array.

    The filters move by `step` pixels. For each block of rows, the values under each position of the filters become a
    row of a matrix, which is multiplied by the filters. `run` calls a function for each block: it is ``map``, or the
    ``map`` of a pool of threads. The blocks and the result are the same with either.
    """
    filters = filters.transpose(2, 3, 1, 0)
    side, _, seen, out = filters.shape
    matrix = np.ascontiguousarray(filters.reshape(side * side * seen, out))
    windows = sliding_window_view(values, (side, side), axis=(0, 1))[::step, ::step].transpose(0, 1, 3, 4, 2)
    high, wide = windows.shape[:2]
    found = np.empty((high, wide, out), np.float32)
    rows = max(1, _BLOCK // (wide * len(matrix)))

    def fill(top: int) -> None:
        block = windows[top : top + rows]
        np.add(
            (block.reshape(-1, len(matrix)) @ matrix).reshape(*block.shape[:2], out), bias, out=found[top : top + rows]
        )

    for _ in run(fill, range(0, high, rows)):
        pass
    return found
