"""What is read back is what was written: arrays, pictures and ledgers damaged in many ways, and runs ended anywhere."""

import random
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import sweep_sample as SAMPLE
from command_line import call
from refusal import refusal

from rodcone.errors import InputError
from studies.pages.report import render_report
from studies.pages.report_sweep import sweep_report
from studies.study.study import SceneChoice
from studies.sweep.database import FILE
from studies.sweep.export import read_rows
from studies.sweep.row import Row
from studies.sweep.run_cell import run_cell
from studies.sweep.stored import is_whole, keep, keep_facts, read_facts, read_whole


def test_a_kept_file_has_its_contents_name_and_any_other_content_is_told(tmp_path: Path) -> None:
    name = keep(tmp_path, b"abc", ".bin")
    assert name == "ba/ba7816bf8f01cfea414140de5dae2223.bin", "SHA-256 of abc, FIPS 180-4's example, its first half"
    assert is_whole(tmp_path / name)
    assert read_whole(tmp_path, name) == b"abc"
    for content in (b"", b"a", b"abd", b"abc\0"):
        (tmp_path / name).write_bytes(content)
        assert not is_whole(tmp_path / name)
        refusal(read_whole, tmp_path, name, match="isn't what was written")
    (tmp_path / name).unlink()
    assert not is_whole(tmp_path / name)
    refusal(read_whole, tmp_path, name, match=r"can't be read .*; run rodcone sweep again")
    refusal(read_whole, tmp_path, "../x", match="does not lie in")


def test_facts_that_are_not_what_was_kept_are_none(tmp_path: Path) -> None:
    keep_facts(tmp_path, "a", {"x": 1})
    assert read_facts(tmp_path, "a") == {"x": 1}
    file = tmp_path / "a.json"
    for text in (file.read_text("utf-8").replace("1", "2", 1), "[]", "{", ""):
        file.write_text(text, "utf-8")
        assert read_facts(tmp_path, "a") is None, text
    assert read_facts(tmp_path, "b") is None


def flip(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 0x10
    path.write_bytes(bytes(content))


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["electrons", "errors", "truth"])
def test_a_flipped_bit_in_what_cells_share_is_told_and_made_again(name: str, tmp_path: Path) -> None:
    """In the exponent of the last number: 16 binary orders, which no file format notices."""
    study, out = SAMPLE.small_study(tmp_path), tmp_path / "out"
    SAMPLE.swept(study, out)
    before = SAMPLE.content(out)
    cell = SAMPLE.made_cells(out, study)[0]
    path: Path = getattr(cell.frame, name)
    right = np.load(path).copy()
    flip(path, -1)
    assert not np.array_equal(np.load(path), right)
    refusal(run_cell, cell, match="isn't what was written")
    (out / "pictures" / read_rows(out)[0].picture).unlink()
    assert SAMPLE.swept(study, out).made == 1
    assert SAMPLE.content(out) == before
    assert np.array_equal(np.load(path), right)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Row]]:
    """A sweep's folder, with its study beside it, and its rows."""
    folder: Path = tmp_path_factory.mktemp("whole")
    SAMPLE.picture(folder / "scene.exr")
    text = 'scenes = [{source = "scene.exr", light = "E"}]\nlevels = ["1cd/m2", "25cd/m2"]\nprocessors = ["bayer"]\n'
    (folder / "study.toml").write_text(text + "seeds = [0, 1, 2]\n", "utf-8")
    call(["sweep", folder / "study.toml", "-o", folder / "out", "--workers", "1", "--as-stated"])
    return folder, read_rows(folder / "out")


def header(place: int, content: bytes) -> Callable[[bytes], bytes]:
    return lambda whole: whole[:place] + content + whole[place + len(content) :]


def page(number: int, content: bytes) -> Callable[[bytes], bytes]:
    return header(number * 4096, (content * 4096)[:4096])


