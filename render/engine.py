"""Rendering a scene's transport: independent passes, their scatter as the error, and the rule that stops them."""

import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from render.cache import load_transport, save_transport
from render.errors import InputError, require_whole
from render.limits import Limits
from render.loader import Film, integrator_name, integrators, load_direct, load_unit, mitsuba_module, parts, variant
from render.scene import Scene
from render.spectrum import DEFAULT_WAVELENGTH_NM, Floats, band_widths
from render.transport import Stop, Transport, relative_error

Planes = NDArray[np.float32]  # (band, h, w)
Progress = Callable[[float, float], None]  # share of the work done (0..1), relative error so far

# Bands traced together by the camera. 40 bands of `still_life`, 256x256, 64 samples on two cores, in parts of 40, 20,
# 12, 8, 4: first kernels after 31, 21, 11, 10, 9 s, then 55, 33, 30, 32, 40 s a render.
CAMERA_BANDS = 12
METER_BANDS = 4  # by the irradiance meter: its film is small, and its kernel another one to compile
VISIBLE_SPP = 16  # samples a pixel to find where a light is seen directly


@dataclass
class _Sums:
    """Running sums of one group's passes (Welford), planes of (band, h, w); the only mutable state of a render."""

    mean: Planes
    scatter: Planes
    signed: Planes
    plane: Floats | None = None
    passes: int = 0
    drawn: int = 0

    def add(self, planes: Planes) -> None:
        self.passes += 1
        delta = planes - self.mean
        self.mean += delta / np.float32(self.passes)
        self.scatter += delta * (planes - self.mean)
        self.signed += planes if self.passes % 2 else -planes

    @property
    def variance(self) -> Planes:
        """Variance of the mean."""
        return self.scatter / np.float32((self.passes - 1) * self.passes)


def render(
    scene: Scene,
    size: tuple[int, int],
    *,
    wavelength_nm: ArrayLike | None = None,
    width_nm: ArrayLike | None = None,
    spp: int | None = None,
    noise: float | None = None,
    max_seconds: float | None = None,
    max_depth: int = 8,
    seed: int = 0,
    cache: str | Path | None = None,
    progress: Progress | None = None,
) -> Transport:
    """Render each light group of a scene at unit spectral emission.

    Stops at whichever comes first of `spp`, `noise` and `max_seconds`; with none of them after 64 samples a pixel.

    Parameters
    ----------
    scene : Scene
    size : (int, int)
        Height and width in pixels.
    wavelength_nm, width_nm : (band,) array_like, optional
        Band centres and widths; 40 bands of 10 nm over 380-780 nm by default.
    spp : int, optional
        Samples a pixel, rounded up to what the passes and the stratified sampler can hold.
    noise : float, optional
        Relative Monte Carlo error (median over pixels and bands, scene's own lights) to reach.
    max_seconds : float, optional
        Time to keep; at least two passes are made.
    max_depth : int
        Longest path in segments; 2 is direct light.
    seed : int
        The same seed gives the same bits on one machine, variant and LLVM, whatever the number of threads.
    cache : path, optional
        Folder of finished renders; an unreadable entry is rendered again.
    progress : callable, optional
        Called after each pass with the share done and the error so far.

    Returns
    -------
    Transport

    Raises
    ------
    InputError
        For a bad size, band or limit, a scene without light, or a material that picks lobes by wavelength.
    """
    film = _checked_film(scene, size, wavelength_nm, width_nm, max_depth)
    limits = Limits(spp, noise, max_seconds, seed)
    if cache is not None and (found := load_transport(Path(cache), scene, film, asdict(limits))) is not None:
        return found
    try:
        transport = _render(scene, film, limits, progress or (lambda done, error: None))
    except InputError as error:
        _let_go(error)
        raise
    if cache is not None:
        save_transport(Path(cache), scene, film, asdict(limits), transport)
    return transport


def _checked_film(
    scene: Scene, size: tuple[int, int], wavelength_nm: ArrayLike | None, width_nm: ArrayLike | None, max_depth: int
) -> Film:
    if not scene.groups:
        raise InputError(f"scene {scene.name}: it has no light; allowed: one light group or more; add one")
    if (
        not isinstance(size, tuple | list)
        or len(size) != 2
        or not all(isinstance(n, int | np.integer) and 1 <= n <= 1 << 15 for n in size)
    ):
        raise InputError(f"size: {size!r} is not allowed; give (height, width) in pixels, each 1 to 32768")
    require_whole("max_depth", max_depth, 2, 1 << 16, "2 is direct light")
    nm = np.array(DEFAULT_WAVELENGTH_NM if wavelength_nm is None else wavelength_nm, dtype=np.float64)
    return Film((int(size[0]), int(size[1])), nm, band_widths(nm, width_nm), int(max_depth))


