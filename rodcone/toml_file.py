"""Reading TOML with limits on size, nesting and whole numbers, which Python's parser lacks."""

import re
import tomllib
from pathlib import Path
from typing import Any

MOST_BYTES = 1 << 18  # cameras and studies take some 2 kB
# Over 32 parts of a key: the parser's time grows with the square of their number, to 13 s for a file of 40 kB.
_LONG_KEY = re.compile(r"""(?:\.[ \t]*(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*){32}""")


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    ValueError
        For what is no TOML in UTF-8, is over 256 KiB, nested deeper than Python's parser goes, has a key of over 32
        parts, or holds a whole number of more than 64 bits.
    OSError
        Where there is no file, or it can't be read.
    """
    if path.exists() and not path.is_file():  # a pipe or a device may never end
        raise ValueError("it is a folder or a device; allowed: a file")
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f"it is over {MOST_BYTES} bytes")
    return parse_toml(content.decode())


def parse_toml(text: str) -> dict[str, Any]:
    """Content of a text in TOML; a `ValueError` as `read_toml`."""
    if _LONG_KEY.search(text):
        raise ValueError("it is nested too deep")
    try:
        content = tomllib.loads(text)
        _check_numbers(content)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    return content


def _check_numbers(value: Any) -> None:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            _check_numbers(item)
    elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:  # TOML 1.0, "Integer"
        raise ValueError("it holds a whole number of more than 64 bits")
