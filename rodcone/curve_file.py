"""Tables of curves over wavelength, in the spellings of spreadsheets, renderers, light meters and IES TM-27.

A table has wavelengths in its first column and one value or more in further columns. Text before it (titles, a meter's
list of results) and after it is ignored. A line of text within the table is refused, and so is a row that isn't whole.
"""

import csv
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from xml.parsers import expat

import numpy as np

from rodcone.errors import InputError, read_errors
from rodcone.files import read_bounded
from rodcone.types import Floats

ENDINGS = (".csv", ".tsv", ".txt", ".spd", ".spdx", ".xls")  # .xls: text files of light meters
NM = "wavelength_nm"
LEAST_NM = 50.0  # if no wavelength reaches this, the column isn't in nm but probably in micrometres
MOST_BYTES = 1 << 23  # 100 columns at 0.1 nm over 300-1100 nm take 6 MB

# Units of length in nm, as instruments write them. Others, such as cm-1, eV or THz, are refused by name.
LENGTHS_NM = {
    **dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), 1.0),
    **dict.fromkeys(("um", "µm", "μm", "micron", "microns"), 1e3),
    **dict.fromkeys(("micrometer", "micrometers", "micrometre", "micrometres"), 1e3),
    **dict.fromkeys(("å", "angstrom", "angstroms"), 0.1),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1e6),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1e9),
}
_WORDS = ("wavelengths", "wavelength", "lambda", "wave", "wl", "λ")
_NOT_LETTERS = re.compile(r"[^a-zλåµμ]")  # lambda [nm], Wavelength (nm)
_PER_CENT = re.compile(r"\s*[\[(]?\s*(?:%|\bper ?cent\b|_percent\b)\s*[\])]?\s*", re.IGNORECASE)
_COMMENTS = ("#", "%", "//", "!")
_SEPARATORS = ("\t", ";", None, ",")  # None: white space
_METER = re.compile(r"(?:spectral data\s*)?([\d.,]+)\s*[\[(]?nm[\])]?", re.IGNORECASE)  # 380nm, Spectral Data 380[nm]
_BINARY = {b"PK\x03\x04": "Excel's .xlsx", b"\xd0\xcf\x11\xe0": "Excel's binary .xls", b"%PDF": "a PDF"}

# IES TM-27-14: quantities that are allowed for each use of a file, and the elements that don't change values.
_QUANTITIES = {
    "illuminant": ("flux", "intensity", "irradiance", "radiance", "exitance", "relative"),
    "chart": ("reflectance", "R-Factor"),
    "responses": ("transmittance", "T-Factor", "relative", "other"),
}
_WITHOUT_EFFECT = ("BandwidthFWHM", "BandwidthCorrected", "ReflectionGeometry", "TransmissionGeometry")


def is_curve_file(name: str | Path) -> bool:
    """Return whether a name has an ending of a table of curves."""
    return str(name).lower().endswith(ENDINGS)


@dataclass(frozen=True)
class _Line:
    """Line of a file: its number from 1, its text, its cells, and their numbers if every cell is one.

    The cells are empty if the first isn't a number. `of_meter` says whether the first is spelt as by light meters
    (`_METER`).
    """

    number: int
    text: str
    cells: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()
    of_meter: bool = False


def read_columns(path: str | Path, what: str) -> dict[str, Floats]:
    """Read the columns of a table by their names; the first, ``wavelength_nm``, contains rising wavelengths.

    Cells are separated by commas, semicolons, tabs or white space; with the last three, a decimal comma is read. A
    header names the columns; without one they are called ``1``, ``2``, ... Units in a header are applied: µm, Å, and
    per cent, which a `UserWarning` reports. Falling wavelengths are reversed.

    Parameters
    ----------
    path : str or Path
    what : str
        What the file holds: ``illuminant``, ``chart`` or ``responses``.

    Raises
    ------
    InputError
        For a file that can't be read or holds no table, or two, for a row that isn't whole, another header or unit,
        or wavelengths that neither rise nor fall.
    """
    place = f"{what}: {str(path)!r}"
    fix = "give a table: a header, then rows of a wavelength in nm and one number or more, such as a CSV"
    with read_errors(f"{place} can't be read", fix):
        content = read_bounded(Path(path), MOST_BYTES)
        if kind := next((name for start, name in _BINARY.items() if content.startswith(start)), ""):
            raise ValueError(f"it is {kind}")
        text = _decoded(content)
        if not text.strip():
            raise ValueError("it is empty")
    if text.lstrip().startswith("<"):
        names = [NM, "1"]
        table = _of_tm27(text, what, place)
    else:
        names, table = _of_text(text, place)
    nm = table[:, 0]
    if nm.max() < LEAST_NM:
        raise InputError(f"{place} has wavelengths up to {nm.max():g}; allowed: nm, or a unit in the header; convert")
    if np.all(nm[1:] < nm[:-1]):
        table, nm = table[::-1], nm[::-1]
    falls = np.flatnonzero(~(nm[1:] > nm[:-1]))
    if falls.size:
        pair = " then ".join(f"{x:g}" for x in nm[falls[0] : falls[0] + 2])
        raise InputError(
            f"{place} has wavelengths {pair}; allowed: strictly increasing or falling; sort its rows, each wavelength "
            "once"
        )
    return dict(zip(names, np.ascontiguousarray(table.T), strict=True))


