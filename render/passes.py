"""Independent passes over a scene, and their running sums: the mean is the picture, the scatter its error."""

import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.error_estimates import SharedPaths
from render.errors import InputError, one_line
from render.loader import PART_BANDS, Film, Loaded, integrators, load_direct, mitsuba_module, parts, variant
from render.scene import Scene
from render.spectrum import Floats
from render.transport import Transport

Planes = NDArray[np.float32]  # (band, h, w)

METER_BANDS = 4  # traced together by the irradiance meter: its film is small, and its kernel another one to compile
METER_SPP = 16  # most samples a pixel and pass of its 64x64 film: 65 536 paths a pass for one number a band
VISIBLE_SPP = 16  # samples a pixel to find where a light is seen directly


@dataclass
class Sums:
    """Running sums over passes (Welford), (group, band, h, w); the only mutable state of a render.

    `product` (band, h, w) is the scatter's counterpart of two groups that `share` their paths: their covariance's.
    """

    mean: NDArray[np.float32]
    scatter: NDArray[np.float32]
    signed: NDArray[np.float32]
    plane: Floats
    share: tuple[int, int] | None = None
    product: Planes | None = None
    passes: int = 0
    drawn: int = 0

    @property
    def variance_factor(self) -> np.float32:
        """What turns the scatter into the variance of the mean."""
        return np.float32(1 / ((self.passes - 1) * self.passes))

    @property
    def shared(self) -> SharedPaths | None:
        """How the errors of two groups go together."""
        if self.share is None or self.product is None:
            return None
        one, other = (np.sqrt(self.scatter[group]) for group in self.share)
        both = one * other
        found = np.divide(self.product, both, out=np.zeros_like(both), where=both > 0)
        return SharedPaths(self.share, np.clip(found, -1, 1, out=found))


def no_passes(groups: int, film: Film) -> Sums:
    """Sums of nothing."""
    shape = (groups, film.wavelength_nm.size, *film.size)
    mean, scatter, signed = (np.zeros(shape, np.float32) for _ in range(3))
    return Sums(mean, scatter, signed, plane=np.zeros(shape[:2]))


def sums_of(transport: Transport) -> Sums:
    """Sums that an earlier render stopped at, to go on from: its radiance to the bit."""
    passes, drawn, shared = transport.passes, transport.spp, transport.shared
    sums = Sums(
        mean=transport.radiance.copy(),
        scatter=transport.variance * np.float32((passes - 1) * passes),
        signed=transport.half_difference * np.float32(passes),
        plane=np.zeros(transport.radiance.shape[:2]) if transport.irradiance is None else transport.irradiance * passes,
        passes=passes,
        drawn=drawn,
    )
    if shared:
        one, other = (np.sqrt(sums.scatter[group]) for group in shared.groups)
        sums.share, sums.product = shared.groups, shared.correlation * one * other
    return sums


def add_pass(loaded: list[Loaded], sums: Sums, film: Film, pass_spp: int, seed: int) -> None:
    """Render every group once more, with a seed of its own, and add it to the sums."""
    sums.passes += 1
    for unit in loaded:
        camera, *meter = unit.mi_scene.sensors()
        of_pass = pass_seed(seed, unit.groups[0], sums.passes - 1)
        for first, planes in band_parts(unit, camera, film, PART_BANDS, pass_spp, of_pass):
            _add(sums, unit.groups, slice(first, first + planes.shape[1]), planes)
        if meter:
            sums.plane[list(unit.groups)] += _meter(unit, meter[0], film, min(pass_spp, METER_SPP), of_pass)
    sums.drawn += int(camera.sampler().sample_count())  # what the stratified sampler really drew


def _add(sums: Sums, groups: tuple[int, ...], bands: slice, planes: Planes) -> None:
    """Add some bands of one pass; `planes` holds the groups in the order given."""
    count, off_mean = np.float32(sums.passes), []
    for group, of_group in zip(groups, planes, strict=True):
        mean = sums.mean[group, bands]
        delta = of_group - mean
        mean += delta / count
        sums.scatter[group, bands] += delta * (of_group - mean)
        sums.signed[group, bands] += of_group if sums.passes % 2 else -of_group
        off_mean.append(delta)
    if len(groups) == 2:
        if sums.product is None:
            sums.share, sums.product = (groups[0], groups[1]), np.zeros_like(sums.mean[0])
        sums.product[bands] += off_mean[0] * (planes[1] - sums.mean[groups[1], bands])


