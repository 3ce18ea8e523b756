"""The results database: whole rows, a version that is checked, and one line for a full disk or a foreign file."""

import errno
import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from refusal import refusal
from sweep_sample import ROW

from rodcone.errors import InputError
from studies.study.render_facts import RenderFacts
from studies.sweep.cells import RenderRecord
from studies.sweep.database import (
    FILE,
    VERSION,
    LastRun,
    add,
    content,
    done,
    forget_old,
    last_run,
    made_with,
    noisiest,
    note_keys,
    note_render,
    note_run,
    note_stages,
    open_results,
    read_results,
    render_record,
    rows,
    want,
)
from studies.sweep.stored import keep


def test_rows_outlive_the_connection_and_a_key_stands_once(tmp_path: Path) -> None:
    with open_results(tmp_path) as base:
        add(base, ROW)
        add(base, replace(ROW, ssim=0.5))
        add(base, replace(ROW, key="1"))
    with open_results(tmp_path) as base:
        assert list(rows(base, everything=True)) == [replace(ROW, ssim=0.5), replace(ROW, key="1")]
        assert list(rows(base)) == []  # none were asked for


@pytest.mark.parametrize("column", ["picture", "truth"])
def test_a_row_counts_as_done_only_with_whole_pictures(column: str, tmp_path: Path) -> None:
    """Content cut to a byte, to none, or of one bit more is another file's; each is named after what was written."""
    kept = {name: keep(tmp_path, f"a picture {name}".encode(), ".png") for name in ("whole", "cut", "empty", "flipped")}
    (tmp_path / kept["cut"]).write_bytes(b"a")
    (tmp_path / kept["empty"]).write_bytes(b"")
    (tmp_path / kept["flipped"]).write_bytes(b"a picture glipped")
    with open_results(tmp_path) as base:
        for name, place in {**kept, "gone": "00/00.png", "unasked": kept["whole"]}.items():
            files = {"picture": kept["whole"], "truth": kept["whole"]} | {column: place}
            add(base, replace(ROW, key=name, **files))
        assert done(base, tmp_path, {*kept, "gone"}) == {"whole"}
        base.execute("UPDATE cells SET psnr_db = 39.0 WHERE key = 'whole'")
        assert done(base, tmp_path, {*kept, "gone"}) == set(), "a row that isn't what was written"


def test_what_the_last_run_wants_takes_the_place_of_the_ones_before(tmp_path: Path) -> None:
    with open_results(tmp_path) as base:
        for key in ("a", "b", "c"):
            add(base, replace(ROW, key=key))
        want(base, ["a", "missing", "b"])
        want(base, ["c", "b"])
        assert [row.key for row in rows(base)] == ["c", "b"]
        want(base, ["c", None, None])  # the second scene isn't rendered yet
        assert [row.key for row in rows(base)] == ["c"]
        note_keys(base, 1, ["b", "missing"])
        assert [row.key for row in rows(base)] == ["c", "b"]


def test_the_file_is_named_by_four_letters_in_sqlites_header(tmp_path: Path) -> None:
    """Bytes 60 to 72, SQLite's "Database file format", 1.3: the tables' version, that of VACUUM, the program."""
    with open_results(tmp_path):
        pass
    header = (tmp_path / FILE).read_bytes()[60:72]
    assert (int.from_bytes(header[:4]), header[8:]) == (VERSION, b"rodc")


def test_renders_and_runs_are_noted(tmp_path: Path) -> None:
    facts = RenderFacts("dense", "llvm_ad_spectral", 1.5, 64, "samples", 0.01, None, 20, 390.0, 770.0, 20.0)
    record = RenderRecord("content", facts, 0.02, ("assumed",))
    with open_results(tmp_path) as base:
        assert render_record(base, "request") is None
        note_render(base, "request", replace(record, content="coarser"))
        note_render(base, "request", record)
        assert render_record(base, "request") == record
        base.execute("UPDATE renders SET record = replace(record, '64', '65')")
        assert render_record(base, "request") is None, "it isn't what was written"


def test_the_last_study_comes_with_the_seconds_of_all_its_runs(tmp_path: Path) -> None:
    with open_results(tmp_path) as base:
        add(base, ROW)
        want(base, [ROW.key, None])
        refusal(last_run, tmp_path, match="has made no cell yet")
        for study, seconds in (('{"b": 1}', 10.0), ('{"A": 1}', 1000.0), ('{"a": 1}', 1.0), ('{"a": 1}', 100.0)):
            run = note_run(base, "2026-01-01T00:00:00+00:00", "here", study)
            note_stages(base, run, {"renders": 99.0})
            note_stages(base, run, {"renders": seconds, "other": 0.5})
        note_run(base, "2026-01-01T00:00:00+00:00", "here", '{"a": 1}')  # killed before its first cell
        stages = {"renders": 101.0, "other": 1.0}
        assert last_run(tmp_path) == LastRun({"a": 1}, stages, 2, [ROW], content(base))
        base.execute("UPDATE runs SET stages = replace(stages, '100.0', '900.0')")
        refusal(last_run, tmp_path, match="isn't what was written")


