"""Camera simulation from spectral scene to developed picture: the public names of the chain.

A name is imported from its module when it is asked for, so that `import rodcone` takes no time and loads neither
Mitsuba nor Dr.Jit. It only chooses the LLVM library that Dr.Jit will load: import rodcone before `mitsuba` or `drjit`.
"""

from importlib import import_module
from typing import Any

from rodcone import llvm as _llvm  # noqa: F401  (run for its effect: it names the LLVM library to Dr.Jit)

# Public name: module and attribute. These strings are the one exemption from the layers (rodcone is the ground that
# the other packages stand on): import-linter sees no imports here, since nothing is imported until a user asks.
# `__init__.pyi` states the same names with their types. No module of this package may bear one of them.
_PUBLIC = {
    "InputError": ("rodcone.errors", "InputError"),
    # light
    "scenes": ("scenes.catalog", "names"),
    "load": ("scenes.catalog", "load"),
    "render": ("render.engine", "render"),
    "Scene": ("render.scene", "Scene"),
    "LightGroup": ("render.scene", "LightGroup"),
    "Spectrum": ("render.spectrum", "Spectrum"),
    "SpectralRadiance": ("render.radiance", "SpectralRadiance"),
    "illuminants": ("render.illuminants", "names"),
    "illuminant": ("render.illuminants", "illuminant"),
    "load_scene_file": ("render.user_scene.scene_file", "load_scene_file"),
    "load_radiance": ("render.radiance_files.radiance_source", "load_radiance"),
    "write_exr": ("render.radiance_files.exr", "write_exr"),
    # sensor
    "sensors": ("sensor.presets", "names"),
    "mosaics": ("sensor.cfa", "mosaics"),
    "preset": ("sensor.presets", "preset"),
    "low_noise": ("sensor.presets", "low_noise"),
    "table1_pixel": ("sensor.presets", "table1_pixel"),
    "table1_output": ("sensor.presets", "table1_output"),
    "draw_device": ("sensor.device", "draw_device"),
    "auto_exposure_s": ("sensor.exposure", "auto_exposure_s"),
    "capture": ("sensor.capture", "capture"),
    "expose": ("sensor.capture", "expose"),
    "read_raw": ("sensor.raw_files.raw_file", "read_raw"),
    "write_raw": ("sensor.raw_files.raw_file", "write_raw"),
    # picture
    "processors": ("isp.processors.catalogue", "names"),
    "calibrate": ("studies.photograph.calibrate", "calibrate"),
    "develop": ("studies.photograph.develop", "develop"),
    "encode_srgb": ("rodcone.colour_spaces", "encode_srgb"),
    "write_picture": ("studies.photograph.picture_file", "write_picture"),
    # studies
    "Study": ("studies.study.study", "Study"),
    "read_study": ("studies.study.study_file", "read_study"),
    "plan": ("studies.budget.plan", "plan"),
    "sweep": ("studies.sweep.run_sweep", "sweep"),
    "run": ("studies.sweep.workers", "run"),
    "read_rows": ("studies.sweep.export", "read_rows"),
    "explore": ("studies.explore.widget", "explore"),
    "report": ("studies.commands.report", "write_report"),
}

__all__ = sorted(_PUBLIC)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Import a public name from its module."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'rodcone' has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    return getattr(import_module(module), attribute)


def __dir__() -> list[str]:
    """Names that tab shows."""
    return __all__