def _meter(unit: Loaded, sensor: Any, film: Film, spp: int, seed: int) -> Floats:
    """Irradiance on the reference plane, shape (group, band); summed in float64, so that threads don't change it."""
    parts_of = band_parts(unit, sensor, film, METER_BANDS, spp, seed, meter=True)
    meter = np.concatenate([planes.mean(axis=(2, 3), dtype=np.float64) for _, planes in parts_of], axis=1)
    # The meter's weight of a cosine-distributed ray, which Mitsuba leaves off extra channels.
    return meter if variant() == "scalar_spectral" else meter * np.pi


def band_parts(
    unit: Loaded, sensor: Any, film: Film, most: int, spp: int, seed: int, meter: bool = False
) -> Iterator[tuple[int, Planes]]:
    """Render one sensor, at most `most` bands at a time: index of the first band, and band averages.

    These have shape (group, band, h, w), the groups being those of the unit. Every part of the bands sees the same
    paths.
    """
    first, tracers = 0, integrators(film, most, unit, seed, meter)
    if variant() == "scalar_spectral":  # specfilm integrates over the band
        image = _rendered(unit, sensor, tracers[0], spp, seed)
        yield 0, (image / film.width_nm.astype(np.float32)[:, None, None])[None]
        return
    for part, integrator in zip(parts(film, most), tracers, strict=True):
        image = _rendered(unit, sensor, integrator, spp, seed)
        if image[-1].any():
            raise InputError(
                "scene: a material chooses where light goes by wavelength (dispersion, wavelength-dependent lobes); "
                "allowed: materials whose sampling doesn't depend on wavelength; replace it"
            )
        # Channel 0 is the film's own luminance, the last one the mark above; between them each group's bands.
        groups = image[1:-1].reshape(len(unit.groups), -1, *image.shape[1:])
        yield first, groups[:, : part.size]
        first += part.size


def _rendered(unit: Loaded, sensor: Any, integrator: Any, spp: int, seed: int) -> Planes:
    try:
        image = mitsuba_module().render(unit.mi_scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed)
    except RuntimeError as error:
        cause = _root_cause(error)
        if not isinstance(cause, RuntimeError):  # a fault of this program, not of the scene
            raise
        raise InputError(f"scene: Mitsuba can't render it: {one_line(cause)}; correct the description") from None
    return np.ascontiguousarray(np.moveaxis(np.asarray(image, dtype=np.float32), -1, 0))


def emitter_visible(scene: Scene, film: Film, seed: int) -> NDArray[np.bool_]:
    """Pixels in which a light is seen directly, shape (h, w)."""
    loaded = load_direct(scene, film)
    one_band = Film(film.size, film.wavelength_nm[:1], film.width_nm[:1], 1)
    of_pass = pass_seed(seed, len(scene.groups), 0)
    camera = loaded.mi_scene.sensors()[0]
    _, planes = next(band_parts(loaded, camera, one_band, PART_BANDS, VISIBLE_SPP, of_pass))
    return np.asarray(planes[0, 0] > 0)


def pass_seed(seed: int, group: int, index: int) -> int:
    """Seed of one pass of one group, from its coordinates alone."""
    return int(np.random.SeedSequence([seed, group, index]).generate_state(1)[0])


def let_go(error: BaseException) -> None:
    """Free the refused scene, which the traceback holds: Dr.Jit compiles every live material into the next render."""
    cause: BaseException | None = error
    while cause:
        if cause.__traceback__ and cause.__traceback__.tb_next:
            traceback.clear_frames(cause.__traceback__.tb_next)
        cause.__traceback__, cause = None, cause.__cause__ or cause.__context__


def _root_cause(error: BaseException) -> BaseException:
    """Error from under the layers that Dr.Jit wraps around it."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return error
