"""The scenes that rodcone ships, by name."""

import inspect
from collections.abc import Callable
from typing import Any

from render.scene import Scene
from rodcone.errors import require_keys, unknown
from scenes.color_checker import color_checker
from scenes.cornell_box import cornell_box
from scenes.flat_field import flat_field
from scenes.furnace import furnace
from scenes.lit_and_shadowed import lit_and_shadowed
from scenes.metamers import metamers
from scenes.night_street import night_street
from scenes.siemens_star import siemens_star
from scenes.slanted_edge import slanted_edge
from scenes.still_life import still_life
from scenes.still_life_outdoor import still_life_outdoor

_BUILDERS: dict[str, Callable[..., Scene]] = {
    "color_checker": color_checker,
    "cornell_box": cornell_box,
    "flat_field": flat_field,
    "furnace": furnace,
    "lit_and_shadowed": lit_and_shadowed,
    "metamers": metamers,
    "night_street": night_street,
    "siemens_star": siemens_star,
    "slanted_edge": slanted_edge,
    "still_life": still_life,
    "still_life_outdoor": still_life_outdoor,
}


def names() -> tuple[str, ...]:
    """Names that `load` knows, in alphabetical order."""
    return tuple(sorted(_BUILDERS))


def load(name: str, **options: Any) -> Scene:
    """Build a scene by name.

    Parameters
    ----------
    name : str
        One of `names()`.
    **options
        The builder's own parameters, such as ``light="A"``.

    Raises
    ------
    InputError
        For an unknown name or option; the nearest allowed one is named.
    """
    if name not in _BUILDERS:
        raise unknown("scene", name, _BUILDERS)
    require_keys(f"scene {name}: option", options, inspect.signature(_BUILDERS[name]).parameters)
    return _BUILDERS[name](**options)