def _render(scene: Scene, film: Film, limits: Limits, progress: Progress) -> Transport:
    start = time.perf_counter()
    loaded = [load_unit(scene, group, film) for group in scene.groups]
    shape = (film.wavelength_nm.size, *film.size)
    sums = [
        _Sums(np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.float32)) for _ in loaded
    ]
    stopped_by: Stop | None = None
    for done, pass_seconds in _pairs(loaded, sums, film, limits):
        seconds, error = time.perf_counter() - start, _own_error(scene, film, sums)
        progress(limits.share(sums[0].drawn, error, seconds), error)
        stopped_by = limits.stop(sums[0].drawn, done, error, seconds, pass_seconds)
        if stopped_by:
            break
    return Transport(
        radiance=np.stack([s.mean for s in sums]),
        half_difference=np.stack([s.signed / np.float32(s.passes) for s in sums]),
        variance=np.stack([s.variance for s in sums]),
        irradiance=np.stack([s.plane / s.passes for s in sums if s.plane is not None])
        if scene.reference_plane
        else None,
        emitter_visible=_emitter_visible(scene, film, limits.seed),
        groups=dict(scene.groups),
        wavelength_nm=film.wavelength_nm,
        width_nm=film.width_nm,
        spp=sums[0].drawn,
        passes=sums[0].passes,
        stopped_by=stopped_by or "samples",
        seconds=time.perf_counter() - start,
        integrator=integrator_name(),
        variant=variant(),
    )


def _pairs(loaded: list[Any], sums: list[_Sums], film: Film, limits: Limits) -> Iterator[tuple[int, float]]:
    """Add passes two by two, so that even and odd halves stay equal.

    Yields the passes done, and the seconds of the last one: the second of a pair, which compiles nothing.
    """
    done = 0
    while True:
        for _ in range(2):
            start = time.perf_counter()
            for index, (mi_scene, total) in enumerate(zip(loaded, sums, strict=True)):
                total.drawn += _one_pass(mi_scene, total, film, limits.pass_spp, _pass_seed(limits.seed, index, done))
            done += 1
        yield done, time.perf_counter() - start


def _one_pass(mi_scene: Any, total: _Sums, film: Film, pass_spp: int, seed: int) -> int:
    """Add one pass to the sums; gives the samples a pixel that the sampler really drew."""
    sensors = mi_scene.sensors()
    total.add(_bands(mi_scene, sensors[0], film, CAMERA_BANDS, pass_spp, seed))
    if len(sensors) > 1:
        meter = _bands(mi_scene, sensors[1], film, METER_BANDS, pass_spp, seed).mean(axis=(1, 2), dtype=np.float64)
        if variant() != "scalar_spectral":
            meter *= np.pi  # the meter's weight of a cosine-distributed ray, which Mitsuba leaves off extra channels
        total.plane = meter if total.plane is None else total.plane + meter
    return int(sensors[0].sampler().sample_count())


def _bands(mi_scene: Any, sensor: Any, film: Film, most_bands: int, spp: int, seed: int) -> Planes:
    """Render one sensor: band averages, shape (band, h, w). Every part of the bands sees the same paths."""
    mi, images = mitsuba_module(), []
    for integrator in integrators(film, most_bands):
        try:
            image = mi.render(mi_scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed)
        except RuntimeError as error:
            raise InputError(f"scene: Mitsuba can't render it: {_root_cause(error)}; correct the description") from None
        images.append(np.moveaxis(np.asarray(image, dtype=np.float32), -1, 0))
    if variant() == "scalar_spectral":  # specfilm integrates over the band
        return np.ascontiguousarray(images[0] / film.width_nm.astype(np.float32)[:, None, None])
    if any(image[-1].any() for image in images):
        raise InputError(
            "scene: a material chooses where light goes by wavelength (dispersion, wavelength-dependent lobes); "
            "allowed: materials whose sampling doesn't depend on wavelength; replace it"
        )
    sizes = [part.size for part in parts(film, most_bands)]
    # Channel 0 is the film's own luminance; the last one the mark tested above.
    return np.concatenate([image[1 : 1 + size] for image, size in zip(images, sizes, strict=True)])


def _let_go(error: BaseException) -> None:
    """Free the refused scene, which the traceback holds: Dr.Jit compiles every live material into the next render."""
    cause: BaseException | None = error
    while cause:
        if cause.__traceback__ and cause.__traceback__.tb_next:
            traceback.clear_frames(cause.__traceback__.tb_next)
        cause.__traceback__, cause = None, cause.__cause__ or cause.__context__


def _root_cause(error: BaseException) -> str:
    """Mitsuba's own words, from under the layers that Dr.Jit wraps around them, on one line."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return " ".join(str(error).split())


def _emitter_visible(scene: Scene, film: Film, seed: int) -> NDArray[np.bool_]:
    """Pixels in which a light is seen directly, shape (h, w)."""
    loaded = load_direct(scene, film)
    one_band = Film(film.size, film.wavelength_nm[:1], film.width_nm[:1], 1)
    planes = _bands(
        loaded, loaded.sensors()[0], one_band, METER_BANDS, VISIBLE_SPP, _pass_seed(seed, len(scene.groups), 0)
    )
    return np.asarray(planes[0] > 0)


def _pass_seed(seed: int, group: int, index: int) -> int:
    """Seed of one pass of one group, from its coordinates alone."""
    return int(np.random.SeedSequence([seed, group, index]).generate_state(1)[0])


def _own_error(scene: Scene, film: Film, sums: list[_Sums]) -> float:
    """Relative error under the scene's own lights."""
    values = np.zeros_like(sums[0].mean)
    variance = np.zeros_like(values)
    for group, total in zip(scene.groups.values(), sums, strict=True):
        spectrum = (group.spectrum * group.power).band_average(film.wavelength_nm, film.width_nm)
        emission = spectrum.astype(np.float32)[:, None, None]
        values += emission * total.mean
        variance += emission**2 * total.variance
    return relative_error(values, variance)
