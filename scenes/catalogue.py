"""The scenes that rodcone ships, by name."""

import inspect
import re
from importlib import import_module
from typing import Any

from render.scene import Scene
from rodcone.errors import require_keys, unknown

# Each is built by the function of its name in the module of its name.
_NAMES = (
    "color_checker",
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
)
DRAWN = ("diorama", "generated")  # from a number, in hexadecimal after a dash


def scene_names() -> tuple[str, ...]:
    """Names that `load` knows, in alphabetical order.

    Examples
    --------
    >>> import rodcone
    >>> "still_life" in rodcone.scenes()
    True
    """
    return _NAMES


def load(name: str, **options: Any) -> Scene:
    """Build a scene by name.

    Parameters
    ----------
    name : str
        One of `names()`; ``generated-1f3a`` is `scenes.generated.generated` with that seed, in hexadecimal, and
        ``diorama-1f3a`` is `scenes.diorama.diorama`.
    **options
        The builder's own parameters, such as ``light="A"``.

    Raises
    ------
    InputError
        For an unknown name or option; the nearest allowed one is named.
    """
    if drawn := re.fullmatch(f"({'|'.join(DRAWN)})-([0-9a-f]{{1,40}})", name):
        name = drawn[1]
        options = {**options, "seed": int(drawn[2], 16)}
    if name not in _NAMES:
        raise unknown("scene", name, _NAMES)
    builder = getattr(import_module(f"scenes.{name}"), name)
    require_keys(f"scene {name}: option", options, inspect.signature(builder).parameters)
    scene: Scene = builder(**options)
    return scene
