"""One mosaic of 16-bit whole numbers or single-precision floats in a TIFF.

It is written by `tifffile`, and read here with every size compared with the file's own first.

TIFF 6.0, section 2: a directory holds a count, entries of 12 bytes (tag, type, count, value or its offset), and the
offset of the next directory.
"""

import struct
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, read_errors

Values = bytes | tuple[int, ...] | tuple[float, ...]
Tags = Mapping[int, tuple[str, Values]]  # by code: format of one value (below), values; a rational is two numbers

WIDTH, HEIGHT, BITS_PER_SAMPLE, COMPRESSION, PHOTOMETRIC = 256, 257, 258, 259, 262
STRIP_OFFSETS, SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS, SAMPLE_FORMAT = 273, 277, 279, 339
EXIF, SUB_DIRECTORIES = 34665, 330  # the latter: SubIFDs (TIFF 6.0, Supplement 1)
_MOST_SUB_DIRECTORIES = 16  # most sub-directories in which the mosaic is searched
_EXIF_PLACE = 34664  # no tag's code: tifffile doesn't write EXIF, so this entry is written and then changed into it
MIN_IS_BLACK, CFA = 1, 32803
_LAYOUT = (WIDTH, HEIGHT, BITS_PER_SAMPLE, COMPRESSION, PHOTOMETRIC, STRIP_OFFSETS, SAMPLES_PER_PIXEL)
_SAMPLES: dict[tuple[tuple[int, ...], tuple[int, ...]], np.dtype[Any]] = {
    ((16,), (1,)): np.dtype("<u2"),
    ((32,), (3,)): np.dtype("<f4"),
}  # by BitsPerSample and SampleFormat
_FORMATS = dict(enumerate(("B", "s", "H", "I", "2I", "b", "U", "h", "i", "2i", "f", "d", "I"), start=1))  # by type
_BYTES = "BsU"  # formats whose values are bytes: numbers, ASCII, and those whose meaning is the tag's own
_TYPES = {form: kind for kind, form in reversed(_FORMATS.items())}
_MOST_VALUE_BYTES = 1 << 20  # most bytes of one tag: a million pixel rows in strips of four, or any calibration
_LONGEST_SIDE = 1 << 17  # pixels; no single chip is larger


def write_mosaic(
    path: Path, dn: NDArray[Any], photometric: int, tags: Tags, exif: Tags | None = None, least_bytes: int = 0
) -> None:
    """Write an uncompressed TIFF with further tags, and an Exif directory with those of `exif`.

    Zeros behind the last byte make the file as large as `least_bytes`.

    Raises
    ------
    InputError
        Where `dn` is not a (h, w) array of uint16 or float32.
    """
    import tifffile

    if dn.ndim != 2 or dn.dtype not in _SAMPLES.values():
        raise InputError(f"dn: {dn.dtype} of shape {dn.shape} is not allowed; give (h, w) of uint16 or float32")
    tags = {**tags, **({_EXIF_PLACE: ("I", (0,))} if exif else {})}
    extra: list[Any] = [
        (code, _TYPES[form], _count(form, values), values if form in _BYTES or len(values) > 1 else values[0], True)
        for code, (form, values) in tags.items()
    ]
    pixels = np.ascontiguousarray(dn)
    with tifffile.TiffWriter(path, byteorder="<", bigtiff=False) as file:
        file.write(pixels, photometric=photometric, metadata=None, software="rodcone", extratags=extra)
    if exif:
        with tifffile.TiffFile(path) as written:
            entry = written.pages.first.tags[_EXIF_PLACE].offset
        with path.open("r+b") as stream:
            start = stream.seek(0, 2)
            stream.write(_directory(exif, start))
            stream.seek(entry)
            stream.write(struct.pack("<HHII", EXIF, 4, 1, start))
    with path.open("ab") as stream:
        stream.write(bytes(max(least_bytes - stream.tell(), 0)))


def _directory(tags: Tags, start: int) -> bytes:
    """Return a directory of tags for the even byte `start`; the values that don't fit into it follow it."""
    entries = struct.pack("<H", len(tags))
    behind = b""
    for code, (form, values) in sorted(tags.items()):
        packed = values if isinstance(values, bytes) else struct.pack(f"<{len(values)}{form[-1]}", *values)
        entries += struct.pack("<HHI", code, _TYPES[form], _count(form, values))
        if len(packed) > 4:
            entries += struct.pack("<I", start + 2 + 12 * len(tags) + 4 + len(behind))
            behind += packed + bytes(len(packed) % 2)
        else:
            entries += packed.ljust(4, b"\0")
    return entries + bytes(4) + behind


def _count(form: str, values: Values) -> int:
    return len(values) // 2 if form in ("2I", "2i") else len(values)


def text(value: str) -> tuple[str, bytes]:
    """Return an ASCII tag with its closing zero."""
    return "s", value.encode("ascii") + b"\0"


def read_mosaic(path: Path, photometric: int, codes: Collection[int] = ()) -> tuple[NDArray[Any], Tags]:
    """Read the pixels (h, w), and the tags of these codes (also Exif's) unless they hold more than a mebibyte.

    Raises
    ------
    InputError
        For a file that is missing, cut off, no classic little-endian TIFF, or holds anything but one uncompressed
        mosaic of this photometric interpretation, of 16-bit whole numbers or single-precision floats.
    """
    name = str(path)
    with read_errors(f"{name}: can't be read", "give the path of a raw file", OSError), path.open("rb") as file:
        tags = read_tags(file, {*_LAYOUT, STRIP_BYTE_COUNTS, SAMPLE_FORMAT, *codes}, name)
        return _read_strips(file, tags, photometric, name), tags


