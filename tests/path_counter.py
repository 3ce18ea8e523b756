"""Samples counted by the paths that the integrator is handed, whatever the render says of them."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from render import passes
from rodcone.jit import dr


def count_paths(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts the camera's paths and the meter's, of all light groups together, as they are traced by Dr.Jit."""
    counts, make = Counter[str](), passes.integrators

    def counted(*arguments: Any, **named: Any) -> Iterator[tuple[Any, Any]]:
        for part, integrator in make(*arguments, **named):
            own = type(integrator).sample

            def sample(
                self: Any, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True, own: Any = own
            ) -> Any:
                counts["meter" if self.tracer.meter else "camera"] += dr.width(ray.o)
                return own(self, scene, sampler, ray, medium, active)

            if not hasattr(own, "counts"):
                sample.counts = True  # type: ignore[attr-defined]
                monkeypatch.setattr(type(integrator), "sample", sample)
            yield part, integrator

    monkeypatch.setattr(passes, "integrators", counted)
    return counts
