"""The ledger of a sweep: an SQLite file with a row a cell. A row stands whole or not at all, whatever ends the run."""

import errno
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from functools import cache, partial
from pathlib import Path, PurePath
from typing import Any, get_type_hints

from render.errors import InputError
from studies.cell_run import Row

VERSION = 2  # of the tables; raise it with any change to them
APPLICATION_ID = 0x726F6463  # "rodc": tells this file from other SQLite files
FILE = "ledger.sqlite"
_DAMAGED = (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_ERROR, sqlite3.SQLITE_TOOBIG)
_WAIT_S = 30.0  # for another process that writes: a row takes milliseconds
_TYPES: dict[Any, str] = {str: "TEXT NOT NULL", int: "INTEGER NOT NULL", float: "REAL NOT NULL"}
_OPTIONAL: dict[Any, str] = {float | None: "REAL", int | None: "INTEGER"}
_HINTS = get_type_hints(Row)
COLUMNS = tuple(field.name for field in fields(Row))
_CREATE = (
    "CREATE TABLE cells ("
    + ", ".join(
        f"{name} {(_TYPES | _OPTIONAL)[_HINTS[name]]}" + (" PRIMARY KEY" if name == "key" else "") for name in COLUMNS
    )
    + ") STRICT",
    # What the last run asked for, in the study's order; the cells of earlier ones stay in `cells`.
    "CREATE TABLE wanted (place INTEGER PRIMARY KEY, key TEXT NOT NULL) STRICT",
    "CREATE TABLE renders (request TEXT PRIMARY KEY, content TEXT NOT NULL, spp INTEGER NOT NULL, "
    "bands INTEGER NOT NULL, seconds REAL NOT NULL) STRICT",
    "CREATE TABLE runs (started TEXT NOT NULL, host TEXT NOT NULL, study TEXT NOT NULL, environment TEXT NOT NULL) "
    "STRICT",
)


@dataclass(frozen=True)
class RenderRecord:
    """A render as the ledger knows it: hash of its content, samples a pixel, bands, and the seconds that it took."""

    content: str
    spp: int
    bands: int
    seconds: float


