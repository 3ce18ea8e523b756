"""One 16-bit mosaic in a TIFF: written by `tifffile`, read here, where nothing is taken that the file can't hold.

Reading needs only the first directory of a classic little-endian TIFF (TIFF 6.0, section 2) and the Exif directory that
it names. Every size is compared with the file's own before memory is asked for.
"""

import struct
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError

Values = tuple[int, ...] | tuple[float, ...]
Tags = Mapping[int, tuple[str, Values]]  # code: (struct format of one value, values); rationals are pairs

IMAGE_WIDTH, IMAGE_LENGTH, BITS_PER_SAMPLE, COMPRESSION, PHOTOMETRIC = 256, 257, 258, 259, 262
STRIP_OFFSETS, SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS = 273, 277, 279
MAKER = 271  # Make: of the camera
EXIF = 34665
_EXIF_LATER = 34664  # no tag's code: tifffile refuses to write EXIF itself, and this keeps the codes in order
MIN_IS_BLACK, CFA = 1, 32803
_LAYOUT = (IMAGE_WIDTH, IMAGE_LENGTH, BITS_PER_SAMPLE, COMPRESSION, PHOTOMETRIC)
_STRIPS = (STRIP_OFFSETS, SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS)

_FORMATS = {1: "B", 2: "s", 3: "H", 4: "I", 5: "2I", 6: "b", 7: "B", 8: "h", 9: "i", 10: "2i", 11: "f", 12: "d"}
_UNDEFINED = 7  # bytes whose meaning is the tag's own; written from the form "U", read as "B"
_MOST_VALUE_BYTES = 1 << 20  # of one tag: a million pixel rows in strips of four, or any calibration
_LONGEST_SIDE = 1 << 17  # pixels; larger chips exist as mosaics of chips alone


def write_mosaic(path: Path, dn: NDArray[np.uint16], photometric: int, tags: Tags, exif: Tags | None = None) -> None:
    """Write an uncompressed 16-bit TIFF with further tags, and an Exif directory with those of `exif`.

    Raises
    ------
    InputError
        Where `dn` is not a (h, w) array of uint16.
    """
    import tifffile

    if dn.ndim != 2 or dn.dtype != np.uint16:
        raise InputError(f"dn: {dn.dtype} of shape {dn.shape} is not allowed; give (h, w) of uint16")
    tags = {**tags, **({_EXIF_LATER: ("I", (0,))} if exif else {})}
    extra = [
        (code, _UNDEFINED if kind == "U" else kind, _count(kind, values), _value(kind, values), True)
        for code, (kind, values) in tags.items()
    ]
    with tifffile.TiffWriter(path, byteorder="<", bigtiff=False) as file:
        file.write(
            np.ascontiguousarray(dn), photometric=photometric, metadata=None, software="rodcone", extratags=extra
        )
    if exif:
        _append_exif(path, exif)


def _append_exif(path: Path, exif: Tags) -> None:
    """Put a directory behind the pixels and enter its place in the first one."""
    with path.open("r+b") as file:
        start = file.seek(0, 2)
        file.write(_directory(exif, start))
        file.seek(4)
        (first,) = struct.unpack("<I", file.read(4))
        file.seek(first)
        (count,) = struct.unpack("<H", file.read(2))
        codes = [struct.unpack("<H10x", file.read(12))[0] for _ in range(count)]
        file.seek(first + 2 + 12 * codes.index(_EXIF_LATER))
        file.write(struct.pack("<HHII", EXIF, 4, 1, start))


def _directory(tags: Tags, start: int) -> bytes:
    """Directory of tags that stands at byte `start` (an even one), the values that don't fit into it behind it."""
    kinds = {form: kind for kind, form in _FORMATS.items()}
    entries, behind = struct.pack("<H", len(tags)), b""
    for code, (form, values) in sorted(tags.items()):
        packed = struct.pack(f"<{len(values)}{form[-1]}", *values)
        entries += struct.pack("<HHI", code, kinds[form], _count(form, values))
        if len(packed) > 4:
            entries += struct.pack("<I", start + 2 + 12 * len(tags) + 4 + len(behind))
            behind += packed + bytes(len(packed) % 2)
        else:
            entries += packed.ljust(4, b"\0")
    return entries + bytes(4) + behind


def _count(kind: str, values: Values) -> int:
    return len(values) // 2 if kind in ("2I", "2i") else len(values)


def _value(kind: str, values: Values) -> Any:
    """Value as tifffile takes it: texts and bytes as bytes, one number alone, more as a tuple."""
    if kind in ("s", "B", "U"):
        return bytes(int(value) for value in values)
    return values[0] if len(values) == 1 else values


def text(value: str) -> tuple[str, Values]:
    """ASCII tag with its closing zero."""
    return "s", (*value.encode("ascii"), 0)


def read_make(path: Path) -> str | None:
    """Make of the camera as the first directory gives it; None where it gives none, or there is none to read."""
    try:
        with path.open("rb") as file:
            kind, values = _read_tags(file, path.stat().st_size, (MAKER,), str(path)).get(MAKER, ("", ()))
    except (InputError, OSError):
        return None
    return bytes(int(value) for value in values).rstrip(b"\0").decode("ascii", "replace") if kind == "s" else None


