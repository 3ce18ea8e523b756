"""Read black level, white level and colours of a digital negative from its own tags, without a library's changes.

Tags and their meaning: Adobe, "Digital Negative (DNG) Specification", version 1.6.0.0, chapters 4 to 7. The patterns of
black and of the colours begin at the first row and column of the active area.
"""

import struct
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from rodcone.types import Floats
from sensor.cfa import Tile
from sensor.raw_files.tiff import CFA, HEIGHT, PHOTOMETRIC, SUB_DIRECTORIES, WIDTH, Tags, read_directory

_MOST_DIRECTORIES = 64  # most directories of a file that are read

# The known tags that change samples, their place or their meaning. LibRaw applies LINEARIZATION.
VERSION, LINEARIZATION = 50706, 50712
CFA_REPEAT, CFA_PATTERN, CFA_COLOURS = 33421, 33422, 50710
BLACK_REPEAT, BLACK, BLACK_ROW, BLACK_COLUMN = 50713, 50714, 50715, 50716  # BlackLevelDeltaH is per column
WHITE, ACTIVE_AREA = 50717, 50829
_FIXED = {  # name of each tag, and the values with which it has no effect; other values are refused
    50711: ("CFALayout", (1,)),
    50718: ("DefaultScale", (1.0, 1.0)),
    50975: ("RowInterleaveFactor", (1,)),
    52547: ("ColumnInterleaveFactor", (1,)),
}
_OPCODES = {51008: "OpcodeList1", 51009: "OpcodeList2", 51022: "OpcodeList3"}
_OPCODE_NAMES = {
    1: "WarpRectilinear",
    2: "WarpFisheye",
    3: "FixVignetteRadial",
    4: "FixBadPixelsConstant",
    5: "FixBadPixelsList",
    6: "TrimBounds",
    7: "MapTable",
    8: "MapPolynomial",
    9: "GainMap",
    10: "DeltaPerRow",
    11: "DeltaPerColumn",
    12: "ScalePerRow",
    13: "ScalePerColumn",
    14: "WarpRectilinear2",
}
_CODES = (
    *(WIDTH, HEIGHT, PHOTOMETRIC, VERSION, CFA_REPEAT, CFA_PATTERN, CFA_COLOURS, BLACK_REPEAT, BLACK, BLACK_ROW),
    *(BLACK_COLUMN, WHITE, ACTIVE_AREA, *_FIXED, *_OPCODES),
)
_COLOURS = "RGBCMYW"  # by number of CFAPattern


@dataclass(frozen=True)
class DngLevels:
    """Levels and colours of a digital negative's samples.

    Attributes
    ----------
    area : tuple of slice
        Rows and columns of the raw image that were exposed to light.
    tile : tuple of str
        Colours that repeat from the first of these rows and columns on.
    black_dn : (h, w) float64
        Black level of each sample in the area [DN].
    white_dn : float or None
        White level; None if the file doesn't state it.
    """

    area: tuple[slice, slice]
    tile: Tile
    black_dn: Floats
    white_dn: float | None


def directories(path: Path, codes: Collection[int]) -> Iterator[Tags]:
    """Yield the tags of these codes from each directory of a TIFF and those below it; nothing for another format.

    tifffile follows damaged chains of directories for minutes. Here only a few directories are visited, and no other
    tag is read.
    """
    with path.open("rb") as file:
        head = file.read(8)
        order = {b"II*\0": "<", b"MM\0*": ">"}.get(head[:4])
        if order is None or len(head) < 8:
            return  # no TIFF, but a camera's own format
        waiting = list(struct.unpack(f"{order}I", head[4:]))
        offsets = {0}
        while waiting and len(offsets) <= _MOST_DIRECTORIES:
            start = waiting.pop(0)
            if start in offsets:
                continue
            offsets.add(start)
            try:
                tags, following = read_directory(file, start, {*codes, SUB_DIRECTORIES}, str(path), order)
            except InputError:
                continue  # damaged: others may be whole
            yield tags
            form, starts = tags.get(SUB_DIRECTORIES, ("", ()))
            if form == "I":
                waiting += [int(start) for start in starts[:_MOST_DIRECTORIES]]
            waiting.append(following)


