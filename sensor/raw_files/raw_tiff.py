"""Any mosaic as a TIFF, with a JSON sidecar that holds its tile and calibration exactly."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, read_errors
from rodcone.files import read_bounded, replacing
from sensor.raw import RawImage
from sensor.raw_files.raw_json import MOST_BYTES, parse_json, raw_image, raw_to_json
from sensor.raw_files.tiff import MIN_IS_BLACK, read_mosaic, write_mosaic

DIGEST = "pixels_sha256"


def write_tiff(raw: RawImage, path: Path) -> tuple[Path, Path]:
    """Write the mosaic, and beside it its sidecar under the same name with ``.json``; return both paths.

    Raises
    ------
    InputError
        Where the pixels are neither uint16 nor float32, or another program's file has the sidecar's name.
    OSError
        Where the folder is missing or can't be written.
    """
    sidecar = path.with_suffix(".json")
    if sidecar.exists() and DIGEST.encode() not in _text(sidecar, path):
        raise InputError(
            f"{path}: {sidecar.name} beside it is another program's; allowed: none, or a sidecar that rodcone wrote; "
            "choose another name"
        )
    with replacing(sidecar, path) as (note, picture):
        write_mosaic(picture, raw.dn, MIN_IS_BLACK, {})
        note.write_text(raw_to_json(raw, **{DIGEST: _digest(raw.dn)}) + "\n", encoding="utf-8")
    return path, sidecar


def read_tiff(path: Path) -> RawImage:
    """Read a mosaic and its sidecar.

    Raises
    ------
    InputError
        For a file that is missing or damaged, or a sidecar that belongs to other pixels.
    """
    dn, _ = read_mosaic(path, MIN_IS_BLACK)
    sidecar = path.with_suffix(".json")
    calibration = parse_json(_text(sidecar, path), str(sidecar), (DIGEST,))
    if calibration[DIGEST] != _digest(dn):
        raise InputError(f"{sidecar}: it describes other pixels than {path.name}; keep the two files of one exposure")
    return raw_image(calibration, dn, str(sidecar))


def _text(sidecar: Path, picture: Path) -> bytes:
    with read_errors(f"{sidecar}: can't be read", f"keep the sidecar beside {picture.name}"):
        return read_bounded(sidecar, MOST_BYTES)


def _digest(dn: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(dn, dtype=dn.dtype.newbyteorder("<")).data).hexdigest()
