"""Path integrator that carries every wavelength band along each path.

Mitsuba's own spectral integrators give four wavelengths to a path, so that a narrow band gets few samples. Here a path
is traced once, and emission and BSDF are evaluated for all bands along it, four at a time: every band gets every path.
The wavelengths of a path are the bands' centres, shifted by one random share of each width. The mean over paths is
therefore an unbiased average over each band.

Mitsuba is handed in by `render.loader`, which alone imports it.
"""

from types import ModuleType

import numpy as np

from render.integrator.matte import TableReader, at_all, band_offsets, reflectance_table
from render.integrator.points import APERTURE, FILM, WAVELENGTH, Points
from render.integrator.variant_types import (
    SPECTRUM_SIZE,
    Bsdf,
    BsdfSample,
    Channels,
    DirectionSample,
    Emitter,
    Float,
    Interaction,
    Mask,
    MitsubaScene,
    Point2,
    Ray,
    Spectra,
    Spectrum4,
    Start,
    UInt,
    Vector,
)
from render.loader import Film, LoadedScene
from rodcone.jit import dr, syntax

# A BSDF is sampled at the first four wavelengths. If the density at another wavelength differs by more than this
# relative amount, the BSDF chooses lobes by wavelength, and one path can't serve all bands. The difference is relative
# to the density's absolute value, because Mitsuba's `measured` gives negative densities below the horizon.
PDF_TOLERANCE = 1e-3
CHOSEN = "chosen"  # the channel that counts such paths


