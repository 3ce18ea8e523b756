"""Script of the child process in which SciPy reads a MATLAB file for `mat_file`; it imports nothing of rodcone."""

import resource
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

NAMES = "names of all"  # key that asks for all names; it holds blanks, so that no variable has this name
READER_BYTES = 1 << 28  # memory for SciPy's buffers, beside the file's values
COPIES = 4  # copies of the values that exist at once: inflated, stored type, MATLAB's type, written


def main(path: str, output: str, most_bytes: str, *keys: str) -> None:
    """Write the numbers under some keys into one .npz file."""
    from scipy.io import loadmat

    _limit(int(most_bytes))
    warnings.simplefilter("error", np.exceptions.ComplexWarning)  # it would drop the imaginary part
    names = {key.split("/")[0] for key in keys}
    content = loadmat(path, variable_names=names, mat_dtype=True, struct_as_record=False)
    numbers: dict[str, Any] = {key: value for key in keys if (value := _numbers(content, key)) is not None}
    if NAMES in keys:
        numbers[NAMES] = np.array(list(_names(path, content)))
    np.savez(output, **numbers)


def _names(path: str, content: dict[str, Any]) -> Iterator[str]:
    """Yield the names of a file's variables, and the paths of all fields of those structs that are read."""
    from scipy.io import whosmat

    yield from (name for name, _, _ in whosmat(path))
    places = [(name, value) for name, value in content.items() if not name.startswith("__")]
    while places:
        place, value = places.pop()
        struct = value.item() if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1 else None
        for field in getattr(struct, "_fieldnames", ()):
            yield f"{place}/{field}"
            places.append((f"{place}/{field}", getattr(struct, field)))


def _numbers(content: dict[str, Any], key: str) -> np.ndarray[Any, Any] | None:
    """Return the array of real numbers under a key, or None."""
    name, *fields = key.split("/")
    value = content.get(name)
    for field in fields:
        struct = value.item() if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1 else None
        value = getattr(struct, "__dict__", {}).get(field)
    return value if isinstance(value, np.ndarray) and value.dtype.kind in "iuf" else None


def _limit(most_bytes: int) -> None:
    """Limit this process's memory and the file that it writes; without /proc only the file."""
    _lower(resource.RLIMIT_FSIZE, most_bytes)
    statm = Path("/proc/self/statm")
    if statm.is_file():
        address_bytes = int(statm.read_text().split()[0]) * resource.getpagesize()
        _lower(resource.RLIMIT_AS, address_bytes + READER_BYTES + COPIES * most_bytes)


def _lower(limit: int, most: int) -> None:
    hard = resource.getrlimit(limit)[1]  # the user's own, which can't be raised
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(limit, (most, most))


if __name__ == "__main__":
    main(*sys.argv[1:])
