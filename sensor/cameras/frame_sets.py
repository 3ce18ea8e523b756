"""Sets of frames by light: the EMVA 1288 descriptor, a list in CSV, arrays; in a folder or a zip file."""

import csv
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import StringIO
from math import isnan, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rodcone.errors import InputError, read_errors, require_range, require_whole, unknown
from rodcone.files import inside, read_bounded
from sensor.cfa import Tile
from sensor.raw_files.raw_file import read_raw

MOST_BYTES = 1 << 24  # largest descriptor or list
MOST_ZIP_BYTES = 1 << 33  # largest zip file, unpacked
MOST_FRAMES = 10_000
LIST_NAME = "frames.csv"
LIST_HEAD = ("file", "kind", "exposure_s", "photons")
_PICTURES = (".png", ".tif", ".tiff", ".bmp", ".pgm")
_HEADLESS = (".raw", ".bin")
_MONOCHROME: Tile = ("W",)
_FIX = f"give the descriptor of EMVA 1288 (lines v, n, b, d, i) or {LIST_NAME} with {', '.join(LIST_HEAD[:3])}"

Frame = Path | NDArray[Any]


@dataclass(frozen=True)
class LightFrames:
    """Frames under one light.

    Attributes
    ----------
    frames : tuple of Path or (h, w) array
        Two or more frames.
    lit : bool
        False for frames in the dark.
    exposure_s, photons : float
        Exposure time [s] and photons that fall onto a pixel in it; NaN where they aren't known.
    """

    frames: tuple[Frame, ...]
    lit: bool
    exposure_s: float = nan
    photons: float = nan


@dataclass(frozen=True)
class FrameSet:
    """Frames of one camera at one gain, by light.

    Attributes
    ----------
    lights : tuple of LightFrames
        Flat frames and dark frames.
    white_dn : float
        Greatest reading of the converter; NaN if the raw files state it themselves.
    shape : (int, int)
        Height and width of files without a header (.raw, .bin), which need it; (0, 0) if it isn't known.
    notes : tuple of str
        Notes on what was assumed about the files.
    """

    lights: tuple[LightFrames, ...]
    white_dn: float = nan
    shape: tuple[int, int] = (0, 0)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Pixels:
    """Content of a frame file: digital numbers, its mosaic, and the white level, which is NaN if it isn't known."""

    dn: NDArray[Any]
    cfa: Tile
    white_dn: float


def is_set(path: Path) -> bool:
    """Return whether a path is a set of frames (folder, zip file, descriptor or list), not a single raw file."""
    return path.is_dir() or path.suffix.lower() in (".zip", ".txt", ".csv")


@contextmanager
def open_set(path: Path) -> Iterator[FrameSet]:
    """Open the frames of a folder, a descriptor (.txt), a list (.csv) or a zip file, unpacked while the context lasts.

    Raises
    ------
    InputError
        For a place without a descriptor or a list, or one that can't be read.
    """
    if path.suffix.lower() == ".zip" and path.is_file():
        with TemporaryDirectory(prefix="rodcone-frames-") as folder:
            _unpack(path, Path(folder))
            yield _read_index(_index_in(Path(folder), str(path)))
    elif path.is_dir():
        yield _read_index(_index_in(path, str(path)))
    else:
        yield _read_index(path)


def read_frame_pixels(frame: Frame, frames: FrameSet) -> Pixels:
    """Read a frame as it is; a developed picture of several channels is refused.

    Raises
    ------
    InputError
        For a file that is missing, damaged, in colours, or of another size than its set says.
    """
    if isinstance(frame, np.ndarray):
        return _checked(frame, "array", frames.white_dn)
    if not frame.is_file():
        raise InputError(f"{frame}: there is no such file; correct the descriptor, or put the frames beside it")
    ending = frame.suffix.lower()
    if ending in _HEADLESS:
        return Pixels(_headless(frame, frames), _MONOCHROME, frames.white_dn)
    if ending in _PICTURES and not frame.with_suffix(".json").exists():
        kinds = (OSError, ValueError, SyntaxError)
        with read_errors(f"{frame}: can't be read", "give a grey PNG or TIFF", kinds), Image.open(frame) as picture:
            mode = picture.mode
            dn = np.asarray(picture)
        if mode not in ("L", "I", "I;16", "I;16B", "F"):
            raise InputError(
                f"{frame}: its pixels are {mode}; allowed: one grey channel of 8 or 16 bits; give raw data"
            )
        return _checked(dn, str(frame), frames.white_dn)
    raw = read_raw(frame)
    return Pixels(raw.dn, raw.cfa, raw.white_dn if isnan(frames.white_dn) else frames.white_dn)


def _checked(dn: NDArray[Any], name: str, white_dn: float) -> Pixels:
    if dn.ndim != 2 or dn.dtype.kind not in "uif":
        raise InputError(f"{name}: {dn.ndim} axes of {dn.dtype}; allowed: a grey frame (h, w) of numbers; give one")
    if np.min(dn) < 0 or not np.all(np.isfinite(dn)):
        raise InputError(f"{name}: it has negative or infinite samples; allowed: digital numbers from 0; add an offset")
    return Pixels(dn, _MONOCHROME, white_dn)


def _headless(path: Path, frames: FrameSet) -> NDArray[Any]:
    """Read the pixels of a file without a header: bytes up to 8 bits, little-endian 16-bit words above."""
    height, width = frames.shape
    if not height or isnan(frames.white_dn):
        raise InputError(f"{path}: it has no head; allowed: beside a descriptor whose line n gives bits and size")
    kind = np.dtype("u1" if frames.white_dn < 256 else "<u2")
    size = path.stat().st_size
    if size != height * width * kind.itemsize:
        raise InputError(f"{path}: {size} bytes; allowed: {height} x {width} pixels of {kind.itemsize}; correct line n")
    return np.fromfile(path, kind).reshape(height, width)


