"""Open the subject of a study: a scene by name, a Mitsuba scene of the user's own, or a spectral picture file."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from render.illuminants import illuminant
from render.radiance_files.file_checks import require_file
from render.radiance_files.photo import EXTENSIONS, SRGB_BASIS, SURFACES
from render.radiance_files.radiance_source import (
    ENDINGS,
    REFERENCE,
    is_iset,
    is_reference,
    is_reflectance,
    load_picture,
    stored_illuminant,
)
from render.scene import LightGroup, Scene
from render.spectrum import Spectrum
from render.transport import Transport
from render.user_scene.scene_file import load_scene_file
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError, require_absent, require_range, require_whole
from scenes.catalogue import load, scene_names, scene_options
from studies.study.levels import parse_level

_OTHER_FILES = {
    **dict.fromkeys((".dng", ".tif", ".tiff", ".nef", ".cr2", ".cr3", ".arw"), "a raw file, for rodcone develop"),
    **dict.fromkeys(ENDINGS, "a picture, for rodcone capture or a study"),
    REFERENCE: "reference light, for rodcone capture and explore; a study has render.reference = true",
    ".toml": "a study or a sensor, for rodcone sweep or --sensor",
}

_TIME = "time_s"  # option or parameter that sets the time of a scene that moves

_UPSAMPLED = {
    SURFACES: "reflectance of measured surfaces that looks like it (Otsu et al. 2018)",
    SRGB_BASIS: "mixture of sRGB's three basis curves (Mallett and Yuksel 2019), which one matrix undoes without error",
}


def open_scene(
    source: str,
    trust: bool = False,
    extend: str | None = None,
    light: str | None = None,
    chart: str | None = None,
    define: Sequence[str] = (),
    time_s: float | None = None,
) -> SceneFile:
    """Open a scene by its name or file; return it with the size of its film and notes.

    Parameters
    ----------
    source : str
        Name in the catalogue, or a Mitsuba scene (``.xml``).
    trust, extend
        As in `load_scene_file`.
    light, chart : str, optional
        Options of a catalogue scene's builder: its light, and a file of reflectances for color_checker's patches.
    define : sequence of str
        ``NAME=VALUE`` of a scene file's $parameters.
    time_s : float, optional
        Time at which a scene that moves is seen: its builder's option, or a scene file's parameter $time_s.

    Raises
    ------
    InputError
        For an unknown name, a time for a scene that doesn't move, a scene file that isn't allowed, `trust` for a
        catalogue scene, or `light` or `chart` for a file.
    """
    if Path(source).suffix.lower() == ".xml":
        require_absent(f"for {source}, a file that has its own", light=light, chart=chart)
        define = (*define, *(() if time_s is None else (f"{_TIME}={time_s!r}",)))
        return load_scene_file(source, trust=trust, extend=extend, define=defined(define))
    require_absent(f"for {source!r}; allowed: with an .xml scene", trust_scene=trust, define=tuple(define))
    if suffix := Path(source).suffix.lower():
        what = _OTHER_FILES.get(suffix, f"no file that is a scene ({suffix})")
        files = (".xml",) if suffix in ENDINGS else (".xml", *ENDINGS)
        raise InputError(f"scene: {source!r} is {what}; allowed: {', '.join(files)}, or a name of rodcone list scenes")
    given = (("light", light), ("chart", chart), (_TIME, time_s))
    if time_s is not None and _TIME not in scene_options(source):
        moving = [name for name in scene_names() if _TIME in scene_options(name)]
        raise InputError(
            f"moments: scene {source} doesn't move; allowed: {', '.join(moving)}, or a .xml scene with a parameter "
            f"${_TIME}; leave --moments out"
        )
    options = {name: value for name, value in given if value is not None}
    scene = load(source, **options)
    return SceneFile(replace(scene, extend=extend), scene.size, ())


def defined(texts: Sequence[str]) -> dict[str, str]:
    """Return the values of a scene file's $parameters by name."""
    for text in texts:
        if "=" not in text[1:]:
            raise InputError(f"define: {text!r} is not allowed; write NAME=VALUE, as -D depth=4")
    return {name: value for name, _, value in (text.partition("=") for text in texts)}


def asked_size(size: tuple[int, int], height: int | None, width: int | None) -> tuple[int, int]:
    """Return the requested height and width; a side that isn't given follows from the proportions of `size`."""
    for name, pixels in (("height", height), ("width", width)):
        if pixels is not None:
            require_whole(name, pixels, 1, 1 << 15, "give pixels")
    if height is not None:
        return height, width if width is not None else max(1, round(height * size[1] / size[0]))
    return (max(1, round(width * size[0] / size[1])), width) if width is not None else size


