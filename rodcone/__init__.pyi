from isp.processors.catalogue import names as processors
from render.engine import render as render
from render.illuminants import illuminant as illuminant
from render.illuminants import names as illuminants
from render.radiance import SpectralRadiance as SpectralRadiance
from render.radiance_files.exr import write_exr as write_exr
from render.radiance_files.radiance_source import load_radiance as load_radiance
from render.scene import LightGroup as LightGroup
from render.scene import Scene as Scene
from render.spectrum import Spectrum as Spectrum
from render.user_scene.scene_file import load_scene_file as load_scene_file
from rodcone.colour_spaces import encode_srgb as encode_srgb
from rodcone.errors import InputError as InputError
from scenes.catalog import load as load
from scenes.catalog import names as scenes
from sensor.capture import capture as capture
from sensor.capture import expose as expose
from sensor.cfa import mosaics as mosaics
from sensor.device import draw_device as draw_device
from sensor.exposure import auto_exposure_s as auto_exposure_s
from sensor.presets import low_noise as low_noise
from sensor.presets import names as sensors
from sensor.presets import preset as preset
from sensor.presets import table1_output as table1_output
from sensor.presets import table1_pixel as table1_pixel
from sensor.raw_files.raw_file import read_raw as read_raw
from sensor.raw_files.raw_file import write_raw as write_raw
from studies.budget.plan import plan as plan
from studies.commands.report import write_report as report
from studies.explore.widget import explore as explore
from studies.photograph.calibrate import calibrate as calibrate
from studies.photograph.develop import develop as develop
from studies.photograph.picture_file import write_picture as write_picture
from studies.study.study import Study as Study
from studies.study.study_file import read_study as read_study
from studies.sweep.export import read_rows as read_rows
from studies.sweep.run_sweep import sweep as sweep
from studies.sweep.workers import run as run

__all__ = [
    "InputError",
    "LightGroup",
    "Scene",
    "SpectralRadiance",
    "Spectrum",
    "Study",
    "auto_exposure_s",
    "calibrate",
    "capture",
    "develop",
    "draw_device",
    "encode_srgb",
    "explore",
    "expose",
    "illuminant",
    "illuminants",
    "load",
    "load_radiance",
    "load_scene_file",
    "low_noise",
    "mosaics",
    "plan",
    "preset",
    "processors",
    "read_raw",
    "read_rows",
    "read_study",
    "render",
    "report",
    "run",
    "scenes",
    "sensors",
    "sweep",
    "table1_output",
    "table1_pixel",
    "write_exr",
    "write_picture",
    "write_raw",
]