def _decoded(content: bytes) -> str:
    """Decode a file's bytes: UTF-16 if they begin with its mark, else UTF-8, else Latin-1 (instruments' µ and Å)."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


# Text


def _of_text(text: str, place: str) -> tuple[list[str], Floats]:
    """Return the names and numbers of the one table in a text."""
    written = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    plain = [(number, line) for number, line in written if not line.startswith(_COMMENTS)]
    parsed = [[_parsed(number, line, separator) for number, line in plain] for separator in _SEPARATORS]
    lines = max(parsed, key=lambda lines: sum(bool(line.numbers) for line in lines))
    separator = _SEPARATORS[parsed.index(lines)]
    block = _table(lines, place)
    if separator != ",":
        _check_decimals(block, place)
    before = [line for number, line in written if number < block[0].number]
    names, scales = _header(before[-1] if before else "", separator, len(block[0].numbers), place)
    return names, np.array([line.numbers for line in block]) * scales


def _parsed(number: int, text: str, separator: str | None) -> _Line:
    """Split a line into cells; its numbers are empty unless it is a row: two cells or more, each a number."""
    cells = _cells(text, separator)
    first = _number(cells[0], separator)
    meter = None
    if first is None and (meter := _METER.fullmatch(cells[0])):
        first = _number(meter[1], separator)
    numbers = [first, *(_number(cell, separator) for cell in cells[1:])] if first is not None else [None]
    whole = tuple(value for value in numbers if value is not None and isfinite(value))
    row = len(cells) > 1 and len(whole) == len(cells)
    return _Line(number, text, cells if first is not None else (), whole if row else (), meter is not None)


def _cells(text: str, separator: str | None) -> tuple[str, ...]:
    """Split a line into cells, without the empty ones that spreadsheets leave at its end."""
    if separator is None:
        return tuple(text.split())
    line = text.rstrip(f"{separator} \t")
    try:
        cells = next(csv.reader([line], delimiter=separator)) if '"' in line else line.split(separator)
    except (csv.Error, StopIteration):
        cells = line.split(separator)
    return tuple(cell.strip() for cell in cells)


def _number(cell: str, separator: str | None) -> float | None:
    """Return a cell's number, else None. A comma is its decimal point, unless commas separate the cells."""
    if "_" in cell or (separator == "," and "," in cell) or ("," in cell and "." in cell):
        return None
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return None


def _table(lines: Sequence[_Line], place: str) -> list[_Line]:
    """Return the rows of the only table among lines; refuse lines that are broken rows, and further tables.

    A light meter lists one spectrum in coarse and in fine steps. If such tables have the same first and last
    wavelength, the finest is used.
    """
    blocks: list[list[_Line]] = []
    for before, line in zip([None, *lines[:-1]], lines, strict=True):
        if not line.numbers:
            continue
        goes_on = before is not None and len(before.numbers) == len(line.numbers)
        goes_on = goes_on and not (line.of_meter and before is not None and line.numbers[0] <= before.numbers[0])
        if goes_on:
            blocks[-1].append(line)
        else:
            blocks.append([line])
    ends = {(block[0].numbers[0], block[-1].numbers[0]) for block in blocks}
    if len(ends) == 1 and all(block[0].of_meter for block in blocks):
        blocks = [max(blocks, key=len)]
    broken = next((line for line in lines if line.cells and not line.numbers), None)
    if broken is not None:
        raise InputError(
            f"{place}: line {broken.number} ({broken.text[:60]!r}) begins with a number and is no row of numbers; "
            "mend it, or put # before it"
        )
    if len(blocks) > 1:
        first, second = blocks[0][0], blocks[1][0]
        raise InputError(
            f"{place}: tables of {len(first.numbers)} and {len(second.numbers)} columns begin in lines {first.number} "
            f"and {second.number}; allowed: one; mend what stands between them, or put # before the other's lines"
        )
    if not blocks or len(blocks[0]) < 2:
        shown = lines[0].text[:60] if lines else ""
        raise InputError(
            f"{place} holds no table of numbers (it begins with {shown!r}); allowed: a header, then two rows or more "
            "of a wavelength in nm and one number or more; give such a file"
        )
    return blocks[0]


