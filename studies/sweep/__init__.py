"""Every cell of a study: made, stored, exported."""

from typing import Any

__all__ = ["sweep"]


def __getattr__(name: str) -> Any:
    if name == "sweep":  # late: a worker process imports modules of this package and needs no sweep
        from studies.sweep.run_sweep import sweep

        return sweep
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
