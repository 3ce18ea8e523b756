"""The machine that times belong to."""

import os
import platform
from pathlib import Path
from typing import Any


def processor_facts() -> dict[str, Any]:
    """Return the processor, its cores, and how busy they are."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    facts: dict[str, Any] = {"processor": processor, "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load before the run"] = round(os.getloadavg()[0], 1)
    return facts