@contextmanager
def open_ledger(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the ledger of a folder, or make it.

    Raises
    ------
    InputError
        For a file that is no ledger, or one of another version.
    OSError
        Where the file or the disk can't be written; it names the path.
    """
    path = folder / FILE
    with _told(path):
        base = sqlite3.connect(path, timeout=_WAIT_S, isolation_level=None)
        try:
            _distrust(base)
            _prepare(base, path)
            yield base
        finally:
            base.close()


@contextmanager
def read_ledger(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the ledger of a folder to read from it alone; a sweep may go on writing to it.

    Raises
    ------
    InputError
        For a file that is no ledger, one of another version, or a damaged one.
    OSError
        Where it can't be read.
    """
    path = folder / FILE
    # Beside what can't be written no log can be, which a reader otherwise looks into; and no other process writes.
    still = not os.access(folder, os.W_OK) and not path.with_name(f"{FILE}-wal").exists()
    with _told(path):
        address = f"{path.resolve().as_uri()}?mode=ro{'&immutable=1' if still else ''}"
        base = sqlite3.connect(address, timeout=_WAIT_S, isolation_level=None, uri=True)
        try:
            _distrust(base)
            found = base.execute("PRAGMA quick_check(1)").fetchone()[0] if _has_tables(base, path) else "it is empty"
            if found != "ok":
                raise InputError(f"{path}: it is no whole ledger ({found}); run the sweep again in another folder")
            yield base
        finally:
            base.close()


def _distrust(base: sqlite3.Connection) -> None:
    """Read a file as SQLite advises for one from elsewhere (sqlite.org/security.html), and any bytes as text."""
    base.execute("PRAGMA trusted_schema = OFF")
    base.execute("PRAGMA cell_size_check = ON")
    base.execute("PRAGMA mmap_size = 0")
    base.text_factory = partial(str, encoding="utf-8", errors="replace")


def _prepare(base: sqlite3.Connection, path: Path) -> None:
    """Check the version, or make the tables, write ahead: readers don't wait, a killed writer leaves no half."""
    if not _has_tables(base, path):
        base.execute("BEGIN IMMEDIATE")  # of two sweeps that start at once one makes the tables
        if not _has_tables(base, path):
            for statement in _CREATE:
                base.execute(statement)
            base.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            base.execute(f"PRAGMA user_version = {VERSION}")
        base.execute("COMMIT")
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA synchronous = NORMAL")


def _has_tables(base: sqlite3.Connection, path: Path) -> bool:
    """Whether a ledger of this version is there; `InputError` for anything else that is."""
    tables = base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    version, owner = (base.execute(f"PRAGMA {name}").fetchone()[0] for name in ("user_version", "application_id"))
    if tables and owner != APPLICATION_ID:
        raise InputError(f"{path}: it is no ledger of rodcone; allowed: one, or none; choose another folder with --out")
    if tables and version != VERSION:
        raise InputError(
            f"{path}: it has version {version}, this rodcone reads {VERSION}; allowed: that version; sweep again into "
            "another folder with --out, or export this one with the rodcone that wrote it"
        )
    if tables and {sql for (sql,) in base.execute("SELECT sql FROM sqlite_master WHERE sql NOT NULL")} != {*_CREATE}:
        raise InputError(
            f"{path}: its tables are not a ledger's; allowed: no other tables, views or triggers; remove it"
        )
    return bool(tables)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn SQLite's errors into those that the command line tells in one line."""
    try:
        yield
    except UnicodeDecodeError as error:  # of an error that quotes the file
        raise InputError(f"{path}: it is no ledger (its names are no text); move it away") from error
    except sqlite3.DatabaseError as error:
        code = getattr(error, "sqlite_errorcode", None)
        if code is None:  # a fault of ours, not of the file's
            raise
        if code & 0xFF in _DAMAGED:
            raise InputError(f"{path}: it is no ledger ({error}); move it away, or choose another folder") from error
        number = errno.ENOSPC if code == sqlite3.SQLITE_FULL else errno.EIO
        raise OSError(number, str(error), str(path)) from error


def add(base: sqlite3.Connection, row: Row) -> None:
    """Add a row, at once and whole; one of the same key is replaced."""
    marks = ", ".join("?" * len(COLUMNS))
    base.execute(f"INSERT OR REPLACE INTO cells ({', '.join(COLUMNS)}) VALUES ({marks})", astuple(row))


def done(base: sqlite3.Connection, pictures: Path) -> set[str]:
    """Keys of the cells that have a row, and pictures that aren't empty: a power cut may have taken these."""
    rows = base.execute("SELECT key, picture, truth FROM cells")
    standing = cache(lambda name: _stands(pictures / name))  # many cells share a truth
    return {key for key, picture, truth in rows if standing(picture) and standing(truth)}


def rows(base: sqlite3.Connection, everything: bool = False) -> list[Row]:
    """Rows of the cells that the last run asked for, in the study's order; with `everything` all that there are."""
    columns = ", ".join(f"cells.{name}" for name in COLUMNS)
    chosen = (
        f"SELECT {columns} FROM cells ORDER BY key"
        if everything
        else f"SELECT {columns} FROM wanted JOIN cells USING (key) ORDER BY place"
    )
    found = [Row(*values) for values in base.execute(chosen)]
    for picture in (PurePath(name) for row in found for name in (row.picture, row.truth)):
        if picture.is_absolute() or ".." in picture.parts:
            raise InputError(f"ledger: picture {str(picture)!r} lies outside the folder of pictures; remove that row")
    return found


def last_run(base: sqlite3.Connection) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Study and environment of the last run, as `note_run` had them; None before there is one."""
    found = base.execute("SELECT study, environment FROM runs ORDER BY rowid DESC LIMIT 1").fetchone()
    return None if found is None else (json.loads(found[0]), json.loads(found[1]))


def want(base: sqlite3.Connection, keys: Iterable[str]) -> None:
    """Note which cells the run under way asks for, in place of what the last one did."""
    base.execute("BEGIN IMMEDIATE")
    base.execute("DELETE FROM wanted")
    base.executemany("INSERT INTO wanted (key) VALUES (?)", ((key,) for key in keys))
    base.execute("COMMIT")


def note_run(base: sqlite3.Connection, started: str, host: str, study: str, environment: dict[str, Any]) -> None:
    """Note a run: when, where, of what, with which versions."""
    base.execute("INSERT INTO runs VALUES (?, ?, ?, ?)", (started, host, study, json.dumps(environment)))


def render_record(base: sqlite3.Connection, request: str) -> RenderRecord | None:
    """What was found about a render that was asked for before."""
    found = base.execute("SELECT content, spp, bands, seconds FROM renders WHERE request = ?", (request,))
    values = found.fetchone()
    return None if values is None else RenderRecord(*values)


def note_render(base: sqlite3.Connection, request: str, record: RenderRecord) -> None:
    """Keep what was found about a render."""
    base.execute("INSERT OR REPLACE INTO renders VALUES (?, ?, ?, ?, ?)", (request, *astuple(record)))


def _stands(path: Path) -> bool:
    try:
        return path.stat().st_size > 0
    except OSError:
        return False
