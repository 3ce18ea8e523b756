"""Samples counted by the paths that a tracer is handed, whatever the render says of them."""

from collections import Counter
from typing import Any

import pytest

from render.integrator.dense import Tracer
from rodcone.jit import dr


def count_paths(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts the camera's paths and the meter's, of all light groups together, as they are traced by Dr.Jit."""
    counts = Counter[str]()
    for name in ("camera", "meter"):
        monkeypatch.setattr(Tracer, name, _counted(getattr(Tracer, name), name, counts))
    return counts


def _counted(own: Any, name: str, counts: Counter[str]) -> Any:
    def trace(*given: Any) -> Any:
        counts[name] += dr.width(given[-1].index)
        return own(*given)

    return trace
