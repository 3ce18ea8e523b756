"""Measured responses of cameras by name: one of colour-science, and those of `sensor.cameras.convert`'s file."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from render.published_spectra import published_spectra
from render.spectrum import Floats, Spectrum
from rodcone.errors import InputError, one_line, unknown
from rodcone.files import read_bounded
from sensor.curves import Responses

FILE = "cameras.json"
VARIABLE = "RODCONE_CAMERAS"  # environment variable: folder of the file
MOST_BYTES = 1 << 23  # 52 cameras take 68 kB
STEPS = 100_000  # whole numbers in the file are this many to 1: half a step is under the sources' own last digits
_SHIPPED = Path(__file__).parent / "measured"  # a distribution may ship what `convert` writes
_NPL = "Nikon D5100"
_TEXTS = ("maker", "model", "creator", "laboratory", "equipment", "date")


@dataclass(frozen=True)
class MeasuredCamera:
    """Relative spectral response of a camera, as its laboratory published it.

    Attributes
    ----------
    maker, model, creator, laboratory, equipment, date : str
        As the source has them; empty where it says nothing.
    source, licence : str
        Of the collection.
    wavelength_nm : (n,) float64
    per_power : mapping of str to (n,) float64
        Response of each channel to equal radiant power, in a unit that all channels share where `balanced`.
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
        """Whether the channels share a unit: False where each was divided by its own maximum."""
        return not all(abs(float(curve.max()) - 1.0) < 1e-4 for curve in self.per_power.values())

    @property
    def responses(self) -> Responses:
        """Electrons per photon, relative: the greatest is 1.

        A photon carries the energy h c / wavelength, so a response to equal power, divided by the wavelength, is one to
        equal photons. What LibRaw holds for daylight says that the published curves are the former (decision 0045).
        """
        per_photon = {name: curve / self.wavelength_nm for name, curve in self.per_power.items()}
        greatest = max(float(curve.max()) for curve in per_photon.values())
        return Responses(
            {name: Spectrum(self.wavelength_nm, curve / greatest) for name, curve in per_photon.items()}, relative=True
        )

    @property
    def text(self) -> str:
        """Who measured it, when and how, on one line."""
        return ", ".join(
            part for part in dict.fromkeys((self.creator, self.laboratory, self.date, self.equipment)) if part
        )


def library_file() -> Path | None:
    """File of the measured responses: below `VARIABLE`'s folder, else the one shipped; None where there is none."""
    folder = os.environ.get(VARIABLE)
    path = (Path(folder) if folder else _SHIPPED) / FILE
    if folder and not path.is_file():
        raise InputError(
            f"{VARIABLE}: {folder!r} holds no {FILE}; allowed: a folder of rodcone new cameras; correct it"
        )
    return path if path.is_file() else None


def measured_cameras() -> dict[str, MeasuredCamera]:
    """Cameras by name, such as ``Nikon D850``: those of the file, and one that every installation has.

    Raises
    ------
    InputError
        For a file that is damaged.
    """
    path = library_file()
    cameras = {} if path is None else read_library(path, path.stat().st_mtime_ns)
    return cameras if _NPL in cameras else {_NPL: _npl_camera(), **cameras}


def measured_camera(name: str) -> MeasuredCamera:
    """Camera by name, whatever the case of its letters.

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
    if library_file() is None:
        raise InputError(
            f"camera: {name!r} is unknown; allowed: {', '.join(cameras)}, and the names of a copy of rawtoaces-data, "
            f"which isn't at hand: rodcone new cameras COPY -o FOLDER, then {VARIABLE}=FOLDER"
        )
    raise unknown("camera", name, cameras)


@cache
def _npl_camera() -> MeasuredCamera:
    """Camera that every installation has.

    The same measurement as rawtoaces-data's, equal to the last digit there. colour-science's other camera, a Sigma SD1
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
def read_library(path: Path, _changed: int) -> dict[str, MeasuredCamera]:
    """Cameras of a file as `sensor.cameras.convert` writes it; one that changed is read anew.

    Raises
    ------
    InputError
        For a file that is damaged.
    """
    try:
        return _cameras(json.loads(read_bounded(path, MOST_BYTES).decode("utf-8")))
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"measured responses: {str(path)!r} can't be read ({type(error).__name__}: {one_line(error)}); "
            "allowed: what rodcone new cameras wrote; write it anew"
        ) from error


def _cameras(content: Mapping[str, Any]) -> dict[str, MeasuredCamera]:
    first, last, step = (float(value) for value in content["range_nm"])
    if not (100 <= first < last <= 20_000 and (last - first) / 1e4 < step < last - first):
        raise ValueError(f"range_nm {[first, last, step]} is no range")
    nm = np.arange(first, last + step / 2, step)
    cameras = {}
    for entry in content["cameras"]:
        curves = {channel: np.array(values, dtype=np.float64) / STEPS for channel, values in entry["curves"].items()}
        if not curves or any(curve.shape != nm.shape or not np.all(curve >= 0) for curve in curves.values()):
            raise ValueError(f"curves of {entry['model']!r} are not {nm.size} numbers of 0 or more")
        if not max(curve.max() for curve in curves.values()) <= 2:
            raise ValueError(f"curves of {entry['model']!r} are not relative to their greatest value")
        texts = {name: str(entry.get(name, "")) for name in _TEXTS}
        camera = MeasuredCamera(
            **texts, source=str(content["source"]), licence=str(content["licence"]), wavelength_nm=nm, per_power=curves
        )
        cameras[f"{camera.maker} {camera.model}"] = camera
    return cameras
