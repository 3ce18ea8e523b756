"""Refractive indices of metals and other materials, from Mitsuba's own data."""

import re
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from render.spectrum import Spectrum

_NAME = re.compile(r"[\w-]+")


@cache
def optical_constant(material: str, part: str) -> Spectrum | None:
    """Table of one part, ``eta`` or ``k``, of a complex index; found without importing Mitsuba.

    None for a material that Mitsuba has no table of, such as ``none``, its perfect mirror.
    """
    path = metadata.distribution("mitsuba").locate_file(f"mitsuba/data/ior/{material}.{part}.spd")
    if not _NAME.fullmatch(material) or not Path(str(path)).is_file():
        return None
    table = np.loadtxt(str(path))
    return Spectrum(table[:, 0], table[:, 1])