def swapped(whole: bytes) -> bytes:
    return whole[:4096] + whole[8192:12288] + whole[4096:8192] + whole[12288:]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda whole: b"",
    "one byte": lambda whole: whole[:1],
    "cut in the header": lambda whole: whole[:50],
    "first page alone": lambda whole: whole[:4096],
    "cut within a page": lambda whole: whole[:-1000],
    "last page gone": lambda whole: whole[:-4096],
    "half": lambda whole: whole[: len(whole) // 2],
    "text": lambda whole: b"notes of mine\n" * 100,
    "zeros": lambda whole: bytes(len(whole)),
    "page size": header(16, b"\x00\x07"),
    "written by a later format": header(18, b"\x09\x09"),
    "number of pages": header(28, b"\x00\x00\xff\xff"),
    "free pages": header(32, b"\x00\x00\x00\x02\x00\x00\x00\x09"),
    "schema's format": header(44, b"\x00\x00\x00\x99"),
    "text encoding": header(56, b"\x00\x00\x00\x02"),
    "schema page zeroed": header(100, bytes(3996)),
    "schema's cells": header(105, b"\xff\xff\xff\xff"),
    "pages swapped": swapped,
    "garbage after the end": lambda whole: whole + b"garbage" * 1000,
    **{f"page {number} zeroed": page(number, b"\0") for number in range(1, 9)},
    **{f"page {number} of ones": page(number, b"\xff") for number in range(1, 9)},
}


def flipped(seed: int) -> Callable[[bytes], bytes]:
    """Some bits at random places, as many as 16 of them."""

    def damage(content: bytes) -> bytes:
        draw, changed = random.Random(seed), bytearray(content)
        for _ in range(2 ** draw.randrange(5)):
            changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
        return bytes(changed)

    return damage


DAMAGES |= {f"bits flipped, seed {seed}": flipped(seed) for seed in (*range(24), 58)}  # 58: a key in its table alone


def told_in_one_line(arguments: list[str]) -> int:
    """Exit code of a command that says what is wrong, if anything, in one line."""
    code, _, err = call(arguments)
    assert code in (0, 2)
    assert code == 0 or (err.count("\n") == 1 and err.startswith("rodcone: ")), err
    return code


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_ledger_is_one_line_and_no_row_is_another(name, whole, tmp_path):
    folder, right = whole
    out = tmp_path / "out"
    shutil.copytree(folder / "out", out)
    (out / FILE).write_bytes(DAMAGES[name]((out / FILE).read_bytes()))
    for command in (["report"], ["export", "-o", str(tmp_path / "t.csv"), "--all"]):
        told_in_one_line([command[0], str(out), *command[1:]])
    with suppress(InputError):
        assert [row for row in read_rows(out, everything=True) if row not in right] == []
    command = ["sweep", str(folder / "study.toml"), "-o", str(out), "--workers", "1", "--as-stated"]
    if told_in_one_line(command) == 0:
        assert [row.key for row in read_rows(out)] == [row.key for row in right], "made again where it had to be"


@pytest.mark.thorough
def test_a_sweep_of_two_scenes_ended_in_its_first_gives_a_report_that_counts_all_cells(tmp_path: Path) -> None:
    """After its first cell, of two seeds: no figure has all of its seeds, nor the second scene a picture's size."""
    SAMPLE.picture(tmp_path / "other.exr", (24, 16))
    scenes = (SceneChoice(str(tmp_path / "scene.exr"), "E"), SceneChoice(str(tmp_path / "other.exr"), "E"))
    study, out = replace(SAMPLE.small_study(tmp_path), scenes=scenes), tmp_path / "out"
    for made in range(1, 8):
        with pytest.raises(KeyboardInterrupt):
            SAMPLE.swept(study, out, partial(SAMPLE.ended_after, 1))
        results, pictures = sweep_report(out)
        assert results.notes == (f"{8 - made} of 8 cells are not made yet: rodcone sweep goes on with them.",)
        assert render_report(results, pictures).lstrip().startswith("<!doctype html>")
        assert len(read_rows(out)) == made
    assert SAMPLE.swept(study, out).made == 1
    assert sweep_report(out)[0].notes == ()
