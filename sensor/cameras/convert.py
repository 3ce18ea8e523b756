"""From a copy of rawtoaces-data to one compact file: `rodcone new cameras`.

The collection (Academy Software Foundation, Apache License 2.0) holds a JSON file a camera: relative response of R, G
and B at 380-780 nm, 5 nm apart, with the name of its laboratory.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from rodcone.errors import InputError, one_line
from rodcone.files import read_bounded, replacing
from sensor.cameras.library import FILE, STEPS

SOURCE = "rawtoaces-data, Academy Software Foundation, https://github.com/AcademySoftwareFoundation/rawtoaces-data"
LICENCE = "Apache-2.0"
NOTICE = (
    "cameras.json holds the camera spectral sensitivities of rawtoaces-data (Academy Software Foundation and its\n"
    "contributors, https://github.com/AcademySoftwareFoundation/rawtoaces-data), licensed under the Apache License,\n"
    "Version 2.0: see LICENSE beside it. Each camera names its laboratory. Changed: values rounded to 1e-5, and all\n"
    "cameras put into one file by rodcone new cameras.\n"
)
RANGE_NM = (380.0, 780.0, 5.0)
_MOST_BYTES = 1 << 20  # of one camera's file: some 20 kB
_MOST_CAMERAS = 10_000


def convert(copy: Path, folder: Path) -> Path:
    """Write the cameras of a copy, its licence and a notice into a new folder; gives the path of the cameras' file.

    Parameters
    ----------
    copy : Path
        Folder of the repository, with ``data/camera`` and ``LICENSE`` in it.

    Raises
    ------
    InputError
        For a folder that isn't a copy, a file in it that is damaged or under another licence, or a folder to write
        that holds one of the three files already.
    """
    camera_files = sorted((copy / "data" / "camera").glob("*.json"))[: _MOST_CAMERAS + 1]
    licence = copy / "LICENSE"
    if not 0 < len(camera_files) <= _MOST_CAMERAS or not licence.is_file():
        raise InputError(
            f"copy: {str(copy)!r} holds no data/camera/*.json with a LICENSE; allowed: a copy of rawtoaces-data; "
            "give its folder"
        )
    places = (folder / "LICENSE", folder / "NOTICE", folder / FILE)
    for place in places:
        if place.exists():
            raise InputError(f"out: {str(place)!r} exists; allowed: a folder without it; choose another folder")
    content = {
        "source": SOURCE,
        "licence": LICENCE,
        "range_nm": RANGE_NM,
        "cameras": [_camera(path) for path in camera_files],
    }
    try:
        licence_text = read_bounded(licence, _MOST_BYTES)
    except ValueError as error:
        raise InputError(f"copy: {str(licence)!r}: {error}; give a copy of rawtoaces-data") from error
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(*places) as (to_licence, to_notice, to_cameras):
        to_licence.write_bytes(licence_text)
        to_notice.write_text(NOTICE, "utf-8")
        to_cameras.write_text(_compact(content), "utf-8")
    return folder / FILE


def _camera(path: Path) -> dict[str, Any]:
    """One camera, its curves as whole numbers."""
    try:
        content = json.loads(read_bounded(path, _MOST_BYTES).decode("utf-8"))
        header, data = content["header"], content["spectral_data"]
        channels, rows = list(data["index"]["main"]), data["data"]["main"]
        nm = np.array(sorted(float(key) for key in rows))
        table = np.array([rows[key] for key in sorted(rows, key=float)], dtype=np.float64)
        if header["license"] != LICENCE:
            raise ValueError(f"licence {header['license']!r} is not {LICENCE}")
        if data["units"] != "relative" or channels != ["R", "G", "B"] or table.shape != (nm.size, 3):
            raise ValueError("it holds no relative R, G and B")
        if not np.array_equal(nm, np.arange(RANGE_NM[0], RANGE_NM[1] + 1, RANGE_NM[2])):
            raise ValueError("its wavelengths are not 380 to 780 nm, 5 nm apart")
        if not np.all(np.isfinite(table) & (table >= 0)) or not 0 < table.max() < 2:
            raise ValueError("its responses are not 0 to 1")
        return {
            "maker": header["manufacturer"],
            "model": header["model"],
            "creator": header["document_creator"],
            "laboratory": header.get("laboratory") or "",
            "equipment": header.get("measurement_equipment") or "",
            "date": header["document_creation_date"][:10],
            "curves": {name: np.rint(table[:, at] * STEPS).astype(int).tolist() for at, name in enumerate("RGB")},
        }
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"camera: {str(path)!r} can't be read ({type(error).__name__}: {one_line(error)}); allowed: a camera of "
            "rawtoaces-data; copy it again"
        ) from error


def _compact(content: dict[str, Any]) -> str:
    """JSON with a camera a line, so that changes can be read."""
    head = {key: value for key, value in content.items() if key != "cameras"}
    lines = ",\n".join(json.dumps(camera, separators=(",", ":"), ensure_ascii=False) for camera in content["cameras"])
    return f'{json.dumps(head)[:-1]}, "cameras": [\n{lines}\n]}}\n'
