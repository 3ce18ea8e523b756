"""Planes of a large picture's light that stay in a file, so that a reader loads only those it asks for."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

from render.error_estimates import Halves
from render.transport import Transport
from rodcone.types import Planes


class StoredPlanes:
    """Planes (..., h, w) in a file of NumPy's format, which is opened and closed at each access.

    Parameters
    ----------
    path : path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        planes = self._mapped()
        self.shape, self.dtype = planes.shape, planes.dtype

    def __getitem__(self, index: Any) -> Planes:
        """Return a copy of what an index selects."""
        return np.array(self._mapped()[index])

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[np.floating]:
        return np.array(self._mapped(), dtype=dtype)

    def _mapped(self) -> Planes:
        return cast(Planes, np.load(self.path, mmap_mode="r"))


def with_stored_light(transport: Transport, folder: Path) -> Transport:
    """Store a transport's light in files of a folder; return a transport of the same bits that reads it by plane.

    Raises
    ------
    OSError
        If the folder can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stored = []
    for name, planes in vars(transport.light).items():
        path = folder / f"light_{name}.npy"
        np.save(path, planes)
        stored.append(cast(Planes, StoredPlanes(path)))
    return replace(transport, light=Halves(*stored))
