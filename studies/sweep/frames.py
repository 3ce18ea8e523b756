"""Files that all cells of one scene share, made once: the truth, and the electrons at 1 cd/m^2 and 1 s.

Light is linear: the expected electrons at any level and exposure time are those at 1 cd/m^2 and 1 s, multiplied by
both. So a cell reads one (h, w) array from a file, whatever the number of bands, and no array is sent to a worker.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isp.colour.colour_fit import ColourFit
from isp.processors.catalogue import Processor
from render.denoised.relight import relight_denoised
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import DEFAULT_WAVELENGTH_NM, VISIBLE_NM, Spectrum, band_widths
from render.transport import Transport
from rodcone.curve_file import is_curve_file
from rodcone.digests import digest_inputs
from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W, amplified, at_level_s, best_exposure
from sensor.photodiodes import with_gain
from sensor.response import behind_filters, imaged_electrons
from studies.metrics.truth import Light, light_in_bands, shown_white_cd_m2, true_srgb
from studies.photograph.camera import colour_fit
from studies.study.equal_area import in_pixels, site_grid
from studies.study.gain import at_gain
from studies.study.levels import parse_exposure
from studies.study.lit_scene import OpenedScene, in_lux, level_luminance, lux_per_cd_m2
from studies.study.model import unit_exposure_s
from studies.study.study import Study
from studies.sweep.provenance import versions
from studies.sweep.stored import is_whole, keep_array, keep_facts, read_facts


@dataclass(frozen=True)
class UnitFrame:
    """A lit scene on a sensor, at a mean luminance of 1 cd/m^2 and an exposure of 1 s.

    Attributes
    ----------
    key : str
    sensor : SensorConfig
        The sensor with the modelled lens.
    light : Light
        The light that the cameras' colours are set to.
    white_cd_m2 : float
        Luminance shown as white.
    lux_per_cd_m2 : float or None
        Illuminance of the reference plane; None without a plane, or if no level is in lux.
    auto_s, auto_w_s : float
        Exposure times that the automatic exposures choose at 1 cd/m^2, without a limit [s]: `auto_s` for G of the
        preset, `auto_w_s` for W of the modelled mosaic, or for its unit channel if it has no W.
    truth : Path
        Linear sRGB of the noise-free scene, in which `white_cd_m2` is 1; not clipped; (h, w, 3) float64. It is the same
        at every level and for every sensor.
    electrons : Path
        Expected electrons, (h, w) float64; for a camera that shakes, those behind every filter, (h, w, channel).
    errors : Path
        Errors of the render in electrons, float32. For unbiased light one draw, half the difference of the render's
        halves, (1, h, w). For denoised light its differences from two independent folds, (2, h, w).
    """

    key: str
    sensor: SensorConfig
    light: Light
    white_cd_m2: float
    lux_per_cd_m2: float | None
    auto_s: float
    auto_w_s: float
    truth: Path
    electrons: Path
    errors: Path


def frame_key(
    render: str,
    opened: OpenedScene,
    spectrum: str,
    study: Study,
    preset: SensorConfig,
    sensor: SensorConfig,
    exposure: str = "",
) -> str:
    """Return the key of a frame: a digest of all that decides it, and of the versions that compute it.

    Parameters
    ----------
    render : str
        Digest of the render's content.
    opened : OpenedScene
        The opened scene, with its own lights.
    spectrum : str
    study : Study
        The study. Its levels matter only if one is in lux, because a frame then states lux per cd/m^2.
    preset, sensor : SensorConfig
        The preset, by which an automatic exposure is set, and the sensor as it is modelled.
    exposure : str
        Exposure of a scene that moves, because its length blurs the scene; empty for other scenes.
    """
    light = illuminant(spectrum) if is_curve_file(spectrum) else spectrum
    area = [] if study.equal_area is None else [study.equal_area]
    moving = [parse_exposure(exposure)] if exposure else []
    terms = [render, opened.identity, light, in_lux(study.levels), versions(), preset, sensor, *area, *moving]
    return digest_inputs(terms)


def load_frame(folder: Path, key: str, sensor: SensorConfig) -> UnitFrame | None:
    """Load a frame made earlier; return None if it, or a file that it names, is missing or damaged."""
    facts = read_facts(folder, key)
    if facts is None:
        return None
    files = {name: (folder / facts.pop(name)).resolve() for name in ("truth", "electrons", "errors")}
    if not all(is_whole(path) for path in files.values()):
        return None
    light_facts = {name: np.array(values, float) for name, values in facts.pop("light").items()}
    light = Light(**light_facts, lamp=Spectrum(*facts.pop("lamp")))
    return UnitFrame(key=key, sensor=sensor, light=light, **facts, **files)


def make_frames(
    folder: Path,
    transport: Transport,
    light: Light,
    wanted: Mapping[str, tuple[SensorConfig, SensorConfig]],
    study: Study,
    samples: int = 1,
    still: Transport | None = None,
) -> None:
    """Make and keep the frames of one lit scene.

    Parameters
    ----------
    transport : Transport
        Light of the scene, lit as `studies.study.lit_scene.under` does.
    light : Light
        The light that the cameras' colours are set to.
    wanted : mapping of str to (SensorConfig, SensorConfig)
        For each frame's key the preset, by which an automatic exposure is set for every mosaic and lens, and the sensor
        as it is modelled.
    study : Study
        The study, for its levels and its `sensor_side_um`.
    samples : int
        Samples of the light along each side of a pixel.
    still : Transport, optional
        For a scene that moves, its light at the middle of the exposures, which gives the truth.
    """
    if transport.denoised is None:
        views = (transport.relight(luminance_cd_m2=1.0), *transport.relight_halves(luminance_cd_m2=1.0))
    else:
        views = relight_denoised(transport, luminance_cd_m2=1.0)
    true = transport if still is None else still
    white = shown_white_cd_m2(true, 1.0)
    area = study.equal_area
    seen = views[0] if still is None else still.relight(luminance_cd_m2=1.0)
    picture = in_pixels(seen, samples) if area is None else area.view(seen, area.coarsest_um)
    scene = {
        "light": {name: getattr(light, name).tolist() for name in ("wavelength_nm", "width_nm", "spectrum")},
        "lamp": (light.lamp.wavelength_nm.tolist(), light.lamp.values.tolist()),
        "white_cd_m2": white,
        "lux_per_cd_m2": lux_per_cd_m2(true, study.levels),
        "truth": keep_array(folder, true_srgb(picture, light, white)),
    }
    for key, (preset, sensor) in wanted.items():
        radiances: tuple[SpectralRadiance, ...] = views
        if area is not None:
            pitch_um, block = site_grid(sensor)
            radiances = tuple(area.view(view, pitch_um / samples, block * samples) for view in views)
        of_pixels = in_pixels(radiances[0], samples)
        unmoved, *halves = (imaged_electrons(view, sensor, 1.0, samples) for view in radiances)
        whole, first, second = (behind_filters(electrons, sensor) for electrons in (unmoved, *halves))
        errors = [(first - second) / 2] if transport.denoised is None else [whole - first, whole - second]
        facts = scene | {
            "auto_s": unit_exposure_s(of_pixels, preset),
            "auto_w_s": unit_exposure_s(of_pixels, sensor, "W" if "W" in sensor.channels else None),
            "electrons": keep_array(folder, unmoved if sensor.lens.shake_um else whole),
            "errors": keep_array(folder, np.stack(errors).astype(np.float32)),
        }
        keep_facts(folder, key, facts)


def exposure_of(
    frame: UnitFrame, exposure: str, gain: str, luminance_cd_m2: float, longest_s: float
) -> tuple[float, SensorConfig]:
    """Return the exposure time of a frame at a mean luminance [s], and the camera at the gain that it then has.

    `exposure` and `gain` are texts as in `studies.study.study.Condition`. If `exposure` is a rule, it may raise the
    gain.
    """
    asked_s = parse_exposure(exposure)
    sensor = at_gain(frame.sensor, gain)
    if asked_s is not None:
        return asked_s, sensor
    less = frame.sensor.gain / sensor.gain  # because the frame's times fill the converter's range at its own gain
    if exposure in (AUTO, AUTO_W):
        unit_s = frame.auto_s if exposure == AUTO else frame.auto_w_s
        return amplified(sensor, less * at_level_s(unit_s, luminance_cd_m2, exposure, frame.sensor), longest_s)
    per_second_e = np.load(frame.electrons, allow_pickle=False) * luminance_cd_m2
    if per_second_e.ndim == 3:
        per_second_e = behind_filters(per_second_e, frame.sensor)
    green_s = less * at_level_s(frame.auto_s, luminance_cd_m2, AUTO, frame.sensor)
    return best_exposure(per_second_e, sensor, green_s, longest_s)


def kept_exposures(
    folder: Path, frame: UnitFrame, exposure: str, gain: str, levels: Sequence[str], longest_s: float
) -> list[tuple[float, SensorConfig]]:
    """Return the exposure time and the camera of a frame, as `exposure_of` does, at each of a study's levels.

    The rule that has to read the frame's light is slow, so its results are stored in the folder and read from there
    when they are needed again.
    """
    key = digest_inputs([frame.key, exposure, gain, levels, longest_s])
    facts = read_facts(folder, key) if exposure == AUTO_INFORMATION else None
    sensor = at_gain(frame.sensor, gain)
    if facts is None:
        luminances_cd_m2 = (level_luminance(level, frame.lux_per_cd_m2) for level in levels)
        made = [exposure_of(frame, exposure, gain, luminance, longest_s) for luminance in luminances_cd_m2]
        if exposure == AUTO_INFORMATION:
            rungs = [(exposure_s, None if camera is sensor else camera.gain) for exposure_s, camera in made]
            keep_facts(folder, key, {"exposures": rungs})
        return made
    return [
        (exposure_s, sensor if raised_to is None else with_gain(sensor, raised_to))
        for exposure_s, raised_to in facts["exposures"]
    ]


def colours_under(sensor: SensorConfig, processor: Processor, spectrum: Spectrum) -> ColourFit:
    """Fit a processor's colours under a light, in bands that don't depend on the render.

    The bands reach as far as the sensor's window does, so that a camera is calibrated with the infrared that it sees.
    """
    nm: Floats = np.arange(DEFAULT_WAVELENGTH_NM[0], max(sensor.window_nm[1], VISIBLE_NM[1]), 10.0)
    return colour_fit(sensor, processor, light_in_bands(spectrum, nm, band_widths(nm)))
