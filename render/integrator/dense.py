"""Path integrator that carries every wavelength band along each path.

Stock spectral integrators give four wavelengths to a path, so that a narrow band gets few samples. Here a path is
traced once, and emission and BSDF are evaluated for all bands along it, four at a time: every band gets every path.
Band wavelengths are jittered by one common offset a path, which makes each band an unbiased band average.

Mitsuba is handed in by `render.loader`, which alone (with `render.engine`) imports it.
"""

from functools import partial
from typing import Any

import numpy as np

from render.integrator.reflectance_table import TableReader
from render.integrator.scattering import draw, scatter
from rodcone.jit import dr

LANES = 4  # wavelengths of a spectral variant's `Spectrum`
RR_DEPTH = 5  # Russian roulette from this depth on, as Mitsuba's `path`


def dense_path(mi: Any) -> Any:
    """Build the integrator class for the variant that is set; register it as ``densepath``.

    Properties of the plug-in: ``wavelength_nm`` and ``width_nm`` (comma-separated, a multiple of four), ``max_depth``;
    ``own_colour``: whether emission depends on wavelength (at unit emission it doesn't, and is evaluated once);
    ``sample_lights``: whether paths go to look for lights. Where the one light is an even sky, any direction finds it;
    ``meter``: whether paths begin on the shape of the scene's irradiance meter, instead of with the camera's ray. Its
    bands are irradiance over pi.
    ``even_sky``: whether the light of an even sky, which isn't in the scene, is told as well, by the paths that escape.

    Channels after the first (alpha-less luminance film) hold the bands, then the sky's. The camera's bands leave out
    the light that is seen directly, which has channels of its own: the share of paths that meet a light first, which is
    that light at unit emission; the share that meet the even sky; with ``own_colour`` the light's bands. The last
    channel is the share of paths whose BSDF chose by wavelength.
    """

    class DensePath(mi.SamplingIntegrator):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.max_depth = int(props.get("max_depth", 8))
            self.own_colour = bool(props.get("own_colour", False))
            self.sample_lights = bool(props.get("sample_lights", True))
            self.meter = bool(props.get("meter", False))
            self.even_sky = bool(props.get("even_sky", False))
            self.offsets: Any = None
            self.table: TableReader | None = None
            self.centres = np.array([float(x) for x in str(props["wavelength_nm"]).split(",")])
            self.widths = np.array([float(x) for x in str(props["width_nm"]).split(",")])

        def prepare(self, offsets: Any, reflectances: Any) -> None:
            """Take a pass's offsets (step,) and table (row, step, band) of `render.integrator.reflectance_table`."""
            self.offsets, self.table = mi.Float(offsets), TableReader(mi, reflectances)

        def aov_names(self) -> list[str]:
            bands = self.centres.size
            seen = 0 if self.meter else 1 + self.even_sky + self.own_colour * bands
            count = bands * (1 + self.even_sky)
            names = [*(f"band{i:04d}" for i in range(count)), *(f"seen{i:04d}" for i in range(seen))]
            return [*names, "wavelength_dependent_choice"]

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            offset, step = _jitter(mi, self.offsets, sampler.next_1d(active))
            wavelengths = _band_wavelengths(mi, self.centres, self.widths, offset)
            how = (self.own_colour, self.sample_lights)
            start = (_at_meter if self.meter else _at_camera)(mi, scene, sampler, ray, wavelengths, *how)
            path = (wavelengths, step, self.table, self.max_depth, *how, self.even_sky, self.meter)
            result, chosen = _trace(mi, scene, sampler, start, *path, mi.Bool(active))
            bands = [value for group in result for value in group]
            if not self.meter:
                bands += _seen(mi, scene, ray, wavelengths, self.own_colour, self.even_sky)
            return mi.Spectrum(0.0), mi.Bool(True), [*bands, dr.select(chosen, mi.Float(1.0), mi.Float(0.0))]

    return DensePath


def _jitter(mi: Any, offsets: Any, sample: Any) -> tuple[Any, Any]:
    """Offset of a path from the bands' centres, in widths; of those that the pass has a table for, and which."""
    if offsets is None:
        return sample - 0.5, mi.UInt32(0)
    step = dr.minimum(mi.UInt32(sample * len(offsets)), len(offsets) - 1)
    return dr.gather(mi.Float, offsets, step), step


def _band_wavelengths(mi: Any, centres: Any, widths: Any, offset: Any) -> list[Any]:
    """Wavelengths of a path, four bands an entry. They reach the kernel as data: other bands don't compile it anew."""
    pairs = zip(centres.tolist(), widths.tolist(), strict=True)
    lanes = [dr.fma(offset, dr.opaque(mi.Float, width), dr.opaque(mi.Float, centre)) for centre, width in pairs]
    return [mi.Spectrum(*lanes[i : i + LANES]) for i in range(0, len(lanes), LANES)]