class Tracer:
    """Tracer of one light group's paths. A path's wavelengths are a list of `Spectrum`, four bands per entry.

    It is no dataclass, because Dr.Jit would treat a dataclass's arrays as variables of a loop.

    Parameters
    ----------
    mi : module
    loaded : LoadedScene
        Scene to render. If it is `coloured`, emission is evaluated at all wavelengths, otherwise once. If it has
        `sample_lights`, directions towards lights are sampled. A second group is a constant environment, which isn't
        in the scene: paths that escape bring its light.
    film : Film
        Size, bands, the longest path and the depth at which roulette begins. The last band is repeated until the number
        of bands is a multiple of four.
    seed : int
        Seed of the paths' wavelengths within the bands, for a scene whose reflectances are read from a table.
    split : bool
        Whether indirect light is also given separately.
    """

    def __init__(self, mi: ModuleType, loaded: LoadedScene, film: Film, seed: int, *, split: bool = False) -> None:
        self.mi, self.scene, self.split = mi, loaded.mi_scene, split
        self.size, self.max_depth, self.rr_depth = film.size, film.max_depth, film.rr_depth
        self.coloured, self.sample_lights = loaded.coloured, loaded.sample_lights
        self.environment, self.bands = len(loaded.groups) > 1, film.wavelength_nm.size
        filled = np.minimum(np.arange(-(-self.bands // SPECTRUM_SIZE) * SPECTRUM_SIZE), self.bands - 1)
        self.centres, self.widths = film.wavelength_nm[filled], film.width_nm[filled]
        self.offsets: Float | None = None
        self.table: TableReader | None = None
        if loaded.curves:
            offsets = band_offsets(seed)
            self.offsets = mi.Float(offsets)
            nm = self.centres + self.widths * offsets[:, None]
            self.table = TableReader(mi, reflectance_table(loaded.curves, nm))

    def camera(self, pixel: UInt, points: Points) -> Channels:
        """Trace paths from the camera, one per thread.

        Returns
        -------
        dict of lists of Float
            ``scattered``: bands of light that isn't seen directly, first of the group, then of the environment.
            ``indirect``: if `split`, as many bands of indirect light. ``shares``: share of paths that meet a lamp
            first, which is also the lamp's radiance at unit emission, and share that meet the environment first.
            ``lamps``: for coloured light, bands of the lamp that is met first. ``chosen``: share of paths on which a
            BSDF's sample depended on wavelength.
        """
        wavelengths, step = self._wavelengths(points)
        ray = self._camera_ray(pixel, points)
        dark = [self.mi.Spectrum(0.0) for _ in wavelengths]
        start = self.mi.Ray3f(ray), dr.zeros(self.mi.SurfaceInteraction3f), self.mi.Float(1.0), self.mi.Bool(True), dark
        scattered, indirect, (lamp, sky, first), chosen = self._trace(self.scene, points, start, wavelengths, step, 0)
        return {
            "scattered": self._flat(*scattered),
            "indirect": self._flat(*indirect),
            "shares": [self.mi.Float(share) for share in ([lamp, sky] if self.environment else [lamp])],
            "lamps": self._flat(first),
            CHOSEN: [self.mi.Float(chosen)],
        }

    def meter(self, _: UInt, points: Points) -> Channels:
        """Trace paths from the scene's irradiance meter; ``scattered`` of `camera` is irradiance over pi here.

        Each path starts at a random place on the meter's shape, whatever its pixel.
        """
        wavelengths, step = self._wavelengths(points)
        start = self._start_on_meter(points, wavelengths)
        scattered, _, _, chosen = self._trace(self.scene, points, start, wavelengths, step, 1)
        return {"scattered": self._flat(*scattered), CHOSEN: [self.mi.Float(chosen)]}

    @syntax
    def first_surface(self, pixel: UInt, points: Points) -> Channels:
        """Trace paths from the camera, through glass and over mirrors, to the first surface that scatters light.

        Returns
        -------
        dict of lists of Float
            ``albedo``: bands of the surface's albedo, times the share of light that glass and mirrors in front of it
            leave; ``normal``; ``chosen`` as in `camera`.
        """
        mi = self.mi
        wavelengths, step = self._wavelengths(points)
        ray = mi.Ray3f(self._camera_ray(pixel, points))
        ray.wavelengths = wavelengths[0]
        throughput = [mi.Spectrum(1.0) for _ in wavelengths]
        albedo = [mi.Spectrum(0.0) for _ in wavelengths]
        normal = mi.Vector3f(0.0)
        depth = mi.UInt32(0)
        chosen, active = mi.Bool(False), mi.Bool(True)
        while dr.hint(active, label="first surface"):
            si = self.scene.ray_intersect(ray, mi.RayFlags.All, coherent=(depth == 0))
            go_on = (depth + 1 < self.max_depth) & si.is_valid()
            _, lobe, angle = points.bounce(depth)
            sample, weights, by_wavelength = dr.dispatch(
                si.bsdf(ray), self._sampled, si, lobe, angle, wavelengths, step
            )
            chosen |= go_on & by_wavelength
            throughput = _times(throughput, weights)
            delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            scatters = go_on & ~delta
            albedo = _select(scatters, throughput, albedo)
            normal = dr.select(scatters, mi.Vector3f(si.sh_frame.n), normal)
            ray = si.spawn_ray(si.to_world(sample.wo))
            ray.wavelengths = wavelengths[0]
            depth += 1
            active = go_on & delta
        normals = [normal.x, normal.y, normal.z]
        return {"albedo": self._flat(albedo), "normal": normals, CHOSEN: [self.mi.Float(chosen)]}

    def _flat(self, *spectra: Spectra) -> list[Float]:
        """List the bands of each spectrum one by one, without the repeated ones at its end."""
        return [value for spectrum in spectra for value in _flat(spectrum)[: self.bands]]

    def _camera_ray(self, pixel: UInt, points: Points) -> Ray:
        """Sample a ray through each thread's pixel."""
        mi, size = self.mi, self.size
        row = pixel // size[1]
        at = points.pair(FILM)
        film = mi.Point2f((mi.Float(pixel - row * size[1]) + at.x) / size[1], (mi.Float(row) + at.y) / size[0])
        ray, _ = self.scene.sensors()[0].sample_ray(0.0, 0.5, film, points.pair(APERTURE))
        return ray

    def _wavelengths(self, points: Points) -> tuple[Spectra, UInt]:
        """Choose a path's wavelengths; also return the index of their offset in the table of reflectances.

        If there is a table, the offset is one of those that it holds. Centres and widths reach the kernel as data, so
        that other bands don't compile it again.
        """
        mi = self.mi
        sample = points.at(WAVELENGTH)
        if self.offsets is None:
            offset = sample - 0.5
            step = mi.UInt32(0)
        else:
            step = dr.minimum(mi.UInt32(sample * len(self.offsets)), len(self.offsets) - 1)
            offset = dr.gather(mi.Float, self.offsets, step)
        bands = [
            dr.fma(offset, dr.opaque(mi.Float, width), dr.opaque(mi.Float, centre))
            for centre, width in zip(self.centres.tolist(), self.widths.tolist(), strict=True)
        ]
        return [mi.Spectrum(*bands[i : i + SPECTRUM_SIZE]) for i in range(0, len(bands), SPECTRUM_SIZE)], step

    def _start_on_meter(self, points: Points, wavelengths: Spectra) -> Start:
        """Start a path on the irradiance meter: a white matte surface from which lights are sampled as from any other.

        Mitsuba's own meter doesn't sample lights: of its rays one in 50 000 meets the sun, and none a point light.

        Returns
        -------
        ray, surface that it leaves, density of its direction, whether no light was sampled, light received so far
        """
        mi, scene = self.mi, self.scene
        card = next(shape for shape in scene.shapes() if shape.is_sensor())
        position = card.sample_position(0.0, points.pair(FILM))
        surface = dr.zeros(mi.SurfaceInteraction3f, dr.width(points.index))
        surface.p, surface.n, surface.sh_frame = position.p, position.n, mi.Frame3f(position.n)
        surface.wavelengths = wavelengths[0]
        received = [mi.Spectrum(0.0) for _ in wavelengths]
        towards_light, _, direction = points.bounce(mi.UInt32(0))
        if self.sample_lights:
            ds, sampled = scene.sample_emitter_direction(surface, towards_light, True)
            density = dr.maximum(surface.to_local(ds.d).z, 0.0) * dr.inv_pi
            factor = density * dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, density))
            arriving = self._arriving(ds, sampled, surface, wavelengths)
            received = [mi.Spectrum(dr.select(ds.pdf != 0, value * factor, 0.0)) for value in arriving]
        out = mi.warp.square_to_cosine_hemisphere(direction)
        onward = surface.spawn_ray(surface.to_world(out))
        density = mi.warp.square_to_cosine_hemisphere_pdf(out)
        return onward, surface, density, mi.Bool(not self.sample_lights), received

    @syntax
    def _trace(
        self, scene: MitsubaScene, points: Points, start: Start, wavelengths: Spectra, step: UInt, bounced: int
    ) -> tuple[list[Spectra], list[Spectra], tuple[Mask, Mask, Spectra], Mask]:
        """Trace one path at all wavelengths (multiple importance sampling, as in Mitsuba's ``path``).

        `bounced` is 1 for a path that starts on the meter, otherwise 0.

        A path that escapes meets the environment; its light at unit radiance is the path's throughput. A light that the
        camera's ray meets first is kept separately: whether it is a lamp, whether it is the environment, and for
        coloured light its bands.

        Light is direct if it comes from the lamp itself, or from the first surface that scatters it (by a lobe that
        isn't a delta), perhaps through glass and over mirrors. All other light is indirect.
        """
        mi = self.mi
        # The path's state.
        ray, previous, previous_pdf, previous_delta, result = start
        ray.wavelengths = wavelengths[0]
        throughput = [mi.Spectrum(1.0) for _ in wavelengths]
        indirect = [mi.Spectrum(0.0) for _ in wavelengths] if self.split else []
        # `direct`: whether light met next counts as direct. `unscattered`: the same, one vertex further on.
        direct, unscattered = mi.Bool(True), mi.Bool(True)
        lamp_first, sky_first = mi.Bool(False), mi.Bool(False)
        first = [mi.Spectrum(0.0) for _ in wavelengths] if self.coloured else []
        eta = mi.Float(1.0)
        depth = mi.UInt32(0)
        chosen, escaped, active = mi.Bool(False), mi.Bool(False), mi.Bool(True)
        while dr.hint(active, label="dense path"):
            # Add the light that the path meets.
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=(depth == 0))
            mis_weight = self._mis_weight(scene, si, previous, previous_pdf, previous_delta)
            emitted = self._emitted(scene, si, wavelengths)
            beyond_first = (depth > 0) | (bounced > 0)
            for value in _flat(emitted) if self.coloured else emitted[:1]:
                lamp_first |= ~beyond_first & (value != 0)
            sky_first |= ~beyond_first & ~si.is_valid()
            first = _select(beyond_first, first, emitted) if self.coloured else first
            result = _plus(result, throughput, emitted, dr.select(beyond_first, mis_weight, 0.0))
            indirect = self._indirect(indirect, throughput, emitted, dr.select(direct, 0.0, mis_weight))

            # Add light that is sampled from here, and choose the direction in which the path goes on.
            go_on = (depth + 1 < self.max_depth) & si.is_valid()
            escaped = beyond_first & ~si.is_valid()
            received, sample, weights, by_wavelength = self._bounce(
                scene, points.bounce(depth + bounced), ray, si, go_on, wavelengths, step
            )
            result = _plus(result, throughput, received, 1.0)
            indirect = self._indirect(indirect, throughput, received, dr.select(unscattered, 0.0, 1.0))
            chosen |= go_on & by_wavelength
            onward = _times(throughput, weights)

            ray = si.spawn_ray(si.to_world(sample.wo))
            ray.wavelengths = wavelengths[0]
            eta *= sample.eta
            previous = dr.detach(si)
            previous_pdf = sample.pdf
            previous_delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            direct = dr.select(si.is_valid(), unscattered, direct)
            unscattered &= previous_delta
            depth[si.is_valid()] += 1
            onward, survives = _roulette(onward, eta, depth >= self.rr_depth, points.roulette(depth))
            throughput = _select(escaped & self.environment, throughput, onward)
            active = go_on & survives
        # Give the environment's light to the paths that escaped.
        dark = [mi.Spectrum(0.0) for _ in wavelengths]
        sky = _select(escaped, throughput, dark)
        indirect_sky = _select(escaped & ~direct, throughput, dark)
        scattered = [result, sky] if self.environment else [result]
        indirects = ([indirect, indirect_sky] if self.environment else [indirect]) if self.split else []
        return scattered, indirects, (lamp_first, sky_first, first), chosen

    def _indirect(self, indirect: Spectra, throughput: Spectra, light: Spectra, factor: Float) -> Spectra:
        """Add indirect light, if it is wanted separately."""
        return _plus(indirect, throughput, light, factor) if self.split else indirect

    def _mis_weight(
        self, scene: MitsubaScene, si: Interaction, previous: Interaction, previous_pdf: Float, previous_delta: Mask
    ) -> Float:
        """Compute the weight of light that a path meets, because the previous point may have sampled this light too."""
        if not self.sample_lights:
            return self.mi.Float(1.0)
        direction = self.mi.DirectionSample3f(scene, si, previous)
        light_pdf = scene.pdf_emitter_direction(previous, direction, ~previous_delta)
        return dr.select(previous_delta, 1.0, _power_heuristic(previous_pdf, light_pdf))

    def _emitted(self, scene: MitsubaScene, si: Interaction, wavelengths: Spectra) -> Spectra:
        """Evaluate the emission of the light that a path meets."""
        emitter = si.emitter(scene)
        if self.coloured:
            return list(dr.dispatch(emitter, _emission, si, wavelengths))
        return [emitter.eval(si)[0]] * len(wavelengths)  # unit emission: the same at every wavelength

    def _arriving(
        self, direction: DirectionSample, sampled: Spectrum4, interaction: Interaction, wavelengths: Spectra
    ) -> Spectra:
        """Evaluate the emission of a light's sampled position towards a point, divided by the sample's density."""
        if self.coloured:
            values = dr.dispatch(direction.emitter, _emission_towards, interaction, direction, wavelengths)
            return [dr.select(direction.pdf != 0, value / direction.pdf, 0.0) for value in values]
        return [sampled[0]] * len(wavelengths)

    def _bounce(
        self,
        scene: MitsubaScene,
        drawn: tuple[Point2, Float, Point2],
        ray: Ray,
        si: Interaction,
        go_on: Mask,
        wavelengths: Spectra,
        step: UInt,
    ) -> tuple[Spectra, BsdfSample, Spectra, Mask]:
        """Sample a lamp's light and the next direction at a surface.

        Returns
        -------
        received light, direction's sample, its weights, whether the sample depends on wavelength
        """
        mi = self.mi
        bsdf = si.bsdf(ray)
        towards_light, lobe, angle = drawn
        if not self.sample_lights:
            sample, weights, by_wavelength = dr.dispatch(bsdf, self._sampled, si, lobe, angle, wavelengths, step)
            return [mi.Spectrum(0.0) for _ in wavelengths], sample, weights, by_wavelength
        lit = go_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        si.wavelengths = wavelengths[0]
        ds, light = scene.sample_emitter_direction(si, towards_light, True, lit)
        lit &= ds.pdf != 0  # 0 also in shadow; a light may be dark at the first wavelengths and shine at others
        values, pdf, sample, weights, by_wavelength = dr.dispatch(
            bsdf, self._eval_and_sample, si, si.to_local(ds.d), lobe, angle, wavelengths, step
        )
        factor = dr.select(lit, dr.select(ds.delta, 1.0, _power_heuristic(ds.pdf, pdf)), 0.0)
        arriving = self._arriving(ds, light, si, wavelengths)
        received = [value * (light * factor) for value, light in zip(values, arriving, strict=True)]
        return received, sample, weights, by_wavelength

    # A surface is evaluated at all wavelengths within one virtual call, so that what doesn't depend on wavelength is
    # computed once. `render.integrator.matte` has `scatter_bands` and `sample_bands`, because its sampling doesn't
    # depend on wavelength at all.

    def _eval_and_sample(
        self,
        bsdf: Bsdf,
        si: Interaction,
        towards_light: Vector,
        lobe: Float,
        angle: Point2,
        wavelengths: Spectra,
        step: UInt,
    ) -> tuple[Spectra, Float, BsdfSample, Spectra, Mask]:
        """Evaluate a BSDF towards a light and sample it.

        Returns
        -------
        values towards the light, density of that direction, sample, its weights, whether the sample depends on
        wavelength
        """
        if hasattr(bsdf, "scatter_bands"):
            values, pdf, sample, weights = bsdf.scatter_bands(si, towards_light, angle, wavelengths, self.table, step)
            return values, pdf, sample, weights, dr.zeros(dr.mask_t(pdf))
        context = self.mi.BSDFContext()
        drawn = at_all(wavelengths, si, lambda: bsdf.eval_pdf_sample(context, si, towards_light, lobe, angle))
        _, pdf, sample, _ = drawn[0]
        chosen = _differs(sample, [other for _, _, other, _ in drawn[1:]])
        for _, other_pdf, _, _ in drawn[1:]:
            chosen |= abs(other_pdf - pdf) > PDF_TOLERANCE * abs(pdf)
        return [value for value, *_ in drawn], pdf, sample, [weight for *_, weight in drawn], chosen

    def _sampled(
        self, bsdf: Bsdf, si: Interaction, lobe: Float, angle: Point2, wavelengths: Spectra, step: UInt
    ) -> tuple[BsdfSample, Spectra, Mask]:
        """Sample a BSDF only; return the sample, its weights, and whether the sample depends on wavelength."""
        if hasattr(bsdf, "sample_bands"):
            sample, weights = bsdf.sample_bands(si, angle, wavelengths, self.table, step)
            return sample, weights, dr.zeros(dr.mask_t(sample.pdf))
        drawn = at_all(wavelengths, si, lambda: bsdf.sample(self.mi.BSDFContext(), si, lobe, angle))
        sample = drawn[0][0]
        return sample, [weight for _, weight in drawn], _differs(sample, [other for other, _ in drawn[1:]])