def dng_levels(path: Path, shape: tuple[int, int]) -> DngLevels | None:
    """Return the levels and colours of a digital negative's mosaic; None for another format, which only LibRaw knows.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the raw image that LibRaw found, margins included.

    Raises
    ------
    InputError
        For tags that don't fit one another, and those that change samples and can't be applied.

    Warns
    -----
    UserWarning
        Where opcodes, such as a map of gains, would change samples: they aren't applied.
    """
    found = list(directories(path, _CODES))
    if not any(VERSION in tags for tags in found):
        return None
    mosaics = [tags for tags in found if _numbers(tags, PHOTOMETRIC) == (CFA,)]
    sides = [(_numbers(tags, HEIGHT), _numbers(tags, WIDTH)) for tags in mosaics]
    fitting = [tags for tags, (h, w) in zip(mosaics, sides, strict=True) if (*h, *w) == shape]
    if len(fitting) != 1:
        if not mosaics:
            return None  # whole pixels, which the caller refuses
        raise InputError(
            f"{path}: {len(fitting)} of its {len(mosaics)} mosaics have the {shape[0]} x {shape[1]} pixels that LibRaw "
            "reads; allowed: one; save it anew with a DNG converter"
        )
    tags = fitting[0]
    for code, (name, without_effect) in _FIXED.items():
        if code in tags and tuple(_fractions(tags, code)) != without_effect:
            raise InputError(f"{path}: {name} is {_fractions(tags, code)[:4]}; allowed: {without_effect}; convert it")
    _tell_opcodes(path, tags)
    top, left, bottom, right = _area(path, tags, shape)
    return DngLevels(
        (slice(top, bottom), slice(left, right)),
        _tile(path, tags),
        _black(path, tags, (bottom - top, right - left)),
        _fractions(tags, WHITE)[0] if WHITE in tags and _fractions(tags, WHITE) else None,
    )


def _area(path: Path, tags: Tags, shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the first row and column of the active area, and those after its last, as slices take them."""
    area = _numbers(tags, ACTIVE_AREA) or (0, 0, *shape)
    fits = len(area) == 4 and area[0] < area[2] <= shape[0] and area[1] < area[3] <= shape[1]
    if not fits:
        raise InputError(f"{path}: ActiveArea is {area[:4]}; allowed: within {shape[0]} x {shape[1]}; it is damaged")
    return area[0], area[1], area[2], area[3]


def _tile(path: Path, tags: Tags) -> Tile:
    """Return the colours of the mosaic, row by row."""
    repeat, pattern = _numbers(tags, CFA_REPEAT), _numbers(tags, CFA_PATTERN)
    fits = len(repeat) == 2 and 0 < repeat[0] * repeat[1] == len(pattern) <= 256
    if not fits or max(pattern) >= len(_COLOURS):
        raise InputError(f"{path}: CFAPattern {pattern[:8]} of {repeat[:2]} is no mosaic; it is damaged, copy it again")
    letters = "".join(_COLOURS[number] for number in pattern)
    return tuple(letters[start : start + repeat[1]] for start in range(0, len(letters), repeat[1]))


def _black(path: Path, tags: Tags, shape: tuple[int, int]) -> Floats:
    """Return the black level of each sample in the active area [DN]: a pattern plus offsets of rows and columns."""
    repeat = _numbers(tags, BLACK_REPEAT) or (1, 1)
    levels = _fractions(tags, BLACK) or (0.0,)
    if len(repeat) != 2 or not 0 < repeat[0] * repeat[1] == len(levels):
        raise InputError(f"{path}: BlackLevel has {len(levels)} values for a pattern of {repeat[:2]}; it is damaged")
    pattern = np.array(levels).reshape(repeat)
    black = np.tile(pattern, (-(-shape[0] // repeat[0]), -(-shape[1] // repeat[1])))[: shape[0], : shape[1]]
    for code, name, side in ((BLACK_ROW, "BlackLevelDeltaH", 1), (BLACK_COLUMN, "BlackLevelDeltaV", 0)):
        if code in tags:
            deltas = np.array(_fractions(tags, code))
            if deltas.size != shape[side]:
                raise InputError(f"{path}: {name} has {deltas.size} values for {shape[side]}; it is damaged")
            black = black + (deltas[None, :] if side else deltas[:, None])
    if not np.all(np.isfinite(black)):
        raise InputError(f"{path}: BlackLevel isn't finite; it is damaged, copy it again")
    return np.asarray(black, dtype=np.float64)


def _tell_opcodes(path: Path, tags: Tags) -> None:
    """Warn of opcodes, none of which is applied. Their lists are big-endian, whatever the file is."""
    named: list[str] = []
    for code, name in _OPCODES.items():
        _, content = tags.get(code, ("", b""))
        place = 4
        while isinstance(content, bytes) and place + 16 <= len(content) and len(named) < 16:
            number, _, _, size = struct.unpack_from(">4I", content, place)
            named.append(f"{_OPCODE_NAMES.get(number, number)} of {name}")
            place += 16 + size
    if named:
        warnings.warn(f"{path.name}: {', '.join(dict.fromkeys(named))} is not applied", stacklevel=4)


def _numbers(tags: Tags, code: int) -> tuple[int, ...]:
    """Return the whole numbers of a tag; empty where it is missing or of another type."""
    form, values = tags.get(code, ("", ()))
    return tuple(int(value) for value in values) if form in ("B", "U", "H", "I") else ()


def _fractions(tags: Tags, code: int) -> tuple[float, ...]:
    """Return the numbers of a tag; empty where it is missing, infinite where a denominator is 0."""
    form, values = tags.get(code, ("", ()))
    if form not in ("2I", "2i"):
        return tuple(float(value) for value in values)
    pairs: NDArray[np.float64] = np.array(values, dtype=np.float64).reshape(-1, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return tuple((pairs[:, 0] / pairs[:, 1]).tolist())
