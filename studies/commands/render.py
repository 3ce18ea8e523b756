"""The command `rodcone render`: a scene's light as a file."""

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from render.cache import kept_beside
from render.denoised.relight import relight_denoised
from render.engine import render as render_transport
from render.radiance import SpectralRadiance
from render.radiance_files.exr import write_exr
from render.scene import Scene
from render.spectrum import RENDER_BAND_NM, VISIBLE_NM, even_bands, fine_bands
from render.transport import Transport, mean_alone, relight_by_band
from render.user_scene.scene_parts import SceneFile
from rodcone.errors import InputError
from rodcone.files import check_place, require_ending
from rodcone.memory import VIEWED, WRITTEN, require_memory
from rodcone.progress import compile_note, progress, render_words
from rodcone.types import Floats
from studies.commands.console import INTERRUPTED, Seconds, announce_cost, print_result, say
from studies.photograph.ready_light import BANDS, find_ready
from studies.study.cost import PictureCost
from studies.study.lit_scene import asked_spectra
from studies.study.render_facts import render_facts
from studies.study.scene_source import asked_level, asked_size, open_scene

MOST_BANDS = 1000
DEFAULT_SPP = 64
_WRITE_S = 2.5e-7  # processor seconds per pixel and band to relight and to write the file
READING = "reading the scene"  # the reading is announced because 100 000 shapes take a minute


@dataclass(frozen=True, kw_only=True)
class RenderOrder:
    """Scene to render, and the settings of the render.

    Attributes
    ----------
    source : str
        Scene by name such as color_checker, or a Mitsuba scene (.xml). Its lights are grouped by their ids up to a
        colon; its files have to lie in its folder; lux are measured on the shape that has an irradiancemeter. Mitsuba
        upsamples RGB colours to spectra; lights given as RGB have no unit, so give --level.
    out : Path
        File to write, ending in .exr.
    height : int, optional
        Pixels; by default those of the scene's light if it is there already, such as 512 of still_life, or else 256; a
        scene file has a film of its own. With one of height and width the other keeps the proportions.
    width : int, optional
        Pixels; as height.
    bands : str, optional
        Wavelength bands in nm as FIRST_EDGE:LAST_EDGE:WIDTH; by default 380:780:20, and a lamp's lines apart.
    light : tuple of str
        GROUP=ILLUMINANT, such as lamp=A: another spectrum for a light group, at the same luminance; or ILLUMINANT
        alone, for all of them; may be given several times. An illuminant is a name or a file: lamp=led.csv.
    chart : str, optional
        File (.csv, .txt, .spd) of reflectances of color_checker's patches, 1 to 24: wavelength_nm and a column each.
    level : str, optional
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); the scene's own
        by default.
    spp : int, optional
        Samples per pixel, at most.
    noise : float, optional
        Relative Monte Carlo error to reach, such as 0.02.
    max_seconds : float, optional
        Time for the render in seconds, at most.
    max_depth : int, optional
        Longest path in segments; 1 is emission alone, 2 direct light. By default what the scene's file states, or
        8.
    seed : int
        Seed of the render.
    render : bool
        Render the scene here, even if its light is there already; --spp, --noise, --max-seconds, --max-depth, --seed,
        --cache and --denoise do so too.
    cache : Path, optional
        Folder of finished renders, to use and to add to.
    trust_scene : bool
        Let the scene file load plug-ins of its own, which are native code, and files from anywhere.
    define : tuple of str
        NAME=VALUE of a $parameter of the scene file; -D is short for it; may be given several times.
    extend : str, optional
        hold: surfaces keep their end values outside their tables' wavelengths; by default bands there are refused.
    denoise : bool
        Write denoised light; its error is measured against two folds of a quarter of the samples each, whose time
        counts. Needs rodcone[denoise].
    force : bool
        Run even where more memory is needed than is free.
    """

    source: str = field(kw_only=False)
    out: Path = field(default=Path("render.exr"), kw_only=False)
    height: int | None = None
    width: int | None = None
    bands: str | None = None
    light: tuple[str, ...] = ()
    chart: str | None = None
    level: str | None = None
    spp: int | None = None
    noise: float | None = None
    max_seconds: Seconds | None = None
    max_depth: int | None = None
    seed: int = 0
    render: bool = False
    cache: Path | None = None
    trust_scene: bool = False
    define: tuple[str, ...] = ()
    extend: str | None = None
    denoise: bool = False
    force: bool = False

    @property
    def samples(self) -> int | None:
        """Return the most samples per pixel; None where an error or the time ends the render."""
        return self.spp if self.spp or self.noise or self.max_seconds else DEFAULT_SPP

    @property
    def renders(self) -> bool:
        """Return whether an option asks for a render even if the scene's light is there already."""
        limits = (self.spp, self.noise, self.max_seconds, self.max_depth, self.cache)
        return self.render or self.denoise or self.seed != 0 or any(limit is not None for limit in limits)


