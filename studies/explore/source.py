"""What is explored: a scene, a file of radiance or a study, and the Python that makes its transport."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from isp.processors.catalogue import NAMED
from render.engine import render
from render.illuminants import illuminant
from render.radiance_files.radiance_source import extent_of, is_radiance_file, is_reflectance, load_picture
from render.scene import LightGroup, Scene, film_size
from render.spectrum import VISIBLE_NM, Floats
from render.transport import Transport
from rodcone.errors import InputError, require_range, require_whole
from rodcone.memory import memory, require_memory
from sensor.exposure import RULES
from sensor.presets import preset
from studies.explore.controls import LENS, TIME, Controls, Lamp
from studies.explore.written import GIVEN
from studies.study.levels import parse_exposure, parse_level
from studies.study.radiance_file import LIGHT, check_radiance_file, open_radiance_file
from studies.study.scene_source import open_scene
from studies.study.study import OWN, RenderLimits, SceneChoice, Study
from studies.study.study_file import read_study

FIRST_SIDE, FIRST_SPP = 64, 16  # of the first picture, which is there at once
_LEAST_BANDS, _MOST_SIDE = 4, 2048


@dataclass(frozen=True)
class Rendered:
    """One state of the render: its transport, the Python that makes it, and whether a finer one follows."""

    transport: Transport
    code: str
    last: bool


@dataclass(frozen=True)
class Source:
    """What is explored.

    Attributes
    ----------
    title : str
    states : callable
        Gives `Rendered` ones, coarse to fine; calls its argument between two runs, which ends the render by raising.
    groups : mapping of str to bool
        Light groups, and whether one has colours of its own.
    controls : Controls
        To begin with.
    scene : SceneChoice, optional
        As a study names it; None where nothing but the transport is known.
    render : RenderLimits
        As a study would have it.
    notes : tuple of str
        What had to be assumed.
    """

    title: str
    states: Callable[[Callable[[], None]], Iterator[Rendered]]
    groups: Mapping[str, bool]
    controls: Controls = field(default_factory=Controls)
    scene: SceneChoice | None = None
    render: RenderLimits = field(default_factory=RenderLimits)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RenderOptions:
    """How a scene is rendered: longer side in pixels (None: its film's), samples a pixel, band width, seed."""

    size: int | None = None
    spp: int = 64
    band_nm: float = 20.0
    seed: int = 0
    range_nm: tuple[float, float] = VISIBLE_NM
    trust: bool = False
    force: bool = False


def of_transport(transport: Transport) -> Source:
    """A transport that is there already."""
    return Source("transport", lambda _: iter((Rendered(transport, GIVEN, True),)), _coloured(transport.groups))


def open_source(source: str, limits: RenderOptions) -> Source:
    """Open a scene by name or file (``.xml``), a file of radiance (``.exr``, ``.mat``) or a study (``.toml``).

    Raises
    ------
    InputError
        For what isn't there, can't be read, or needs more memory than is free.
    """
    require_whole("spp", limits.spp, 1, 1 << 16, "give samples a pixel")
    require_range("band_nm", limits.band_nm, 1.0, 100.0, "give nanometres")
    require_whole("seed", limits.seed, 0, 2**31, "give a whole number")
    if limits.size is not None:
        require_whole("size", limits.size, 16, _MOST_SIDE, "give the picture's longer side in pixels")
    if source.lower().endswith(".toml"):
        study = read_study(source)
        return _of_study(study, replace(limits, size=study.render.size, band_nm=study.render.band_nm), source)
    return of_choice(SceneChoice(source), limits)


def load_transport(path: str | Path, light: str = LIGHT) -> Transport:
    """Light transport of a picture file (`rodcone.load_radiance`), which `relight` and the explorer take.

    Parameters
    ----------
    path : str or Path
    light : str
        Illuminant of reflectances, which other lamps may replace; radiance has its light in it.

    Raises
    ------
    InputError
        As `rodcone.load_radiance`.
    """
    return _with_its_light(load_picture(path, illuminant(light)), path)


def _with_its_light(transport: Transport, path: str | Path) -> Transport:
    """A file's transport, of which radiance's light group is marked to have colours of its own."""
    if is_reflectance(path):
        return transport
    groups = {name: replace(group, coloured=True) for name, group in transport.groups.items()}
    return replace(transport, groups=groups)


def _of_study(study: Study, limits: RenderOptions, source: str) -> Source:
    """The study's first scene and condition; the page goes on from there."""
    limits = replace(limits, seed=study.render.seed, spp=study.render.spp, range_nm=study.render.range_nm)
    opened = of_choice(study.scenes[0], limits)
    notes = list(opened.notes)
    levels = [parse_level(level) for level in study.levels]
    level = next((value for value, unit in levels if unit == "cd/m2"), None)
    if level is None:
        level = Controls().level_cd_m2
        notes.append(f"{source}: its levels are in lux, the explorer's in cd/m2; it begins at {level:g} cd/m2")
    exposure = study.exposures[0]
    time_s = parse_exposure(exposure)
    own = preset(study.sensors[0]).lens
    lens = study.lens.on(own)
    lamps = {}
    if study.spectra[0] != OWN and opened.scene is not None:
        lamps = {name: Lamp(study.spectra[0]) for name in opened.groups}
    controls = replace(
        opened.controls,
        lamps=lamps,
        level_cd_m2=level,
        exposure=exposure if exposure in RULES else TIME,
        exposure_s=study.longest_exposure_s if time_s is None else time_s,
        sensor=study.sensors[0],
        mosaic=NAMED[study.processors[0]].mosaic,
        lens={name: value for name in LENS if (value := getattr(lens, name)) != getattr(own, name)},
        processor=study.processors[0],
        white_balance=study.white_balances[0],
        seed=study.seeds[0],
        frames=study.frames[0],
    )
    return replace(opened, title=f"{study.name}: {opened.title}", controls=controls, notes=tuple(notes))


def of_choice(choice: SceneChoice, limits: RenderOptions) -> Source:
    """A scene or picture file as a study names it."""
    if is_radiance_file(choice.source):
        check_radiance_file(choice.source, ())
        require_memory(memory(*extent_of(choice.source)), limits.force)
        opened_file, _, notes = open_radiance_file(choice.source, choice.light)
        transport = _with_its_light(opened_file, choice.source)
        code = f"transport = rodcone.load_transport({choice.source!r}{_named({'light': choice.light})})\n"
        return Source(
            Path(choice.source).name,
            lambda _: iter((Rendered(transport, code, True),)),
            _coloured(transport.groups),
            Controls(reference_light=choice.light or LIGHT),
            scene=choice,
            render=RenderLimits(size=max(transport.coverage.mean.shape)),
            notes=tuple(notes),
        )
    opened = open_scene(choice.source, limits.trust, choice.extend, choice.light, choice.chart)
    size = film_size(opened.size, limits.size)
    bands = _bands(limits)
    require_memory(memory(size[0] * size[1], bands[0].size, len(opened.scene.groups)), limits.force)
    first, last = limits.range_nm
    code = (
        f"import numpy as np\n\n{_scene_code(choice, limits.trust)}"
        f"edges_nm = np.linspace({first!r}, {last!r}, {bands[0].size + 1})\n"
        "bands = {'wavelength_nm': (edges_nm[1:] + edges_nm[:-1]) / 2, 'width_nm': np.diff(edges_nm)}\n"
    )
    return Source(
        opened.scene.name,
        lambda between: _states(opened.scene, size, bands, limits, code, between),
        _coloured(opened.scene.groups),
        scene=choice,
        render=RenderLimits(max(size), limits.band_nm, limits.spp, seed=limits.seed, range_nm=limits.range_nm),
        notes=tuple(opened.notes),
    )


def _scene_code(choice: SceneChoice, trust: bool) -> str:
    """Python that opens a scene as `open_scene` does."""
    options = {"trust": trust, "extend": choice.extend, "light": choice.light, "chart": choice.chart}
    if Path(choice.source).suffix.lower() == ".xml":
        return f"scene = rodcone.load_scene_file({choice.source!r}{_named(options)}).scene\n"
    extend = options.pop("extend")  # of the builders none takes it
    scene = f"scene = rodcone.load({choice.source!r}{_named(options)})\n"
    if extend is None:
        return scene
    return f"from dataclasses import replace\n{scene}scene = replace(scene, extend={extend!r})\n"


def _named(options: Mapping[str, Any]) -> str:
    return "".join(f", {name}={value!r}" for name, value in options.items() if value)


def _states(
    scene: Scene,
    size: tuple[int, int],
    bands: tuple[Floats, Floats],
    limits: RenderOptions,
    code: str,
    between_runs: Callable[[], None],
) -> Iterator[Rendered]:
    """Render a few pixels, then all of them, then with all samples."""
    steps = [(size, limits.spp)]
    if limits.spp > FIRST_SPP:
        steps.insert(0, (size, FIRST_SPP))
    if max(size) > 2 * FIRST_SIDE:
        steps.insert(0, (film_size(size, FIRST_SIDE), FIRST_SPP))
    done: dict[tuple[int, int], Transport] = {}
    for number, (film, spp) in enumerate(steps, 1):
        asked: dict[str, Any] = {"wavelength_nm": bands[0], "width_nm": bands[1], "spp": spp, "seed": limits.seed}
        done[film] = render(scene, film, resume=done.get(film), progress=lambda *_: between_runs(), **asked)
        call = f"transport = rodcone.render(scene, {film!r}, spp={spp}, seed={limits.seed}, **bands)\n"
        yield Rendered(done[film], code + call, number == len(steps))


def _coloured(groups: Mapping[str, LightGroup]) -> dict[str, bool]:
    return {name: group.coloured for name, group in groups.items()}


def _bands(limits: RenderOptions) -> tuple[Floats, Floats]:
    """Centres and widths of even bands, as near the asked width as whole ones come."""
    first, last = limits.range_nm
    count = max(_LEAST_BANDS, round((last - first) / limits.band_nm))
    if not first < last:
        raise InputError(f"range_nm: {limits.range_nm!r} is not allowed; give [shortest, longest]")
    edges = np.linspace(first, last, count + 1)
    return (edges[1:] + edges[:-1]) / 2, np.diff(edges)