def asked_level(scene: Scene, text: str | None) -> dict[str, float]:
    """Return a level as arguments of `render.transport.Transport.relight`; empty for the lights' own powers.

    Raises
    ------
    InputError
        For a text that is no light level, or lux in a scene without a reference plane.
    """
    if text is None:
        return {}
    value, unit = parse_level(text)
    if unit == "lux" and scene.reference_plane is None:
        raise InputError(
            f"level: {text!r} needs a reference plane, which scene {scene.name} doesn't state; give it in cd/m2, "
            "or put an irradiancemeter on a shape"
        )
    return {"illuminance_lux" if unit == "lux" else "luminance_cd_m2": value}


_SMOOTH = (
    "its light is taken to be smooth within bands; of a lamp with lines bands of 20 nm lose up to 6 % so, which naming "
    "it as the light mends"
)
LIGHT = "D65"  # white of sRGB, for pictures that don't state their light


@dataclass(frozen=True)
class AdoptedWhite:
    """Light under which colours are judged, notes on what was assumed about it, and whether the user named it."""

    spectrum: Spectrum
    notes: tuple[str, ...] = ()
    named: bool = False


def first_light(groups: Mapping[str, LightGroup], default: Spectrum) -> Spectrum:
    """Return the spectrum of a scene's first light, or `default` where that light has colours of its own."""
    first = next(iter(groups.values()))
    return default if first.coloured else first.spectrum


def default_white(path: str | Path) -> AdoptedWhite:
    """Return D65 as the light of a picture file, with a note that it is assumed; none for reference light."""
    use = "it is lit by" if is_reflectance(path) else f"{_SMOOTH}; its colours are judged under"
    note = f"{Path(path).name}: {use} {LIGHT}; give another light where that isn't so"
    return AdoptedWhite(illuminant(LIGHT), () if is_reference(path) else (note,))


def file_white(path: str | Path, light: str | None) -> AdoptedWhite:
    """Return the light under which a picture file is seen: `light` if it is given, else the file's own, else D65.

    A given light replaces the illuminant that an ISETCam scene states. For a file that states none it is the light that
    the file is assumed to have.

    Raises
    ------
    InputError
        For an unknown light, or a ``.mat`` file that can't be read.
    """
    given = None if light is None else illuminant(light)
    stored = stored_illuminant(path)
    if given is not None:
        note = f"{Path(path).name}: lit by {light} in place of the illuminant that it holds"
        return AdoptedWhite(given, (note,) if stored is not None and is_iset(path) else (), named=True)
    if stored is None:
        return default_white(path)
    return AdoptedWhite(stored, (f"{Path(path).name}: its colours are judged under the illuminant that it holds",))


def check_radiance_file(path: str | Path, levels: Iterable[str]) -> None:
    """Raise `InputError` for a file that isn't there, or a level in lux, which has no plane to be measured on."""
    require_file(Path(path))
    for level in levels:
        if parse_level(level)[1] == "lux":
            raise InputError(f"level: {level!r} needs a reference plane, which a picture file hasn't; give it in cd/m2")


def open_radiance_file(path: str | Path, white: AdoptedWhite, spectra: str = SURFACES) -> tuple[Transport, list[str]]:
    """Load a picture file as a transport, and say what had to be assumed.

    Parameters
    ----------
    white : AdoptedWhite
        Light that illuminates a file of reflectances.
    spectra : str
        How a photograph's colours become spectra, as in `render.radiance_files.photo.read_photo`.

    Raises
    ------
    InputError
        As `load_picture`, and for a picture of fewer than 16 or more than 4096 pixels a side.
    """
    with warnings.catch_warnings(record=True) as file_warnings:
        warnings.simplefilter("always")
        transport = load_picture(path, white.spectrum, spectra, named=white.named)
    name = Path(path).name
    for side in transport.counts.shape:
        require_range(f"{name}: side", side, 16, 4096, "a picture needs so many pixels a side; crop or scale it")
    assumed = [*(f"{name}: {warning.message}" for warning in file_warnings), *white.notes]
    if is_reference(path):
        assumed.append(f"{name}: reference light, {transport.spp:.0f} samples a pixel")
        return transport, assumed
    if Path(path).suffix.lower() in EXTENSIONS:
        assumed.append(f"{name}: a photograph doesn't tell spectra; each colour stands for a {_UPSAMPLED[spectra]}")
    if transport.relative_mc_error:
        assumed.append(
            f"{name}: it was rendered with noise of {transport.relative_mc_error:.1%} of the value in a pixel and "
            "band; pictures of it hold that beside the sensor's noise, and no Monte Carlo share counts it"
        )
    return transport, assumed
