"""The machine that numbers and times belong to."""

import os
import platform
from pathlib import Path
from typing import Any


def processor_name() -> str:
    """Model of the processor, whose loops give a float its last bits."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = (line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    return next(names, platform.processor() or platform.machine())


def machine() -> str:
    """Processor, operating system and Python, in words."""
    return f"{processor_name()}, {platform.platform()}, Python {platform.python_version()}"


def processor_facts() -> dict[str, Any]:
    """Return the processor, its cores, and how busy they are."""
    facts: dict[str, Any] = {"processor": processor_name(), "cores": os.cpu_count()}
    if hasattr(os, "getloadavg"):
        facts["load before the run"] = round(os.getloadavg()[0], 1)
    return facts
