"""Open the scene or file of radiance that is explored, and write the Python that makes its transport."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from render.engine import render
from render.illuminants import illuminant
from render.radiance_files.radiance_source import (
    extent_of,
    is_radiance_file,
    is_reference,
    is_reflectance,
    load_picture,
)
from render.scene import LightGroup, Scene, film_size
from render.spectrum import VISIBLE_NM, even_bands
from render.transport import Transport
from rodcone.errors import require_absent, require_fields
from rodcone.memory import memory, require_memory
from rodcone.types import Floats
from scenes.catalogue import scene_names
from studies.photograph.ready_light import Ready, find_ready, load_ready
from studies.study.scene_source import (
    LIGHT,
    check_radiance_file,
    default_white,
    defined,
    open_radiance_file,
    open_scene,
)

GIVEN = "transport = ...  # the one that was given to rodcone.explore\n"
FIRST_SIDE, FIRST_SPP = 64, 16  # longer side and samples per pixel of the first picture, which appears at once
_SPP, _LEAST_BANDS = 64, 4


@dataclass(frozen=True)
class RenderState:
    """One state of the render: its transport, the Python that makes it, and whether it is the last, finest one."""

    transport: Transport
    code: str
    last: bool


@dataclass(frozen=True)
class Source:
    """Scene or picture file that is explored.

    Attributes
    ----------
    title : str
    states : callable
        Function that yields `RenderState` objects, coarse to fine. Its argument is a function that it calls between two
        runs of the render, and which may end the render by raising an error.
    groups : mapping of str to bool
        Light groups, and whether one has colours of its own.
    notes : tuple of str
        Notes on what had to be assumed.
    """

    title: str
    states: Callable[[Callable[[], None]], Iterator[RenderState]]
    groups: Mapping[str, bool]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """Settings of a scene's render.

    Attributes
    ----------
    size : int, optional
        Longer side of the rendered picture in pixels; 256 by default, a .xml scene's film has its own.
    spp : int, optional
        Samples per pixel of the render; 64 by default, where the scene's light isn't there already.
    band_nm : float
        Width of the wavelength bands; 20 nm do for smooth spectra.
    seed : int
        Seed of the render.
    render : bool
        Render the scene here, even if its light is there already; --spp and --seed do so too.
    trust_scene : bool
        Let a .xml scene load plug-ins of its own, which are native code, and files from anywhere.
    define : tuple of str
        NAME=VALUE of a $parameter of the scene file; -D is short for it; may be given several times.
    force : bool
        Run even where more memory is needed than is free.
    """

    size: Annotated[int | None, (16, 2048, "give the picture's longer side in pixels")] = None
    spp: Annotated[int | None, (1, 1 << 16, "give samples a pixel")] = None
    band_nm: Annotated[float, (1.0, 100.0, "give nanometres")] = 20.0
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0
    render: bool = False
    trust_scene: bool = False
    define: tuple[str, ...] = ()
    force: bool = False

    def __post_init__(self) -> None:
        require_fields(self)


def of_transport(transport: Transport) -> Source:
    """Return a source that shows a transport that exists already."""
    return Source("transport", lambda _: iter((RenderState(transport, GIVEN, True),)), _coloured(transport.groups))


def open_source(source: str, options: RenderOptions) -> Source:
    """Open a scene by name or file (``.xml``), or a file of radiance (``.exr``, ``.mat``, a cube, a photograph).

    Raises
    ------
    InputError
        For a source that doesn't exist, can't be read, or needs more memory than is free.
    """
    if is_radiance_file(source):
        check_radiance_file(source, ())
        require_memory(memory(*extent_of(source)), options.force)
        # An ISETCam scene's own illuminant has no name, and the page can only show lights by name: it isn't used.
        transport, notes = open_radiance_file(source, default_white(source))
        transport = _with_its_light(transport, source)
        code = f"transport = rodcone.load_transport({source!r})\n"
        return Source(
            Path(source).name,
            lambda _: iter((RenderState(transport, code, True),)),
            _coloured(transport.groups),
            notes=tuple(notes),
        )
    opened = open_scene(source, options.trust_scene, define=options.define)
    size = film_size(opened.size, options.size)
    bands = _bands(options)
    require_memory(memory(size[0] * size[1], bands[0].size, len(opened.scene.groups)), options.force)
    coloured = _coloured(opened.scene.groups)
    if ready := _ready(source, opened.scene, size, bands, options):
        code = f"transport = rodcone.load_transport({source!r}, size={size!r})\n"
        return Source(
            opened.scene.name,
            lambda _: iter((RenderState(ready.transport, code, True),)),
            coloured,
            notes=(ready.line,),
        )
    extras = ", trust=True" * options.trust_scene + f", define={defined(options.define)!r}" * bool(options.define)
    file = Path(source).suffix.lower() == ".xml"
    scene = f"rodcone.load_scene_file({source!r}{extras}).scene" if file else f"rodcone.load({source!r})"
    first, last = VISIBLE_NM
    code = (
        f"import numpy as np\n\nscene = {scene}\n"
        f"edges_nm = np.linspace({first!r}, {last!r}, {bands[0].size + 1})\n"
        "bands = {'wavelength_nm': (edges_nm[1:] + edges_nm[:-1]) / 2, 'width_nm': np.diff(edges_nm)}\n"
    )
    return Source(
        opened.scene.name,
        lambda between: _states(opened.scene, size, bands, options, code, between),
        coloured,
        notes=tuple(opened.notes),
    )


def _ready(
    source: str, scene: Scene, size: tuple[int, int], bands: tuple[Floats, Floats], options: RenderOptions
) -> Ready | None:
    """Return a catalogue scene's light that was rendered before; None without any, or if an option wants a render."""
    if options.render or options.spp is not None or options.seed or source not in scene_names():
        return None
    return find_ready(scene, size, size, [group.spectrum for group in scene.groups.values()], bands)


