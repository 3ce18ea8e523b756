"""Runs of samples over a scene, and their means: the picture, and half the difference of two halves as its error.

Each pixel has two independent sequences of Sobol points, the even and the odd half. A point gives one path. A run draws
the next points of both halves. They are added in chunks, whose limits depend only on the position in the sequence.
Therefore a resumed render has the same bits as one that was never interrupted.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from render.error_estimates import (
    Halves,
    SharedPaths,
    group_errors,
    median_error,
    relative_error,
    shared_paths,
    spread_pixels,
)
from render.integrator.allocation import rates_of
from render.integrator.dense import Tracer
from render.integrator.wavefront import Span, launches, on_whole_film, seed_of, traced_at, tracers, where
from render.level import SceneMeans
from render.limits import MOST_POINTS, chunk_from
from render.loader import PART_BANDS, Film, LoadedScene
from render.scene import Scene
from render.transport import Transport
from rodcone.types import Floats, Planes

MOST_FLOATS = 1 << 24  # floats in all channels of one launch (64 MiB); they limit how many threads a launch has
PILOT = Span(0, 8, 2)  # points of each half: 32 samples per pixel, in four sets
_PILOT_STREAM = 8  # number of the pilot's random stream
BLOCK = 1 << 16  # pixels whose errors are summed in double precision at once


@dataclass
class Means:
    """Means over the points drawn so far, at unit spectral emission. They are the only mutable state of a render.

    Attributes
    ----------
    count : int
        Points of each half in a pixel of rate 1.
    rates : (h, w) uint32
        Points of each pixel over those of a pixel of rate 1; powers of two.
    light : Halves of (group, band, h, w)
    seen : list of Halves of (1 or band, h, w)
        Directly visible light of each group: one plane if its emission doesn't depend on wavelength.
    coverage : Halves of (h, w)
        Share of the paths that meet a light first.
    shared : (int, int) or None
        Indices of a light group and the constant environment, which share paths.
    indirect : Halves of (group, band, h, w) or None
        The indirect part of `light`, if it is kept separately.
    """

    count: int
    rates: NDArray[np.uint32]
    light: Halves
    seen: list[Halves]
    coverage: Halves
    shared: tuple[int, int] | None = None
    indirect: Halves | None = None


@dataclass(frozen=True)
class Half:
    """One half of a loaded scene's paths.

    Attributes
    ----------
    loaded : LoadedScene
    tracers : tuple of Tracer
        One for each part of the bands; all parts see the same paths.
    seed : int
    split : bool
        Whether indirect light is also given separately.
    """

    loaded: LoadedScene
    tracers: tuple[Tracer, ...]
    seed: int
    split: bool


@dataclass(frozen=True)
class Drawn:
    """Means over one half of a loaded scene's paths in some chunks, at the pixels of a launch.

    Attributes
    ----------
    radiance : (chunk, group, band, pixel) float32
    seen : list of (chunk, 1 or band, pixel) float32
        For each group, as `Means.seen`.
    coverage : (chunk, pixel) float32
    indirect : (chunk, group, band, pixel) float32
        Indirect part of `radiance`; without any group unless `Half.split`.
    """

    radiance: Planes
    seen: list[Planes]
    coverage: Planes
    indirect: Planes


def no_means(scene: Scene, film: Film, rates: NDArray[np.uint32], *, split: bool = False) -> Means:
    """Return means of no samples, with which a render begins. With `split`, indirect light has its own means too."""
    bands = film.wavelength_nm.size
    groups = scene.groups.values()
    return Means(
        count=0,
        rates=rates,
        light=Halves.zeros(len(groups), bands, *film.size),
        seen=[Halves.zeros(bands if group.coloured else 1, *film.size) for group in groups],
        coverage=Halves.zeros(*film.size),
        indirect=Halves.zeros(len(groups), bands, *film.size) if split else None,
    )


def means_of(transport: Transport, *, split: bool = False) -> Means:
    """Return the means at which an earlier render stopped, to be continued with the same bits; arrays aren't copied."""
    denoised = transport.denoised if split else None
    return Means(
        count=int(transport.counts.min()) // 2,
        rates=transport.counts // transport.counts.min(),
        light=transport.light,
        seen=list(transport.seen),
        coverage=transport.coverage,
        shared=transport.shared.groups if transport.shared else None,
        indirect=denoised.indirect if denoised else None,
    )


