"""Memory that is free, and the refusal of a run that needs more: the system would end it without a word."""

import resource
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from render.errors import InputError

GB = 1e9


@dataclass(frozen=True)
class Memory:
    """What a run needs at its peak [bytes]: all its processes together, and the largest of them."""

    total: float
    largest: float


@dataclass(frozen=True)
class Limit:
    """One bound on memory.

    Attributes
    ----------
    name : str
    free : float
        Bytes that are not in use.
    each : bool
        Whether every process has it for itself.
    """

    name: str
    free: float
    each: bool = False


def require_memory(need: Memory, force: bool = False) -> None:
    """Raise `InputError` where a run needs more memory than is free, unless `force`.

    What this process holds already is part of what the run needs. The message names the need and the least limit.
    """
    held = _pages(1)
    for limit in sorted([] if force else memory_limits(), key=lambda each: each.free):
        needed, whose = (need.largest, "a process of the run") if limit.each else (need.total, "the run")
        if needed > held + limit.free:
            raise InputError(
                f"memory: {whose} needs about {needed / GB:.1f} GB; allowed: {(held + limit.free) / GB:.1f} GB, which "
                f"is {limit.name}; take a smaller picture, fewer bands or workers, or go on with --force"
            )


def memory_limits(root: Path = Path("/")) -> Iterator[Limit]:
    """Bounds on this process's memory that the system tells; none where it tells none.

    Parameters
    ----------
    root : Path
        Under which ``proc`` and ``sys`` lie.
    """
    with suppress(OSError, LookupError, ValueError):
        lines = (root / "proc/meminfo").read_text().splitlines()
        facts = dict(line.split(":", 1) for line in lines)
        yield Limit("what is available on this machine", 1024.0 * int(facts["MemAvailable"].split()[0]))
    yield from _groups(root)
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most != resource.RLIM_INFINITY:
        yield Limit(f"what the address-space limit of {most / GB:.1f} GB leaves (ulimit -v)", most - _pages(0), True)


def _groups(root: Path) -> Iterator[Limit]:
    """Limits of the control groups that this process is in, of both versions; parents bind too."""
    mount = root / "sys/fs/cgroup"
    try:
        places = [line.split(":", 2) for line in (root / "proc/self/cgroup").read_text().splitlines()]
    except OSError:
        return
    for _, controllers, place in places:
        if not controllers:
            top, names = mount, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            top, names = mount / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        own = top / place.lstrip("/")
        for folder in (own, *own.parents):
            with suppress(OSError, LookupError, ValueError):
                yield _group_limit(folder, *names)
            if folder == top:
                break


def _group_limit(folder: Path, most_file: str, used_file: str, cache_key: str) -> Limit:
    """Limit of one group; `ValueError` where it has none. Files that it merely holds in its cache are no use."""
    most = int((folder / most_file).read_text())  # the word "max" without a limit
    used = int((folder / used_file).read_text())
    cached = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())[cache_key]
    return Limit(f"what the control group's limit of {most / GB:.1f} GB leaves", most - used + float(cached))


def _pages(field: int) -> float:
    """Memory of this process [bytes] by a field of ``/proc/self/statm``: 0 all addresses, 1 what is resident."""
    with suppress(OSError, LookupError, ValueError):
        return float(Path("/proc/self/statm").read_text().split()[field]) * resource.getpagesize()
    return 0.0
