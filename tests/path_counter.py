"""Samples counted by the paths that a tracer is handed, whatever the render says of them."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from render.integrator.dense import Tracer


def count_paths(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts the camera's paths and the meter's, of all light groups together, as they are traced by Dr.Jit."""
    counts = Counter[str]()
    for name in ("camera", "meter"):
        monkeypatch.setattr(Tracer, name, _counted(getattr(Tracer, name), name, counts))
    return counts


def pixels_of_paths(pixel: Any, points: Any) -> NDArray[np.uint64]:
    """Pixel of each path; one that is traced twice, to fill a packet up, counts once."""
    places = (pixel.numpy().astype(np.uint64) << np.uint64(32)) + points.index.numpy()
    return np.unique(places) >> np.uint64(32)


def _counted(own: Any, name: str, counts: Counter[str]) -> Any:
    def trace(*given: Any) -> Any:
        counts[name] += pixels_of_paths(*given[-2:]).size
        return own(*given)

    return trace