def test_what_is_made_anew_is_forgotten_and_what_was_not_asked_for_stays(tmp_path: Path) -> None:
    other = {"numpy": "2.4.5", "rodcone": "0.1.0+abc"}
    with open_results(tmp_path) as base:
        add(base, replace(ROW, key="new"))
        add(base, replace(ROW, key="old versions", versions=json.dumps(other)))
        add(base, replace(ROW, key="old variant", variant="scalar_spectral"))
        add(base, replace(ROW, key="another plan", readout_engine="llvm"))
        add(base, replace(ROW, key="coarser", spp=1))
        add(base, replace(ROW, key="another seed", seed=1, versions=json.dumps(other)))
        want(base, ["new", None])
        forget_old(base)
        assert [row.key for row in rows(base, everything=True)] == ["another plan", "another seed", "coarser", "new"]


def test_the_noisiest_row_of_each_scene_is_the_first_of_equals_in_the_studys_order(tmp_path: Path) -> None:
    shares = {"b1": 0.1, "b2": 0.4, "b3": 0.4, "a1": 0.2, "a2": 0.05}
    with open_results(tmp_path) as base:
        for key, share in shares.items():
            add(base, replace(ROW, key=key, scene=key[0], mc_share=share, versions=f'{{"rodcone": "{key[1]}"}}'))
        add(base, replace(ROW, key="a9", scene="a", mc_share=0.9))  # of an earlier run
        want(base, [*sorted(shares, reverse=True), None])
        assert [row.key for row in noisiest(base)] == ["b3", "a1"]
        want(base, shares)
        assert [row.key for row in noisiest(base)] == ["b2", "a1"]
        assert made_with(base) == {f'{{"rodcone": "{n}"}}': count for n, count in ((1, 2), (2, 2), (3, 1))}
        base.execute("UPDATE cells SET mc_share = 0.5 WHERE key = 'b1'")
        with pytest.raises(InputError, match="row 'b1' isn't what was written"):
            noisiest(base)


def test_another_version_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    for version, change, words in (
        (VERSION + 1, "user_version", f"it has version {VERSION + 1}, this rodcone reads {VERSION}"),
        (0, "user_version", f"it has version 0, this rodcone reads {VERSION}; allowed: that version; sweep again into"),
        (0, "application_id", "it is no results database of rodcone"),
    ):
        folder = tmp_path / f"{change}{version}"
        folder.mkdir()
        with open_results(folder) as base:
            add(base, ROW)
            base.execute(f"PRAGMA {change} = {version}")
        with pytest.raises(InputError, match=words), open_results(folder):
            pass
        with closing(sqlite3.connect(folder / FILE)) as kept:
            assert kept.execute("SELECT key FROM cells").fetchall() == [(ROW.key,)]


def test_a_file_that_is_no_database_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    for damaged in (b"notes of mine " * 100, b"", b"SQLite format 3\0" + bytes(500)):
        (tmp_path / FILE).write_bytes(damaged)
        with pytest.raises(InputError, match="it is no"), read_results(tmp_path):
            pass
        assert (tmp_path / FILE).read_bytes() == damaged
    (tmp_path / FILE).write_bytes(b"notes of mine " * 100)
    with pytest.raises(InputError, match="it is no results database"), open_results(tmp_path):
        pass
    assert (tmp_path / FILE).read_bytes() == b"notes of mine " * 100


def test_a_full_disk_is_told_as_such_and_the_rows_before_it_stand(tmp_path: Path) -> None:
    kept = 0

    def fill() -> None:
        nonlocal kept
        with open_results(tmp_path) as base:
            pages = base.execute("PRAGMA page_count").fetchone()[0]
            base.execute(f"PRAGMA max_page_count = {pages + 8}")  # SQLite's own "database or disk is full"
            while kept < 1000:
                add(base, replace(ROW, key=f"{kept:04}"))
                kept += 1

    with pytest.raises(OSError, match="full") as told:
        fill()
    assert told.value.errno == errno.ENOSPC
    assert told.value.filename == str(tmp_path / FILE)
    assert 0 < kept < 1000
    with open_results(tmp_path) as base:
        assert [row.key for row in rows(base, everything=True)] == [f"{place:04}" for place in range(kept)]


def test_reading_changes_nothing_and_sees_what_a_sweep_writes_meanwhile(tmp_path: Path) -> None:
    with open_results(tmp_path) as writer:
        add(writer, ROW)
        assert writer.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
        with read_results(tmp_path) as reader:
            assert list(rows(reader, everything=True)) == [ROW]
            add(writer, replace(ROW, key="1"))
            assert len(list(rows(reader, everything=True))) == 2
            with pytest.raises(sqlite3.OperationalError, match="readonly"):
                reader.execute("DELETE FROM cells")
    before = (tmp_path / FILE).read_bytes()
    with read_results(tmp_path) as reader:
        assert len(list(rows(reader, everything=True))) == 2
    assert (tmp_path / FILE).read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == [FILE]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("DROP TABLE cells", "it is no results database"),
        ("UPDATE cells SET picture = '/etc/passwd'", "isn't what was written"),
        ("UPDATE cells SET ssim = -0.125", "row '00ff' isn't what was written"),
    ],
)
def test_what_a_sweep_never_writes_is_refused(change: str, words: str, tmp_path: Path) -> None:
    with open_results(tmp_path) as base:
        add(base, ROW)
        base.execute(change)
    with pytest.raises(InputError, match=words), read_results(tmp_path) as base:
        list(rows(base, everything=True))