def _unpack(path: Path, folder: Path) -> None:
    kinds = (OSError, ValueError, zipfile.BadZipFile, EOFError)
    with read_errors(f"{path}: can't be read", "give a zip file", kinds), zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        total = sum(member.file_size for member in members)
        if total > MOST_ZIP_BYTES or len(members) > 2 * MOST_FRAMES:
            raise InputError(f"{path}: {len(members)} files of {total} bytes; allowed: {MOST_ZIP_BYTES}; unpack it")
        for member in members:
            inside(folder, member.filename)
        archive.extractall(folder)


def _index_in(folder: Path, name: str) -> Path:
    """Return the path of the only list or descriptor at a folder's top or, if there is none, in its subfolders."""
    for pattern in (LIST_NAME, f"*/{LIST_NAME}", "*.txt", "*/*.txt"):
        found = [path for path in sorted(folder.glob(pattern)) if path.suffix == ".csv" or _is_descriptor(path)]
        if len(found) > 1:
            names = ", ".join(str(path.relative_to(folder)) for path in found)
            raise InputError(f"{name}: it has {len(found)} descriptors, {names}; allowed: one; name the one you mean")
        if found:
            return found[0]
    raise InputError(f"{name}: it has no descriptor; {_FIX}")


def _is_descriptor(path: Path) -> bool:
    lines = [line.split() for line in _text(path).splitlines()]
    return any(words[0] == "n" and len(words) == 4 for words in lines if words)


def _text(path: Path) -> str:
    with read_errors(f"{path}: can't be read", "give the path of a descriptor or a list"):
        return read_bounded(path, MOST_BYTES).decode("utf-8", errors="replace").lstrip("\ufeff")


def _read_index(path: Path) -> FrameSet:
    frames = _read_list(path) if path.suffix.lower() == ".csv" else _read_descriptor(path)
    count = sum(len(light.frames) for light in frames.lights)
    require_whole(f"{path}: frames", count, 2, MOST_FRAMES, "give frames of a few lights")
    return replace(frames, lights=tuple(light for light in frames.lights if light.frames))


def _read_descriptor(path: Path) -> FrameSet:
    """Read a descriptor with the lines: v release, n bits width height, b ns photons, d ns, i file."""
    lights: list[LightFrames] = []
    bits = 0
    shape = (0, 0)
    skipped = set()
    for number, line in enumerate(_text(path).splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        place = f"{path}: line {number}"
        key = words[0]
        values = words[1:]
        if key == "i":
            if not lights:
                raise InputError(f"{place}: a frame before its light; allowed: after a line b or d; move it")
            file = inside(path.parent, line.strip()[1:].strip().replace("\\", "/"))
            lights[-1] = replace(lights[-1], frames=(*lights[-1].frames, file))
        elif key in ("n", "b", "d"):
            need = {"n": 3, "b": 2, "d": 1}[key]
            with read_errors(f"{place}: {line.strip()!r} isn't {need} numbers", "correct it", ValueError):
                numbers = [float(word) for word in values[:need]]
                if len(numbers) < need:
                    raise ValueError("too few")
            if key == "n":
                require_range(f"{place}: bits", numbers[0], 1, 16, "give the converter's bits")
                bits = int(numbers[0])
                shape = (int(numbers[2]), int(numbers[1]))
            else:
                photons = numbers[1] if key == "b" else 0.0
                lights.append(LightFrames((), key == "b", numbers[0] * 1e-9, photons))
        elif key != "v":
            skipped.add(key)
    if not bits or not lights:
        raise InputError(f"{path}: it has no line n, or none of b and d; {_FIX}")
    notes = ["exposure times of the descriptor are nanoseconds, its light is photons per pixel"]
    if skipped:
        notes.append(f"lines of the descriptor that begin with {', '.join(sorted(skipped))} were skipped")
    return FrameSet(tuple(lights), 2.0**bits - 1, shape, tuple(notes))


def _read_list(path: Path) -> FrameSet:
    """Read a list with the columns file, kind (flat or dark), exposure_s and, if known, photons."""
    rows = list(csv.DictReader(StringIO(_text(path))))
    head = tuple(rows[0]) if rows else ()
    if not set(LIST_HEAD[:3]) <= set(head):
        raise InputError(f"{path}: its columns are {', '.join(map(str, head)) or 'none'}; {_FIX}")
    found: dict[tuple[bool, float, float], list[Path]] = {}
    for number, row in enumerate(rows, 2):
        kind = (row["kind"] or "").strip()
        if kind not in ("flat", "dark"):
            raise unknown(f"{path}: line {number}: kind", kind, ("flat", "dark"))
        with read_errors(f"{path}: line {number}: exposure_s or photons isn't a number", "correct it", ValueError):
            exposure_s, photons = (float(row.get(name) or nan) for name in LIST_HEAD[2:])
        file = inside(path.parent, (row["file"] or "").replace("\\", "/"))
        found.setdefault((kind == "flat", exposure_s, photons if kind == "flat" else 0.0), []).append(file)
    lights = tuple(LightFrames(tuple(files), *key) for key, files in found.items())
    return FrameSet(
        lights, notes=("the list's frames with one exposure time and one number of photons are of one light",)
    )


def white_level(pixels: Sequence[Pixels]) -> tuple[float, str]:
    """Return the white level of frames that don't state it, and a note.

    It is the greatest number with as few bits as hold all readings.
    """
    most = max(float(np.max(one.dn)) for one in pixels)
    bits = max(int(most).bit_length(), 1)
    return 2.0**bits - 1, f"the converter has {bits} bits, the fewest that hold the greatest reading, {most:g} DN"
