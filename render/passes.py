"""Independent passes over a scene, and their running sums: the mean is the picture, the scatter its error."""

import traceback
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from render.error_estimates import SharedPaths
from render.integrator.dense import SPECTRUM_SIZE
from render.level import PassMeans
from render.loader import PART_BANDS, Film, Loaded, integrators, mitsuba_module, mitsuba_words
from render.scene import Scene
from render.transport import Transport
from rodcone.errors import InputError
from rodcone.jit import backend
from rodcone.types import Floats, Planes

METER_BANDS = 4  # traced together by the irradiance meter: its film is small, and its kernel another one to compile
METER_SPP = 16  # most samples a pixel and pass of its 64x64 film: 65 536 paths a pass for one number a band


@dataclass
class PassSums:
    """Running sums over passes, each weighed by its samples (Welford; West 1979); the only mutable state of a render.

    `mean`, `scatter` and `signed` have the shape (group, band, h, w). `seen` and `coverage` are as of `Transport`,
    times the samples. `product` (band, h, w) is the scatter's counterpart of two groups that `share` their paths.
    `spp`, `uncovered`, `radiance` and `irradiance` hold a value a pass, as `PassMeans`.
    """

    mean: Planes
    scatter: Planes
    signed: Planes
    seen: list[Planes]
    coverage: Planes
    share: tuple[int, int] | None = None
    product: Planes | None = None
    spp: list[int] = field(default_factory=list)
    uncovered: list[float] = field(default_factory=list)
    radiance: list[Floats] = field(default_factory=list)
    irradiance: list[Floats] = field(default_factory=list)

    @property
    def passes(self) -> int:
        """Passes so far."""
        return len(self.spp)

    @property
    def drawn(self) -> int:
        """Samples a pixel so far."""
        return sum(self.spp)

    @property
    def variance_factor(self) -> np.float32:
        """Factor from the scatter to the variance of the mean."""
        return np.float32(1 / ((self.passes - 1) * self.drawn))

    @property
    def shared(self) -> SharedPaths | None:
        """Correlation of the errors of two groups that share paths."""
        if self.share is None or self.product is None:
            return None
        one, other = (np.sqrt(self.scatter[group]) for group in self.share)
        both = one * other
        found = np.divide(self.product, both, out=np.zeros_like(both), where=both > 0)
        return SharedPaths(self.share, np.clip(found, -1, 1, out=found))

    def pass_means(self) -> PassMeans:
        """Means over each pass, from which levels are computed."""
        return PassMeans(
            spp=np.array(self.spp),
            uncovered=np.array(self.uncovered),
            radiance=np.array(self.radiance),
            irradiance=np.array(self.irradiance) if self.irradiance else None,
        )


def no_passes(scene: Scene, film: Film) -> PassSums:
    """Sums before the first pass."""
    bands = film.wavelength_nm.size
    mean, scatter, signed = (np.zeros((len(scene.groups), bands, *film.size), np.float32) for _ in range(3))
    seen = [np.zeros((bands if x.coloured else 1, *film.size), np.float32) for x in scene.groups.values()]
    return PassSums(mean=mean, scatter=scatter, signed=signed, seen=seen, coverage=np.zeros(film.size, np.float32))


def sums_of(transport: Transport) -> PassSums:
    """Sums that an earlier render stopped at, to go on from: its radiance to the bit."""
    means, samples = transport.pass_means, np.float32(transport.spp)
    sums = PassSums(
        mean=transport.radiance.copy(),
        scatter=transport.variance * np.float32((transport.passes - 1) * transport.spp),
        signed=transport.half_difference * samples,
        seen=[planes * samples for planes in transport.seen],
        coverage=transport.coverage * samples,
        spp=means.spp.tolist(),
        uncovered=means.uncovered.tolist(),
        radiance=list(means.radiance),
        irradiance=[] if means.irradiance is None else list(means.irradiance),
    )
    if shared := transport.shared:
        one, other = (np.sqrt(sums.scatter[group]) for group in shared.groups)
        sums.share, sums.product = shared.groups, shared.correlation * one * other
    return sums


def add_pass(light_groups: list[Loaded], sums: PassSums, film: Film, pass_spp: int, seed: int) -> None:
    """Render every group once more, with a seed of its own, and add it to the sums."""
    groups, bands = sums.mean.shape[:2]
    index, covered = sums.passes, 0.0
    radiance, irradiance = np.zeros((groups, bands)), np.zeros((groups, bands))
    sums.spp.append(pass_spp)
    for loaded in light_groups:
        of_pass = int(np.random.SeedSequence([seed, loaded.groups[0], index]).generate_state(1)[0])
        for part, integrator in integrators(film, PART_BANDS, loaded, of_pass):
            scattered, seen, coverage = _camera_part(loaded, integrator, film.width_nm[part], pass_spp, of_pass)
            chosen = slice(int(part[0]), int(part[-1]) + 1)
            _add(sums, loaded.groups, chosen, scattered, seen)
            radiance[loaded.groups, chosen] = scattered.mean(axis=(2, 3), dtype=np.float64)
            if part[0] == 0:  # every part of the bands sees the same paths
                sums.coverage += np.float32(pass_spp) * coverage
                covered += float(coverage.mean(dtype=np.float64))
        if loaded.meter is not None:
            irradiance[list(loaded.groups)] = _irradiance(loaded, film, min(pass_spp, METER_SPP), of_pass)
    sums.uncovered.append(1 - covered)
    sums.radiance.append(radiance)
    if any(loaded.meter is not None for loaded in light_groups):
        sums.irradiance.append(irradiance)


