"""The results database of a sweep: an SQLite file with a row for each cell. A row is written whole or not at all.

Each row ends in its digest, because SQLite doesn't notice if a number in the file was changed by accident.
"""

import errno
import json
import os
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, fields
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, get_type_hints

from cattrs import structure

from rodcone.digests import digest
from rodcone.errors import InputError, one_line
from studies.sweep.cells import RenderRecord
from studies.sweep.row import AXES, Row
from studies.sweep.stored import is_whole

VERSION = 8  # version of the tables; raise it with any change to them
APPLICATION_ID = 0x726F6463  # "rodc", by which this file differs from other SQLite files
FILE = "ledger.sqlite"
_DAMAGED = (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_ERROR, sqlite3.SQLITE_TOOBIG)
_WAIT_S = 30.0  # time for another process to finish writing; a row takes milliseconds
_TYPES: dict[Any, str] = {
    str: "TEXT NOT NULL",
    int: "INTEGER NOT NULL",
    float: "REAL NOT NULL",
    float | None: "REAL",
    int | None: "INTEGER",
}
_HINTS = get_type_hints(Row)
COLUMNS = tuple(field.name for field in fields(Row))
_COLUMNS = ", ".join(f"cells.{name}" for name in (*COLUMNS, "digest"))
_REAL = {name for name in COLUMNS if _HINTS[name] in (float, float | None)}
_TEXT = partial(str, encoding="utf-8", errors="replace")  # changed bytes don't stop the reader; the digest shows them
_CREATE = (
    "CREATE TABLE cells ("
    + ", ".join(f"{name} {_TYPES[_HINTS[name]]}" + (" PRIMARY KEY" if name == "key" else "") for name in COLUMNS)
    + ", digest TEXT NOT NULL) STRICT",
    # The cells that the last run asks for, in the study's order. The key of a cell is NULL until its scene is rendered.
    # Cells of earlier runs stay in `cells`.
    "CREATE TABLE wanted (place INTEGER PRIMARY KEY, key TEXT) STRICT",
    "CREATE TABLE renders (request TEXT PRIMARY KEY, record TEXT NOT NULL, digest TEXT NOT NULL) STRICT",
    "CREATE TABLE runs (started TEXT NOT NULL, host TEXT NOT NULL, study TEXT NOT NULL, stages TEXT NOT NULL, "
    "digest TEXT NOT NULL) STRICT",
)


@dataclass(frozen=True)
class LastRun:
    """The last run in a folder: its study, its seconds per stage, the number of cells that it asks for, and their rows
    as far as they are made. `content` is a hash of all of this except the seconds.
    """

    study: dict[str, Any]
    stages: dict[str, float]
    wanted: int
    rows: list[Row]
    content: str