def _differs(sample: BsdfSample, others: list[BsdfSample]) -> Mask:
    """Return whether the BSDF sampled another component, or with another density, at other wavelengths."""
    chosen = dr.zeros(dr.mask_t(sample.pdf))
    for other in others:
        chosen |= abs(other.pdf - sample.pdf) > PDF_TOLERANCE * abs(sample.pdf)
        chosen |= other.sampled_component != sample.sampled_component
    return chosen


def _emission(emitter: Emitter, interaction: Interaction, wavelengths: Spectra) -> Spectra:
    """Evaluate an emitter at all wavelengths within one virtual call."""
    return at_all(wavelengths, interaction, lambda: emitter.eval(interaction))


def _emission_towards(
    emitter: Emitter, interaction: Interaction, direction: DirectionSample, wavelengths: Spectra
) -> Spectra:
    return at_all(wavelengths, interaction, lambda: emitter.eval_direction(interaction, direction))


def _flat(groups: Spectra) -> list[Float]:
    """List all wavelengths one by one."""
    return [value for group in groups for value in group]


def _power_heuristic(a: Float, b: Float) -> Float:
    """Compute a^2 / (a^2 + b^2) from the ratio b / a, because the squares of large densities exceed float32's range."""
    weight = dr.rcp(1 + dr.square(b / a))
    return dr.select((a > 0) & dr.isfinite(weight), weight, 0)


def _times(first: Spectra, second: Spectra) -> Spectra:  # a function, because `dr.syntax` allows no such comprehension
    return [a * b for a, b in zip(first, second, strict=True)]


def _select(mask: Mask, if_true: Spectra, if_false: Spectra) -> Spectra:
    return [dr.select(mask, a, b) for a, b in zip(if_true, if_false, strict=True)]


def _plus(result: Spectra, throughput: Spectra, light: Spectra, factor: Float) -> Spectra:
    """Add light times the path's throughput and a factor that all wavelengths share."""
    return [r + t * (x * factor) for r, t, x in zip(result, throughput, light, strict=True)]


def _roulette(throughput: Spectra, eta: Float, plays: Mask, sample: Float) -> tuple[Spectra, Mask]:
    """Play Russian roulette by the brightest wavelength, so that one decision serves all; also return who survives."""
    brightest = dr.max(throughput[0])
    for group in throughput[1:]:
        brightest = dr.maximum(brightest, dr.max(group))
    survival = dr.minimum(brightest * dr.square(eta), 0.95)
    factor = dr.select(plays, dr.rcp(survival), 1.0)
    return [group * factor for group in throughput], (~plays | (sample < survival)) & (brightest != 0)