def read_tags(file: BinaryIO, codes: Collection[int], name: str) -> Tags:
    """Read the tags of these codes from the first directory, the Exif directory that it names, and that of the mosaic.

    Other programs write a preview into the first directory and the mosaic into one below it, whose tags take
    precedence.
    """
    head = file.read(8)
    if head[:4] != b"II*\0" or len(head) < 8:
        raise InputError(f"{name}: not a little-endian TIFF or DNG; allowed: files that `rodcone capture` wrote")
    wanted = {*codes, SUB_DIRECTORIES, PHOTOMETRIC}
    tags, _ = read_directory(file, struct.unpack("<I", head[4:])[0], wanted, name)
    if tags.get(PHOTOMETRIC, ("", ()))[1] != (CFA,) and SUB_DIRECTORIES in tags:
        for start in whole(tags, SUB_DIRECTORIES, name)[:_MOST_SUB_DIRECTORIES]:
            below, _ = read_directory(file, start, wanted, name)
            if below.get(PHOTOMETRIC, ("", ()))[1] == (CFA,):
                tags |= below
                break
    if EXIF in tags:
        tags |= read_directory(file, whole(tags, EXIF, name)[0], codes, name)[0]
    return tags


def read_directory(
    file: BinaryIO, start: int, codes: Collection[int], name: str, order: str = "<"
) -> tuple[dict[int, tuple[str, Values]], int]:
    """Read the tags of these codes from the directory at byte `start`, and the start of the next one (0 for none).

    No other tag is read, because each of up to 65 535 tags could claim the whole file. Types that TIFF 6.0 doesn't know
    are skipped.

    Raises
    ------
    InputError
        Where the directory or a tag's values are not all in the file.
    """
    size = file.seek(0, 2)
    file.seek(start)
    length = file.read(2)
    count = struct.unpack(f"{order}H", length)[0] if len(length) == 2 else 0
    entries = file.read(12 * count)
    if not count or len(entries) != 12 * count:
        raise InputError(f"{name}: cut off, its directory of tags at byte {start} is not all there; copy it again")
    (following,) = struct.unpack(f"{order}I", file.read(4).ljust(4, b"\0"))
    tags: dict[int, tuple[str, Values]] = {}
    for code, kind, number, inline in struct.iter_unpack(f"{order}HHI4s", entries):
        if kind not in _FORMATS or code not in codes:
            continue
        form = _FORMATS[kind]
        nbytes = struct.calcsize(f"<{form}".replace("U", "B")) * number
        content = inline[:nbytes]
        if nbytes > 4:
            (offset,) = struct.unpack(f"{order}I", inline)
            if offset + nbytes > size:
                raise InputError(
                    f"{name}: tag {code} claims bytes {offset} to {offset + nbytes} of {size}; "
                    "it is cut off, copy it again"
                )
            if nbytes > _MOST_VALUE_BYTES:
                continue
            file.seek(offset)
            content = file.read(nbytes)
        if form in _BYTES:
            tags[code] = form, content
        else:
            tags[code] = form, tuple(value for (value,) in struct.iter_unpack(order + form[-1], content))
    return tags, following


def whole(tags: Tags, code: int, name: str) -> tuple[int, ...]:
    """Return the values of a tag of whole numbers; raise `InputError` where it is missing or of another type."""
    form, values = tags.get(code, ("", ()))
    if form not in ("B", "U", "H", "I") or not values:
        raise InputError(f"{name}: tag {code} is missing or holds no whole numbers; allowed: files that rodcone wrote")
    return tuple(int(value) for value in values)


def _read_strips(file: BinaryIO, tags: Tags, photometric: int, name: str) -> NDArray[Any]:
    """Read the pixels (h, w); refuse a file with fewer bytes than its pixels need before any memory is taken."""
    kind = whole(tags, BITS_PER_SAMPLE, name), whole(tags, SAMPLE_FORMAT, name) if SAMPLE_FORMAT in tags else (1,)
    if (samples := _SAMPLES.get(kind)) is None:
        raise InputError(
            f"{name}: tag {BITS_PER_SAMPLE} is {kind[0][:4]}; allowed: 16, or 32 with {SAMPLE_FORMAT} of 3 (float); "
            "use a rodcone file"
        )
    fixed = {COMPRESSION: 1, PHOTOMETRIC: photometric, SAMPLES_PER_PIXEL: 1}
    for code, allowed in fixed.items():
        if (values := whole(tags, code, name)) != (allowed,):
            raise InputError(f"{name}: tag {code} is {values[:4]}; allowed: {allowed}; use a rodcone file")
    width, height = (whole(tags, code, name)[0] for code in (WIDTH, HEIGHT))
    offsets, counts = whole(tags, STRIP_OFFSETS, name), whole(tags, STRIP_BYTE_COUNTS, name)
    if not (1 <= width <= _LONGEST_SIDE and 1 <= height <= _LONGEST_SIDE):
        raise InputError(f"{name}: {width} x {height} pixels; allowed: 1 to {_LONGEST_SIDE} a side; it is damaged")
    size = file.seek(0, 2)
    fits = len(offsets) == len(counts) and all(a + n <= size for a, n in zip(offsets, counts, strict=True))
    if not fits or sum(counts) != samples.itemsize * width * height or sum(counts) > size:
        raise InputError(
            f"{name}: {width} x {height} pixels of {samples.itemsize} bytes don't fit its {size} bytes; "
            "cut off, copy it again"
        )
    pixels = bytearray()
    for offset, count in zip(offsets, counts, strict=True):
        file.seek(offset)
        pixels += file.read(count)
    return np.frombuffer(pixels, dtype=samples).astype(samples.newbyteorder("="), copy=False).reshape(height, width)
