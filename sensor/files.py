"""Files that appear whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Give a place beside each path to write to; at the end each takes its name, in this order, on failure none does.

    Raises
    ------
    OSError
        Where the folder of the first, which has to be that of all, is missing or can't be written.
    """
    with tempfile.TemporaryDirectory(dir=paths[0].parent, prefix=".part-") as parts:
        places = tuple(Path(parts) / path.name for path in paths)
        yield places
        for place, path in zip(places, paths, strict=True):
            os.replace(place, path)
