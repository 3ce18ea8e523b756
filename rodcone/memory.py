"""Memory that a run needs, and a refusal if less is free, because the system would kill the run without a message."""

import resource
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rodcone.errors import InputError

GB = 1e9
# The numbers follow from the arrays that exist at the same time, and are compared with measured peaks in
# `tests/rodcone/test_memory.py`.
TRANSPORT_ARRAYS = 3  # float32 arrays (group, band, h, w) of a transport: radiance, half difference, variance
_DENOISED_ARRAYS = 7  # further ones if it is denoised: denoised light, indirect light, folds, and their copies
_DENOISER_BYTES = 1300  # per pixel, for Open Image Denoise
_DENOISER_LIBRARY_BYTES = 200e6  # for its library, and for what Dr.Jit keeps of the folds' launches
_MEANS_ARRAYS = 2  # transport arrays that exist while a render draws; variance comes last, when Dr.Jit's memory is free
_LAUNCH_BYTES = 4 * (1 << 24)  # largest size of all channels of a launch (`render.runs.MOST_FLOATS`)
_CHANNELS_BESIDE = 4  # channels of a launch beside its bands
# Memory for drawing, in multiples of all channels of a launch: what Dr.Jit keeps of one launch, its sums and their
# copy, in blocks of powers of two; both halves' light, and the step by which the means move.
_LAUNCHES = 4.5
_LAST_LAUNCH = 3.0  # added if a run has several launches: the last one is smaller, and Dr.Jit keeps its blocks too
_OTHER_LAUNCHES = 1.0  # added per further group, whose launches differ in size if a render has many samples
_MANY_SPP = 32  # samples per pixel from which on a render has many
_RENDERER_BYTES = 224e6  # libraries and compiled kernels
_RENDER_BYTES = 45  # per pixel, whatever the number of bands: order, rate, coverage, light that is seen directly
# Arrays (band, h, w) that exist after a render beside its transport: relit light, its image, both halves' light and the
# arrays from which they are made, and the image that is being formed of one of them, with its copy for the lens.
_VIEW_ARRAYS = 10
# Per pixel of a capture that computes its light's bands one at a time: electrons behind every filter, for both halves
# or beside a photograph's colours, their sums while an image is formed, and the arrays for the raw files.
_CAPTURE_BYTES = 185
_VIEWER_BYTES = 212e6  # libraries, and what Dr.Jit doesn't give back
_CELL_BYTES = 800  # per pixel: mosaic, planes, patches' packed planes, picture, and two truths with their CIELABs
_WORKER_BYTES = 350e6  # libraries and compiled kernels of a worker
_MAPPED_BYTES = 200e6  # address space of libraries and threads of a render, beyond the memory that they use
_FILE_BANDS = 40  # bands of a picture file
_FILE_PACKING = 1.5  # bytes of a picture file in float32 over those on disk: 1.2 with a render's noise, more without


@dataclass(frozen=True)
class Memory:
    """What a run needs at its peak [bytes]: all its processes together, and the largest of them."""

    total: float
    largest: float


@dataclass(frozen=True)
class LightMemory:
    """Memory of the light in the steps after a render.

    Attributes
    ----------
    group_arrays : int
        Number of float32 arrays (band, h, w) for each light group.
    lit_arrays : int
        Number of further such arrays for the light of all groups together.
    pixel_bytes : float
        Further bytes per pixel, whatever the number of bands.
    """

    group_arrays: int
    lit_arrays: int = 0
    pixel_bytes: float = 0.0


VIEWED = LightMemory(TRANSPORT_ARRAYS, _VIEW_ARRAYS)  # all bands together, by steps that image and judge them
# Light that goes into a file: the lit light takes the place of the arrays that state the render's error, and the
# preview's colours take less memory than these arrays did, so that the peak is the end of the render.
WRITTEN = LightMemory(TRANSPORT_ARRAYS, pixel_bytes=_RENDER_BYTES)


def imaged_by_band(group_arrays: int) -> LightMemory:
    """Return the memory of light that lies in so many arrays per group, for a capture of one band at a time."""
    return LightMemory(group_arrays, pixel_bytes=_CAPTURE_BYTES)


@dataclass(frozen=True)
class Limit:
    """One bound on memory.

    Attributes
    ----------
    name : str
    free : float
        Bytes that are not in use.
    per_process : bool
        Whether the bound applies to each process separately.
    """

    name: str
    free: float
    per_process: bool = False


