"""What all cells of one scene share, made once and kept as files: the truth, and electrons per cd/m^2 and second.

Light is linear: a mosaic's expected electrons at any level and exposure are those at 1 cd/m^2 and 1 s times both. So a
cell reads one (h, w) array from its path, whatever the number of bands, and no array goes through a scheduler.
"""

import json
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.colour.colour_fit import ColourFit
from isp.processors.catalogue import Processor
from render.radiance import SpectralRadiance
from render.spectrum import DEFAULT_WAVELENGTH_NM, VISIBLE_NM, Floats, Spectrum, band_widths
from render.transport import Transport
from rodcone.digests import digest
from rodcone.files import replacing
from sensor.config import SensorConfig
from sensor.exposure import auto_exposure_s
from sensor.optics import form_image
from sensor.response import expected_electrons
from studies.metrics.truth import Light, light_in_bands, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit
from studies.study.lit_scene import OpenedScene, white_spectrum
from studies.sweep.provenance import versions
from studies.sweep.stored import is_whole, keep

_DARK_S = 1e7  # what `auto_exposure_s` answers where there is no light: longer than any exposure


@dataclass(frozen=True)
class LitScene:
    """A render under one spectrum, at a mean luminance of 1 cd/m^2.

    Attributes
    ----------
    key : str
    light : Light
        That the cameras' colours are set to.
    white_cd_m2 : float
        Luminance shown as white.
    lux_per_cd_m2 : float or None
        Illuminance of the reference plane; None without one.
    truth : Path
        Linear sRGB of the noise-free scene, not clipped, `white_cd_m2` reads 1, (h, w, 3) float64; the same at every
        level.
    """

    key: str
    light: Light
    white_cd_m2: float
    lux_per_cd_m2: float | None
    truth: Path


@dataclass(frozen=True)
class Frame:
    """A lit scene on a sensor, at 1 cd/m^2 and 1 s.

    Attributes
    ----------
    key : str
    sensor : SensorConfig
        With the modelled lens.
    auto_s : float
        Auto exposure there, without a longest time [s].
    electrons : Path
        Expected electrons, (h, w) float64.
    half_difference : Path
        Of even and odd passes, one draw of the Monte Carlo error, (h, w) float32.
    """

    key: str
    sensor: SensorConfig
    auto_s: float
    electrons: Path
    half_difference: Path


def lit_key(render: str, opened: OpenedScene, spectrum: str) -> str:
    """Key of a lit scene: the render's content, the scene's own lights, the spectrum, and what computes it."""
    return digest([render, opened.identity, spectrum, versions()])


def frame_key(lit: str, preset: SensorConfig, sensor: SensorConfig) -> str:
    """Key of a frame: the lit scene, the preset that sets the exposure, and the sensor as it is modelled."""
    return digest([lit, preset, sensor])


def read_lit(folder: Path, key: str) -> LitScene | None:
    """Lit scene made earlier, None where there is none that is whole."""
    facts = _read(folder, key, "truth")
    if facts is None:
        return None
    light = Light(*(np.array(facts["light"][name], float) for name in ("wavelength_nm", "width_nm", "spectrum")))
    return LitScene(key, light, facts["white_cd_m2"], facts["lux_per_cd_m2"], folder / facts["truth"])


def make_lit(folder: Path, key: str, opened: OpenedScene, transport: Transport, spectrum: str) -> LitScene:
    """Make and keep a lit scene; `transport` is lit by `under` already."""
    radiance = transport.relight(luminance_cd_m2=1.0)
    light = light_in_bands(white_spectrum(opened, spectrum), transport.wavelength_nm, transport.width_nm)
    white = shown_white_cd_m2(transport, 1.0)
    lux = transport.illuminance_lux(1.0)
    facts: dict[str, Any] = {
        "light": {name: value.tolist() for name, value in vars(light).items()},
        "white_cd_m2": white,
        "lux_per_cd_m2": lux,
        "truth": keep(folder, _npy(true_srgb(radiance, light, white)), ".npy"),
    }
    _write(folder, key, facts)
    return LitScene(key, light, white, lux, folder / facts["truth"])


def read_frame(folder: Path, key: str, sensor: SensorConfig) -> Frame | None:
    """Frame made earlier, None where there is none that is whole."""
    facts = _read(folder, key, "electrons", "half_difference")
    if facts is None:
        return None
    return Frame(key, sensor, facts["auto_s"], folder / facts["electrons"], folder / facts["half_difference"])


def make_frame(
    folder: Path,
    key: str,
    views: tuple[SpectralRadiance, SpectralRadiance, SpectralRadiance],
    preset: SensorConfig,
    sensor: SensorConfig,
) -> None:
    """Make and keep a frame.

    Parameters
    ----------
    views : three SpectralRadiance
        The lit scene at 1 cd/m^2: all passes of its render, the even, and the odd ones.
    preset : SensorConfig
        Whose auto exposure it is, whatever mosaic and lens `sensor` has.
    """
    whole, even, odd = (expected_electrons(form_image(view, sensor), sensor, 1.0) for view in views)
    facts = {
        "auto_s": _auto_s(views[0], preset),
        "electrons": keep(folder, _npy(whole), ".npy"),
        "half_difference": keep(folder, _npy(((even - odd) / 2).astype(np.float32)), ".npy"),
    }
    _write(folder, key, facts)


def _auto_s(radiance: SpectralRadiance, preset: SensorConfig) -> float:
    """Auto exposure at 1 cd/m^2 [s], without a longest time.

    It is the same for every processor and every model of the lens, so that their pictures can be compared: the preset's
    own mosaic behind a lens that spreads no light.
    """
    bare = replace(preset.lens, diffraction=0.0, veiling_glare=0.0, horizontal_view_deg=0.0, defocus_um=0.0)
    plain = replace(preset, lens=bare)
    return auto_exposure_s(form_image(radiance, plain), plain, _DARK_S)


def colours_under(sensor: SensorConfig, processor: Processor, spectrum: Spectrum) -> ColourFit:
    """Fit a processor's colours under a light, in bands of its own: calibration doesn't depend on the render.

    The bands go on as far as the sensor's window does: a camera is calibrated with the infrared that it sees.
    """
    nm: Floats = np.arange(DEFAULT_WAVELENGTH_NM[0], max(sensor.window_nm[1], VISIBLE_NM[1]), 10.0)
    return colour_fit(sensor, processor, light_in_bands(spectrum, nm, band_widths(nm)))


def _npy(array: NDArray[np.floating]) -> memoryview:
    file = BytesIO()
    np.save(file, array)
    return file.getbuffer()


def _write(folder: Path, key: str, facts: dict[str, Any]) -> None:
    with replacing(folder / f"{key}.json") as (text,):
        text.write_text(json.dumps({"facts": facts, "digest": digest(facts)}), "utf-8")


def _read(folder: Path, key: str, *files: str) -> dict[str, Any] | None:
    """Facts kept under a key, None where they or the files that they name aren't whole: these are made again."""
    try:
        stored = json.loads((folder / f"{key}.json").read_text("utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(stored, dict) or digest(stored.get("facts")) != stored.get("digest"):
        return None
    facts: dict[str, Any] = stored["facts"]
    return facts if all(is_whole(folder / facts[name]) for name in files) else None