def _power_heuristic(a: Any, b: Any) -> Any:
    """Weight a^2 / (a^2 + b^2), by the ratio: the squares of densities near a light's rim leave float32's range."""
    weight = dr.rcp(1 + dr.square(b / a))
    return dr.select((a > 0) & dr.isfinite(weight), weight, 0)


def _emission(emitter: Any, interaction: Any, wavelengths: list[Any]) -> list[Any]:
    """Evaluate an emitter at all wavelengths within one virtual call."""
    values = []
    for group in wavelengths:
        interaction.wavelengths = group
        values.append(emitter.eval(interaction))
    return values


def _emission_towards(emitter: Any, interaction: Any, direction: Any, wavelengths: list[Any]) -> list[Any]:
    values = []
    for group in wavelengths:
        interaction.wavelengths = group
        values.append(emitter.eval_direction(interaction, direction))
    return values


def _emitted(emitter: Any, interaction: Any, wavelengths: list[Any], own_colour: bool) -> list[Any]:
    """Emission of the light that a path meets."""
    if own_colour:
        return list(dr.dispatch(emitter, _emission, interaction, wavelengths))
    return [emitter.eval(interaction)[0]] * len(wavelengths)  # unit emission: the same at every wavelength


def _arriving(direction: Any, sampled: Any, interaction: Any, wavelengths: list[Any], own_colour: bool) -> list[Any]:
    """Emission towards a point from the sampled position on a light, over the density of the sample."""
    if own_colour:
        values = dr.dispatch(direction.emitter, _emission_towards, interaction, direction, wavelengths)
        return [dr.select(direction.pdf != 0, value / direction.pdf, 0.0) for value in values]
    return [sampled[0]] * len(wavelengths)


def _seen(mi: Any, scene: Any, ray: Any, wavelengths: list[Any], own_colour: bool, even_sky: bool) -> list[Any]:
    """Channels of what the camera's ray meets first, if that is a light."""
    si = scene.ray_intersect(mi.Ray3f(ray), mi.RayFlags.All, coherent=True)
    emitted = _emitted(si.emitter(scene), si, wavelengths, own_colour)
    bands = [value for group in emitted for value in group] if own_colour else []
    shines = mi.Bool(False)
    for value in bands or emitted[:1]:
        shines |= value != 0
    lights = [shines, ~si.is_valid()] if even_sky else [shines]
    return [*(dr.select(light, mi.Float(1.0), mi.Float(0.0)) for light in lights), *bands]


def _share(
    mi: Any, scene: Any, si: Any, previous: Any, previous_pdf: Any, previous_delta: Any, sample_lights: bool
) -> Any:
    """Weight of the light that a path meets, beside the chance that it had been sampled from the point before."""
    if not sample_lights:
        return mi.Float(1.0)
    seen = mi.DirectionSample3f(scene, si, previous)
    light_pdf = scene.pdf_emitter_direction(previous, seen, ~previous_delta)
    return dr.select(previous_delta, 1.0, _power_heuristic(previous_pdf, light_pdf))


def _bounce(
    mi: Any,
    scene: Any,
    sampler: Any,
    bsdf: Any,
    si: Any,
    go_on: Any,
    wavelengths: list[Any],
    step: Any,
    table: TableReader | None,
    own_colour: bool,
    sample_lights: bool,
) -> tuple[list[Any], Any, list[Any], Any]:
    """Light received from a sampled position on a lamp; then a sampled direction, its weights, and the mark."""
    context = mi.BSDFContext()
    if not sample_lights:
        lobe, angle = sampler.next_1d(), sampler.next_2d()
        sample, weights, by_wavelength = dr.dispatch(
            bsdf, partial(draw, table), context, si, lobe, angle, wavelengths, step
        )
        return [mi.Spectrum(0.0) for _ in wavelengths], sample, weights, by_wavelength
    lit = go_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
    si.wavelengths = wavelengths[0]
    ds, sampled = scene.sample_emitter_direction(si, sampler.next_2d(), True, lit)
    lit &= (ds.pdf != 0) & dr.any(sampled != 0)
    lobe, angle = sampler.next_1d(), sampler.next_2d()
    values, pdf, sample, weights, by_wavelength = dr.dispatch(
        bsdf, partial(scatter, table), context, si, si.to_local(ds.d), lobe, angle, wavelengths, step
    )
    factor = dr.select(lit, dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, pdf)), 0.0)
    arriving = _arriving(ds, sampled, si, wavelengths, own_colour)
    received = [value * (light * factor) for value, light in zip(values, arriving, strict=True)]
    return received, sample, weights, by_wavelength


def _times(first: list[Any], second: list[Any]) -> list[Any]:
    return [a * b for a, b in zip(first, second, strict=True)]


def _either(first: Any, where: list[Any], elsewhere: list[Any]) -> list[Any]:
    return [dr.select(first, a, b) for a, b in zip(where, elsewhere, strict=True)]


def _plus(result: list[Any], throughput: list[Any], light: list[Any], factor: Any) -> list[Any]:
    """Add light, times a factor that all wavelengths share, seen through the path's throughput."""
    return [r + t * (x * factor) for r, t, x in zip(result, throughput, light, strict=True)]


