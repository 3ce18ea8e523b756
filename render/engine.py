"""The render of a scene's transport: two halves of the samples, their difference as the error, and when to stop."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from render.cache import read_transport, save_transport
from render.combinations import check_combinations
from render.combine import emission
from render.denoised.denoise import Denoised, denoiser
from render.denoised.folds import FOLD_SHARE, denoise_means
from render.geometry import horizontal_view_deg
from render.level import Irradiance
from render.limits import LEAST_POINTS, PILOT_FROM, Limits
from render.loader import INTEGRATOR, Film, load_groups, own_mitsuba_variant, variant
from render.meter import Meter
from render.runs import add_run, clear_traceback, error_of, fields_of, means_of, no_means, pilot_rates, scene_means_of
from render.scene import Scene, film_size
from render.scene_range import check_range, warn_of_coloured_lights
from render.spectrum import RENDER_BAND_NM, VISIBLE_NM, band_widths, even_bands
from render.transport import Stop, Transport
from rodcone.errors import InputError, is_out_of_memory, one_line, require_whole
from rodcone.jit import compiling, release_memory
from rodcone.progress import Step, progress_bar, render_words
from rodcone.types import Progress

KEEP_EVERY_S = 60.0  # least time between two copies of a long render to the cache
KEEP_SHARE = 0.1  # largest share of the time that these copies take


@own_mitsuba_variant()
def render(  # noqa: PLR0913  calls in README and tutorials have to keep working
    scene: Scene,
    size: tuple[int, int] | int,
    *,
    wavelength_nm: ArrayLike | None = None,
    width_nm: ArrayLike | None = None,
    spp: int | None = None,
    max_spp: int | None = None,
    noise: float | None = None,
    max_seconds: float | None = None,
    max_depth: int | None = None,
    seed: int = 0,
    cache: str | Path | None = None,
    resume: Transport | None = None,
    progress: Progress | None = None,
    denoise: bool = False,
) -> Transport:
    """Render each light group of a scene at unit spectral emission.

    The render stops at whichever limit is reached first: `spp` (or `max_spp`), `noise` or `max_seconds`; without any of
    them, after 64 samples per pixel. Ctrl-C ends it after the current run and keeps the result; a second one aborts it.

    Parameters
    ----------
    scene : Scene
    size : (int, int) or int
        Height and width in pixels, or the longer side alone, from which the scene's proportions give the other.
    wavelength_nm, width_nm : (band,) array_like, optional
        Band centres and widths; 20 bands of 20 nm over 380-780 nm by default. `render.spectrum.line_bands` gives
        emission lines bands of their own.
    spp : int, optional
        Samples per pixel in the mean over the picture, in two independent halves; rounded up by an eighth at most.
        `Transport.counts` holds the samples of each pixel. If `spp` exceeds 64, a pilot of 32 samples, which aren't
        counted, first finds the pixels that need more. Every pixel gets at least a quarter of the mean.
    max_spp : int, optional
        The same, as a ceiling that may be combined with `noise` or `max_seconds`.
    noise : float, optional
        Relative Monte Carlo error to reach: median over pixels and bands, with variance pooled over 3x3 pixels, under
        the scene's own lights. It is checked from 16 samples on, at powers of two and half-way between them.
    max_seconds : float, optional
        Time limit, which includes earlier calls' time; at least one run is made.
    max_depth : int, optional
        Longest path in segments; 1 is emission alone, 2 direct light. By default the scene's own.
    seed : int
        The same seed gives the same bits on one machine, variant and LLVM, whatever the number of threads.
    cache : path, optional
        Folder of renders. A stored one that is fine enough is returned, a coarser one continued, a damaged one ignored.
        Unless it is denoised, a long render is also stored every minute or so: after a kill it continues from there.
    resume : Transport, optional
        An earlier result of the same scene, size, bands, depth and seed, to be continued. The result has the same bits
        as one uninterrupted render. A result of 64 samples or fewer had no pilot, so that it starts over if more are
        asked for.
    progress : callable, optional
        Called after each launch with the share done and the error so far, which is infinite before it is first known;
        a run of a large picture has many launches. If it raises `KeyboardInterrupt`, the render ends as by Ctrl-C. If
        it is left out, a notebook shows a progress bar.
    denoise : bool
        Also give denoised light, and two folds, each of a quarter of the samples, by which its error is measured
        (`render.denoised.relight`). `max_seconds` includes their time. After Ctrl-C they are still drawn.

    Returns
    -------
    Transport

    Raises
    ------
    InputError
        For a bad size, band or limit, a scene without light, a material that picks lobes by wavelength, a surface
        or sunsky whose data end within the bands, or an earlier result of another size, bands or lights; for `denoise`
        without the extra of that name; without LLVM and CUDA.
    MemoryError
        Where the system or Dr.Jit has no more.

    Warns
    -----
    UserWarning
        If the data of a coloured light end within the bands: beyond them the light is dark.
    """
    # Check the arguments.
    sides = film_size(scene.size, size) if isinstance(size, int) and size > 0 else size
    film = _checked_film(scene, sides, wavelength_nm, width_nm, scene.max_depth if max_depth is None else max_depth)
    warn_of_coloured_lights(scene, film.wavelength_nm, film.width_nm)
    if denoise:
        denoiser()
    if denoise and max_seconds is not None:
        max_seconds /= 1 + 2 * FOLD_SHARE
    limits = Limits(spp=spp, max_spp=max_spp, noise=noise, max_seconds=max_seconds, seed=seed)
    meter: Callable[[], Irradiance] | None = None
    if scene.reference_plane:
        meter = Meter(scene, film, seed, None if cache is None else Path(cache))
    # Look for an earlier result.
    earlier = _checked_earlier(resume, scene, film, denoise)
    keep: Callable[[Transport], None] | None = None
    if cache is not None:
        keep = partial(save_transport, Path(cache), scene, film, seed)
        stored = read_transport(Path(cache), scene, film, seed, denoised=denoise)
        earlier = max((x for x in (earlier, stored) if x), key=lambda x: x.spp, default=None)
        del stored
    if earlier is not None:
        meter = earlier.meter or meter  # the earlier result's meter may have measured already
        if limits.met_by(earlier):
            return replace(earlier, meter=meter)
        earlier = _to_go_on_with(earlier, copied=earlier is resume)
    silent: Step | None = (lambda what, share: None) if progress else None
    with progress_bar(silent) as step, compiling() as compiled_s:
        step(render_words(np.inf), 0.0)

        def show(share: float, error: float) -> None:
            compiled_s()  # read after each launch, so that the list of compilations that Dr.Jit keeps stays short
            (progress or (lambda share, error: step(render_words(error, share), share)))(share, error)

        try:
            transport = _render(scene, film, limits, earlier, show, denoise, keep)
        except InputError as error:
            clear_traceback(error)
            raise
        except RuntimeError as error:
            if not is_out_of_memory(error):
                raise
            clear_traceback(error)
            raise MemoryError(one_line(error)) from None
        transport = replace(transport, compile_s=compiled_s())
    release_memory()  # Dr.Jit's reserve for its next launch is as large as the light, of which copies are made next
    if keep is not None:
        keep(transport)
    return replace(transport, meter=meter)


def _checked_film(
    scene: Scene,
    size: tuple[int, int] | int,
    wavelength_nm: ArrayLike | None,
    width_nm: ArrayLike | None,
    max_depth: int,
) -> Film:
    if not scene.groups:
        raise InputError(f"scene {scene.name}: it has no light; allowed: one light group or more; add one")
    sides = list(size) if isinstance(size, tuple | list) else []
    if len(sides) != 2 or not all(isinstance(n, int | np.integer) and 1 <= n <= 1 << 15 for n in sides):
        raise InputError(f"size: {size!r} is not allowed; give (height, width) in pixels, each 1 to 32768")
    require_whole("max_depth", max_depth, 1, 1 << 16, "1 is emission alone, 2 direct light")
    if wavelength_nm is None:
        wavelength_nm = even_bands(VISIBLE_NM, round((VISIBLE_NM[1] - VISIBLE_NM[0]) / RENDER_BAND_NM))[0]
    nm = np.array(wavelength_nm, dtype=np.float64)
    widths = band_widths(nm, width_nm)
    check_combinations(scene)
    check_range(scene, float((nm - widths / 2).min()), float((nm + widths / 2).max()))
    return Film(
        size=(int(sides[0]), int(sides[1])),
        wavelength_nm=nm,
        width_nm=widths,
        max_depth=int(max_depth),
        rr_depth=scene.rr_depth,
    )


def _checked_earlier(earlier: Transport | None, scene: Scene, film: Film, denoise: bool) -> Transport | None:
    """Return the result to continue, or raise `InputError` if it is of another scene, size or bands."""
    if earlier is None:
        return None
    shape = (len(scene.groups), film.wavelength_nm.size, *film.size)
    same_centres = np.array_equal(earlier.wavelength_nm, film.wavelength_nm)
    same_bands = same_centres and np.array_equal(earlier.width_nm, film.width_nm)
    if earlier.radiance.shape != shape or not same_bands or list(earlier.groups) != list(scene.groups):
        raise InputError(
            f"resume: (group, band, h, w) {earlier.radiance.shape} of lights {list(earlier.groups)} don't fit the "
            f"{shape} of {list(scene.groups)} asked for; allowed: a result of the same scene, size and bands; "
            "leave it out"
        )
    if denoise and earlier.denoised is None:
        raise InputError("resume: it wasn't denoised; allowed with denoise: a result that was; leave one of them out")
    return earlier


def _to_go_on_with(earlier: Transport, *, copied: bool) -> Transport:
    """Return an earlier result, without its variance, whose arrays the render may overwrite.

    With `copied` they are copies, because the caller keeps the result.
    """
    if copied:
        denoised = earlier.denoised
        earlier = replace(
            earlier,
            light=earlier.light.copy(),
            coverage=earlier.coverage.copy(),
            seen=tuple(halves.copy() for halves in earlier.seen),
            denoised=replace(denoised, indirect=denoised.indirect.copy()) if denoised else None,
        )
    return replace(earlier, variance=np.zeros((0, 0, 0, 0), np.float32))


def _render(
    scene: Scene,
    film: Film,
    limits: Limits,
    earlier: Transport | None,
    progress: Progress,
    denoise: bool,
    keep: Callable[[Transport], None] | None = None,
) -> Transport:
    """Draw runs, continuing an earlier result's means, until a limit is reached; call `keep` from time to time."""
    start = time.perf_counter() - (earlier.seconds if earlier else 0.0)
    own_share = 1 / (1 + 2 * FOLD_SHARE) if denoise else 1.0
    denoised: Denoised | None = None
    piloted = limits.most_samples > PILOT_FROM
    loaded = load_groups(scene, film)
    lights = emission(scene.groups, film.wavelength_nm, film.width_nm)
    stopped_by: Stop | None = None
    # Continue the earlier means, or begin.
    had_pilot = earlier and (earlier.spp > PILOT_FROM or earlier.counts.min() < earlier.counts.max())
    if earlier and (had_pilot or not piloted):
        means = means_of(earlier, split=denoise)
    else:  # there is no earlier result, or it had no pilot and this render needs one
        rates = pilot_rates(loaded, film, lights, limits.seed) if piloted else np.ones(film.size, np.uint32)
        means = no_means(scene, film, rates, split=denoise)
        earlier = None
    limits = replace(limits, mean_rate=float(means.rates.mean()))
    # Draw runs until a limit is reached.
    error = np.inf
    look = limits.next_look(means.count)
    asked_to_end = threading.Event()

    def show(points: float) -> None:
        try:
            progress(own_share * limits.share(points, error, time.perf_counter() - start), error)
        except KeyboardInterrupt:
            if interrupted():  # the second Ctrl-C came just then
                raise
            asked_to_end.set()

    def so_far(stopped_by: Stop) -> Transport:
        release_memory()  # Dr.Jit's reserve for its next launch
        return Transport(
            **fields_of(lights, means),
            scene_means=scene_means_of(means),
            groups=dict(scene.groups),
            wavelength_nm=film.wavelength_nm,
            width_nm=film.width_nm,
            counts=2 * means.count * means.rates,
            stopped_by=stopped_by,
            seconds=time.perf_counter() - start,
            integrator=INTEGRATOR,
            variant=variant(),
            denoised=denoised,
            horizontal_view_deg=horizontal_view_deg(scene.geometry["sensor"], film.size) or None,
        )

    keep_from = time.perf_counter() + KEEP_EVERY_S
    with _interrupt_noted() as interrupted:
        while stopped_by is None:
            run_start = time.perf_counter()
            add_run(loaded, means, film, look, limits.seed, show)
            if means.count >= LEAST_POINTS:
                error = error_of(lights, means)
            now = time.perf_counter()
            show(means.count)
            if asked_to_end.is_set():
                stopped_by = "interrupt"
            # The error is reported after every run, but only at a look may it stop the render.
            looked_at = error if means.count >= look else np.inf
            stopped_by = stopped_by or limits.stop(means.count, looked_at, now - start, now - run_start)
            look = limits.next_look(means.count) if means.count >= look else look
            if stopped_by is None and interrupted():
                stopped_by = "interrupt"
            if keep and not denoise and stopped_by is None and now > keep_from:
                keep(so_far("interrupt"))
                took_s = time.perf_counter() - now
                keep_from = now + took_s + max(KEEP_EVERY_S, took_s / KEEP_SHARE)
        if denoise:
            denoised = denoise_means(scene, loaded, film, means, limits.seed, earlier.denoised if earlier else None)
    return so_far(stopped_by)


@contextmanager
def _interrupt_noted() -> Iterator[Callable[[], bool]]:
    """Note the first Ctrl-C; a second one raises KeyboardInterrupt. Only the main thread receives signals."""
    noted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield noted.is_set
        return

    def note(number: int, frame: object) -> None:
        if noted.is_set():
            raise KeyboardInterrupt
        noted.set()

    before = signal.signal(signal.SIGINT, note)
    try:
        yield noted.is_set
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
