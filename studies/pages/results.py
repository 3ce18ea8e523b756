"""What a study found, as plain data: the content of `results.json`, and what the report shows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from render.loader import variant
from render.transport import Transport
from rodcone.jit import backend
from scenes.levels import LightLevel
from sensor.presets import preset
from studies.sweep.provenance import machine, threads, versions

DISPLAY_WHITE = "the scene's 99th percentile of luminance, visible lamps excluded, is shown at 90 % of white"


def render_facts(transport: Transport) -> dict[str, Any]:
    """How the render was made, and the error it reached under the scene's own lights."""
    return {
        "integrator": transport.integrator,
        "variant": transport.variant,
        "seconds": transport.seconds,
        "spp": transport.spp,
        "passes": transport.passes,
        "stopped_by": transport.stopped_by,
        "relative_mc_error": transport.relight().relative_mc_error,
        "bands": transport.wavelength_nm.size,
        "first_nm": float(transport.wavelength_nm[0]),
        "last_nm": float(transport.wavelength_nm[-1]),
        "width_nm": float(transport.width_nm[0]),
    }


def level_facts(levels: Sequence[LightLevel], transport: Transport) -> list[dict[str, Any]]:
    """Each level in cd/m^2 and, where the scene states a plane, in lux."""
    return [{**asdict(level), "illuminance_lux": transport.illuminance_lux(level.luminance_cd_m2)} for level in levels]


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


def engines_told(cells: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Which engines drew and developed a report's cells, in words."""
    known = [cell["engines"] for cell in cells if cell["engines"]]
    return {
        f"engine of {name}": ", ".join(dict.fromkeys(engines[step] for engines in known))
        for name, step in (("captures", "capture"), ("development", "develop"))
    }


def notes() -> list[str]:
    """What fell back, in words."""
    if backend() == "numpy":
        return [
            "Neither LLVM nor CUDA answered: stock path + specfilm rendered in scalar_spectral, captures and the "
            "reconstruction ran their NumPy forms."
        ]
    return []