def read_mosaic(path: Path, photometric: int, codes: Collection[int] = ()) -> tuple[NDArray[np.uint16], Tags]:
    """Pixels (h, w), and the tags of these codes, Exif's among them; one of more than a mebibyte is left out.

    Raises
    ------
    InputError
        For a file that is missing, cut off, no classic little-endian TIFF, or holds anything but one uncompressed
        16-bit mosaic of this photometric interpretation.
    """
    try:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file; give the path of a raw file")
        with path.open("rb") as file:
            size = path.stat().st_size
            tags = _read_tags(file, size, {*_LAYOUT, *_STRIPS, *codes}, str(path))
            return _read_strips(file, size, tags, photometric, str(path)), tags
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror or error}); give the path of a raw file") from error


def _read_tags(file: BinaryIO, size: int, wanted: Collection[int], name: str) -> Tags:
    """Tags that are wanted, those of the Exif directory among them."""
    head = file.read(8)
    if head[:4] != b"II*\0" or len(head) < 8:
        raise InputError(f"{name}: not a little-endian TIFF or DNG; allowed: files that `rodcone capture` wrote")
    tags = _read_directory(file, size, struct.unpack("<I", head[4:])[0], wanted, name)
    if EXIF in tags:
        tags |= _read_directory(file, size, whole(tags, EXIF, name)[0], wanted, name)
    return tags


def _read_directory(
    file: BinaryIO, size: int, start: int, wanted: Collection[int], name: str
) -> dict[int, tuple[str, Values]]:
    """Wanted tags of the directory at byte `start`: 65 535 others could each claim the whole file."""
    file.seek(start)
    length = file.read(2)
    entries = file.read(12 * struct.unpack("<H", length)[0]) if len(length) == 2 else b""
    if not entries or len(entries) != 12 * struct.unpack("<H", length)[0]:
        raise InputError(f"{name}: cut off, its directory of tags at byte {start} is not all there; copy it again")
    tags: dict[int, tuple[str, Values]] = {}
    for code, kind, count, inline in struct.iter_unpack("<HHI4s", entries):
        if kind not in _FORMATS or code not in wanted:
            continue  # TIFF 6.0, section 2: readers skip types that they don't know
        nbytes = struct.calcsize("<" + _FORMATS[kind]) * count
        (place,) = struct.unpack("<I", inline)
        if nbytes > 4 and place + nbytes > size:
            raise InputError(
                f"{name}: tag {code} claims bytes {place} to {place + nbytes} of {size}; it is cut off, copy it again"
            )
        if nbytes <= _MOST_VALUE_BYTES:
            tags[code] = (_FORMATS[kind], _unpack(file, kind, count, inline, place))
    return tags


def _unpack(file: BinaryIO, kind: int, count: int, inline: bytes, place: int) -> Values:
    form = _FORMATS[kind]
    nbytes = struct.calcsize("<" + form) * count
    if nbytes > 4:
        file.seek(place)
        inline = file.read(nbytes)
    if form in ("s", "B"):
        return tuple(inline[:count])
    return struct.unpack(f"<{count * (2 if form[0] == '2' else 1)}{form[-1]}", inline[:nbytes])


def whole(tags: Tags, code: int, name: str) -> tuple[int, ...]:
    """Values of a tag of whole numbers, or `InputError` where it is missing or of another type."""
    kind, values = tags.get(code, ("", ()))
    if kind not in ("B", "H", "I") or not values:
        raise InputError(f"{name}: tag {code} is missing or holds no whole numbers; allowed: files that rodcone wrote")
    return tuple(int(value) for value in values)


def _read_strips(file: BinaryIO, size: int, tags: Tags, photometric: int, name: str) -> NDArray[np.uint16]:
    for code, allowed in (
        (BITS_PER_SAMPLE, 16),
        (COMPRESSION, 1),
        (PHOTOMETRIC, photometric),
        (SAMPLES_PER_PIXEL, 1),
    ):
        if (found := whole(tags, code, name)) != (allowed,):
            raise InputError(f"{name}: tag {code} is {found[:4]}; allowed: {allowed}; use a rodcone file")
    width, height = (whole(tags, code, name)[0] for code in (IMAGE_WIDTH, IMAGE_LENGTH))
    offsets, counts = whole(tags, STRIP_OFFSETS, name), whole(tags, STRIP_BYTE_COUNTS, name)
    if not (1 <= width <= _LONGEST_SIDE and 1 <= height <= _LONGEST_SIDE):
        raise InputError(f"{name}: {width} x {height} pixels; allowed: 1 to {_LONGEST_SIDE} a side; it is damaged")
    fits = len(offsets) == len(counts) and all(a + n <= size for a, n in zip(offsets, counts, strict=False))
    if not fits or sum(counts) != 2 * width * height or sum(counts) > size:
        raise InputError(
            f"{name}: {width} x {height} pixels of 2 bytes don't fit its {size} bytes; cut off, copy it again"
        )
    pixels = bytearray()
    for offset, count in zip(offsets, counts, strict=True):
        file.seek(offset)
        pixels += file.read(count)
    return np.frombuffer(pixels, dtype="<u2").astype(np.uint16).reshape(height, width)
