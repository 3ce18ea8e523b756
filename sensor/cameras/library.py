"""Measured responses of cameras by name: one of colour-science, and those of a copy of rawtoaces-data.

That collection (Academy Software Foundation, Apache License 2.0) holds a JSON file per camera: the relative response of
R, G and B at 380-780 nm, 5 nm apart, with the name of the laboratory.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from render.spectrum import Spectrum, published_spectra
from rodcone.errors import InputError, one_line, unknown
from rodcone.files import read_bounded
from rodcone.types import Floats
from sensor.curves import Responses

VARIABLE = "RODCONE_CAMERAS"  # environment variable: folder of a copy of rawtoaces-data
SOURCE = "rawtoaces-data, Academy Software Foundation, https://github.com/AcademySoftwareFoundation/rawtoaces-data"
LICENCE = "Apache-2.0"
RANGE_NM = (380.0, 780.0, 5.0)
_MOST_BYTES = 1 << 20  # of one camera's file: some 20 kB
_MOST_CAMERAS = 10_000
_NPL = "Nikon D5100"


@dataclass(frozen=True)
class MeasuredCamera:
    """Relative spectral response of a camera, as its laboratory published it.

    Attributes
    ----------
    maker, model, creator, laboratory, equipment, date : str
        As the source states them; empty if it doesn't.
    source, licence : str
        Source and licence of the collection.
    wavelength_nm : (n,) float64
    per_power : mapping of str to (n,) float64
        Response of each channel to equal radiant power; if `balanced`, all channels share a unit.
    """

    maker: str
    model: str
    creator: str
    laboratory: str
    equipment: str
    date: str
    source: str
    licence: str
    wavelength_nm: Floats
    per_power: Mapping[str, Floats]

    @property
    def balanced(self) -> bool:
        """Return whether the channels share a unit: False where each was divided by its own maximum."""
        return not all(abs(float(curve.max()) - 1.0) < 1e-4 for curve in self.per_power.values())

    @property
    def responses(self) -> Responses:
        """Return the responses in electrons per photon, relative: the greatest is 1.

        A photon carries the energy h c / wavelength, so a response to equal power divided by the wavelength is a
        response to equal photons. LibRaw's white balance for daylight indicates that the published curves are per power
        (decision 0045).
        """
        per_photon = {name: curve / self.wavelength_nm for name, curve in self.per_power.items()}
        greatest = max(float(curve.max()) for curve in per_photon.values())
        return Responses(
            {name: Spectrum(self.wavelength_nm, curve / greatest) for name, curve in per_photon.items()}, relative=True
        )

    @property
    def text(self) -> str:
        """Return on one line who measured the camera, when and how."""
        return ", ".join(
            part for part in dict.fromkeys((self.creator, self.laboratory, self.date, self.equipment)) if part
        )


def measured_cameras() -> dict[str, MeasuredCamera]:
    """Return the measured cameras by name, such as ``Nikon D850``: those of the copy, and one that is always installed.

    Raises
    ------
    InputError
        For a folder that is no copy, or a damaged file in it.
    """
    copy = os.environ.get(VARIABLE)
    cameras = read_library(Path(copy)) if copy else {}
    return cameras if _NPL in cameras else {_NPL: _npl_camera(), **cameras}


def measured_camera(name: str) -> MeasuredCamera:
    """Return the measured camera of this name, in upper or lower case.

    Raises
    ------
    InputError
        For an unknown name.
    """
    cameras = measured_cameras()
    names = {" ".join(camera.lower().split()): camera for camera in cameras}
    key = " ".join(name.lower().split())
    if key in names:
        return cameras[names[key]]
    if not os.environ.get(VARIABLE):
        raise InputError(
            f"camera: {name!r} is unknown; allowed: {', '.join(cameras)}, and the names of a copy of rawtoaces-data; "
            f"name its folder by {VARIABLE}=FOLDER"
        )
    raise unknown("camera", name, cameras)


@cache
def _npl_camera() -> MeasuredCamera:
    """Return the camera that every installation has, a Nikon D5100.

    It is the same measurement as rawtoaces-data's, equal to the last digit. colour-science's other camera, a Sigma SD1
    Merrill, has three layers in each pixel and no mosaic (decision 0052).
    """
    curves = published_spectra("nikon_d5100")
    return MeasuredCamera(
        maker="Nikon",
        model="D5100",
        creator="Darrodi, Finlayson, Goodman and Mackiewicz",
        laboratory="National Physical Laboratory",
        equipment="monochromator",
        date="2015",
        source="colour-science, from J. Opt. Soc. Am. A 32, 381 (2015), doi:10.1364/JOSAA.32.000381",
        licence="BSD-3-Clause",
        wavelength_nm=curves["G"][0],
        per_power={channel: values for channel, (_, values) in curves.items()},
    )


@cache
def read_library(copy: Path) -> dict[str, MeasuredCamera]:
    """Read the cameras of a copy of rawtoaces-data, by maker and model.

    Raises
    ------
    InputError
        For a folder that is no copy, or a damaged file in it.
    """
    camera_files = sorted((copy / "data" / "camera").glob("*.json"))[: _MOST_CAMERAS + 1]
    if not 0 < len(camera_files) <= _MOST_CAMERAS:
        raise InputError(
            f"{VARIABLE}: {str(copy)!r} holds no data/camera/*.json; allowed: a copy of rawtoaces-data; give its folder"
        )
    cameras = map(read_camera, camera_files)
    return {f"{camera.maker} {camera.model}": camera for camera in cameras}


def read_camera(path: Path) -> MeasuredCamera:
    """Read one camera of rawtoaces-data; raise `InputError` for a file that is damaged or under another licence."""
    try:
        content = json.loads(read_bounded(path, _MOST_BYTES).decode("utf-8"))
        header, data = content["header"], content["spectral_data"]
        channels = list(data["index"]["main"])
        rows = data["data"]["main"]
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
        return MeasuredCamera(
            maker=str(header["manufacturer"]),
            model=str(header["model"]),
            creator=str(header["document_creator"]),
            laboratory=str(header.get("laboratory") or ""),
            equipment=str(header.get("measurement_equipment") or ""),
            date=header["document_creation_date"][:10],
            source=SOURCE,
            licence=LICENCE,
            wavelength_nm=nm,
            per_power=dict(zip(channels, table.T, strict=True)),
        )
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"camera: {str(path)!r} can't be read ({type(error).__name__}: {one_line(error)}); allowed: a camera of "
            "rawtoaces-data; copy it again"
        ) from error
