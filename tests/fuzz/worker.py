"""One process that feeds changed files to readers, and notes whatever isn't a result or an `InputError`."""

import logging
import os
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from targets import TARGETS, InputErrorlessRefusal, Sample, Target

from rodcone.errors import MOST_TOLD, InputError

MOST_MIB = 256  # of memory over what the process held before
MOST_CPU_S = 5.0  # of processor time
MORE_ADDRESSES = 8 << 30  # that all inputs together may map: a single huge claim fails at once
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_FORBIDDEN = ("pickle.find_class", "os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect")
_CHANGING = ("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.chmod", "os.truncate")


class OutsideError(Exception):
    """A reader did what reading never needs."""


def input_files(target: Target, samples: Sequence[Sample], name: str, seed: int, number: int) -> dict[str, bytes]:
    """Input `number` of a target: the files of a sample, one of them changed."""
    source = random.Random(f"{seed}:{name}:{number}")
    made = dict(source.choice(samples))
    chosen = source.choice([each for each in made if Path(each).suffix in target.mutators])
    made[chosen] = target.mutators[Path(chosen).suffix](source, made[chosen])
    return made


def judge(target: Target, made: Sample, folder: Path) -> tuple[str, str]:
    """What a reader makes of files: ``accepted``, ``refused``, or a finding, with its words."""
    for name in os.listdir(folder):
        if name not in made:
            (folder / name).unlink()
    for name, content in made.items():
        (folder / name).write_bytes(content)
    before, start = _peak_mib(), time.process_time()
    told, words = "accepted", ""
    try:
        with _guarded(folder, target.in_child):
            target.read(folder / next(iter(made)))
    except InputErrorlessRefusal:
        told = "refused"
    except InputError as error:
        told, words = "refused", str(error)
        if not words.isprintable() or len(words) > MOST_TOLD or not words:
            return "message", repr(words)[:MOST_TOLD]
    except BaseException as error:
        return type(error).__name__, traceback.format_exc()
    seconds, taken = time.process_time() - start, _peak_mib() - before
    if taken > MOST_MIB:
        return "memory", f"{taken:.0f} MiB; {words}"
    if seconds > MOST_CPU_S:
        return "slow", f"{seconds:.1f} s of processor time; {words}"
    if os.listdir(folder.parent) != [folder.name]:
        return "outside", f"{os.listdir(folder.parent)} beside its folder"
    return told, words


_inside: list[str] = []  # folders that may be written to while a reader is at work
_own_programs: list[str] = []  # that it may start


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if not _inside:
        return
    if event in _FORBIDDEN and not (event == "subprocess.Popen" and arguments[0] in _own_programs):
        raise OutsideError(f"{event} {arguments!r:.300}")
    if (event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING) or event in _CHANGING:
        path = os.path.realpath(os.path.join(_folder_of(event, arguments), str(arguments[0])))
        if path != os.devnull and not path.startswith(tuple(_inside)):
            raise OutsideError(f"{event} {arguments!r:.300}")


def _folder_of(event: str, arguments: tuple[Any, ...]) -> str:
    """The folder that a relative path is told from: `os.remove` and `os.rmdir` may name it by an open file."""
    number = arguments[-1] if event in ("os.remove", "os.rmdir") else -1
    return os.readlink(f"/proc/self/fd/{number}") if number >= 0 else ""


@contextmanager
def _guarded(folder: Path, in_child: bool) -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", RuntimeWarning)
        _inside.append(os.path.realpath(folder))
        if in_child:
            _inside.append(os.path.realpath(tempfile.gettempdir()))
            _own_programs.append(sys.executable)
        try:
            yield
        finally:
            _inside.clear()
            _own_programs.clear()


def _reset_peak() -> None:
    """Let the most memory held so far be what is held now; Linux alone can."""
    with suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _memory_mib(name: str) -> float:
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith(name)) / 1024


def work(first: Mapping[str, int], seconds: float, seed: int, messages: Any, out: Path, place: Path) -> None:
    """Feed targets in turns, and tell the parent of each input, so that it knows of which one this died.

    The target that has had the fewest inputs is always the next: readers in a process of their own and large files are
    reached as often as the others.

    Parameters
    ----------
    first : mapping of str to int
        By target the number of its first input.
    seconds : float
        For all together, once their samples are read.
    messages : end of a pipe
        Takes the target and what became of an input; nothing became of it where a turn begins.
    out, place : Path
        Where findings are kept, and where files are put to be read.
    """
    quiet()
    folder = place / "in"
    folder.mkdir()
    samples = {name: TARGETS[name].samples() for name in first}
    for name in first:
        for sample in samples[name]:  # loads what is loaded at first use
            judge(TARGETS[name], sample, folder)
    end, numbers = time.monotonic() + seconds, dict(first)
    while time.monotonic() < end:
        name = min(numbers, key=lambda each: numbers[each])
        _reset_peak()
        messages.send((name, ""))
        made = input_files(TARGETS[name], samples[name], name, seed, numbers[name])
        told, words = judge(TARGETS[name], made, folder)
        if told not in ("refused", "accepted"):
            keep(out / "findings" / f"{name}-{told}-{seed}-{numbers[name]}", made, words)
        messages.send((name, told))
        numbers[name] += 1


def quiet() -> None:
    """Bound the addresses, silence what libraries print, and listen to what readers open."""
    logging.disable()
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (int(_memory_mib("VmSize")) * (1 << 20) + MORE_ADDRESSES, -1))
    sys.addaudithook(_audit)


def keep(folder: Path, made: Sample, words: str) -> None:
    """Keep a finding: its files, and what was told."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in made.items():
        (folder / name).write_bytes(content)
    (folder / "told.txt").write_text(words, "utf-8", errors="backslashreplace")