def render(order: Annotated[RenderOrder, Parameter(name="*")], *, dry_run: bool = False, json: bool = False) -> int:
    """Render a scene into a spectral OpenEXR file, and print its path.

    If the scene's light exists already, as for still_life, which comes with rodcone, it is used without a render. A
    render stops when it first reaches --spp, --noise or --max-seconds. If none of them is given, it stops after 64
    samples per pixel. Ctrl-C keeps what is done and exits with 130.

    Parameters
    ----------
    dry_run
        Print what it would cost in time, memory and samples; compute nothing.
    json
        Print one JSON object with the path and facts of the render instead of the path.
    """
    # Check what can be checked before the render.
    require_ending(order.out, ".exr")
    bands = _bands(order.bands)
    with progress(sys.stderr) as step:
        step(READING, 0.0)
        opened = open_scene(order.source, order.trust_scene, order.extend, chart=order.chart, define=order.define)
    scene = opened.scene
    size = asked_size(opened.size, order.height, order.width)
    spectra = asked_spectra(scene, order.light)
    lit_at: dict[str, Any] = asked_level(scene, order.level)
    lamps = [spectra.get(name, group.spectrum) for name, group in scene.groups.items()]
    stated = None if order.height is None and order.width is None else size
    ready = None if order.renders else find_ready(scene, opened.size, stated, lamps, bands or BANDS)
    size = ready.size if ready else size
    wavelength_nm, width_nm = (
        (ready.transport.wavelength_nm, ready.transport.width_nm)
        if ready
        else (bands or fine_bands(lamps, width_nm=RENDER_BAND_NM))
    )
    cost = PictureCost(
        size,
        wavelength_nm.size,
        len(scene.groups),
        0 if ready else order.samples,
        _WRITE_S,
        denoised=order.denoise,
        max_seconds=order.max_seconds,
        light=VIEWED if order.denoise else WRITTEN,
    )
    if not announce_cost(cost, dry_run=dry_run, json=json):
        return 0
    require_memory(cost.memory, order.force)
    check_place(order.out)
    # Render and write.
    with kept_beside(order.out) as kept:
        if ready:
            transport = ready.transport
            notes = (*opened.notes, ready.line)
        else:
            transport = _rendered(order, scene, size, (wavelength_nm, width_nm), kept)
            notes = opened.notes
            notes = (*notes, *filter(None, [compile_note(transport.compile_s)]))
        band_error = max(transport.band_error(spectra).values())
        if order.denoise:
            radiance = relight_denoised(transport, spectra, **lit_at)[0]
        else:
            by_band = relight_by_band(transport, spectra, **lit_at)
            # The lit light, which is one more array of all bands, takes the place of those that state the error.
            del ready
            transport = mean_alone(transport)
            radiance = replace(by_band, signed=False).whole()
        write_exr(radiance, order.out, scene=scene.name)
    # Say what was done.
    say(*notes)
    interrupted = transport.stopped_by == "interrupt"
    if interrupted:
        say(f"stopped; {transport.spp:.0f} samples a pixel are kept in {order.out}")
    facts = {"path": str(order.out), **_facts(opened, transport, radiance)}
    facts["largest_band_error"] = band_error
    print_result(order.out, facts, json=json)
    return INTERRUPTED if interrupted else 0


def _rendered(
    order: RenderOrder, scene: Scene, size: tuple[int, int], bands: tuple[Floats, Floats], kept: Path
) -> Transport:
    with progress(sys.stderr) as step:
        step(render_words(np.inf), 0.0)
        return render_transport(
            scene,
            size,
            wavelength_nm=bands[0],
            width_nm=bands[1],
            spp=order.spp,
            noise=order.noise,
            max_seconds=order.max_seconds,
            max_depth=order.max_depth,
            seed=order.seed,
            cache=order.cache or kept,
            progress=lambda share, error: step(render_words(error, share), share),
            denoise=order.denoise,
        )


def _bands(text: str | None) -> tuple[Floats, Floats] | None:
    """Return the centres and widths [nm] of even bands given as ``380:780:10``; None where the lights choose them."""
    if text is None:
        return None
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
    return even_bands((first, last), count)


def _facts(opened: SceneFile, transport: Transport, radiance: SpectralRadiance) -> dict[str, Any]:
    groups = {
        name: {"emitters": list(group.emitters), "power": group.power, "own_colour": group.coloured}
        for name, group in opened.scene.groups.items()
    }
    return {
        "scene": opened.scene.name,
        "size": list(radiance.shape[:2]),
        **vars(render_facts(transport, radiance)),
        "mean_luminance_cd_m2": float(radiance.luminance().mean()),
        "groups": groups,
        "notes": list(opened.notes),
    }
