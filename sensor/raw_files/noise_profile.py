"""NoiseProfile of a digital negative of any camera (DNG 1.4 specification, tag 51041)."""

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np

from render.spectrum import Floats
from sensor.raw_files.noise_estimate import NoiseEstimate

NOISE_PROFILE = 51041
_SUB_DIRECTORIES, _DOUBLE, _OFFSETS = 330, 12, (4, 13)  # SubIFDs; types LONG and IFD (TIFF 6.0, and its Supplement 1)
_MOST_DIRECTORIES, _MOST_VALUES = 64, 64  # of a file, and of one tag: a pair for each of 32 planes


def read_noise_profile(path: Path, full_dn: float) -> NoiseEstimate | None:
    """Gain and dark noise from the profile; None where the file has none, or one that says nothing of use.

    N(x)^2 = S x + O for x from black (0) to white (1), so the full scale is 1 / S electrons and a dark pixel's standard
    deviation sqrt(O) of it. Files with one pair a channel: their mean.

    Parameters
    ----------
    full_dn : float
        White level above black [DN].
    """
    values = _values(path)
    if values is None or values.size < 2 or values.size % 2 or not np.all(np.isfinite(values)):
        return None
    with np.errstate(over="ignore"):
        slope, offset = values.reshape(-1, 2).mean(axis=0)
    if not (1e-9 < slope < 1.0 and 0.0 <= offset < 1.0):
        return None
    return NoiseEstimate(float(1.0 / slope / full_dn), float(np.sqrt(offset) / slope))


def _values(path: Path) -> Floats | None:
    """Numbers of the tag, from the first directory that has it: of the chain of pictures, and of those below them.

    tifffile follows damaged chains for minutes; here a few directories are looked into, and no tag is read but two.
    """
    try:
        with path.open("rb") as file:
            head = file.read(8)
            order = {b"II*\0": "<", b"MM\0*": ">"}.get(head[:4])
            if order is None or len(head) < 8:
                return None  # no TIFF: most cameras' own formats; LibRaw has read the picture all the same
            waiting, seen = [*struct.unpack(f"{order}I", head[4:])], set[int]()
            while waiting and len(seen) < _MOST_DIRECTORIES:
                start = waiting.pop(0)
                if start and start not in seen:
                    seen.add(start)
                    found, further = _directory(file, order, start)
                    if found is not None:
                        return found
                    waiting += further
    except OSError:
        pass
    return None


def _directory(file: BinaryIO, order: str, start: int) -> tuple[Floats | None, list[int]]:
    """Numbers of the tag if the directory at byte `start` has it, and where further directories begin."""
    file.seek(start)
    (count,) = struct.unpack(f"{order}H", file.read(2).ljust(2, b"\0"))
    entries, (after,) = file.read(12 * count), struct.unpack(f"{order}I", file.read(4).ljust(4, b"\0"))
    further: list[int] = []
    for code, kind, number, inline in struct.iter_unpack(f"{order}HHI4s", entries[: len(entries) // 12 * 12]):
        if not 0 < number <= _MOST_VALUES:
            continue
        (place,) = struct.unpack(f"{order}I", inline)
        if code == NOISE_PROFILE and kind == _DOUBLE:
            file.seek(place)
            content = file.read(8 * number)
            return np.frombuffer(content[: len(content) // 8 * 8], f"{order}f8").astype(np.float64), []
        if code == _SUB_DIRECTORIES and kind in _OFFSETS:
            file.seek(place)
            content = inline if number == 1 else file.read(4 * number)
            further += struct.unpack(f"{order}{len(content) // 4}I", content[: len(content) // 4 * 4])
    return None, [*further, after]