def _add(sums: PassSums, groups: tuple[int, ...], bands: slice, scattered: Planes, seen: tuple[Planes, ...]) -> None:
    """Add some bands of the pass whose samples were noted last."""
    weight, drawn = np.float32(sums.spp[-1]), np.float32(sums.drawn)
    deltas, radiances = [], []
    for group, scattered_of_group, seen_of_group in zip(groups, scattered, seen, strict=True):
        radiance = scattered_of_group + seen_of_group
        mean = sums.mean[group, bands]
        delta = radiance - mean
        mean += delta * (weight / drawn)
        sums.scatter[group, bands] += weight * delta * (radiance - mean)
        sums.signed[group, bands] += weight * (radiance if sums.passes % 2 else -radiance)
        if len(seen_of_group) > 1 or bands.start == 0:
            sums.seen[group][bands if len(seen_of_group) > 1 else slice(None)] += weight * seen_of_group
        deltas.append(delta)
        radiances.append(radiance)
    if len(groups) == 2:
        if sums.product is None:
            sums.share, sums.product = (groups[0], groups[1]), np.zeros_like(sums.mean[0])
        sums.product[bands] += weight * deltas[0] * (radiances[1] - sums.mean[groups[1], bands])


def _camera_part(
    loaded: Loaded, integrator: Any, width_nm: Floats, spp: int, seed: int
) -> tuple[Planes, tuple[Planes, ...], Planes]:
    """Render some bands of the camera's picture.

    Returns
    -------
    scattered : (group, band, h, w) float32
        Band averages without the light that is seen directly.
    seen : tuple of (band or 1, h, w) float32
        Light that is seen directly, of each group: by band where the group is coloured.
    coverage : (h, w) float32
        Share of the samples that meet a light first.
    """
    count = len(loaded.groups)
    image = _rendered(loaded.mi_scene, loaded.camera, integrator, spp, seed)
    scattered, others = _bands(image, count, width_nm)
    shares, of_light = others[:count], others[count : count + width_nm.size]
    if loaded.covering is not None:  # without Dr.Jit renders of their own show the lights
        seen_directly = mitsuba_module().load_dict({"type": "path", "max_depth": 1})
        image = _rendered(loaded.covering, loaded.covering.sensors()[0], seen_directly, spp, seed)
        shares = _bands(image, 1, width_nm[:1])[0][0]
        if loaded.coloured:
            image = _rendered(loaded.mi_scene, loaded.camera, seen_directly, spp, seed)
            of_light = _bands(image, 1, width_nm)[0][0]
    return scattered, (of_light if loaded.coloured else shares[:1], *shares[1:, None]), shares.sum(axis=0)


def _irradiance(loaded: Loaded, film: Film, spp: int, seed: int) -> Floats:
    """Irradiance on the reference plane, shape (group, band); summed in float64, so that threads don't change it."""
    means = []
    for part, integrator in integrators(film, METER_BANDS, loaded, seed, meter=True):
        image = _rendered(loaded.mi_scene, loaded.meter, integrator, spp, seed)
        means.append(_bands(image, len(loaded.groups), film.width_nm[part])[0].mean(axis=(2, 3), dtype=np.float64))
    # The meter's weight of a cosine-distributed ray, which Mitsuba leaves off extra channels.
    return np.concatenate(means, axis=1) * (1 if backend() == "numpy" else np.pi)


def _bands(image: Planes, groups: int, width_nm: Floats) -> tuple[Planes, Planes]:
    """Band averages (group, band, h, w) of a rendered part, and the channels after them."""
    size = width_nm.size
    if backend() == "numpy":  # specfilm integrates over the band
        return (image[:size] / width_nm.astype(np.float32)[:, None, None])[None], image[size:]
    if image[-1].any():
        raise InputError(
            "scene: a material chooses where light goes by wavelength (dispersion, wavelength-dependent lobes); "
            "allowed: materials whose sampling doesn't depend on wavelength; replace it"
        )
    # Channel 0 is the film's own luminance; a group has its bands, filled up to a multiple of four.
    filled = size + -size % SPECTRUM_SIZE
    bands, others = np.split(image[1:-1], [groups * filled])
    return bands.reshape(groups, filled, *image.shape[1:])[:, :size], others


def _rendered(mi_scene: Any, sensor: Any, integrator: Any, spp: int, seed: int) -> Planes:
    """Channels of a picture, shape (channel, h, w)."""
    try:
        image = mitsuba_module().render(mi_scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed)
    except RuntimeError as error:
        cause = _root_cause(error)
        if not isinstance(cause, RuntimeError):  # a fault of this program, not of the scene
            raise
        raise InputError(f"scene: Mitsuba can't render it: {mitsuba_words(cause)}; correct the description") from None
    return np.ascontiguousarray(np.moveaxis(np.asarray(image, dtype=np.float32), -1, 0))


def let_go(error: BaseException) -> None:
    """Free the refused scene, which the traceback holds: Dr.Jit compiles every live material into the next render."""
    cause: BaseException | None = error
    while cause:
        if cause.__traceback__ and cause.__traceback__.tb_next:
            traceback.clear_frames(cause.__traceback__.tb_next)
        cause.__traceback__, cause = None, cause.__cause__ or cause.__context__


def _root_cause(error: BaseException) -> BaseException:
    """First cause of an error that Dr.Jit has wrapped."""
    while error.__cause__ or error.__context__:
        error = error.__cause__ or error.__context__ or error
    return error
