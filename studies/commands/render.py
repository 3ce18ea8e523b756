"""The command `rodcone render`."""

import json as notation
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from render.engine import render as render_transport
from render.illuminants import illuminant
from render.photometry import luminance
from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.scene import LightGroup, Scene
from render.spectrum import DEFAULT_WAVELENGTH_NM, VISIBLE_NM, Floats, Spectrum
from render.transport import Transport
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError, require_keys, require_whole
from rodcone.files import check_place
from rodcone.memory import memory, require_memory
from rodcone.progress import progress
from studies.pages.results import render_facts
from studies.study.scene_source import asked_level, open_scene

MOST_BANDS = 1000
INTERRUPTED = 130  # exit code after Ctrl-C: 128 + SIGINT


@dataclass(frozen=True)
class Order:
    """What to render, as it stands on the command line."""

    source: str
    out: Path
    height: int | None = None
    width: int | None = None
    bands: str | None = None
    light: tuple[str, ...] = ()
    level: str | None = None
    limits: dict[str, Any] = field(default_factory=dict)  # spp, noise, max_seconds, max_depth, seed, cache
    trust: bool = False
    extend: str | None = None
    force: bool = False


def render(
    source: str,
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("render.radiance_files.exr"),
    height: int | None = None,
    width: int | None = None,
    bands: str | None = None,
    light: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    level: str | None = None,
    spp: int | None = None,
    noise: float | None = None,
    max_seconds: float | None = None,
    max_depth: int = 8,
    seed: int = 0,
    cache: Path | None = None,
    trust_scene: Annotated[bool, Parameter(negative="")] = False,
    extend: str | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Render a scene into a spectral OpenEXR file; prints its path.

    Stops at whichever comes first of --spp, --noise and --max-seconds; with none of them after 64 samples a pixel.
    Ctrl-C keeps what is done and exits with 130.

    Parameters
    ----------
    source
        Scene by name such as color_checker, or a Mitsuba scene (.xml). Its lights are grouped by their ids up to a
        colon; its files have to lie in its folder; a shape with an irradiancemeter is the plane on which lux are meant;
        RGB colours are upsampled to spectra by Mitsuba, and lights stated so have no unit: give --level.
    out
        File to write, ending in .exr.
    height
        Pixels; the scene file's film by default, or 256. With one of height and width the other keeps the proportions.
    width
        Pixels; as height.
    bands
        Wavelength bands in nm as FIRST_EDGE:LAST_EDGE:WIDTH; 380:780:10 by default.
    light
        GROUP=ILLUMINANT, such as lamp=A: another spectrum for a light group, at the same luminance; may be given
        several times.
    level
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); the scene's own
        by default.
    spp
        Samples a pixel, at most.
    noise
        Relative Monte Carlo error to reach, such as 0.02.
    max_seconds
        Time for the render, at most.
    max_depth
        Longest path in segments; 2 is direct light.
    seed
        Seed of the render.
    cache
        Folder of finished renders, to use and to add to.
    trust_scene
        Let the scene file load plug-ins of its own, which are native code, and files from anywhere.
    extend
        Give hold to let surfaces go on at their end values outside their tables; bands beyond are refused by default.
    force
        Go on where more memory is needed than is free.
    json
        Print one JSON object with the path and facts of the render instead of the path.
    """
    limits = {"spp": spp, "noise": noise, "max_seconds": max_seconds, "max_depth": max_depth, "seed": seed}
    lights = tuple(light or ())
    limited = {**limits, "cache": cache}
    order = Order(source, out, height, width, bands, lights, level, limited, trust_scene, extend, force)
    facts = run(order)
    for note in facts["notes"]:
        print(f"rodcone: {note}", file=sys.stderr)
    if facts["stopped_by"] == "interrupt":
        print(f"rodcone: stopped; {facts['spp']} samples a pixel are kept in {out}", file=sys.stderr)
    print(notation.dumps(facts) if json else out)
    return INTERRUPTED if facts["stopped_by"] == "interrupt" else 0


def run(order: Order) -> dict[str, Any]:
    """Render and write the file; gives the facts of the render.

    Raises
    ------
    InputError
        For anything in `order` that isn't allowed, before anything is rendered.
    OSError
        Where the file can't be written; what can be told before the render is.
    """
    if order.out.suffix.lower() != ".exr":
        raise InputError(f"out: {str(order.out)!r} is not allowed; give a file ending in .exr")
    nm, widths = _bands(order.bands)
    opened = open_scene(order.source, order.trust, order.extend)
    scene, size = opened.scene, _size(opened.size, order.height, order.width)
    spectra = _spectra(scene, order.light)
    luminance_cd_m2, illuminance_lux = asked_level(scene, order.level)
    count = DEFAULT_WAVELENGTH_NM.size if nm is None else nm.size
    require_memory(memory(size[0] * size[1], count, len(scene.groups)), order.force)
    check_place(order.out)
    with progress(sys.stderr) as step:
        step("render", 0.0)
        transport = render_transport(
            scene,
            size,
            wavelength_nm=nm,
            width_nm=widths,
            progress=lambda share, error: step(f"render, relative error {error:.3f}", share),
            **order.limits,
        )
    radiance = transport.relight(spectra, luminance_cd_m2=luminance_cd_m2, illuminance_lux=illuminance_lux)
    write_exr(order.out, radiance, scene=scene.name)
    largest = float(transport.band_error(spectra).max())
    return _facts(order, opened, transport, radiance) | {"largest_band_error": largest}


def _bands(text: str | None) -> tuple[Floats | None, Floats | None]:
    """Centres and widths of evenly spaced bands from ``380:780:10``; None where the engine's own are wanted."""
    if text is None:
        return None, None
    try:
        first, last, width = (float(part) for part in text.split(":"))
        count = round((last - first) / width)
    except (ValueError, ZeroDivisionError, OverflowError):
        first = last = width = count = 0
    if not (1 <= count <= MOST_BANDS and 0 < first < last and abs(first + count * width - last) < 1e-6 * width):
        raise InputError(
            f"bands: {text!r} is not allowed; give FIRST_EDGE:LAST_EDGE:WIDTH [nm] with 1 to {MOST_BANDS} whole bands, "
            f"such as {VISIBLE_NM[0]:g}:{VISIBLE_NM[1]:g}:10"
        )
    edges = np.linspace(first, last, count + 1)
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)


