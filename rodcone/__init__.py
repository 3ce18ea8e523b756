"""Camera simulation from spectral scene to developed picture: the public names of the chain.

A name is imported from its module when it is asked for, so that `import rodcone` takes no time and loads neither
Mitsuba nor Dr.Jit. It only chooses the LLVM library that Dr.Jit will load: import rodcone before `mitsuba` or `drjit`.
"""

from importlib import import_module
from typing import Any

from rodcone import llvm as _llvm  # noqa: F401  (run for its effect: it names the LLVM library to Dr.Jit)
from rodcone.doors import door

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
    "lines_nm": ("render.illuminants", "lines_nm"),
    "line_bands": ("render.spectrum", "line_bands"),
    "look_at": ("render.geometry", "look_at"),
    "to_world": ("render.geometry", "to_world"),
    "grey": ("scenes.reflectances", "grey"),
    "matte": ("scenes.materials", "matte"),
    "panel": ("scenes.materials", "panel"),
    "relight_denoised": ("render.denoised.relight", "relight_denoised"),
    "load_scene_file": ("render.user_scene.scene_file", "load_scene_file"),
    "load_transport": ("studies.explore.source", "load_transport"),
    "load_radiance": ("render.radiance_files.radiance_source", "load_radiance"),
    "write_exr": ("render.radiance_files.exr", "write_exr"),
    # sensor
    "sensors": ("sensor.presets", "names"),
    "mosaics": ("sensor.cfa", "mosaics"),
    "preset": ("sensor.presets", "preset"),
    "low_noise": ("sensor.presets", "low_noise"),
    "PixelConfig": ("sensor.chip", "PixelConfig"),
    "Reading": ("sensor.chip", "Reading"),
    "ChannelReading": ("sensor.chip", "ChannelReading"),
    "binned": ("sensor.photodiodes", "binned"),
    "with_readings": ("sensor.config", "with_readings"),
    "with_channel_readings": ("sensor.config", "with_channel_readings"),
    "draw_device": ("sensor.device", "draw_device"),
    "form_image": ("sensor.optics", "form_image"),
    "channel_electrons": ("sensor.response", "channel_electrons"),
    "expected_electrons": ("sensor.response", "expected_electrons"),
    "auto_exposure_s": ("sensor.exposure", "auto_exposure_s"),
    "capture": ("studies.photograph.camera", "capture"),
    "expose": ("sensor.capture", "expose"),
    "RawImage": ("sensor.raw", "RawImage"),
    "merged_raw": ("sensor.burst", "merged_raw"),
    "read_raw": ("sensor.raw_files.raw_file", "read_raw"),
    "write_raw": ("sensor.raw_files.raw_file", "write_raw"),
    "snr": ("studies.photograph.snr", "snr"),
    "expect": ("studies.design.expect", "expect"),
    "light_for_snr": ("studies.photograph.snr", "light_for_snr"),
    "characterise": ("sensor.emva1288.characterise", "characterise"),
    # picture
    "processors": ("isp.processors.catalogue", "names"),
    "Processor": ("isp.processors.catalogue", "Processor"),
    "mask": ("sensor.cfa", "mask"),
    "finish": ("isp.picture", "finish"),
    "Picture": ("isp.picture", "Picture"),
    "calibrate": ("studies.photograph.camera", "calibrate"),
    "develop": ("studies.photograph.develop", "develop"),
    "encode_srgb": ("rodcone.colour_spaces", "encode_srgb"),
    "write_picture": ("studies.photograph.picture_file", "write_picture"),
    "Order": ("studies.photograph.shot", "Order"),
    "take": ("studies.photograph.shot", "take"),
    "develop_file": ("studies.photograph.develop", "develop_file"),
    # studies
    "Study": ("studies.study.study", "Study"),
    "SceneChoice": ("studies.study.study", "SceneChoice"),
    "RenderLimits": ("studies.study.study", "RenderLimits"),
    "read_study": ("studies.study.study_file", "read_study"),
    "plan": ("studies.budget.plan", "plan"),
    "reference_plan": ("studies.budget.plan", "reference_plan"),
    "sweep": ("studies.sweep.run_sweep", "sweep"),
    "run_in_processes": ("studies.sweep.workers", "run_in_processes"),
    "read_rows": ("studies.sweep.export", "read_rows"),
    "report": ("studies.commands.report", "write_report"),
    "explore": ("studies.explore.widget", "explore"),
    "explorer_view": ("studies.explore.views", "explorer_view"),
}

__all__ = sorted(_PUBLIC)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Import a public name from its module: a class, or a function with the checks of `rodcone.doors` before it."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'rodcone' has no attribute {name!r}")
    module, attribute = _PUBLIC[name]
    value = getattr(import_module(module), attribute)
    globals()[name] = value if isinstance(value, type) else door(name, value)
    return globals()[name]


def __dir__() -> list[str]:
    """Names that tab shows."""
    return __all__