def _check_decimals(block: Sequence[_Line], place: str) -> None:
    """Refuse a table that has both commas and points within its numbers, because one of them may separate thousands."""
    comma, point = (next((line for line in block if mark in line.text), None) for mark in ",.")
    if comma is not None and point is not None:
        raise InputError(
            f"{place}: lines {comma.number} and {point.number} have decimal commas and points ({comma.text[:40]!r}); "
            "allowed: one of the two; mend the other"
        )


def _header(above: str, separator: str | None, columns: int, place: str) -> tuple[list[str], Floats]:
    """Return names and factors of a table's columns from the line above, or numbers and 1 if it is no header."""
    comment = above.startswith(_COMMENTS)
    line = above.lstrip("".join(_COMMENTS)).strip() if comment else above
    splits = [_cells(line, by) for by in (separator, "\t", ";", ",", None)] if line else []
    fitting = [cells for cells in splits if len(cells) == columns]
    known = [cells for cells in fitting if _wavelength_factor(cells[0]) is not None]
    if known:
        names = [_PER_CENT.sub("", name).strip() or str(number) for number, name in enumerate(known[0][1:], 1)]
        per_cent = [bool(_PER_CENT.search(name)) for name in known[0][1:]]
        if len(set(names)) < len(names) or NM in names:
            raise InputError(f"{place} has header {list(known[0])}; allowed: each name once; rename a column")
        if any(per_cent):
            shown = ", ".join(name for name, is_so in zip(known[0][1:], per_cent, strict=True) if is_so)
            warnings.warn(f"{place}: {shown}: per cent by the header, divided by 100", stacklevel=4)
        factors = [_wavelength_factor(known[0][0]) or 1.0, *(0.01 if is_so else 1.0 for is_so in per_cent)]
        return [NM, *names], np.array(factors)
    named = [cells for cells in fitting if not any(_number(cell, None) is not None for cell in cells[1:])]
    miscounted = [cells for cells in splits if len(cells) > 1 and _wavelength_factor(cells[0]) is not None]
    if not comment and (named or miscounted):
        header = list((named or miscounted)[0])
        raise InputError(
            f"{place} has header {header} over {columns} columns; allowed: {NM} (or wavelength, lambda, nm, with a "
            "unit of length) and one name a column; correct it, or put # before a line that is no header"
        )
    return [NM, *(str(number) for number in range(1, columns))], np.ones(columns)


def _wavelength_factor(name: str) -> float | None:
    """Return the nanometres per unit of a column of wavelengths, by its name; None for any other column."""
    letters = _NOT_LETTERS.sub("", name.lower())
    if letters in ("nm", "um", "µm", "μm"):
        return LENGTHS_NM[letters]
    word = next((word for word in _WORDS if letters.startswith(word)), None)
    if word is None:
        return None
    unit = letters[len(word) :].removeprefix("in") if letters[len(word) :] != "in" else "in"
    return LENGTHS_NM.get(unit or "nm")


# IES TM-27-14


def _of_tm27(text: str, what: str, place: str) -> Floats:
    """Return the wavelengths and values of a ``.spdx`` file (IES TM-27), which names its quantity."""
    found: list[tuple[str, str]] = []
    path: list[str] = []
    said: list[str] = []

    def begin(name: str, attributes: dict[str, str]) -> None:
        path.append(name.rpartition(":")[2])
        said.clear()
        if path[-1] == "SpectralData":
            found.append(("wavelength", attributes.get("wavelength", "")))

    def end(_: str) -> None:
        if path[-2:-1] == ["SpectralDistribution"]:
            found.append((path[-1], "".join(said).strip()))
        path.pop()

    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{place}: it declares a document type; allowed: IES TM-27 without one; take it out")
    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = begin, end, said.append
    with read_errors(f"{place} is no XML", "give an IES TM-27 file, or a table", (expat.ExpatError, ValueError)):
        parser.Parse(re.sub(r"^\s*<\?xml[^>]*\?>", "", text), True)
    quantity = next((value for name, value in found if name == "SpectralQuantity"), "")
    if quantity not in _QUANTITIES[what]:
        allowed = ", ".join(_QUANTITIES[what])
        raise InputError(f"{place}: SpectralQuantity {quantity!r} is not allowed; give one of {allowed}; convert it")
    known = ("wavelength", "SpectralData", "SpectralQuantity", *_WITHOUT_EFFECT)
    if other := next((name for name, _ in found if name not in known), ""):
        raise InputError(f"{place}: element {other!r} is unknown and may change values; take it out")
    columns = [[_number(x, None) for key, x in found if key == name] for name in ("wavelength", "SpectralData")]
    if (
        len({len(column) for column in columns}) > 1
        or len(columns[0]) < 2
        or not all(x is not None and isfinite(x) for column in columns for x in column)
    ):
        raise InputError(f"{place}: SpectralData needs a wavelength in nm and a number, twice or more; correct them")
    return np.array(columns, dtype=np.float64).T