def _size(own: tuple[int, int], height: int | None, width: int | None) -> tuple[int, int]:
    """Height and width; the one that isn't given keeps the scene's proportions."""
    for name, pixels in (("height", height), ("width", width)):
        if pixels is not None:
            require_whole(name, pixels, 1, 1 << 15, "give pixels")
    if height is not None:
        return height, width if width is not None else max(1, round(height * own[1] / own[0]))
    return (max(1, round(width * own[0] / own[1])), width) if width is not None else own


def _spectra(scene: Scene, lights: tuple[str, ...]) -> dict[str, Spectrum]:
    """Illuminants by light group, each at the luminance of the group's own spectrum."""
    found: dict[str, Spectrum] = {}
    for text in lights:
        group, _, name = text.rpartition("=")
        if not group or not name:
            raise InputError(f"light: {text!r} is not allowed; write GROUP=ILLUMINANT, such as lamp=A")
        require_keys(f"scene {scene.name}: light group", [group], scene.groups)
        found[group] = illuminant(name) * _luminance(scene, group, scene.groups[group])
    return found


def _luminance(scene: Scene, name: str, group: LightGroup) -> float:
    """Luminance of a group's spectrum at power 1, which another illuminant is brought to."""
    if group.coloured:
        raise InputError(f"light: group {name!r} of scene {scene.name} has colours of its own; leave it as it is")
    nm, width = np.arange(360.5, 830.0), np.ones(470)  # as in `render.illuminants.unit_luminance`
    own = float(luminance(group.spectrum.band_average(nm, width), nm, width))
    if own <= 0:
        raise InputError(f"light: group {name!r} of scene {scene.name} is dark; give it a spectrum in the scene")
    return own


def _facts(order: Order, opened: SceneFile, transport: Transport, radiance: SpectralRadiance) -> dict[str, Any]:
    groups = {
        name: {"emitters": list(group.emitters), "power": group.power, "own_colour": group.coloured}
        for name, group in opened.scene.groups.items()
    }
    return {
        "path": str(order.out),
        "scene": opened.scene.name,
        "size": list(radiance.shape[:2]),
        **render_facts(transport),
        "relative_mc_error": radiance.relative_mc_error,
        "relative_level_error": radiance.relative_level_error,
        "mean_luminance_cd_m2": float(radiance.luminance().mean()),
        "groups": groups,
        "notes": list(opened.notes),
    }
