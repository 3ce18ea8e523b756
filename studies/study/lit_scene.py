"""A study's scene: opened, rendered once, and lit by the spectra that the study asks for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from render.cache import file_digests
from render.denoised.relight import relight_denoised
from render.engine import render
from render.illuminants import illuminant, spectral_luminance
from render.loader import Film
from render.radiance import SpectralRadiance
from render.radiance_files.photo import EXTENSIONS, SPECTRA, SURFACES
from render.radiance_files.radiance_source import files_of, is_radiance_file, is_reference
from render.reference import find_reference, require_agreement
from render.scene import Scene, film_size
from render.scene_range import check_range
from render.spectrum import Spectrum
from render.transport import Transport, replaceable_luminance
from render.user_scene.scene_parts import SceneFile
from rodcone.digests import digest_file, digest_inputs
from rodcone.errors import InputError, require_absent, require_keys, require_name
from rodcone.jit import backend
from rodcone.types import Progress
from sensor.config import check_frame
from sensor.presets import preset
from studies.study.equal_area import require_pixels
from studies.study.focus import in_focus
from studies.study.levels import parse_exposure, parse_level
from studies.study.model import RenderModel
from studies.study.motion import longest_span_s, moments_s
from studies.study.render_noise import render_quietly
from studies.study.scene_source import (
    LIGHT,
    AdoptedWhite,
    asked_level,
    check_radiance_file,
    file_white,
    first_light,
    open_radiance_file,
    open_scene,
)
from studies.study.study import OWN, SceneChoice, Study

LIVE_SPP = 64  # samples per pixel of a render that is compared with a reference


@dataclass(frozen=True)
class OpenedScene:
    """A scene ready to be rendered.

    Attributes
    ----------
    choice : SceneChoice
    scene : Scene or None
        The scene; None for a picture file, which needs no render.
    size : (int, int)
        Height and width; (0, 0) for a picture file, which is read only when it is needed.
    identity : str
        Hash of all that the scene is.
    notes : tuple of str
    moving : tuple of Scene
        The scene at times that are spread over `whole_s`; `scene` is the one in the middle of this time. Empty for a
        scene that stands still.
    whole_s : float
        Length of the longest exposure of a moving scene [s]; all exposures have the same middle.
    """

    choice: SceneChoice
    scene: Scene | None
    size: tuple[int, int]
    identity: str
    notes: tuple[str, ...] = ()
    moving: tuple[Scene, ...] = ()
    whole_s: float = 0.0

    @cached_property
    def white(self) -> AdoptedWhite:
        """Return the light that cameras' colours are set to under the scene's own lights, or a file's."""
        if self.scene is None:
            return file_white(self.choice.source, self.choice.light)
        return AdoptedWhite(first_light(self.scene.groups, illuminant(LIGHT)))


def open_choice(choice: SceneChoice, study: Study) -> OpenedScene:
    """Open a scene and check the study's levels and spectra against it; nothing is rendered.

    Raises
    ------
    InputError
        For a scene that is unknown or can't be read, a level in lux without a reference plane, another spectrum for
        lights that have colours of their own, or a size that doesn't fit a sensor: one that needs more pixels, or an
        odd number for one that bins.
    """
    if is_reference(choice.source):
        raise InputError(
            f"scene: {choice.source!r} is reference light, which a study finds by itself; give the scene's name and "
            "render.reference = true"
        )
    if is_radiance_file(choice.source):
        place = f"for {choice.source}, a picture without surfaces"
        options = ("extend", "chart", "define", "spp", "focus_m", "moments")
        require_absent(place, **{name: getattr(choice, name) for name in options})
        check_radiance_file(choice.source, study.levels)
        if choice.spectra is not None:
            require_name("spectra", choice.spectra, SPECTRA)
            if Path(choice.source).suffix.lower() not in EXTENSIONS:
                require_absent(
                    f"for {choice.source}, which has its own; allowed: with a photograph", spectra=choice.spectra
                )
        identity = digest_inputs(
            [
                [digest_file(file) for file in files_of(choice.source)],
                None if choice.light is None else illuminant(choice.light),
                choice.spectra,
            ]
        )
        return OpenedScene(choice=choice, scene=None, size=(0, 0), identity=identity)
    # A scene that is rendered.
    require_absent(f"for {choice.source!r}; allowed: with a photograph", spectra=choice.spectra)
    opened = _at(choice, None if choice.moments is None else 0.0)
    scene = opened.scene
    for level in study.levels:
        asked_level(scene, level)
    for spectrum, (name, group) in product(study.spectra, scene.groups.items()):
        if spectrum != OWN and group.coloured:
            raise InputError(
                f"spectra: {spectrum!r} can't relight group {name!r} of scene {scene.name}, whose lights have colours "
                f"of their own; allowed: {OWN}; put the scene into a study of its own"
            )
    check_range(scene, *study.render.range_nm)
    size = film_size(opened.size, study.render.size)
    for name in study.sensors:
        check_frame(preset(name), size)
    if study.equal_area is not None:
        require_pixels(study.equal_area, study.sensors, size)
    # The scene as the lens sees it, and at its times.
    scenes = [scene]
    whole_s = 0.0
    if choice.moments is not None:  # the middle, then the times
        whole_s = _whole_s(study, size[0])
        scenes = [_at(choice, float(at_s)).scene for at_s in (whole_s / 2, *moments_s(whole_s, choice.moments))]
    if choice.focus_m is not None:
        scenes = [_in_focus(each, choice, study, size) for each in scenes]
    scene, *times = scenes
    of_motion = [whole_s, *map(digest_scene, times)] if times else []
    identity = digest_inputs([digest_scene(scene), size, *of_motion])
    return OpenedScene(choice, scene, size, identity, tuple(opened.notes), tuple(times), whole_s)


