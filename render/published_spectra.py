"""Published tables of spectra: the observer, lights, daylight's basis, the sun, the ColorChecker, a camera.

They are colour-science's, to the last digit, in a file of this package: importing that library takes 1 to 2 s.
Tables of refractive indices are Mitsuba's own.
``python tests/render/test_illuminants.py`` writes the file.
"""

import json
import re
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from render.spectrum import Spectrum
from rodcone.types import Floats

PATH = Path(__file__).parent / "data" / "published_spectra.json"


@cache
def published_spectra(collection: str) -> dict[str, tuple[Floats, Floats]]:
    """Wavelengths [nm] and values of each table of a collection, in its published order.

    Parameters
    ----------
    collection : str
        ``observer`` (CIE 1931, 2 degrees; CIE 018:2019), ``illuminants`` and ``daylight`` (CIE 015:2018), ``sun`` (ASTM
        G173-03, direct and circumsolar, in 1 nm means), ``color_checker`` (Ohta 1997) or ``nikon_d5100`` (Darrodi
        et al. 2015, response of R, G and B to equal power).
    """
    tables = json.loads(PATH.read_text(encoding="utf-8"))[collection]
    return {
        name: (table["first_nm"] + table["step_nm"] * np.arange(len(table["values"])), np.array(table["values"]))
        for name, table in tables.items()
    }


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
