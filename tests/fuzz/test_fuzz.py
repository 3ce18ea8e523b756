"""Changed files never harm: what was found stays found, a few new inputs every time, and a fuzzer that notices."""

import os
import pickle
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

FUZZ = Path(__file__).parent
FINDINGS = sorted((FUZZ / "findings").iterdir())
QUICK = 20  # inputs of each target in `make test`
NAMES = (
    *("exr", "mat", "dng", "tiff", "photograph", "noise_profile", "study", "sensor", "report", "library"),
    *("cube", "photo", "lamp", "curves", "scene", "cache", "prior", "ledger", "wheel"),
)


@pytest.fixture(scope="module")
def fuzz() -> Iterator[Any]:
    """Modules beside this one, which are no package."""
    pytest.importorskip("rawpy", reason="rodcone[photographs] (LibRaw) is not installed")
    sys.path.insert(0, str(FUZZ))
    import mutate
    import targets
    import worker

    yield SimpleNamespace(mutate=mutate, targets=targets, worker=worker)
    sys.path.remove(str(FUZZ))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "place" / "in").mkdir(parents=True)
    return tmp_path / "place" / "in"


def test_every_reader_is_a_target(fuzz: Any) -> None:
    assert tuple(fuzz.targets.TARGETS) == NAMES


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", NAMES)
def test_valid_files_are_read_and_changed_ones_refused_or_read(name: str, fuzz: Any, folder: Path) -> None:
    target = fuzz.targets.TARGETS[name]
    samples = target.samples()
    for sample in samples:
        told, words = fuzz.worker.judge(target, sample, folder)
        assert told in ("accepted", "slow", "memory"), words  # what is loaded at first use takes time and memory
    seen = set()
    for number in range(QUICK):
        made = fuzz.worker.input_files(target, samples, name, 2, number)
        assert made == fuzz.worker.input_files(target, samples, name, 2, number)  # a seed and a number name an input
        told, words = fuzz.worker.judge(target, made, folder)
        assert told in ("accepted", "refused"), words
        seen.add(told)
    assert seen & ({"refused"} if name != "noise_profile" else {"accepted"})  # which tells by None that there is none


@pytest.mark.sample(4)
@pytest.mark.parametrize("found", FINDINGS, ids=lambda path: path.name)
def test_what_was_found_once_is_refused_or_read(found: Path, fuzz: Any, folder: Path) -> None:
    target = fuzz.targets.TARGETS[found.name.split("-")[0]]
    first = next(iter(target.samples()[0]))
    held = {path.name: path.read_bytes() for path in sorted(found.iterdir(), key=lambda path: path.name != first)}
    told, words = fuzz.worker.judge(target, held, folder)
    assert told in ("accepted", "refused"), words


@pytest.mark.slow
def test_a_minute_of_new_inputs_finds_nothing(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(FUZZ / "run.py"), "--seconds", "60", "--seed", "3", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    told = [path.read_text("utf-8") for path in tmp_path.glob("findings/*/told.txt")]
    assert done.returncode == 0, f"{done.stdout}{done.stderr}{told}"
    print(done.stdout)


def _takes_memory(_: Path) -> None:
    bytearray(400 << 20)


def _takes_time(_: Path) -> None:
    end = time.process_time() + 0.3
    while time.process_time() < end:
        pass


def _writes_natively(path: Path) -> None:
    with closing(sqlite3.connect(path.parent.parent / "beside")) as base:  # no word of it reaches Python
        base.execute("CREATE TABLE a (b)")


def _never_ends(path: Path) -> None:
    _never_ends(path)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "reads": ("accepted", lambda path: path.read_bytes()),
    "raises": ("KeyError", lambda path: {}[path]),
    "never ends": ("RecursionError", _never_ends),
    "takes memory": ("memory", _takes_memory),
    "takes time": ("slow", _takes_time),
    "writes": ("OutsideError", lambda path: (path.parent.parent / "beside").write_text("x")),
    "removes": ("OutsideError", lambda path: path.parent.parent.rmdir()),
    "writes natively": ("outside", _writes_natively),
    "unpickles": ("OutsideError", lambda path: pickle.loads(pickle.dumps(Path))),
    "runs a program": ("OutsideError", lambda path: os.system("true")),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize(("told", "read"), READERS.values(), ids=READERS)
def test_a_reader_that_does_harm_is_noticed(
    told: str, read: Callable[[Path], object], fuzz: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sys.addaudithook(fuzz.worker._audit)  # which listens while a reader is at work
    monkeypatch.setattr(fuzz.worker, "MOST_CPU_S", 0.1)
    fuzz.worker._reset_peak()
    seen, _ = fuzz.worker.judge(fuzz.targets.Target(list, {}, read), {"a.x": b"abc"}, folder)
    assert seen == told


PLANTED = """
import os, sys, time
sys.path.insert(0, {fuzz!r})
import run, targets
from mutate import any_bytes
def planted(harm):
    return targets.Target(lambda: [{{"a.x": b"abcdefgh"}}], {{".x": any_bytes}}, harm)
targets.TARGETS.clear()
targets.TARGETS["dies"] = planted(lambda path: b"abc" in path.read_bytes() or os.abort())
targets.TARGETS["hangs"] = planted(lambda path: b"abc" in path.read_bytes() or time.sleep(60))
run.START, run.HANGS_S = "fork", 1.0
sys.argv[1:] = ["--seconds", "3", "--out", {out!r}]
sys.exit(run.main())
"""


@pytest.mark.thorough
def test_a_reader_that_ends_or_stops_its_process_is_noticed_and_the_rest_goes_on(tmp_path: Path) -> None:
    code = PLANTED.format(fuzz=str(FUZZ), out=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=600)
    found = {path.name.rsplit("-", 2)[0] for path in (tmp_path / "findings").iterdir()}
    assert found == {"dies-died-6", "hangs-hangs"}, done.stderr
    assert done.returncode == 1
    for path in (tmp_path / "findings").iterdir():
        assert b"abc" not in (path / "a.x").read_bytes()  # the very input that it died of