def _whole_s(study: Study, rows: int) -> float:
    """Return the length of the longest exposure of a scene that moves, from the first row's start to the last's end."""
    exposures_s = [parse_exposure(exposure) or 0.0 for exposure in study.exposures]
    return longest_span_s([preset(name) for name in study.sensors], rows, exposures_s)


def _at(choice: SceneChoice, time_s: float | None) -> SceneFile:
    """Open a scene as it is at a time, or with None one that stands still."""
    return open_scene(
        choice.source, extend=choice.extend, light=choice.light, chart=choice.chart, define=choice.define, time_s=time_s
    )


def _in_focus(scene: Scene, choice: SceneChoice, study: Study, size: tuple[int, int]) -> Scene:
    """Return a scene as the lens of the sensors sees it; all sensors must have the same lens."""
    cameras = [study.lens.behind(preset(name)) for name in study.sensors]
    apart = dict.fromkeys(f"f/{camera.lens.f_number:g}" for camera in cameras)
    if choice.focal_length_mm is None:
        apart = dict.fromkeys(f"f/{camera.lens.f_number:g}, {camera.site_pitch_um:g} um" for camera in cameras)
    if len(apart) > 1 or (study.equal_area is not None and choice.focal_length_mm is None):
        raise InputError(
            f"focus_m: {choice.focus_m:g} with sensors of {'; '.join(apart)}; allowed: one f-number, and one sensor's "
            "width where no focal_length_mm is given, because a render has one lens; state it, or make a study of each"
        )
    assert choice.focus_m is not None
    return in_focus(scene, cameras[0], size, choice.focus_m, choice.focal_length_mm)[0]


def make_transport(
    opened: OpenedScene,
    study: Study,
    model: RenderModel | None,
    cache: Path,
    progress: Progress,
    share: Callable[[Transport], float] | None = None,
    samples: int = 1,
) -> tuple[Transport, tuple[str, ...]]:
    """Render a scene, or read a picture file; also return notes on what had to be assumed about the file.

    Parameters
    ----------
    model : RenderModel or None
        How the scene is rendered; None for a picture file.
    cache : Path
        Folder of renders. One of this scene with fewer samples is continued; one with more is used as it is.
    progress : callable
        As in `render.engine.render`. It is also called before the render, with an infinite error, because kernels may
        have to be compiled first.
    share : callable, optional
        Function that returns a render's noise variance over the sensor's own, for a study with a `noise_share`.
    samples : int
        Samples of the light along each side of a pixel (`studies.study.model.samples_a_side`); each is rendered like a
        pixel.

    Raises
    ------
    InputError
        As `render.engine.render` and `open_radiance_file`, and if the render that is made here disagrees with the
        reference light.
    KeyboardInterrupt
        Where Ctrl-C ended the render; what was rendered is in `cache`.
    """
    if opened.scene is None or model is None:
        transport, assumed = open_radiance_file(opened.choice.source, opened.white, opened.choice.spectra or SURFACES)
        if study.render.size is not None:
            assumed.append(
                f"{Path(opened.choice.source).name}: a picture keeps its own pixels; render.size is for scenes"
            )
        return transport, tuple(assumed)
    limits = study.render
    progress(0.0, np.inf)
    terms: dict[str, Any] = {
        "wavelength_nm": model.wavelength_nm,
        "width_nm": model.width_nm,
        "max_spp": model.spp,
        "max_seconds": limits.max_seconds,
        "seed": limits.seed,
        "cache": cache,
        "progress": progress,
        "denoise": model.denoise,
    }
    film = film_of(opened, model, samples)
    if limits.reference and (reference := find_reference(opened.scene, film)):
        if backend() == "numpy":
            return reference.transport, (f"light: the reference {reference.path.name}; nothing here can test it",)
        live = render(opened.scene, film.size, **terms | {"max_spp": LIVE_SPP, "max_seconds": None})
        return replace(reference.transport, meter=live.meter), (require_agreement(live, reference),)
    if limits.noise_share is None or share is None:
        transport = render(opened.scene, film.size, **terms)
    else:
        transport = render_quietly(opened.scene, film.size, share, most_share=limits.noise_share, **terms)
    if transport.stopped_by == "interrupt":
        raise KeyboardInterrupt
    return transport, ()


