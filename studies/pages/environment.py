"""What makes numbers in this process: versions, engines and machine, for pages and JSON."""

from typing import Any

from render.loader import variant
from rodcone.jit import backend
from studies.photograph.clock import machine
from studies.sweep.provenance import threads, versions


def environment() -> dict[str, Any]:
    """Facts by name, as JSON holds them."""
    return {**versions(), "variant": variant(), "engine": backend(), "threads": threads(), "machine": machine()}
