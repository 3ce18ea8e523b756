"""Every way to make a picture from a raw file."""

from typing import Any

__all__ = ["PROCESSORS"]


def __getattr__(name: str) -> Any:
    if name == "PROCESSORS":  # late: the catalogue imports the pipeline, which imports a processor of this package
        from isp.processors.catalogue import PROCESSORS

        return PROCESSORS
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
