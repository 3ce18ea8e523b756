"""Published tables of spectra: the observer, lights, daylight's basis, the sun, the ColorChecker.

They are colour-science's, to the last digit, in a file of this package: importing that library takes 1 to 2 s.
``python tests/render/test_published_spectra.py`` writes the file.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np

from rodcone.types import Floats

PATH = Path(__file__).parent / "data" / "published_spectra.json"


@cache
def published_spectra(collection: str) -> dict[str, tuple[Floats, Floats]]:
    """Wavelengths [nm] and values of each table of a collection, in its published order.

    Parameters
    ----------
    collection : str
        ``observer`` (CIE 1931, 2 degrees; CIE 018:2019), ``illuminants`` and ``daylight`` (CIE 015:2018), ``sun`` (ASTM
        G173-03, direct and circumsolar, in 1 nm means) or ``color_checker`` (Ohta 1997).
    """
    tables = json.loads(PATH.read_text(encoding="utf-8"))[collection]
    return {
        name: (table["first_nm"] + table["step_nm"] * np.arange(len(table["values"])), np.array(table["values"]))
        for name, table in tables.items()
    }
