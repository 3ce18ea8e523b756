"""Changes to files that readers have to survive: at random places, or where a format keeps its sizes.

Every change is drawn from a `random.Random`, so that a seed and a number name an input.
"""

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from copy import deepcopy
from random import Random
from typing import Any

Mutator = Callable[[Random, bytes], bytes]

MOST_BYTES = 1 << 20
_EXTREMES = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 1 << 24, 0x7FFFFFFF, 0x80000000)
_EXTREMES += (0xFFFFFFF8, 0xFFFFFFFF, 1 << 32, 1 << 48, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
NUMBERS = (
    *("0", "-1", "1e400", "-1e400", "nan", "inf", "-inf", "1e-400", "1e308", "0.5", "2147483648", "true", '""', "[]"),
    *("99999999999999999999", "0x" + 300 * "f", 5000 * "9", "{}", '"\\u202e"', "[[1], 2]", "1_000", "1979-05-27"),
)
_PACKED = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_LETTERS = (*"\0\n\"'[]{}=,.#<>&$/", "\x1b[2J", "\u202e", "\ud800")


def any_bytes(random: Random, content: bytes) -> bytes:
    """One to five changes at random places; half of them within the first 512 bytes, where headers are."""
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 1, 2, 5))):
        at = random.randrange(max(min(len(changed), random.choice((512, MOST_BYTES))), 1))
        random.choice(_CHANGES)(random, changed, at)
    return bytes(changed[:MOST_BYTES])


def _flip(random: Random, changed: bytearray, at: int) -> None:
    if changed:
        changed[at] ^= 1 << random.randrange(8)


def _byte(random: Random, changed: bytearray, at: int) -> None:
    changed[at : at + 1] = bytes([random.randrange(256)])


def _number(random: Random, changed: bytearray, at: int) -> None:
    """A number of 2, 4 or 8 bytes: an extreme, or the old one and a little."""
    width, order = random.choice((2, 4, 8)), random.choice(("little", "big"))
    old = int.from_bytes(changed[at : at + width], order)  # type: ignore[arg-type]
    new = random.choice(_EXTREMES) if random.random() < 0.7 else old + random.choice((-8, -1, 1, 8))
    changed[at : at + width] = (new % (1 << 8 * width)).to_bytes(width, order)  # type: ignore[arg-type]


def _cut(random: Random, changed: bytearray, at: int) -> None:
    del changed[at:]


def _drop(random: Random, changed: bytearray, at: int) -> None:
    del changed[at : at + random.choice((1, 4, 8, 64))]


def _again(random: Random, changed: bytearray, at: int) -> None:
    piece = changed[at : at + random.choice((1, 4, 12, 64, 4096))]
    changed[at:at] = piece * random.choice((1, 2, 50))


def _move(random: Random, changed: bytearray, at: int) -> None:
    width, source = random.choice((2, 4, 8, 12)), random.randrange(len(changed) + 1)
    changed[at : at + width] = changed[source : source + width]


_CHANGES = (_flip, _flip, _byte, _number, _number, _number, _cut, _drop, _again, _move)


def any_text(random: Random, content: bytes) -> bytes:
    """One to five changes of a text: numbers, lines, letters, brackets nested deep; bytes now and then."""
    if random.random() < 0.1:
        return any_bytes(random, content)
    for _ in range(random.choice((1, 1, 1, 2, 5))):
        content = random.choice((_other_number, _other_number, _lines, _letter, _deep, _word))(random, content)
    return content[:MOST_BYTES]


def _other_number(random: Random, content: bytes) -> bytes:
    places = list(_NUMBER.finditer(content))
    if not places:
        return content
    place = random.choice(places)
    return content[: place.start()] + random.choice(NUMBERS).encode() + content[place.end() :]


def _lines(random: Random, content: bytes) -> bytes:
    lines = content.split(b"\n")
    one, other = random.randrange(len(lines)), random.randrange(len(lines))
    how = random.randrange(3)
    if how == 0:
        del lines[one]
    elif how == 1:
        lines.insert(one, lines[other])
    else:
        lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def _letter(random: Random, content: bytes) -> bytes:
    at = random.randrange(len(content) + 1)
    letter = random.choice(_LETTERS).encode("utf-8", "surrogatepass")
    return content[:at] + letter * random.choice((1, 1, 3)) + content[at + random.choice((0, 1)) :]


def _deep(random: Random, content: bytes) -> bytes:
    at = random.randrange(len(content) + 1)
    piece = random.choice((b"[", b"{", b"(", b".a", b"<a>", b"[[a]]\n", b'{"a":', b"a=[", b"../"))
    return content[:at] + piece * random.choice((2, 70, 2000)) + content[at:]


def _word(random: Random, content: bytes) -> bytes:
    """A word of the text in the place of another."""
    words = list(re.finditer(rb"[\w.]+", content))
    if not words:
        return content
    one, other = random.choice(words), random.choice(words)
    return content[: one.start()] + other[0] + content[one.end() :]


