"""Find light of a scene that was rendered before, with little noise, so that a command needs no render of its own.

The project ships such light for some scenes. A command uses it at its own size, unless the user asks for a number of
samples or for a size that the light doesn't fit. Studies have a rule of their own (`render.reference`), which also
checks the light against a render.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from render.loader import Film
from render.reference import SHIPPED, Reference, ready_light
from render.scene import OWN_SIDE, Scene, film_size
from render.spectrum import VISIBLE_NM, Spectrum, emission_lines_nm, even_bands
from render.transport import Transport
from rodcone.errors import InputError
from rodcone.types import Floats
from scenes.catalogue import load

BANDS = even_bands(VISIBLE_NM, 20)  # bands of 20 nm, as `rodcone reference` renders them
SIDE = 512  # longer side of the light that is shipped [pixels]


@dataclass(frozen=True)
class Ready:
    """Light that was rendered before, its size, and a line that says what it is."""

    transport: Transport
    size: tuple[int, int]
    line: str


def find_ready(
    scene: Scene,
    own: tuple[int, int],
    asked: tuple[int, int] | None,
    spectra: Iterable[Spectrum],
    bands: tuple[Floats, Floats] = BANDS,
) -> Ready | None:
    """Find light of a scene that was rendered before; return None if none fits.

    Without a requested size, light whose longer side is `SIDE` is tried first, then the scene's own size.

    Parameters
    ----------
    scene : Scene
    own : (int, int)
        Height and width of the scene's own film.
    asked : (int, int) or None
        Requested height and width; None for those of the light.
    spectra : iterable of Spectrum
        Spectra of the lights. A lamp with lines needs bands of its own, so no stored light fits it.
    bands : (array, array)
        Centres and widths [nm].
    """
    if any(emission_lines_nm(spectrum).size for spectrum in spectra):
        return None
    larger = [film_size(own, SIDE)] if max(own) == OWN_SIDE else []  # a scene file states a film size, which is kept
    for size in [asked] if asked else [*larger, own]:
        film = Film(size, *bands, max_depth=scene.max_depth, rr_depth=scene.rr_depth)
        if reference := ready_light(scene, film):
            return Ready(reference.transport, size, _line(reference))
    return None


def load_ready(name: str, size: tuple[int, int] | int | None = None) -> Transport:
    """Load light of a scene of the catalogue that was rendered before, at the requested size or at the light's own.

    Raises
    ------
    InputError
        For an unknown scene, and where no light is there for the scene and size.
    """
    scene = load(name)
    asked = film_size(scene.size, size) if isinstance(size, int) else size
    spectra = [group.spectrum for group in scene.groups.values()]
    if ready := find_ready(scene, scene.size, asked, spectra):
        return ready.transport
    sides = "" if asked is None else f" at {asked[0]} x {asked[1]} pixels"
    at = asked or scene.size
    raise InputError(
        f"path: no light of {name}{sides} is there already; allowed: {', '.join(shipped_scenes())}, at their own "
        f"size or a whole part of it; render it: rodcone.render({name!r}, {at!r})"
    )


def shipped_scenes() -> list[str]:
    """Return the names of the scenes whose light comes with rodcone."""
    return sorted({path.name.split("-")[0] for path in SHIPPED.glob("*.npz")})


def _line(reference: Reference) -> str:
    share = reference.certificate.get("shares", {}).get("low_noise", {}).get("classroom")
    beside = "" if share is None else f", its noise {share:.2g} of the sensor's variance at 25 cd/m2"
    samples = f"{reference.certificate['samples']:.0f} samples per pixel"
    return f"light: {reference.path.name}, rendered before with {samples}{beside}; --render renders it anew"