def fields_of(lights: Floats, means: Means) -> dict[str, Any]:
    """Return the fields of a `Transport` that hold the means and their Monte Carlo error under lights (group, band)."""
    light = means.light
    bands, height, width = light.mean.shape[1:]
    variance = np.empty(light.mean.shape, np.float32)
    correlation = np.empty(light.mean.shape[1:], np.float32)
    together = max(1, BLOCK // (bands * width))  # rows at once; all rows would take several times the render's memory
    for first in range(0, height, together):
        rows = slice(first, min(first + together, height))
        variance[:, :, rows], of_rows = _errors_in_rows(means, rows)
        if of_rows:
            correlation[:, rows] = of_rows.correlation
    shared = SharedPaths(means.shared, correlation) if means.shared else None
    error = relative_error(lights, means.light.mean, variance, shared)
    halves = {"light": light, "coverage": means.coverage, "seen": tuple(means.seen)}
    return halves | {"variance": variance, "shared": shared, "relative_mc_error": error}


def error_of(lights: Floats, means: Means) -> float:
    """Return only the relative error of `fields_of`, computed only in those rows whose pixels it depends on."""
    light = means.light.mean
    chosen = spread_pixels(light.shape[2:])
    _, rows, columns = chosen
    errors = [_errors_in_rows(means, slice(row, row + 1)) for row in rows.ravel().tolist()]
    variance = np.concatenate([variance[..., columns] for variance, _ in errors], axis=2)
    correlations = [shared.correlation[..., columns] for _, shared in errors if shared]
    shared = SharedPaths(means.shared, np.concatenate(correlations, axis=1)) if means.shared else None
    return median_error(lights, light[chosen], variance, shared)


def _errors_in_rows(means: Means, rows: slice) -> tuple[Planes, SharedPaths | None]:
    """Estimate the variance (group, band, row, w) in some rows, and the correlation of groups that share paths."""
    height = len(means.rates)
    near = slice(max(rows.start - 1, 0), min(rows.stop + 1, height))  # errors are pooled over 3x3 pixels
    own = slice(rows.start - near.start, rows.stop - near.start)
    light, *seen = (Halves(x.mean[..., near, :], x.difference[..., near, :]) for x in (means.light, *means.seen))
    rates = means.rates[near]
    errors = group_errors(light, seen, means.coverage.mean[near], rates)
    variance = np.stack([group.covariance(group, rates) for group in errors])
    shared = shared_paths(means.shared, errors, variance, rates) if means.shared else None
    of_rows = replace(shared, correlation=shared.correlation[:, own]) if shared else None
    return variance[:, :, own], of_rows


def scene_means_of(means: Means) -> SceneMeans:
    """Return the mean over the picture of all light except that of directly visible lamps, and its covariance.

    `uncovered` is the share of the picture in which no lamp is visible. The errors of different pixels are independent,
    so that the covariance of the mean is the sum of the pixels' covariances over the square of their number.
    """
    groups, bands, *size = means.light.mean.shape
    pixels = size[0] * size[1]
    scattered = np.empty((groups, bands))
    for group, band in np.ndindex(groups, bands):
        seen = means.seen[group].mean
        of_band = means.light.mean[group, band] - seen[band % len(seen)]
        scattered[group, band] = of_band.mean(dtype=np.float64)
    lit = means.light.difference.reshape(groups, bands, pixels)
    lamps = [seen.difference.reshape(-1, pixels) for seen in means.seen]
    covered = means.coverage.difference.reshape(1, pixels)
    covariance = np.zeros((groups * bands + 1,) * 2)
    with ThreadpoolController().limit(limits=1, user_api="blas"):  # because its threads would wait for Dr.Jit's
        for first in range(0, pixels, BLOCK):
            at = slice(first, first + BLOCK)
            errors = [of_group[:, at] - lamp[:, at] for of_group, lamp in zip(lit, lamps, strict=True)]
            part = np.concatenate([*errors, -covered[:, at]]).astype(np.float64)
            covariance += part @ part.T
    uncovered = 1 - float(means.coverage.mean.mean(dtype=np.float64))
    return SceneMeans(scattered, uncovered, covariance / pixels**2)


def add_run(
    scenes: list[LoadedScene],
    means: Means,
    film: Film,
    stop: int,
    seed: int,
    after: Callable[[float], None] | None = None,
) -> None:
    """Draw points from `means.count` on, at most to `stop` and as many as a launch holds, and add them to the means.

    Each launch adds both halves of its pixels, so that memory holds only the means and one launch's light. After an
    error or a second Ctrl-C the means are incomplete and must not be used.

    Parameters
    ----------
    scenes, means, film, stop, seed
    after : callable, optional
        Called after each launch but the last with the number of points of a half so far, averaged over the picture.
    """
    start = means.count
    chunk = chunk_from(means.count)
    split = means.indirect is not None
    # A launch has as many chunks as fit its threads, but only of one length (chunks grow along the sequence).
    threads = launch_threads(scenes, film, split=split)
    fitting = max(1, threads // (int(means.rates.sum()) * chunk))
    equal_chunks = next(n for n in range(1, MOST_POINTS) if n == fitting or chunk_from(start + n * chunk) != chunk)
    chunks = min(equal_chunks, -(-(stop - start) // chunk))
    span = Span(start, chunk, chunks)
    if len(scenes[0].groups) == 2:
        means.shared = scenes[0].groups[0], scenes[0].groups[1]
    halves = [_halves(loaded, film, seed, split=split) for loaded in scenes]
    parts = launches(means.rates, span, threads)
    for number, pixels in enumerate(parts, 1):
        # Each camera path first meets one lamp at most, which belongs to one group, so coverage adds up over groups.
        covered = np.zeros((2, chunks, pixels.size), np.float32)
        for loaded, both in zip(scenes, halves, strict=True):
            even, odd = (_drawn(half, means.rates, pixels, span) for half in both)
            covered += even.coverage, odd.coverage
            _add(loaded, means, (even, odd), pixels, span)
        for index, weight in enumerate(_weights(span)):
            means.coverage.add(covered[0, index], covered[1, index], weight, where(pixels))
        if after and number < len(parts):
            after(start + chunk * chunks * number / len(parts))
    means.count += chunks * chunk


def _weights(span: Span) -> list[np.float32]:
    """Return each chunk's weight in the mean of all points up to its end."""
    counts = [span.start + index * span.chunk for index in range(span.chunks)]
    return [np.float32(span.chunk / (count + span.chunk)) for count in counts]


def _add(loaded: LoadedScene, means: Means, halves: tuple[Drawn, Drawn], pixels: NDArray[np.intp], span: Span) -> None:
    """Add the light of a loaded scene to the means, chunk by chunk, at the pixels of a launch."""
    even, odd = halves
    at = where(pixels)
    for (index, weight), (slot, group) in product(enumerate(_weights(span)), enumerate(loaded.groups)):
        means.light[group].add(even.radiance[index, slot], odd.radiance[index, slot], weight, at)
        means.seen[group].add(even.seen[slot][index], odd.seen[slot][index], weight, at)
        if means.indirect is not None:
            means.indirect[group].add(even.indirect[index, slot], odd.indirect[index, slot], weight, at)


def pilot_rates(scenes: list[LoadedScene], film: Film, lights: Floats, seed: int) -> NDArray[np.uint32]:
    """Choose the rates of the pixels (h, w) by samples that are drawn for this choice alone.

    Parameters
    ----------
    lights : (group, band) float64
        The scene's own emission.
    """
    energy = (lights * film.width_nm).astype(np.float32)
    uniform = np.ones(film.size, np.uint32)
    scattered = np.zeros((len(lights), 2 * PILOT.chunks, *film.size), np.float32)
    seen = np.zeros((len(lights), *film.size), np.float32)
    threads = launch_threads(scenes, film)
    # If a picture needs several launches, memory holds one chunk of it at a time.
    at_once = PILOT.chunks if uniform.size * PILOT.chunk * PILOT.chunks <= threads else 1
    spans = [Span(first * PILOT.chunk, PILOT.chunk, at_once) for first in range(0, PILOT.chunks, at_once)]
    for loaded in scenes:
        draws = product(_halves(loaded, film, seed_of(seed, _PILOT_STREAM)), spans)
        for number, (half, span) in enumerate(draws):
            radiance, seen_in_half = _drawn_everywhere(half, uniform, span, threads)
            for (slot, group), chunk in product(enumerate(loaded.groups), range(at_once)):
                direct = seen_in_half[slot][chunk]
                # Bands are summed over the whole picture at once, because BLAS rounds by the size.
                light = (radiance[chunk, slot] - direct).reshape(-1, *film.size)
                scattered[group, number * at_once + chunk] = np.tensordot(energy[group], light, axes=1)
                emission = energy[group] if len(direct) > 1 else energy[group].sum(keepdims=True)
                planes = direct.reshape(-1, *film.size)
                seen[group] += np.tensordot(emission, planes, axes=1) / (2 * PILOT.chunks)
    return rates_of(scattered, seen)


def launch_threads(scenes: list[LoadedScene], film: Film, *, split: bool = False) -> int:
    """Return the number of threads per launch, which the memory of their channels limits."""
    return MOST_FLOATS // max(loaded.channels(film.wavelength_nm.size, split=split) for loaded in scenes)


def _halves(loaded: LoadedScene, film: Film, seed: int, *, split: bool = False) -> list[Half]:
    """Return the even and the odd half of a loaded scene's paths."""
    seeds = [seed_of(seed, loaded.groups[0], half) for half in range(2)]
    return [Half(loaded, tuple(tracers(loaded, film, PART_BANDS, each, split=split)), each, split) for each in seeds]


def _drawn(half: Half, rates: NDArray[np.uint32], pixels: NDArray[np.intp], span: Span) -> Drawn:
    """Draw a span of a half's paths at the pixels of a launch."""
    groups = len(half.loaded.groups)
    parts = [traced_at(tracer.camera, rates, pixels, span, half.seed) for tracer in half.tracers]
    total, indirect = (
        _joined([_grouped(part.pop(name), count) for part in parts])
        for name, count in (("scattered", groups), ("indirect", groups * half.split))
    )
    coverage = parts[0]["shares"]  # the parts of the bands see the same paths
    seen = [coverage[:, slot, None] for slot in range(groups)]
    if half.loaded.coloured:
        seen[0] = np.concatenate([part["lamps"] for part in parts], axis=1)
    for slot, planes in enumerate(seen):
        total[:, slot] += planes
    return Drawn(radiance=total, seen=seen, coverage=coverage.sum(axis=1), indirect=indirect)


def _drawn_everywhere(half: Half, rates: NDArray[np.uint32], span: Span, threads: int) -> tuple[Planes, list[Planes]]:
    """Draw a span of a half's paths at all pixels; return its radiance and directly visible light as in `Drawn`."""

    def planes(pixels: NDArray[np.intp]) -> dict[int, Planes]:
        drawn = _drawn(half, rates, pixels, span)
        return dict(enumerate([drawn.radiance, *drawn.seen]))

    radiance, *seen = on_whole_film(planes, rates, span, threads).values()
    return radiance, seen


def _joined(parts: list[Planes]) -> Planes:
    """Join the parts of the bands, (chunk, group, band, pixel)."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2)


def _grouped(channels: Planes, groups: int) -> Planes:
    """Reshape bands of several groups, which lie one after the other, to (chunk, group, band, pixel)."""
    chunks, count, pixels = channels.shape
    return channels.reshape(chunks, groups, count // max(groups, 1), pixels)


def clear_traceback(error: BaseException) -> None:
    """Free the refused scene that a traceback holds; Dr.Jit would compile its materials into the next render."""
    cause: BaseException | None = error
    while cause:
        if cause.__traceback__ and cause.__traceback__.tb_next:
            traceback.clear_frames(cause.__traceback__.tb_next)
        cause.__traceback__, cause = None, cause.__cause__ or cause.__context__