def memory(
    pixels: int,
    bands: int,
    groups: int,
    workers: int = 0,
    *,
    spp: float | None = None,
    denoised: bool = False,
    held: int = 0,
    light: LightMemory = VIEWED,
) -> Memory:
    """Return the memory that a render with `groups` light groups needs, or the steps after it if they need more.

    Kernels that no earlier render has left in `~/.drjit` are compiled, which takes up to 3 MB more per band.

    Parameters
    ----------
    pixels, bands, groups : int
        Size of the render. A picture file, which needs no render, has 0 groups.
    workers : int
        Number of processes that develop cells. 1 means the process that renders, 0 that no cells are developed.
    spp : float, optional
        Largest number of samples per pixel; 0 if the light exists already. If it is left out, it is assumed to be
        large.
    denoised : bool
        Whether the render is denoised.
    held : int
        Other renders of this size whose light is kept in memory meanwhile.
    light : LightMemory
        Memory of the light in the steps after the render: `VIEWED`, `WRITTEN` or `imaged_by_band`.
    """
    plane = 4.0 * pixels * bands  # bytes of one float32 array (band, h, w)
    per_pixel = _DENOISED_ARRAYS * groups * 4.0 * bands + _DENOISER_BYTES
    of_denoiser = denoised * (_DENOISER_LIBRARY_BYTES + pixels * per_pixel)
    # Drawing
    samples = _MANY_SPP if spp is None else spp
    channels = 4.0 * (bands + _CHANNELS_BESIDE)  # bytes per path of one half
    launch = _LAUNCH_BYTES if spp is None else min(_LAUNCH_BYTES, channels * pixels * max(spp, 2.0) / 2)
    launches = _LAUNCHES + _LAST_LAUNCH * (channels * pixels > _LAUNCH_BYTES)
    launches += _OTHER_LAUNCHES * max(groups - 1, 0) * min(1.0, samples / _MANY_SPP)
    drawing = max(_MEANS_ARRAYS * groups * plane + launches * launch, TRANSPORT_ARRAYS * groups * plane)
    drawing += _RENDERER_BYTES + _RENDER_BYTES * pixels
    # Viewing and developing the light; the render is released before the first cell
    viewing = _VIEWER_BYTES + light.group_arrays * groups * plane
    viewing += light.lit_arrays * plane + light.pixel_bytes * pixels
    rendering = max(drawing * (groups > 0 and spp != 0), viewing) + of_denoiser
    rendering += held * TRANSPORT_ARRAYS * groups * plane
    worker = _WORKER_BYTES + _CELL_BYTES * pixels
    if workers <= 1:
        peak_bytes = max(rendering, workers * worker)
        return Memory(peak_bytes, peak_bytes)
    return Memory(rendering + workers * worker, max(rendering, worker))


def file_extent(path: str | Path) -> tuple[int, int, int]:
    """Estimate a picture file's pixels, bands and light groups from its size in bytes, before its header is read."""
    values = Path(path).stat().st_size * _FILE_PACKING / 4
    return round(values / _FILE_BANDS), _FILE_BANDS, 0


def require_memory(need: Memory, force: bool = False) -> None:
    """Raise `InputError` if a run needs more memory than is free, unless `force`.

    What this process holds already is part of what the run needs. The message states the need and the tightest limit.
    """
    resident = _pages(1)
    for limit in sorted([] if force else memory_limits(), key=lambda limit: limit.free):
        needed, whose = (need.largest, "a process of the run") if limit.per_process else (need.total, "the run")
        if needed > resident + limit.free:
            raise InputError(
                f"memory: {whose} needs about {needed / GB:.1f} GB; allowed: {(resident + limit.free) / GB:.1f} GB, "
                f"which is {limit.name}; take a smaller picture, fewer bands or workers, or go on with --force"
            )


def memory_limits(root: Path = Path("/")) -> Iterator[Limit]:
    """Yield the bounds on this process's memory that the system states, if any.

    Parameters
    ----------
    root : Path
        Folder that contains ``proc`` and ``sys``.
    """
    with suppress(OSError, LookupError, ValueError):
        lines = (root / "proc/meminfo").read_text().splitlines()
        facts = dict(line.split(":", 1) for line in lines)
        yield Limit("what is available on this machine", 1024.0 * int(facts["MemAvailable"].split()[0]))
    yield from _groups(root)
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most != resource.RLIM_INFINITY:
        free = most - _pages(0) - _MAPPED_BYTES
        yield Limit(f"what the address-space limit of {most / GB:.1f} GB leaves (ulimit -v)", free, True)


def _groups(root: Path) -> Iterator[Limit]:
    """Yield the limits of the control groups that this process is in, of both versions; those of parents apply too."""
    mount = root / "sys/fs/cgroup"
    try:
        places = [line.split(":", 2) for line in (root / "proc/self/cgroup").read_text().splitlines()]
    except OSError:
        return
    for _, controllers, place in places:
        if not controllers:
            top = mount
            names = ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            top = mount / "memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        innermost = top / place.lstrip("/")
        for folder in (innermost, *innermost.parents):
            with suppress(OSError, LookupError, ValueError):
                yield _group_limit(folder, *names)
            if folder == top:
                break


def _group_limit(folder: Path, most_file: str, used_file: str, cache_key: str) -> Limit:
    """Return the limit of one group, with cached files not counted as used; raise `ValueError` if it has none."""
    most = int((folder / most_file).read_text())  # without a limit it is the word "max"
    used = int((folder / used_file).read_text())
    cached = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())[cache_key]
    return Limit(f"what the control group's limit of {most / GB:.1f} GB leaves", most - used + float(cached))


def _pages(field: int) -> float:
    """Return this process's memory [bytes] by a field of ``/proc/self/statm``: 0 all addresses, 1 the resident part."""
    with suppress(OSError, LookupError, ValueError):
        return float(Path("/proc/self/statm").read_text().split()[field]) * resource.getpagesize()
    return 0.0