def _roulette(throughput: list[Any], eta: Any, depth: Any, sample: Any) -> tuple[list[Any], Any]:
    """Russian roulette by the brightest wavelength, so that one decision serves all; gives the survivors."""
    brightest = dr.max(throughput[0])
    for group in throughput[1:]:
        brightest = dr.maximum(brightest, dr.max(group))
    survival = dr.minimum(brightest * dr.square(eta), 0.95)
    plays = depth >= RR_DEPTH
    factor = dr.select(plays, dr.rcp(survival), 1.0)
    return [group * factor for group in throughput], (~plays | (sample < survival)) & (brightest != 0)


def _at_camera(mi: Any, scene: Any, sampler: Any, ray: Any, wavelengths: list[Any], *how: bool) -> tuple[Any, ...]:
    """Where a path begins: its ray, the point that it left, the density of its direction, light received so far."""
    del scene, sampler, how
    dark = [mi.Spectrum(0.0) for _ in wavelengths]
    return mi.Ray3f(ray), dr.zeros(mi.SurfaceInteraction3f), mi.Float(1.0), mi.Bool(True), dark


def _at_meter(
    mi: Any, scene: Any, sampler: Any, ray: Any, wavelengths: list[Any], own_colour: bool, sample_lights: bool
) -> tuple[Any, ...]:
    """The same on the irradiance meter's shape, a white matte surface whose lights are sampled as any other's.

    Mitsuba's own meter only waits for its rays to meet a light: the sun is met once in 50 000, a point light never.
    """
    card = next(shape for shape in scene.shapes() if shape.is_sensor())
    place = card.sample_position(ray.time, sampler.next_2d())
    here = dr.zeros(mi.SurfaceInteraction3f, dr.width(ray.o))
    here.p, here.n, here.sh_frame, here.wavelengths = place.p, place.n, mi.Frame3f(place.n), wavelengths[0]
    received = [mi.Spectrum(0.0) for _ in wavelengths]
    if sample_lights:
        ds, sampled = scene.sample_emitter_direction(here, sampler.next_2d(), True)
        density = dr.maximum(here.to_local(ds.d).z, 0.0) * dr.inv_pi
        factor = density * dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, density))
        arriving = _arriving(ds, sampled, here, wavelengths, own_colour)
        received = [mi.Spectrum(dr.select(dr.any(sampled != 0), value * factor, 0.0)) for value in arriving]
    out = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    onward = here.spawn_ray(here.to_world(out))
    return onward, here, mi.warp.square_to_cosine_hemisphere_pdf(out), mi.Bool(not sample_lights), received


@dr.syntax
def _trace(
    mi: Any,
    scene: Any,
    sampler: Any,
    start: tuple[Any, ...],
    wavelengths: list[Any],
    step: Any,
    table: TableReader | None,
    max_depth: int,
    own_colour: bool,
    sample_lights: bool,
    even_sky: bool,
    meter: bool,
    active: Any,
) -> tuple[list[Any], Any]:
    """Radiance of all wavelengths along one path (multiple importance sampling, as Mitsuba's ``path``).

    A path that escapes meets the even sky, and then carries what the sky would give it: its throughput. A light that
    the camera's ray meets first counts for `_seen` alone.
    """
    ray, previous, previous_pdf, previous_delta, result = start
    ray.wavelengths = wavelengths[0]
    throughput = [mi.Spectrum(1.0) for _ in wavelengths]
    eta, depth = mi.Float(1.0), mi.UInt32(0)
    chosen, escaped = mi.Bool(False), mi.Bool(False)
    while dr.hint(active, label="dense path"):
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=(depth == 0))
        share = _share(mi, scene, si, previous, previous_pdf, previous_delta, sample_lights)
        emitted = _emitted(si.emitter(scene), si, wavelengths, own_colour)
        indirect = (depth > 0) | meter
        result = _plus(result, throughput, emitted, dr.select(indirect, share, 0.0))

        go_on, escaped = (depth + 1 < max_depth) & si.is_valid(), indirect & ~si.is_valid()
        received, sample, weights, by_wavelength = _bounce(
            mi, scene, sampler, si.bsdf(ray), si, go_on, wavelengths, step, table, own_colour, sample_lights
        )
        result = _plus(result, throughput, received, 1.0)
        chosen |= go_on & by_wavelength
        scattered = _times(throughput, weights)

        ray = si.spawn_ray(si.to_world(sample.wo))
        ray.wavelengths = wavelengths[0]
        eta *= sample.eta
        previous, previous_pdf = dr.detach(si), sample.pdf
        previous_delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        depth[si.is_valid()] += 1
        scattered, survives = _roulette(scattered, eta, depth, sampler.next_1d())
        throughput = _either(escaped & even_sky, throughput, scattered)
        active = go_on & survives
    sky = _either(escaped, throughput, [mi.Spectrum(0.0) for _ in wavelengths])
    return [*result, *(sky if even_sky else [])], chosen
