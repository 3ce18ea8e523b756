"""Launches of paths: mean light of each pixel over consecutive points of its low-discrepancy sequence."""

import math
import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from render.integrator.dense import CHOSEN, Tracer
from render.integrator.points import Points, pixel_keys
from render.integrator.variant_types import Channels, UInt
from render.loader import Film, LoadedScene, mitsuba_module, mitsuba_words
from rodcone.errors import InputError
from rodcone.jit import dr
from rodcone.types import Planes

LANES = 16  # largest number of paths that Embree traces together as a packet
K = TypeVar("K", bound=Hashable)  # name or number of a plane
_COLOUR_FOR_NUMBER = re.compile(r'BitmapTexture "([^"]*)" was queried for a monochromatic value')


@dataclass(frozen=True)
class Span:
    """Consecutive points of each pixel's sequence: `chunks` chunks of `chunk` points each, from `start` on."""

    start: int
    chunk: int
    chunks: int


def seed_of(*coordinates: int) -> int:
    """Derive a seed of 32 bits from the render's own seed and numbers that say what the seed is for."""
    return int(np.random.SeedSequence(coordinates).generate_state(1)[0])


def tracers(loaded: LoadedScene, film: Film, most_bands: int, seed: int, *, split: bool = False) -> Iterator[Tracer]:
    """Yield a tracer for each part of the bands, of at most `most_bands`; all parts follow the same paths."""
    parts = -(-film.wavelength_nm.size // most_bands)
    for nm, width_nm in zip(*(np.array_split(x, parts) for x in (film.wavelength_nm, film.width_nm)), strict=True):
        yield Tracer(mitsuba_module(), loaded, replace(film, wavelength_nm=nm, width_nm=width_nm), seed, split=split)


def traced(
    trace: Callable[[UInt, Points], Channels], rates: NDArray[np.uint32], span: Span, threads: int, seed: int
) -> dict[str, Planes]:
    """Trace paths and return the means of their channels over each chunk: by name, each (chunk, channel, h, w).

    Raises
    ------
    InputError
        As `traced_at`.
    """
    means = on_whole_film(lambda pixels: traced_at(trace, rates, pixels, span, seed), rates, span, threads)
    return {name: planes.reshape(*planes.shape[:2], *rates.shape) for name, planes in means.items()}


def on_whole_film(
    draw: Callable[[NDArray[np.intp]], Mapping[K, Planes]], rates: NDArray[np.uint32], span: Span, threads: int
) -> dict[K, Planes]:
    """Draw all launches and join their results to planes of the whole film, each (..., pixel) float32.

    Parameters
    ----------
    draw : callable
        Function of the pixels of a launch that returns planes (..., pixel of the launch) by their names or numbers.
    rates, span, threads
        As in `launches`.
    """
    whole: dict[K, Planes] = {}
    for pixels in launches(rates, span, threads):
        for key, part in draw(pixels).items():
            if key not in whole:
                whole[key] = np.empty((*part.shape[:-1], rates.size), np.float32)
            whole[key][..., where(pixels)] = part
    return whole


def launches(rates: NDArray[np.uint32], span: Span, threads: int) -> list[NDArray[np.intp]]:
    """Divide the picture into launches of about `threads` threads; return the pixels of each launch, by their rates.

    A pixel of rate r has r times as many points as one of rate 1, because its chunks are r times as long.
    """
    flat = rates.ravel()
    order = np.argsort(flat, kind="stable")
    # Paths of one packet change each other's last bits, because Embree traverses its tree differently once few paths of
    # the packet are left. Therefore a packet holds the same paths however the picture is divided, and copies of a
    # rate's last pixel fill that rate's last packet.
    together = LANES // math.gcd(LANES, span.chunk)
    by_rate = np.split(order, np.flatnonzero(np.diff(flat[order])) + 1)
    order = np.concatenate([np.pad(pixels, (0, -pixels.size % together), mode="edge") for pixels in by_rate])
    ends = np.cumsum(flat[order].astype(np.int64) * span.chunk * span.chunks)
    cuts = (np.flatnonzero(np.diff(ends // threads)) + 1) // together * together
    return np.split(order, np.unique(cuts[cuts > 0]))


def where(pixels: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """Return a slice for consecutive pixels, which NumPy copies faster, or else the pixels unchanged."""
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
    """Trace the paths of one launch and average them as `traced` does: by name, each (chunk, channel, pixel).

    Raises
    ------
    InputError
        If a material sampled another direction at another wavelength.
    """
    mi = mitsuba_module()
    # A launch has a part for each rate, in which all chunks are equally long. They are ordered by chunk, then by pixel.
    # A block is `span.chunk` threads; `blocks` holds the pixel and the first point of each.
    values, firsts = np.unique(rates.ravel()[pixels], return_index=True)
    parts = list(zip(values.tolist(), np.split(pixels, firsts[1:]), firsts.tolist(), strict=True))
    blocks = np.concatenate([_blocks(rate, of_rate, span) for rate, of_rate, _ in parts], axis=1)
    pixel_of, first_of = (mi.UInt32(numbers) + dr.opaque(mi.UInt32, 0) for numbers in blocks)
    dr.eval(pixel_of, first_of)  # copied to Dr.Jit's memory, because code that reads NumPy's depends on its alignment
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
        sums = iter(dr.concat(totals).numpy().reshape(len(totals), span.chunks, -1))  # one copy for all channels
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
    """List the blocks, each of `span.chunk` points, for pixels of one rate: pixel and first point, shape (2, block)."""
    chunk, pixel, block = np.meshgrid(np.arange(span.chunks), pixels, np.arange(rate), indexing="ij")
    first = span.start * rate + (chunk * rate + block) * span.chunk
    return np.stack([pixel.ravel(), first.ravel()]).astype(np.uint32)


def _launched(
    trace: Callable[[UInt, Points], Channels], pixel_of: UInt, first_of: UInt, chunk: int, seed: int
) -> Channels:
    """Trace a path for each point of the blocks, which have `chunk` points each, and evaluate the channels."""
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
        if not isinstance(cause, RuntimeError):  # an error of this program, not of the scene
            raise
        raise _refusal(cause) from None
    return channels


def _refusal(error: RuntimeError) -> InputError:
    """Say what Mitsuba can't render: in plain words for a mistake that is easily made, otherwise in Mitsuba's."""
    words = mitsuba_words(error)
    if colour := _COLOUR_FOR_NUMBER.search(words):
        return InputError(
            f"scene: bitmap {colour[1]!r} has colours where one number is asked for, such as a mask's opacity; "
            'allowed: a grey bitmap, or its luminance as stored: add <boolean name="raw" value="true"/> to it'
        )
    return InputError(f"scene: Mitsuba can't render it: {words}; correct the description")


def _root_cause(error: BaseException) -> BaseException:
    """Return the first cause of an error that Dr.Jit has wrapped."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return error
