"""Control of the threads of BLAS, the library behind NumPy's matrix products."""

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
    """Find the loaded BLAS; the search takes milliseconds, and its result is kept."""
    return ThreadpoolController().select(user_api="blas")
