"""Mitsuba plug-ins that a user's scene may name, and why some of Mitsuba's own are left out.

Mitsuba loads ``plugins/<type>.so`` for any type that a scene names, from any folder on its search path, so that a name
outside this list may be foreign native code. The list is what Mitsuba 3.9 ships, without what the integrator doesn't
simulate, and without ``blender``, which reads memory at addresses that the scene states.
"""

import tomllib
from pathlib import Path
from types import ModuleType

from render.scene import COLOURED_EMITTERS, EMISSION_PARAMETER
from rodcone.errors import InputError, unknown

CAMERAS = ("perspective", "thinlens", "orthographic")
UNUSED_CAMERAS = ("batch", "distant", "radiancemeter")  # allowed, but ignored if there is a camera that can be rendered
METER = "irradiancemeter"  # in a shape it marks the plane on which illuminance is measured
SPECTRA = ("blackbody", "d65", "irregular", "rawconstant", "regular", "srgb", "uniform")

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
ALLOWED: dict[str, tuple[str, ...]] = {kind: tuple(names.split()) for kind, names in _TABLES["allowed"].items()}
ALLOWED["texture"] += SPECTRA
ALLOWED |= {"emitter": (*EMISSION_PARAMETER, *COLOURED_EMITTERS), "sensor": (*CAMERAS, METER, *UNUSED_CAMERAS)}
_KIND = {name: kind for kind, names in ALLOWED.items() for name in names}
# Why a plug-in is refused, and the nearest thing that works.
_REASONS = {name: (row["reason"], row["fix"]) for row in _TABLES["refused"] for name in row["plugins"].split()}


def require_allowed(plugin: str, *, tag: str, name: str, trust: bool) -> None:
    """Raise `InputError` for a plug-in that isn't simulated, or that isn't on the list and the scene isn't trusted.

    Parameters
    ----------
    plugin : str
    tag, name : str
        Type of the scene's element, and its name, which may be empty.
    trust : bool
        Whether the scene may name plug-ins that aren't on the list.
    """
    what = f"{tag} {name!r} of type" if name else f"{tag} type"
    if plugin in _REASONS:
        reason, fix = _REASONS[plugin]
        raise InputError(f"{what} {plugin!r} is refused, {reason}; {fix}")
    if plugin not in _KIND and not trust:
        refusal = unknown(what, plugin, ALLOWED.get(tag) or _KIND)
        raise InputError(f"{refusal}; or, if you trust the scene, trust=True or --trust-scene")


def kind_of(mi: ModuleType, plugin: str) -> str:
    """Return the kind of an allowed plug-in; if it isn't listed, Mitsuba loads it to find the kind.

    Raises
    ------
    InputError
        For an emitter or sensor that a trusted scene brings itself.
    """
    if plugin in _KIND:
        return _KIND[plugin]
    kind = mi.PluginManager.instance().plugin_type(plugin).name.lower()  # "unknown" where it finds none
    if kind in ("emitter", "sensor"):
        raise InputError(f"{kind} {plugin!r} is refused also in a trusted scene; allowed: {', '.join(ALLOWED[kind])}")
    return str(kind)
