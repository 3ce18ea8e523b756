"""What a study found, as plain data: the content of `results.json`, and what the report shows."""

from typing import Any

from render.loader import variant
from rodcone.jit import backend
from studies.sweep.provenance import machine, threads, versions

DISPLAY_WHITE = "the scene's 99th percentile of luminance, visible lamps excluded, is shown at 90 % of white"


def environment() -> dict[str, Any]:
    """What makes numbers in this process."""
    return {
        **versions(),
        "variant": variant(),
        "engine": backend(),
        "threads": threads(),
        "machine": machine(),
    }