def tiff_tags(random: Random, content: bytes) -> bytes:
    """Fields of entries of a TIFF's first directory, and bytes."""
    changed = bytearray(content)
    if len(changed) < 10 or random.random() < 0.3:
        return any_bytes(random, content)
    (start,) = struct.unpack_from("<I", changed, 4)
    count = struct.unpack_from("<H", changed, start)[0] if start + 2 <= len(changed) else 0
    for _ in range(random.choice((1, 1, 2, 4))):
        entry = start + 2 + 12 * random.randrange(max(count, 1))
        at, width = random.choice(((0, 2), (2, 2), (4, 4), (4, 4), (8, 2), (8, 4), (8, 4)))
        if entry + 12 <= len(changed):
            new = random.choice(_EXTREMES) if random.random() < 0.6 else random.randrange(20)
            if random.random() < 0.2:
                new = random.randrange(len(changed))
            changed[entry + at : entry + at + width] = (new % (1 << 8 * width)).to_bytes(width, "little")
    return bytes(changed)


def json_in(start: bytes) -> Mutator:
    """Changes of the JSON that follows `start` in a file, its length kept where it can be."""

    def mutate(random: Random, content: bytes) -> bytes:
        if start not in content or random.random() < 0.5:
            return tiff_tags(random, content)
        at = content.index(start) + len(start)
        end = content.index(b"}}", at) + 2 if b"}}" in content[at:] else len(content)
        new = json_values(random, content[at:end])
        return content[:at] + new.ljust(end - at)[: end - at] + content[end:]

    return mutate


def json_values(random: Random, content: bytes) -> bytes:
    """Values of a JSON object: extremes, other types, keys missing or exchanged; or changes of its text."""
    try:
        held = json.loads(content)
    except (ValueError, RecursionError):
        return any_text(random, content)
    if random.random() < 0.3 or not isinstance(held, dict) or not held:
        return any_text(random, content)
    for _ in range(random.choice((1, 1, 2))):
        _change_value(random, held)
    return json.dumps(held).encode()


def _change_value(random: Random, held: Any) -> None:
    keys = list(held) if isinstance(held, dict) else list(range(len(held)))
    if not keys:
        return
    key = random.choice(keys)
    if isinstance(held[key], dict | list) and random.random() < 0.7:
        _change_value(random, held[key])
    elif isinstance(held, dict) and random.random() < 0.1:
        del held[key]
    elif isinstance(held, dict) and random.random() < 0.1:
        held[key] = held[random.choice(keys)]
    else:
        held[key] = deepcopy(random.choice(_VALUES))  # a later mutation changes lists in place


_VALUES: Sequence[Any] = (
    *(0, -1, 1, 1e308, -1e308, 1e-320, float("nan"), float("inf"), 1 << 62, 1 << 63, 10**400, True, None, "", "x"),
    *(
        [],
        {},
        [1],
        [[1, 2]],
        [[1], [2, 3]],
        ["RG", "GB"],
        ["R"],
        [["a", None]],
        "\x1b[2J\u202e",
        5000 * "x",
        {"a": [1]},
    ),
)


def zip_members(random: Random, content: bytes) -> bytes:
    """Bytes of a zip's members, mostly where they begin, packed in any way: their sums would tell them otherwise."""
    if random.random() < 0.3:
        return any_bytes(random, content)
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as held, zipfile.ZipFile(made, "w") as members:
        chosen = random.choice(held.namelist())
        for name in held.namelist():
            body = held.read(name)
            if name == chosen:
                at = random.choice((0, 0, 0, random.randrange(len(body) + 1)))
                body = body[:at] + any_bytes(random, body[at : at + 8192]) + body[at + 8192 :]
            members.writestr(zipfile.ZipInfo(name), body, random.choice(_PACKED))
    return any_bytes(random, made.getvalue()) if random.random() < 0.3 else made.getvalue()


def mat_elements(random: Random, content: bytes) -> bytes:
    """Bytes of a MATLAB file, within its compressed variables too: zlib's sum would tell them otherwise."""
    if random.random() < 0.3:
        return any_bytes(random, content)
    parts, at = [], 128
    while at + 8 <= len(content):
        kind, size = struct.unpack_from("<II", content, at)
        parts.append((kind, content[at + 8 : at + 8 + size]))
        at += 8 + size
    if not parts:
        return any_bytes(random, content)
    chosen = random.randrange(len(parts))
    changed = content[:128]
    for index, (kind, body) in enumerate(parts):
        new = body
        if index == chosen and kind == 15:
            new = zlib.compress(any_bytes(random, zlib.decompress(body)), 1)
        elif index == chosen:
            new = any_bytes(random, body)
        changed += struct.pack("<II", kind, len(new)) + new
    return changed