def film_of(opened: OpenedScene, model: RenderModel, samples: int = 1) -> Film:
    """Describe the film on which a scene is rendered, with `samples` samples along each side of a pixel."""
    if opened.scene is None:
        raise InputError(f"scene: {opened.choice.source!r} is a picture; allowed: a scene; it needs no render")
    return Film(
        size=(samples * opened.size[0], samples * opened.size[1]),
        wavelength_nm=np.array(model.wavelength_nm),
        width_nm=np.array(model.width_nm),
        max_depth=opened.scene.max_depth,
        rr_depth=opened.scene.rr_depth,
    )


def photographed(lit: Transport, luminance_cd_m2: float) -> SpectralRadiance:
    """Return the light that a study photographs, at a mean luminance; denoised light if the study asked for it."""
    if lit.denoised is None:
        return lit.relight(luminance_cd_m2=luminance_cd_m2)
    return relight_denoised(lit, luminance_cd_m2=luminance_cd_m2)[0]


def under(transport: Transport, spectrum: str) -> Transport:
    """Return the transport with another spectrum in all lights, each at its own luminance; ``own`` changes nothing."""
    if spectrum == OWN:
        return transport
    groups = {
        name: replace(group, spectrum=illuminant(spectrum) * spectral_luminance(group.spectrum))
        for name, group in transport.groups.items()
    }
    return replace(transport, groups=groups)


def asked_spectra(scene: Scene, lights: Sequence[str]) -> dict[str, Spectrum]:
    """Return the requested illuminant of each light group, at the luminance of the group's own spectrum.

    Parameters
    ----------
    scene : Scene
    lights : sequence of str
        ``GROUP=ILLUMINANT``, or ``ILLUMINANT`` alone for every group; a later text replaces an earlier one.

    Raises
    ------
    InputError
        For an unknown group or illuminant, or a group that is dark or has colours of its own.
    """
    spectra: dict[str, Spectrum] = {}
    for text in lights:
        group, equals, name = text.rpartition("=")
        if not name or bool(group) != bool(equals):
            raise InputError(
                f"light: {text!r} is not allowed; write GROUP=ILLUMINANT, such as {next(iter(scene.groups))}=A, or an "
                "illuminant for all lights, such as A"
            )
        require_keys(f"scene {scene.name}: light group", [group] if group else [], scene.groups)
        for lit_name in [group] if group else scene.groups:
            place = f"light: group {lit_name!r} of scene {scene.name}"
            spectra[lit_name] = illuminant(name) * replaceable_luminance(scene.groups[lit_name], place)
    return spectra


def white_spectrum(opened: OpenedScene, spectrum: str) -> Spectrum:
    """Return the light that cameras' colours are set to when all lights have one of the study's spectra."""
    return opened.white.spectrum if spectrum == OWN else illuminant(spectrum)


def lux_per_cd_m2(lit: Transport, levels: Sequence[str]) -> float | None:
    """Return the reference plane's illuminance at 1 cd/m^2 [lux]; None without a plane, or if no level is in lux."""
    return lit.illuminance_lux(1.0) if in_lux(levels) else None


def in_lux(levels: Sequence[str]) -> bool:
    """Return whether any level is in lux; only then the illuminance has to be traced, which takes time."""
    return any(parse_level(level)[1] == "lux" for level in levels)


def level_luminance(level: str, lux_per_cd_m2: float | None) -> float:
    """Return the mean scene luminance of a level [cd m^-2]."""
    value, unit = parse_level(level)
    if unit == "cd/m2":
        return value
    if not lux_per_cd_m2:
        raise InputError(f"level: {level!r} needs light on a reference plane, which the scene hasn't; give it in cd/m2")
    return value / lux_per_cd_m2


def open_all(study: Study) -> dict[SceneChoice, OpenedScene]:
    """Open every scene of a study before the first render, so that a fault in the last one stops the study at once."""
    return {choice: open_choice(choice, study) for choice in study.scenes}


def digest_scene(scene: Scene) -> str:
    """Return the hash of a scene, in which the meshes and bitmaps that it names count by their content."""
    return digest_inputs([scene, file_digests(scene.geometry)])
