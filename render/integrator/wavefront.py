"""Mean light of paths per pixel, over consecutive points of their low-discrepancy sequences."""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.integrator.dense import CHOSEN, Tracer
from render.integrator.points import Points, pixel_keys
from render.integrator.variant_types import Channels, UInt
from render.loader import Film, LoadedScene, mitsuba_module, mitsuba_words
from rodcone.errors import InputError
from rodcone.jit import dr
from rodcone.types import Planes

LANES = 16  # paths of the widest packet that Embree traces together
_COLOUR_FOR_NUMBER = re.compile(r'BitmapTexture "([^"]*)" was queried for a monochromatic value')


@dataclass(frozen=True)
class Span:
    """Consecutive points of each pixel's sequence: from `start` on, `chunks` chunks of `chunk` points each."""

    start: int
    chunk: int
    chunks: int


def seed_of(*coordinates: int) -> int:
    """Derive a seed of 32 bits from numbers: the render's own seed, and numbers that say what the seed is for."""
    return int(np.random.SeedSequence(coordinates).generate_state(1)[0])


def tracers(loaded: LoadedScene, film: Film, most_bands: int, seed: int, *, split: bool = False) -> Iterator[Tracer]:
    """Give a tracer for each part of the bands, at most so many together; all parts see the same paths."""
    parts = -(-film.wavelength_nm.size // most_bands)
    for nm, width_nm in zip(*(np.array_split(x, parts) for x in (film.wavelength_nm, film.width_nm)), strict=True):
        yield Tracer(mitsuba_module(), loaded, replace(film, wavelength_nm=nm, width_nm=width_nm), seed, split=split)


def traced(
    trace: Callable[[UInt, Points], Channels], rates: NDArray[np.uint32], span: Span, threads: int, seed: int
) -> dict[str, Planes]:
    """Trace paths and average what they give over each chunk of points: by name, each (chunk, channel, h, w).

    Raises
    ------
    InputError
        As `traced_at`.
    """
    means: dict[str, Planes] = {}
    for pixels in launches(rates, span, threads):
        for name, part in traced_at(trace, rates, pixels, span, seed).items():
            if name not in means:
                means[name] = np.empty((*part.shape[:2], rates.size), np.float32)
            means[name][..., where(pixels)] = part
    return {name: planes.reshape(*planes.shape[:2], *rates.shape) for name, planes in means.items()}


def launches(rates: NDArray[np.uint32], span: Span, threads: int) -> list[NDArray[np.intp]]:
    """Cut the picture into launches of so many threads: the pixels of each, by their rates.

    A pixel of rate r has r times as many points as one of rate 1: its chunks are r times as long.
    """
    flat = rates.ravel()
    order = np.argsort(flat, kind="stable")
    # Paths of one packet change each other's last bits, because Embree traverses its tree in another way once few paths
    # are left. So a packet holds the same paths in every launch, and copies of a rate's last pixel fill its last
    # packet.
    together = LANES // math.gcd(LANES, span.chunk)
    by_rate = np.split(order, np.flatnonzero(np.diff(flat[order])) + 1)
    order = np.concatenate([np.pad(pixels, (0, -pixels.size % together), mode="edge") for pixels in by_rate])
    ends = np.cumsum(flat[order].astype(np.int64) * span.chunk * span.chunks)
    cuts = (np.flatnonzero(np.diff(ends // threads)) + 1) // together * together
    return np.split(order, np.unique(cuts[cuts > 0]))


def where(pixels: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """Return the slice that picks consecutive pixels, which NumPy copies faster, or the pixels themselves."""
    first, stop = int(pixels[0]), int(pixels[-1]) + 1
    consecutive = stop - first == pixels.size and bool((np.diff(pixels) == 1).all())
    return slice(first, stop) if consecutive else pixels


def traced_at(
    trace: Callable[[UInt, Points], Channels],
    rates: NDArray[np.uint32],
    pixels: NDArray[np.intp],
    span: Span,
    seed: int,
) -> dict[str, Planes]:
    """Trace the paths of one of the `launches` and average them as `traced`: by name, each (chunk, channel, pixel).

    Raises
    ------
    InputError
        Where a material sampled another direction at another wavelength.
    """
    mi = mitsuba_module()
    # A launch has a part for each rate, where chunks of one length follow each other: chunk by chunk, and within it
    # pixel by pixel. `blocks` gives the pixel and the number of the first point of each `span.chunk` threads.
    values, firsts = np.unique(rates.ravel()[pixels], return_index=True)
    parts = list(zip(values.tolist(), np.split(pixels, firsts[1:]), firsts.tolist(), strict=True))
    blocks = np.concatenate([_blocks(rate, of_rate, span) for rate, of_rate, _ in parts], axis=1)
    pixel_of, first_of = (mi.UInt32(numbers) + dr.opaque(mi.UInt32, 0) for numbers in blocks)
    dr.eval(pixel_of, first_of)  # memory of Dr.Jit's own: a kernel reads NumPy's, aligned or not, by other code
    channels = _launched(trace, pixel_of, first_of, span.chunk, seed)
    means = {name: np.empty((len(x), span.chunks, pixels.size), np.float32) for name, x in channels.items()}
    start = 0
    for rate, of_rate, first in parts:
        length = rate * span.chunk
        count = of_rate.size * length * span.chunks
        index = dr.arange(mi.UInt32, count) + dr.opaque(mi.UInt32, start)
        totals = []
        for channel in (x for values in channels.values() for x in values):
            part = channel if count == dr.width(channel) else dr.gather(mi.Float, channel, index)
            totals.append(dr.block_sum(part, length) if length > 1 else part)
        sums = iter(dr.concat(totals).numpy().reshape(len(totals), span.chunks, -1))  # one copy for all
        for planes in means.values():
            for plane in planes:
                np.multiply(next(sums), np.float32(1 / length), out=plane[:, first : first + of_rate.size])
        start += count
    if means.pop(CHOSEN).any():
        raise InputError(
            "scene: a material chooses where light goes by wavelength (dispersion, wavelength-dependent lobes); "
            "allowed: materials whose sampling doesn't depend on wavelength; replace it"
        )
    return {name: np.moveaxis(planes, 0, 1) for name, planes in means.items()}


def _blocks(rate: int, pixels: NDArray[np.intp], span: Span) -> NDArray[np.uint32]:
    """Pixel and first point of blocks of `span.chunk` points of pixels of one rate, shape (2, block)."""
    chunk, pixel, block = np.meshgrid(np.arange(span.chunks), pixels, np.arange(rate), indexing="ij")
    first = span.start * rate + (chunk * rate + block) * span.chunk
    return np.stack([pixel.ravel(), first.ravel()]).astype(np.uint32)


def _launched(
    trace: Callable[[UInt, Points], Channels], pixel_of: UInt, first_of: UInt, chunk: int, seed: int
) -> Channels:
    """Channels of all points of blocks, each `chunk` points long, evaluated."""
    mi = mitsuba_module()
    thread = dr.arange(mi.UInt32, dr.width(pixel_of) * chunk)
    length = dr.opaque(mi.UInt32, chunk)
    block = thread // length
    pixel, first = (dr.gather(mi.UInt32, numbers, block) for numbers in (pixel_of, first_of))
    index = first + thread - block * length
    try:
        channels = trace(pixel, Points(mi, index, pixel_keys(mi, pixel, seed)))
        dr.eval(channels)
    except RuntimeError as error:
        cause = _root_cause(error)
        if not isinstance(cause, RuntimeError):  # a fault of this program, not of the scene
            raise
        raise _refusal(cause) from None
    return channels


def _refusal(error: RuntimeError) -> InputError:
    """Say what Mitsuba can't render: for a fault of otherwise good scenes in plain words, else in Mitsuba's own."""
    words = mitsuba_words(error)
    if colour := _COLOUR_FOR_NUMBER.search(words):
        return InputError(
            f"scene: bitmap {colour[1]!r} has colours where one number is asked for, such as a mask's opacity; "
            'allowed: a grey bitmap, or its luminance as stored: add <boolean name="raw" value="true"/> to it'
        )
    return InputError(f"scene: Mitsuba can't render it: {words}; correct the description")


def _root_cause(error: BaseException) -> BaseException:
    """First cause of an error that Dr.Jit has wrapped."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return error
