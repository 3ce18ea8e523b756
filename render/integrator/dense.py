"""Path integrator that carries every wavelength band along each path.

Stock spectral integrators give four wavelengths to a path, so that a narrow band gets few samples. Here a path is
traced once, and emission and BSDF are evaluated for all bands along it, four at a time: every band gets every path.
Band wavelengths are jittered by one common offset a path, which makes each band an unbiased band average.

Mitsuba is handed in by `render.loader`, which alone imports it.
"""

from typing import Any

from render.integrator.reflectance_table import TableReader
from rodcone.jit import dr

SPECTRUM_SIZE = 4  # wavelengths of a spectral variant's `Spectrum`
RR_DEPTH = 5  # Russian roulette from this depth on, as Mitsuba's `path`
# Sampling decides by the first four wavelengths. Where another's density differs by more than this, a BSDF chooses
# lobes by wavelength and one path can't serve all bands. Under the horizon `measured` gives densities below 0.
PDF_TOLERANCE = 1e-3


def dense_path(mi: Any) -> Any:
    """Build the integrator class for the variant that is set; register it as ``densepath``.

    Properties of the plug-in:

    ``wavelength_nm``, ``width_nm``
        Bands, comma-separated, a multiple of four.
    ``max_depth``
    ``coloured``
        Whether emission depends on wavelength. At unit emission it doesn't, and is evaluated once.
    ``sample_lights``
        Whether directions are sampled towards lights. A constant environment is met in any direction.
    ``environment``
        Whether the light of a constant environment, which isn't in the scene, is carried by the paths that escape.
    ``meter``
        Whether paths begin on the shape of the scene's irradiance meter, instead of with the camera's ray. The bands
        are then irradiance over pi.

    Channels after the first (alpha-less luminance film) hold the bands, then the environment's. The camera's bands
    leave out the light that is seen directly, which has channels of its own: the share of paths that meet a light
    first, which is that light at unit emission; the share that meet the environment; with ``coloured`` the light's
    bands. The last channel is the share of paths whose BSDF chose by wavelength.
    """

    class DensePath(mi.SamplingIntegrator):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.tracer = Tracer(mi, props)

        def aov_names(self) -> list[str]:
            return self.tracer.channel_names()

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            return mi.Spectrum(0.0), mi.Bool(True), self.tracer.channels(scene, sampler, ray, mi.Bool(active))

    return DensePath