def load_transport(path: str | Path, light: str = LIGHT, *, size: tuple[int, int] | int | None = None) -> Transport:
    """Load the light transport of a picture file or of a scene whose light is shipped, for `relight` and the explorer.

    Parameters
    ----------
    path : str or Path
        A picture file (`rodcone.load_radiance`), reference light (.npz of `rodcone reference`), or the name of a scene
        whose light comes with rodcone, such as still_life; that light has so many samples that its noise doesn't show.
    light : str
        Illuminant of a file of reflectances, which other lamps may replace. A file of radiance has its light in it.
    size : (int, int) or int, optional
        Size to which a scene's light is averaged: height and width in pixels, or the longer side; left out, the light's
        own size.

    Raises
    ------
    InputError
        As `rodcone.load_radiance`, and for a scene or size without light.
    """
    if isinstance(path, str) and not Path(path).suffix:
        return load_ready(path, size)
    require_absent(f"for {str(path)!r}, a file that has its own", size=size)
    return _with_its_light(load_picture(path, illuminant(light)), path)


def _with_its_light(transport: Transport, path: str | Path) -> Transport:
    """Return a file's transport; if the file holds radiance, mark its light group as having colours of its own."""
    if is_reflectance(path) or is_reference(path):
        return transport
    groups = {name: replace(group, coloured=True) for name, group in transport.groups.items()}
    return replace(transport, groups=groups)


def _states(
    scene: Scene,
    size: tuple[int, int],
    bands: tuple[Floats, Floats],
    options: RenderOptions,
    code: str,
    between_runs: Callable[[], None],
) -> Iterator[RenderState]:
    """Yield a render of few pixels, then one of all pixels, then one with all samples."""
    full_spp = options.spp or _SPP
    steps = [(size, full_spp)]
    if full_spp > FIRST_SPP:
        steps.insert(0, (size, FIRST_SPP))
    if max(size) > 2 * FIRST_SIDE:
        steps.insert(0, (film_size(size, FIRST_SIDE), FIRST_SPP))
    renders: dict[tuple[int, int], Transport] = {}
    for number, (film, spp) in enumerate(steps, 1):
        renders[film] = render(
            scene,
            film,
            wavelength_nm=bands[0],
            width_nm=bands[1],
            spp=spp,
            seed=options.seed,
            resume=renders.get(film),
            progress=lambda *_: between_runs(),
        )
        call = f"transport = rodcone.render(scene, {film!r}, spp={spp}, seed={options.seed}, **bands)\n"
        yield RenderState(renders[film], code + call, number == len(steps))


def _coloured(groups: Mapping[str, LightGroup]) -> dict[str, bool]:
    return {name: group.coloured for name, group in groups.items()}


def _bands(options: RenderOptions) -> tuple[Floats, Floats]:
    """Return centres and widths of equal bands, whose width is as near the requested one as a whole number allows."""
    first, last = VISIBLE_NM
    return even_bands(VISIBLE_NM, max(_LEAST_BANDS, round((last - first) / options.band_nm)))
