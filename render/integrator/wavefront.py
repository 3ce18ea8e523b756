"""Means of paths over spans of their points: by Dr.Jit, or pass by pass by Mitsuba's own integrators."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from render.integrator.dense import SPECTRUM_SIZE
from render.integrator.points import Points, pixel_keys
from render.loader import Film, mitsuba_module, mitsuba_words
from rodcone.errors import InputError
from rodcone.jit import dr
from rodcone.types import Planes


@dataclass(frozen=True)
class Span:
    """Points from `start` on: `chunks` chunks of `chunk` points."""

    start: int
    chunk: int
    chunks: int


def seed_of(*coordinates: int) -> int:
    """Seed of 32 bits from the render's own and what it is for."""
    return int(np.random.SeedSequence(coordinates).generate_state(1)[0])


def traced(
    trace: Callable[[Any, Points], list[Any]], size: tuple[int, int], span: Span, threads: int, seed: int
) -> Planes:
    """Means over each chunk of the channels that a tracer gives, shape (chunk, channel, h, w)."""
    mi, pixels, samples = mitsuba_module(), size[0] * size[1], span.chunk * span.chunks
    most = max(1, threads // samples)
    means: Planes | None = None
    for first in range(0, pixels, most):
        count = min(most, pixels - first)
        # thread = (number of the chunk x count + number of the pixel) x chunk + number of the point within the chunk
        thread, length = dr.arange(mi.UInt32, count * samples), dr.opaque(mi.UInt32, span.chunk)
        total_of, in_block = thread // length, dr.opaque(mi.UInt32, count)  # a total for each chunk and pixel
        number = total_of // in_block
        pixel = total_of - number * in_block + dr.opaque(mi.UInt32, first)
        index = thread - total_of * length + number * length + dr.opaque(mi.UInt32, span.start)
        try:
            channels = trace(pixel, Points(mi, index, pixel_keys(mi, pixel, seed)))
            dr.eval(channels)
        except RuntimeError as error:
            cause = _root_cause(error)
            if not isinstance(cause, RuntimeError):  # a fault of this program, not of the scene
                raise
            raise InputError(
                f"scene: Mitsuba can't render it: {mitsuba_words(cause)}; correct the description"
            ) from None
        if means is None:
            means = np.empty((span.chunks, len(channels), pixels), np.float32)
        for slot, channel in enumerate(channels):
            total = dr.block_sum(channel, span.chunk) if span.chunk > 1 else channel
            means[:, slot, first : first + count] = total.numpy().reshape(span.chunks, count)
    assert means is not None
    if span.chunk > 1:
        means *= np.float32(1 / span.chunk)
    return means.reshape(span.chunks, -1, *size)


def bands_apart(image: Planes, groups: int, bands: int) -> tuple[Planes, Planes]:
    """Channels of a tracer apart: bands (chunk, group, band, h, w), and those after them (chunk, channel, h, w).

    Raises
    ------
    InputError
        Where a material chose by wavelength.
    """
    if image[:, -1].any():
        raise InputError(
            "scene: a material chooses where light goes by wavelength (dispersion, wavelength-dependent lobes); "
            "allowed: materials whose sampling doesn't depend on wavelength; replace it"
        )
    filled = bands + -bands % SPECTRUM_SIZE
    scattered, others = np.split(image[:, :-1], [groups * filled], axis=1)
    return scattered.reshape(len(image), groups, filled, *image.shape[2:])[:, :, :bands], others


def by_stock(mi_scene: Any, sensor: Any, integrator: Any, *, spp: int, seed: int) -> Planes:
    """Render by an integrator of Mitsuba's, shape (channel, h, w)."""
    try:
        image = mitsuba_module().render(mi_scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed)
    except RuntimeError as error:
        raise InputError(f"scene: Mitsuba can't render it: {mitsuba_words(error)}; correct the description") from None
    return np.ascontiguousarray(np.moveaxis(np.asarray(image, dtype=np.float32), -1, 0))


def film_width(film: Film) -> Planes:
    """Width of each band, for specfilm, which integrates over the band: (band, 1, 1)."""
    return film.width_nm.astype(np.float32)[:, None, None]


def _root_cause(error: BaseException) -> BaseException:
    """First cause of an error that Dr.Jit has wrapped."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return error