class Tracer:
    """What the plug-in does: all wavelengths of a path are a list of `Spectrum`, four bands an entry.

    A plain class: Dr.Jit takes apart the arrays that it finds in a loop's variables.
    """

    def __init__(self, mi: Any, props: Any) -> None:
        self.mi = mi
        self.max_depth = int(props.get("max_depth", 8))
        self.coloured = bool(props.get("coloured", False))
        self.sample_lights = bool(props.get("sample_lights", True))
        self.environment = bool(props.get("environment", False))
        self.meter = bool(props.get("meter", False))
        self.centres = [float(x) for x in str(props["wavelength_nm"]).split(",")]
        self.widths = [float(x) for x in str(props["width_nm"]).split(",")]
        self.offsets: Any = None
        self.table: TableReader | None = None

    def prepare(self, offsets: Any, reflectances: Any) -> None:
        """Take a pass's offsets (step,) and table (row, step, band) of `render.integrator.reflectance_table`."""
        self.offsets, self.table = self.mi.Float(offsets), TableReader(self.mi, reflectances)

    def channel_names(self) -> list[str]:
        """Name of each channel that `channels` gives."""
        bands = len(self.centres)
        seen = 0 if self.meter else 1 + self.environment + self.coloured * bands
        carried = bands * (1 + self.environment)
        names = [*(f"band{i:04d}" for i in range(carried)), *(f"seen{i:04d}" for i in range(seen))]
        return [*names, "wavelength_dependent_choice"]

    def channels(self, scene: Any, sampler: Any, ray: Any, active: Any) -> list[Any]:
        """Trace a path and return its channels."""
        mi = self.mi
        wavelengths, step = self._wavelengths(sampler.next_1d(active))
        if self.meter:
            start = self._start_on_meter(scene, sampler, ray, wavelengths)
        else:
            dark = [mi.Spectrum(0.0) for _ in wavelengths]
            start = mi.Ray3f(ray), dr.zeros(mi.SurfaceInteraction3f), mi.Float(1.0), mi.Bool(True), dark
        result, chosen = self._trace(scene, sampler, start, wavelengths, step, active)
        bands = [value for group in result for value in group]
        if not self.meter:
            bands += self._seen(scene, ray, wavelengths)
        return [*bands, dr.select(chosen, mi.Float(1.0), mi.Float(0.0))]

    def _wavelengths(self, sample: Any) -> tuple[list[Any], Any]:
        """Wavelengths of a path, and the table's step that they belong to.

        The offset from the bands' centres is one of those that the pass has a table for, if it has one. Centres and
        widths reach the kernel as data: other bands don't compile it anew.
        """
        mi = self.mi
        if self.offsets is None:
            offset, step = sample - 0.5, mi.UInt32(0)
        else:
            step = dr.minimum(mi.UInt32(sample * len(self.offsets)), len(self.offsets) - 1)
            offset = dr.gather(mi.Float, self.offsets, step)
        bands = [
            dr.fma(offset, dr.opaque(mi.Float, width), dr.opaque(mi.Float, centre))
            for centre, width in zip(self.centres, self.widths, strict=True)
        ]
        return [mi.Spectrum(*bands[i : i + SPECTRUM_SIZE]) for i in range(0, len(bands), SPECTRUM_SIZE)], step

    def _start_on_meter(self, scene: Any, sampler: Any, ray: Any, wavelengths: list[Any]) -> tuple[Any, ...]:
        """Start of a path on the irradiance meter: a white matte surface whose lights are sampled as any other's.

        Mitsuba's own meter only waits for its rays to meet a light: the sun is met once in 50 000, a point light never.

        Returns
        -------
        ray, surface that it leaves, density of its direction, whether no light was sampled, light received so far
        """
        mi = self.mi
        card = next(shape for shape in scene.shapes() if shape.is_sensor())
        position = card.sample_position(ray.time, sampler.next_2d())
        surface = dr.zeros(mi.SurfaceInteraction3f, dr.width(ray.o))
        surface.p, surface.n, surface.sh_frame = position.p, position.n, mi.Frame3f(position.n)
        surface.wavelengths = wavelengths[0]
        received = [mi.Spectrum(0.0) for _ in wavelengths]
        if self.sample_lights:
            ds, sampled = scene.sample_emitter_direction(surface, sampler.next_2d(), True)
            density = dr.maximum(surface.to_local(ds.d).z, 0.0) * dr.inv_pi
            factor = density * dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, density))
            arriving = self._arriving(ds, sampled, surface, wavelengths)
            received = [mi.Spectrum(dr.select(ds.pdf != 0, value * factor, 0.0)) for value in arriving]
        out = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        onward = surface.spawn_ray(surface.to_world(out))
        density = mi.warp.square_to_cosine_hemisphere_pdf(out)
        return onward, surface, density, mi.Bool(not self.sample_lights), received

    @dr.syntax
    def _trace(
        self, scene: Any, sampler: Any, start: tuple[Any, ...], wavelengths: list[Any], step: Any, active: Any
    ) -> tuple[list[Any], Any]:
        """Radiance of all wavelengths along one path (multiple importance sampling, as Mitsuba's ``path``).

        A path that escapes meets the environment, and then carries what that would give it: its throughput. A light
        that the camera's ray meets first counts for `_seen` alone.
        """
        mi = self.mi
        ray, previous, previous_pdf, previous_delta, result = start
        ray.wavelengths = wavelengths[0]
        throughput = [mi.Spectrum(1.0) for _ in wavelengths]
        eta, depth = mi.Float(1.0), mi.UInt32(0)
        chosen, escaped = mi.Bool(False), mi.Bool(False)
        while dr.hint(active, label="dense path"):
            # Light that the path meets
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=(depth == 0))
            share = self._share(scene, si, previous, previous_pdf, previous_delta)
            emitted = self._emitted(scene, si, wavelengths)
            indirect = (depth > 0) | self.meter
            result = _plus(result, throughput, emitted, dr.select(indirect, share, 0.0))

            # Light that is sampled from here, and the direction to go on in
            go_on, escaped = (depth + 1 < self.max_depth) & si.is_valid(), indirect & ~si.is_valid()
            received, sample, weights, by_wavelength = self._bounce(scene, sampler, ray, si, go_on, wavelengths, step)
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
            throughput = _either(escaped & self.environment, throughput, scattered)
            active = go_on & survives
        sky = _either(escaped, throughput, [mi.Spectrum(0.0) for _ in wavelengths])
        return [*result, *(sky if self.environment else [])], chosen

    def _seen(self, scene: Any, ray: Any, wavelengths: list[Any]) -> list[Any]:
        """Channels of what the camera's ray meets first, if that is a light."""
        mi = self.mi
        si = scene.ray_intersect(mi.Ray3f(ray), mi.RayFlags.All, coherent=True)
        emitted = self._emitted(scene, si, wavelengths)
        bands = [value for group in emitted for value in group] if self.coloured else []
        shines = mi.Bool(False)
        for value in bands or emitted[:1]:
            shines |= value != 0
        lights = [shines, ~si.is_valid()] if self.environment else [shines]
        return [*(dr.select(light, mi.Float(1.0), mi.Float(0.0)) for light in lights), *bands]

    def _share(self, scene: Any, si: Any, previous: Any, previous_pdf: Any, previous_delta: Any) -> Any:
        """Weight of the light that a path meets, beside the chance that it had been sampled from the point before."""
        if not self.sample_lights:
            return self.mi.Float(1.0)
        seen = self.mi.DirectionSample3f(scene, si, previous)
        light_pdf = scene.pdf_emitter_direction(previous, seen, ~previous_delta)
        return dr.select(previous_delta, 1.0, _power_heuristic(previous_pdf, light_pdf))

    def _emitted(self, scene: Any, si: Any, wavelengths: list[Any]) -> list[Any]:
        """Emission of the light that a path meets."""
        emitter = si.emitter(scene)
        if self.coloured:
            return list(dr.dispatch(emitter, _emission, si, wavelengths))
        return [emitter.eval(si)[0]] * len(wavelengths)  # unit emission: the same at every wavelength

    def _arriving(self, direction: Any, sampled: Any, interaction: Any, wavelengths: list[Any]) -> list[Any]:
        """Emission towards a point from the sampled position on a light, over the density of the sample."""
        if self.coloured:
            values = dr.dispatch(direction.emitter, _emission_towards, interaction, direction, wavelengths)
            return [dr.select(direction.pdf != 0, value / direction.pdf, 0.0) for value in values]
        return [sampled[0]] * len(wavelengths)

    def _bounce(
        self, scene: Any, sampler: Any, ray: Any, si: Any, go_on: Any, wavelengths: list[Any], step: Any
    ) -> tuple[list[Any], Any, list[Any], Any]:
        """Light from a sampled position on a lamp; next direction, its weights, whether wavelength chose it."""
        mi, bsdf = self.mi, si.bsdf(ray)
        if not self.sample_lights:
            lobe, angle = sampler.next_1d(), sampler.next_2d()
            sample, weights, by_wavelength = dr.dispatch(bsdf, self._sampled, si, lobe, angle, wavelengths, step)
            return [mi.Spectrum(0.0) for _ in wavelengths], sample, weights, by_wavelength
        lit = go_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        si.wavelengths = wavelengths[0]
        ds, light = scene.sample_emitter_direction(si, sampler.next_2d(), True, lit)
        lit &= ds.pdf != 0  # 0 also in shadow; a light may be dark at the first wavelengths and shine at others
        lobe, angle = sampler.next_1d(), sampler.next_2d()
        values, pdf, sample, weights, by_wavelength = dr.dispatch(
            bsdf, self._scattered, si, si.to_local(ds.d), lobe, angle, wavelengths, step
        )
        factor = dr.select(lit, dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, pdf)), 0.0)
        arriving = self._arriving(ds, light, si, wavelengths)
        received = [value * (light * factor) for value, light in zip(values, arriving, strict=True)]
        return received, sample, weights, by_wavelength

    # A surface at all wavelengths, within one virtual call: what no wavelength changes is then computed once.
    # `render.integrator.matte` brings `scatter_bands` and `sample_bands`: its sampling knows no wavelength.

    def _scattered(
        self, bsdf: Any, si: Any, towards_light: Any, lobe: Any, angle: Any, wavelengths: list[Any], step: Any
    ) -> tuple[list[Any], Any, Any, list[Any], Any]:
        """Values towards a light, density, sampled direction, its weights, and whether wavelength chose it."""
        if hasattr(bsdf, "scatter_bands"):
            values, pdf, sample, weights = bsdf.scatter_bands(si, towards_light, angle, wavelengths, self.table, step)
            return values, pdf, sample, weights, dr.zeros(dr.mask_t(pdf))
        drawn = []
        for group in wavelengths:
            si.wavelengths = group
            drawn.append(bsdf.eval_pdf_sample(self.mi.BSDFContext(), si, towards_light, lobe, angle))
        _, pdf, sample, _ = drawn[0]
        chosen = _differs(sample, [other for _, _, other, _ in drawn[1:]])
        for _, other_pdf, _, _ in drawn[1:]:
            chosen |= abs(other_pdf - pdf) > PDF_TOLERANCE * abs(pdf)
        return [value for value, *_ in drawn], pdf, sample, [weight for *_, weight in drawn], chosen

    def _sampled(
        self, bsdf: Any, si: Any, lobe: Any, angle: Any, wavelengths: list[Any], step: Any
    ) -> tuple[Any, list[Any], Any]:
        """Sampled direction, its weights, and whether wavelength chose it: where no light is sampled."""
        if hasattr(bsdf, "sample_bands"):
            sample, weights = bsdf.sample_bands(si, angle, wavelengths, self.table, step)
            return sample, weights, dr.zeros(dr.mask_t(sample.pdf))
        drawn = []
        for group in wavelengths:
            si.wavelengths = group
            drawn.append(bsdf.sample(self.mi.BSDFContext(), si, lobe, angle))
        sample = drawn[0][0]
        return sample, [weight for _, weight in drawn], _differs(sample, [other for other, _ in drawn[1:]])


def _differs(sample: Any, others: list[Any]) -> Any:
    """Whether the BSDF sampled another way at other wavelengths."""
    chosen = dr.zeros(dr.mask_t(sample.pdf))
    for other in others:
        chosen |= abs(other.pdf - sample.pdf) > PDF_TOLERANCE * abs(sample.pdf)
        chosen |= other.sampled_component != sample.sampled_component
    return chosen


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


def _power_heuristic(a: Any, b: Any) -> Any:
    """Weight a^2 / (a^2 + b^2), by the ratio: the squares of densities near a light's rim leave float32's range."""
    weight = dr.rcp(1 + dr.square(b / a))
    return dr.select((a > 0) & dr.isfinite(weight), weight, 0)


def _times(first: list[Any], second: list[Any]) -> list[Any]:  # Dr.Jit's syntax knows no pairs in a comprehension
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
