"""Threads of BLAS, the library behind NumPy's products of matrices."""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread within a ``with`` block, because on a busy machine its threads wait for each other."""
    limited: AbstractContextManager[Any] = _blas().limit(limits=1)
    return limited


@cache
def _blas() -> ThreadpoolController:
    """Find the BLAS that is loaded, which takes milliseconds."""
    return ThreadpoolController().select(user_api="blas")
