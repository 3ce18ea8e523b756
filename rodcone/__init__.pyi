"""Public names with their types, as docs/make/public_stub.py writes them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.converters import write_with_bayer as write_raw
from isp.picture import Picture as Picture
from isp.processors.catalogue import Processor as Processor
from isp.processors.catalogue import processor_names as processors
from isp.remosaic import remosaic as remosaic
from render.denoised.relight import relight_denoised as relight_denoised
from render.geometry import look_at as look_at
from render.illuminants import illuminant as illuminant
from render.illuminants import illuminant_names as illuminants
from render.illuminants import lines_nm as lines_nm
from render.radiance import SpectralRadiance as SpectralRadiance
from render.radiance_files.exr import write_exr as write_exr
from render.radiance_files.radiance_source import load_radiance as load_radiance
from render.scene import LightGroup as LightGroup
from render.scene import Node
from render.scene import Scene as Scene
from render.spectrum import Spectrum as Spectrum
from render.spectrum import line_bands as line_bands
from render.transport import Transport
from render.user_scene.scene_file import load_scene_file as load_scene_file
from rodcone.errors import InputError as InputError
from rodcone.jit import Backend
from rodcone.progress import Step
from rodcone.types import Floats, Progress
from scenes.catalogue import load as load
from scenes.catalogue import scene_names as scenes
from scenes.materials import Metres
from scenes.materials import matte as matte
from scenes.reflectances import grey as grey
from sensor.burst import merged_raw as merged_raw
from sensor.calibration import ColourCalibration
from sensor.cfa import mask as mask
from sensor.cfa import mosaics as mosaics
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.emva1288.characterise import Characterisation
from sensor.flicker.figures import FlickerFigures
from sensor.flicker.waveform import Waveform as Waveform
from sensor.flicker.waveform import waveform as waveform
from sensor.optics import SpectralIrradiance
from sensor.photodiodes import Gain
from sensor.pixel import ChannelReading as ChannelReading
from sensor.pixel import PixelConfig as PixelConfig
from sensor.pixel import Reading as Reading
from sensor.presets import low_noise as low_noise
from sensor.presets import preset as preset
from sensor.presets import preset_names as sensors
from sensor.raw import RawImage as RawImage
from sensor.raw_files.raw_file import read_raw as read_raw
from studies.budget.ledger import Plan
from studies.commands.report import write_report as report
from studies.design.expect import ExpectedError
from studies.explore.server import explore as explore
from studies.explore.source import load_transport as load_transport
from studies.explore.views import explorer_view as explorer_view
from studies.metrics.compare import ReferencePicture
from studies.metrics.compare import measure as measure
from studies.photograph.clock import Clock
from studies.photograph.develop import develop as develop
from studies.photograph.develop import develop_file as develop_file
from studies.photograph.moments import time_average as time_average
from studies.photograph.shot import Order as Order
from studies.photograph.shot import take as take
from studies.photograph.snr import LightForSnr
from studies.score.figure import Merit
from studies.study.study import RenderLimits as RenderLimits
from studies.study.study import SceneChoice as SceneChoice
from studies.study.study import Study as Study
from studies.study.study_file import read_study as read_study
from studies.sweep.export import read_rows as read_rows
from studies.sweep.run_sweep import Runner, SweepResult
from studies.sweep.workers import run_in_processes as run_in_processes

__all__ = [
    "ChannelReading",
    "InputError",
    "LightGroup",
    "Order",
    "Picture",
    "PixelConfig",
    "Processor",
    "RawImage",
    "Reading",
    "RenderLimits",
    "Scene",
    "SceneChoice",
    "SpectralRadiance",
    "Spectrum",
    "Study",
    "Waveform",
    "auto_exposure_s",
    "binned",
    "calibrate",
    "capture",
    "channel_electrons",
    "characterise",
    "develop",
    "develop_file",
    "draw_device",
    "encode_srgb",
    "expect",
    "expected_electrons",
    "explore",
    "explorer_view",
    "expose",
    "finish",
    "flicker_figures",
    "form_image",
    "grey",
    "illuminant",
    "illuminants",
    "light_for_snr",
    "line_bands",
    "lines_nm",
    "load",
    "load_radiance",
    "load_scene_file",
    "load_transport",
    "look_at",
    "low_noise",
    "mask",
    "matte",
    "measure",
    "merged_raw",
    "moments_s",
    "mosaics",
    "panel",
    "plan",
    "preset",
    "processors",
    "read_raw",
    "read_rows",
    "read_study",
    "reference_picture",
    "reference_plan",
    "relight_denoised",
    "remosaic",
    "render",
    "report",
    "run_in_processes",
    "scenes",
    "score",
    "sensors",
    "snr",
    "sweep",
    "take",
    "time_average",
    "to_world",
    "waveform",
    "with_channel_readings",
    "with_gain",
    "with_readings",
    "write_exr",
    "write_picture",
    "write_raw",
]

__version__: str

_Sensor: TypeAlias = SensorConfig | str | Path
_Seconds: TypeAlias = float | str
_Light: TypeAlias = Spectrum | str
_Study: TypeAlias = Study | str | Path

def auto_exposure_s(
    irradiance: SpectralIrradiance,
    sensor: _Sensor,
    longest_s: float = ...,
    *,
    channel: str | None = None,
    percentile: float = ...,
    well_share: float = ...,
) -> float: ...
def binned(sensor: _Sensor, way: str) -> SensorConfig: ...
def calibrate(sensor: _Sensor, light: _Light) -> ColourCalibration: ...
def capture(
    radiance: SpectralRadiance,
    sensor: _Sensor | None = None,
    exposure_s: _Seconds | None = None,
    device: Device | None = None,
    rng: np.random.Generator | None = None,
    *,
    light: _Light | None = None,
    exact: bool = False,
    samples_per_pixel: int = 1,
    shake: str | None = None,
    gain: Gain | None = None,
    iso: float | None = None,
    flicker: Waveform | str | None = None,
) -> RawImage: ...
def channel_electrons(irradiance: SpectralIrradiance, sensor: _Sensor, exposure_s: _Seconds) -> NDArray[np.float64]: ...
def characterise(
    sensor: _Sensor, shape: tuple[int, int] = ..., seed: int = 0, exposure_s: _Seconds = 0.01, exact: bool = False
) -> Characterisation: ...
def draw_device(sensor: _Sensor, shape: tuple[int, int], rng: np.random.Generator) -> Device: ...
def encode_srgb(linear: ArrayLike) -> NDArray[np.float64]: ...
def expect(
    sensor: _Sensor,
    levels_cd_m2: ArrayLike,
    light: str = "D65",
    exposure: str | float = ...,
    prior: str = "drawn",
    blur: bool = False,
) -> list[ExpectedError]: ...
def expected_electrons(
    irradiance: SpectralIrradiance, sensor: _Sensor, exposure_s: _Seconds
) -> NDArray[np.float64]: ...
def expose(
    expected_e: ArrayLike,
    sensor: _Sensor,
    exposure_s: _Seconds,
    device: Device,
    rng: np.random.Generator,
    *,
    exact: bool = False,
) -> RawImage: ...
def finish(
    raw: RawImage,
    planes: ArrayLike,
    matrix: ArrayLike | ColourFit,
    *,
    neutral: ArrayLike | None = None,
    balance: ArrayLike | WhiteBalance | None = None,
    engine: Backend = "numpy",
    noise_gain: ArrayLike | None = None,
) -> Picture: ...
def flicker_figures(waveform: Waveform | str, exposure_s: _Seconds, tolerance: float = ...) -> FlickerFigures: ...
def form_image(radiance: SpectralRadiance, sensor: _Sensor, samples_per_pixel: int = 1) -> SpectralIrradiance: ...
def light_for_snr(ratio: float, sensor: _Sensor, light: str, exposure_s: _Seconds) -> list[LightForSnr]: ...
def moments_s(exposure_s: _Seconds, count: int) -> Floats: ...
def panel(pose: ArrayLike, width_m: Metres, height_m: Metres, bsdf: Node, **more: Node) -> Node: ...
def plan(study: _Study, *, cache: str | Path | None = None, step: Step | None = None) -> Plan: ...
def reference_picture(radiance: SpectralRadiance, light: _Light | None = None) -> ReferencePicture: ...
def reference_plan(study: _Study) -> Plan: ...
def render(
    scene: Scene | str,
    size: tuple[int, int] | int,
    *,
    wavelength_nm: ArrayLike | None = None,
    width_nm: ArrayLike | None = None,
    spp: int | None = None,
    max_spp: int | None = None,
    noise: float | None = None,
    max_seconds: float | None = None,
    max_depth: int | None = None,
    seed: int = 0,
    cache: str | Path | None = None,
    resume: Transport | None = None,
    progress: Progress | None = None,
    denoise: bool = False,
) -> Transport: ...
def score(
    sensor: _Sensor,
    light: str = "D65",
    exposure_s: _Seconds = 0.033,
    only: Sequence[str] = (),
    seed: int = 0,
    *,
    processor: str | None = None,
    trust_code: bool = False,
    step: Step | None = None,
) -> list[Merit]: ...
def snr(electrons: ArrayLike, sensor: _Sensor, exposure_s: _Seconds, channel: str | None = None) -> Floats: ...
def sweep(
    study: _Study,
    out: str | Path,
    plan: Plan | None = None,
    runner: Runner | None = None,
    step: Step | None = None,
    *,
    clock: Clock | None = None,
    ahead: bool = False,
) -> SweepResult: ...
def to_world(*transforms: ArrayLike) -> Any: ...
def with_channel_readings(sensor: _Sensor, readings: Sequence[ChannelReading]) -> SensorConfig: ...
def with_gain(sensor: _Sensor, gain: Gain) -> SensorConfig: ...
def with_readings(sensor: _Sensor, readings: Sequence[Reading], readout: str = ...) -> SensorConfig: ...
def write_picture(
    picture: Picture | ReferencePicture | ArrayLike, path: str | Path, bits: int = 8, encoding: str = "srgb"
) -> None: ...
