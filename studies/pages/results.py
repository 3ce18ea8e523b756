"""What a study found, as plain data: the content of `results.json`, and what the report shows."""

from typing import Any

from render.loader import variant
from rodcone.jit import backend
from sensor.presets import preset
from studies.sweep.provenance import machine, threads, versions

DISPLAY_WHITE = "the scene's 99th percentile of luminance, visible lamps excluded, is shown at 90 % of white"


def sensor_facts(name: str) -> dict[str, Any]:
    """The numbers of a preset that a reader of the report wants."""
    sensor = preset(name)
    pixel = sensor.pixel
    return {
        "name": name,
        "read_noise_e": pixel.read_noise_e,
        "dsnu_e": pixel.dsnu_e,
        "full_well_e": pixel.full_well_e,
        "prnu": pixel.prnu,
        "pitch_um": pixel.pitch_um,
        "f_number": sensor.lens.f_number,
        "bits": sensor.bits,
    }


def environment() -> dict[str, Any]:
    """What makes numbers in this process."""
    return {
        **versions(),
        "variant": variant(),
        "engine": backend(),
        "threads": threads(),
        "machine": machine(),
    }
