"""NoiseProfile of a digital negative of any camera (DNG 1.4 specification, tag 51041)."""

import struct
from pathlib import Path

import numpy as np

from render.spectrum import Floats
from rodcone.errors import InputError
from sensor.raw_files.noise_estimate import NoiseEstimate
from sensor.raw_files.tiff import read_directory

NOISE_PROFILE = 51041
_SUB_DIRECTORIES = 330  # SubIFDs (TIFF 6.0, Supplement 1)
_MOST_DIRECTORIES = 64  # of a file


def read_noise_profile(path: Path, full_dn: float) -> NoiseEstimate | None:
    """Gain and dark noise from the profile; None where the file has none, or one that says nothing of use.

    N(x)^2 = S x + O for x from black (0) to white (1), so the full scale is 1 / S electrons and a dark pixel's standard
    deviation sqrt(O) of it. Files with one pair a channel: their mean.

    Parameters
    ----------
    full_dn : float
        White level above black [DN].
    """
    values = _profile(path)
    if values.size < 2 or values.size % 2 or not np.all(np.isfinite(values)):
        return None
    with np.errstate(over="ignore"):
        slope, offset = values.reshape(-1, 2).mean(axis=0)
    if not (1e-9 < slope < 1.0 and 0.0 <= offset < 1.0):
        return None
    return NoiseEstimate(float(1.0 / slope / full_dn), float(np.sqrt(offset) / slope))


def _profile(path: Path) -> Floats:
    """Numbers of the first profile among the file's chain of pictures and those below them; empty where none is found.

    tifffile follows damaged chains for minutes; here a few directories are looked into, and no tag is read but two.
    """
    with path.open("rb") as file:
        head = file.read(8)
        order = {b"II*\0": "<", b"MM\0*": ">"}.get(head[:4])
        if order is None or len(head) < 8:
            return np.empty(0)  # no TIFF, but a camera's own format
        waiting, offsets = list(struct.unpack(f"{order}I", head[4:])), {0}
        while waiting and len(offsets) <= _MOST_DIRECTORIES:
            start = waiting.pop(0)
            if start in offsets:
                continue
            offsets.add(start)
            try:
                tags, following = read_directory(file, start, (NOISE_PROFILE, _SUB_DIRECTORIES), str(path), order)
            except InputError:
                continue  # damaged: others may be whole
            form, values = tags.get(NOISE_PROFILE, ("", ()))
            if form == "d":
                return np.array(values)
            form, starts = tags.get(_SUB_DIRECTORIES, ("", ()))
            if form == "I":
                waiting += [int(start) for start in starts[:_MOST_DIRECTORIES]]
            waiting.append(following)
    return np.empty(0)
