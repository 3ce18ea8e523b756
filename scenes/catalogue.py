"""The scenes that rodcone ships, by name."""

import inspect
import re
from collections.abc import Callable
from importlib import import_module

from render.scene import Scene
from rodcone.errors import require_keys, unknown

# Each is built by the function of its name in the module of its name.
_NAMES = (
    "color_checker",
    "contrast_patches",
    "cornell_box",
    "dead_leaves",
    "diorama",
    "flat_field",
    "furnace",
    "generated",
    "lit_and_shadowed",
    "metamers",
    "night_street",
    "oecf",
    "siemens_star",
    "slanted_edge",
    "still_life",
    "still_life_outdoor",
    "walker",
)
DRAWN = ("diorama", "generated")  # scenes drawn at random from a seed, which is written in hexadecimal after a dash
_DRAWN = re.compile(f"({'|'.join(DRAWN)})-([0-9a-f]{{1,40}})")


def scene_names() -> tuple[str, ...]:
    """Return the names that `load` knows, in alphabetical order.

    Examples
    --------
    >>> import rodcone
    >>> "still_life" in rodcone.scenes()
    True
    """
    return _NAMES


def load(name: str, **options: object) -> Scene:
    """Build a scene by name.

    Parameters
    ----------
    name : str
        One of `scene_names()`; ``generated-1f3a`` is `scenes.generated.generated` with that seed, in hexadecimal, and
        ``diorama-1f3a`` is `scenes.diorama.diorama`.
    **options
        The builder's own parameters, such as ``light="A"``.

    Raises
    ------
    InputError
        For an unknown name or option; the nearest allowed one is named.
    """
    builder = _builder(name)
    if drawn := _DRAWN.fullmatch(name):
        options = {**options, "seed": int(drawn[2], 16)}
    require_keys(f"scene {builder.__name__}: option", options, scene_options(name))
    return builder(**options)


def scene_options(name: str) -> tuple[str, ...]:
    """Return the names of the options that `load` takes for a scene.

    Raises
    ------
    InputError
        For an unknown name.
    """
    return tuple(inspect.signature(_builder(name)).parameters)


def _builder(name: str) -> Callable[..., Scene]:
    if drawn := _DRAWN.fullmatch(name):
        name = drawn[1]
    if name not in _NAMES:
        raise unknown("scene", name, _NAMES)
    builder: Callable[..., Scene] = getattr(import_module(f"scenes.{name}"), name)
    return builder