@contextmanager
def open_results(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the results database of a folder, or make it.

    Raises
    ------
    InputError
        For a file that is no results database, or one of another version.
    OSError
        Where the file or the disk can't be written; it names the path.
    """
    path = folder / FILE
    with _connected(path, "mode=rwc") as base:
        _prepare(base, path)
        _check_whole(base, path)
        yield base


@contextmanager
def read_results(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the results database of a folder for reading only; a sweep may go on writing to it.

    Raises
    ------
    InputError
        For a file that is no results database, one of another version, or a damaged one.
    OSError
        Where it can't be read.
    """
    path = folder / FILE
    if not path.is_file():
        raise InputError(f"{folder}: it holds no {FILE}; allowed: the folder of a sweep; run rodcone sweep first")
    # SQLite also reads the write-ahead log. If there is none it makes one, which only a connection with the right to
    # write removes. If the folder can't be written and has no log, nobody writes to it, and the file is all there is.
    log = path.with_name(f"{FILE}-wal")
    options = "mode=rw" if os.access(folder, os.W_OK) else "mode=ro" if log.exists() else "mode=ro&immutable=1"
    with _connected(path, options) as base:
        base.execute("PRAGMA query_only = ON")
        if not _has_tables(base, path):
            raise InputError(f"{path}: it is no results database (it is empty); run the sweep again in another folder")
        _check_whole(base, path)
        yield base


@contextmanager
def _connected(path: Path, options: str) -> Iterator[sqlite3.Connection]:
    """Connect, and turn SQLite's errors into those that the command line prints as one line."""
    address = f"{path.resolve().as_uri()}?{options}"
    try:
        with closing(sqlite3.connect(address, timeout=_WAIT_S, isolation_level=None, uri=True)) as base:
            base.text_factory = _TEXT
            yield base
    except UnicodeDecodeError as error:  # SQLite's message quotes the damaged file
        raise InputError(f"{path}: it is no results database (its names are no text); move it away") from error
    except sqlite3.DatabaseError as error:
        code = getattr(error, "sqlite_errorcode", None)
        if code is None:  # the error is in our SQL statement, not in the file
            raise
        if code & 0xFF in _DAMAGED:
            raise InputError(
                f"{path}: it is no results database ({error}); move it away, or choose another folder"
            ) from error
        number = errno.ENOSPC if code == sqlite3.SQLITE_FULL else errno.EIO
        raise OSError(number, str(error), str(path)) from error


def _check_whole(base: sqlite3.Connection, path: Path) -> None:
    verdict = base.execute("PRAGMA integrity_check(1)").fetchone()[0]
    if verdict != "ok":
        raise InputError(f"{path}: it is damaged ({one_line(verdict)}); run the sweep again in another folder")


def _prepare(base: sqlite3.Connection, path: Path) -> None:
    """Check the version of the tables, or make them, and turn on write-ahead logging.

    With that log readers don't wait, and a writer that is killed leaves no half-written row.
    """
    if not _has_tables(base, path):
        base.execute("BEGIN IMMEDIATE")  # so that of two sweeps only one makes the tables
        if not _has_tables(base, path):
            for statement in _CREATE:
                base.execute(statement)
            base.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            base.execute(f"PRAGMA user_version = {VERSION}")
        base.execute("COMMIT")
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA synchronous = NORMAL")


def _has_tables(base: sqlite3.Connection, path: Path) -> bool:
    """Return whether the file holds tables of this version; raise `InputError` if it holds any other tables."""
    tables = base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    version, owner = (base.execute(f"PRAGMA {name}").fetchone()[0] for name in ("user_version", "application_id"))
    if tables and owner != APPLICATION_ID:
        raise InputError(f"{path}: it is no results database of rodcone; choose another folder with --out")
    if tables and version != VERSION:
        raise InputError(
            f"{path}: it has version {version}, this rodcone reads {VERSION}; allowed: that version; sweep again into "
            "another folder with --out, or export this one with the rodcone that wrote it"
        )
    return bool(tables)


def add(base: sqlite3.Connection, row: Row) -> None:
    """Add a row at once, whole or not at all; it replaces a row with the same key."""
    values = [float(value) if column in _REAL and value is not None else value for column, value in vars(row).items()]
    _put(base, "cells", values)


def done(base: sqlite3.Connection, pictures: Path, keys: Iterable[str]) -> set[str]:
    """Return which of these cells have an undamaged row and undamaged pictures; a power cut may damage either."""
    one = f"SELECT {_COLUMNS} FROM cells WHERE key = ?"
    sound = (Row(*values[:-1]) for key in keys for values in base.execute(one, (key,)) if _is_sound(values))
    return {row.key for row in sound if is_whole(pictures / row.picture) and is_whole(pictures / row.truth)}


def rows(base: sqlite3.Connection, everything: bool = False) -> Iterator[Row]:
    """Yield the rows of the cells that the last run asked for, in the study's order; with `everything` all rows.

    Raises
    ------
    InputError
        For a row that has changed since it was written.
    """
    chosen = (
        f"SELECT {_COLUMNS} FROM cells ORDER BY key"
        if everything
        else f"SELECT {_COLUMNS} FROM wanted JOIN cells USING (key) ORDER BY place"
    )
    for values in base.execute(chosen):
        yield Row(*_require_sound(values, f"row {values[0]!r}"))


def last_run(folder: Path) -> LastRun:
    """Read study and rows of a folder's last run, and the seconds per stage, summed over all runs of this study.

    Raises
    ------
    InputError
        As `read_results`, for a row that has changed since it was written, and if the last run has made no cell yet.
    OSError
        Where the file can't be read.
    """
    with read_results(folder) as base:
        runs = [_require_sound(values, "a run") for values in base.execute("SELECT * FROM runs ORDER BY rowid")]
        cells = list(rows(base))
        wanted = base.execute("SELECT count(*) FROM wanted").fetchone()[0]
        hashed = content(base)
    if not runs or not cells:
        raise InputError(f"{folder}: its last run has made no cell yet; run rodcone sweep, which goes on")
    study = runs[-1][2]
    seconds = Counter[str]()
    for stages in (json.loads(run[3]) for run in runs if run[2] == study):
        seconds.update(stages)
    return LastRun(json.loads(study), dict(seconds), wanted, cells, hashed)


def content(base: sqlite3.Connection) -> str:
    """Return a hash of what `last_run` reads, except the seconds of the stages."""
    study = base.execute("SELECT study FROM runs ORDER BY rowid DESC LIMIT 1").fetchone()
    cells = base.execute("SELECT place, wanted.key, digest FROM wanted LEFT JOIN cells USING (key) ORDER BY place")
    return digest([study, cells.fetchall()])


def want(base: sqlite3.Connection, keys: Iterable[str | None]) -> None:
    """Replace the list of cells that a run asks for by this run's, as keys; a key that isn't known yet is None."""
    base.execute("BEGIN IMMEDIATE")
    base.execute("DELETE FROM wanted")
    base.executemany("INSERT INTO wanted VALUES (?, ?)", enumerate(keys))
    base.execute("COMMIT")


def note_keys(base: sqlite3.Connection, first: int, keys: Iterable[str]) -> None:
    """Store the keys of a scene's cells once it is rendered; `first` is the place of the first cell in the study."""
    base.execute("BEGIN IMMEDIATE")
    base.executemany("UPDATE wanted SET key = ? WHERE place = ?", ((key, at) for at, key in enumerate(keys, first)))
    base.execute("COMMIT")


def noisiest(base: sqlite3.Connection) -> list[Row]:
    """Return for each scene of the last run the row with the largest `mc_share`, in the study's order.

    Of several rows with the same share the first one counts.

    Raises
    ------
    InputError
        If one of these rows has changed since it was written.
    """
    ranked = (
        "SELECT key, row_number() OVER (PARTITION BY scene ORDER BY mc_share DESC, place) AS rank, "
        "min(place) OVER (PARTITION BY scene) AS first FROM wanted JOIN cells USING (key)"
    )
    worst = f"SELECT {_COLUMNS} FROM cells JOIN ({ranked}) USING (key) WHERE rank = 1 ORDER BY first"
    return [Row(*_require_sound(values, f"row {values[0]!r}")) for values in base.execute(worst)]


def made_with(base: sqlite3.Connection) -> dict[str, int]:
    """Count the rows of the last run by the versions that made them."""
    return dict(base.execute("SELECT versions, count(*) FROM wanted JOIN cells USING (key) GROUP BY versions"))


def forget_old(base: sqlite3.Connection) -> None:
    """Remove earlier rows of cells that this run has made anew with other versions or with a render in another variant.

    The versions include the backend's. A row that differs only in its engines is kept, because it belongs to a run with
    another plan.
    """
    others = f"SELECT {_COLUMNS} FROM cells WHERE key NOT IN (SELECT key FROM wanted WHERE key IS NOT NULL)"
    if base.execute(f"{others} LIMIT 1").fetchone() is None:
        return
    place = attrgetter(*AXES, "seed")
    new = {place(row): (row.variant, row.versions) for row in rows(base)}
    sound = (Row(*values[:-1]) for values in base.execute(others) if _is_sound(values))
    old = [(row.key,) for row in sound if new.get(place(row), made := (row.variant, row.versions)) != made]
    base.executemany("DELETE FROM cells WHERE key = ?", old)


def note_run(base: sqlite3.Connection, started: str, host: str, study: str) -> int:
    """Note when and where a run of a study began; return its number."""
    return _put(base, "runs", [started, host, study, "{}"])


def note_stages(base: sqlite3.Connection, run: int, stages: Mapping[str, float]) -> None:
    """Note the seconds that a run has taken so far, by stage."""
    values = base.execute("SELECT started, host, study FROM runs WHERE rowid = ?", (run,)).fetchone()
    text = json.dumps(dict(stages))
    base.execute("UPDATE runs SET stages = ?, digest = ? WHERE rowid = ?", (text, digest([*values, text]), run))


def render_record(base: sqlite3.Connection, request: str) -> RenderRecord | None:
    """Return the stored record of a render by the hash of its request; None if it is missing or damaged."""
    values = base.execute("SELECT * FROM renders WHERE request = ?", (request,)).fetchone()
    if values is None or not _is_sound(values):
        return None
    return structure(json.loads(values[1]), RenderRecord)


def note_render(base: sqlite3.Connection, request: str, record: RenderRecord) -> None:
    """Store the record of a render under the hash of its request."""
    _put(base, "renders", [request, json.dumps(asdict(record))])


def _put(base: sqlite3.Connection, table: str, values: list[Any]) -> int:
    marks = ", ".join("?" * (len(values) + 1))
    cursor = base.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", [*values, digest(values)])
    return int(cursor.lastrowid or 0)


def _is_sound(values: tuple[Any, ...]) -> bool:
    """Return whether a row ends in the digest of the values before it."""
    return bool(digest(values[:-1]) == values[-1])


def _require_sound(values: tuple[Any, ...], what: str) -> tuple[Any, ...]:
    if not _is_sound(values):
        raise InputError(f"results: {what} isn't what was written (damaged); run rodcone sweep again, which makes it")
    return values[:-1]
