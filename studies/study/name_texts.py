"""Sentences that describe mosaics, processors and so on, by name.

They are in a file of their own, because the catalogues import Dr.Jit and take a second to load.
"""

import tomllib
from pathlib import Path

NAMES = Path(__file__).parents[1] / "data" / "names.toml"


def texts_of(kind: str) -> dict[str, str]:
    """Return the names of a kind, such as ``mosaics``, each with a sentence on what it is."""
    texts: dict[str, str] = tomllib.loads(NAMES.read_text("utf-8"))[kind]
    return texts
