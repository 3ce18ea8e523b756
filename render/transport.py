"""Light transport of a scene, rendered once; any spectrum, power and level of its lights afterwards."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from render.bands.error import curve_error, warn_of_wide_bands
from render.bands.mixed_light import BandLight, band_light
from render.combine import combine
from render.denoised.denoise import Denoised
from render.error_estimates import Halves, SharedPaths, relative_error
from render.illuminants import illuminant, spectral_luminance, unit_luminance
from render.level import Irradiance, Level, SceneMeans
from render.radiance import BandRadiance, SpectralRadiance
from render.scene import LightGroup
from render.scene_range import warn_of_dark_ends
from render.spectrum import Spectrum
from rodcone.display import brief
from rodcone.errors import InputError, require_keys, require_kind, require_range
from rodcone.types import Floats, Planes

Stop = Literal["samples", "noise", "seconds", "interrupt"]
# By light group, or one in place of all lights; a name is an illuminant's.
Spectra: TypeAlias = Mapping[str, Spectrum | str] | Spectrum | str
Powers: TypeAlias = Mapping[str, float]  # by light group


@dataclass(frozen=True)
class Transport:
    """Radiance of each light group at unit spectral emission, with its Monte Carlo error.

    Attributes
    ----------
    light : Halves of (group, band, h, w)
        Times a spectral emission it is radiance. Of a large photograph its mean isn't an array yet, but makes one band
        at a time (`render.radiance_files.photo.PhotoPlanes`).
    variance : (group, band, h, w) float32
        Variance of the light, from the difference of the halves, pooled over 3x3 pixels.
    coverage : Halves of (h, w)
        Share of each pixel's samples in which a light is seen directly.
    seen : tuple of Halves of (1 or band, h, w)
        The part of `light` that is seen directly, of each group: one plane for all bands, or by band where the group
        has a colour of its own.
    scene_means : SceneMeans
        What levels are computed from.
    groups : mapping of str to LightGroup
        The scene's own spectra and powers, in the order of the first axis.
    wavelength_nm, width_nm : (band,) float64
    counts : (h, w) uint32
        Samples of each pixel, both halves together; a pixel that is noisier than others has more.
    stopped_by : "samples", "noise", "seconds" or "interrupt"
    seconds : float
        Of all the calls that it took.
    integrator, variant : str
    relative_mc_error : float
        Error reached under the scene's own lights: median over pixels and bands of standard error over mean.
    shared : SharedPaths or None
        Two groups whose errors are correlated, since a constant environment is rendered along with another group.
    meter : callable or None
        Gives the irradiance on the scene's reference plane, traced at its first call; None without a plane.
    denoised : Denoised or None
        Denoised light beside the unbiased, where it was asked for (`render.denoised.relight`).
    horizontal_view_deg : float or None
        Angle of view of the scene's camera across the picture; None where it has none.
    compile_s : float
        Seconds in which kernels were compiled for it; 0 where they were there already, or the light was.
    """

    light: Halves
    variance: Planes
    coverage: Halves
    seen: tuple[Halves, ...]
    scene_means: SceneMeans
    groups: Mapping[str, LightGroup]
    wavelength_nm: Floats
    width_nm: Floats
    counts: NDArray[np.uint32]
    stopped_by: Stop
    seconds: float
    integrator: str
    variant: str
    relative_mc_error: float = 0.0
    shared: SharedPaths | None = None
    meter: Callable[[], Irradiance] | None = None
    denoised: Denoised | None = None
    horizontal_view_deg: float | None = None
    compile_s: float = 0.0

    __repr__ = brief

    @property
    def radiance(self) -> Planes:
        """Mean of both halves, (group, band, h, w) float32: times a spectral emission it is radiance."""
        return np.asarray(self.light.mean)

    @property
    def spp(self) -> float:
        """Samples a pixel in the mean over the picture, both halves together."""
        return float(self.counts.mean())

    @property
    def irradiance(self) -> Floats | None:
        """On the scene's reference plane at unit spectral emission, shape (group, band); None without a plane."""
        return None if self.meter is None else self.meter().mean

    def relight(
        self,
        spectra: Spectra | float | None = None,
        *,
        powers: Powers | None = None,
        luminance_cd_m2: float | None = None,
        illuminance_lux: float | None = None,
        lux: float | None = None,
    ) -> SpectralRadiance:
        """Radiance under given lights: linear in emission, so no new render.

        Parameters
        ----------
        spectra : mapping of group name to Spectrum or illuminant name, or one of these alone, or float, optional
            A mapping replaces the groups' own spectral emission. One lamp alone, such as ``"A"``, takes the place of
            all lights, each of which keeps its luminance, as ``--light A`` does. A number is the power of all groups.
        powers : mapping of group name to float, optional
            Replaces the groups' own powers.
        luminance_cd_m2 : float, optional
            Mean luminance to reach of what is no light (`level`); all groups are scaled together.
        illuminance_lux : float, optional
            Illuminance to reach on the scene's reference plane; the same. The first call that asks for it traces it.
        lux : float, optional
            `illuminance_lux` by a shorter name.

        Returns
        -------
        SpectralRadiance
            float32 over band-planar memory, each value rounded once from float64. `relative_level_error` is the error
            of the level that was asked for.

        Raises
        ------
        InputError
            For an unknown group or illuminant, a negative power or level, two levels at once, a level of a scene
            that gives no light, or illuminance without a reference plane; for one lamp in place of a light that is
            dark or has colours of its own.

        Warns
        -----
        UserWarning
            Where a light's spectrum ends within the bands at a value other than 0: outside it is dark.
        WideBandsWarning
            Where `band_error` of the CIE observer is over 1 %.
        """
        if isinstance(spectra, float | int):
            powers = dict.fromkeys(self.groups, spectra)
            spectra = None
        lights = self._lights(spectra, powers)
        in_bands = self._in_bands(lights)
        light, level_error = self._at_level(in_bands, luminance_cd_m2, illuminance_lux, lux)
        planes = combine(light.maps, self.radiance)
        if light.mixed:  # beside a line the map of a lamp takes light off its neighbour
            np.maximum(planes, np.float32(0), out=planes)
        warn_of_wide_bands(self._curve_error(lights, in_bands), self.width_nm)
        return SpectralRadiance(
            values=np.moveaxis(planes, 0, -1),
            wavelength_nm=self.wavelength_nm,
            relative_mc_error=relative_error(light.emitted, self.light.mean, self.variance, self.shared),
            width_nm=self.width_nm,
            relative_level_error=level_error,
            light=light.spectrum,
            horizontal_view_deg=self.horizontal_view_deg,
        )

    def relight_halves(
        self,
        spectra: Spectra | None = None,
        *,
        powers: Powers | None = None,
        luminance_cd_m2: float | None = None,
        illuminance_lux: float | None = None,
        lux: float | None = None,
    ) -> tuple[SpectralRadiance, SpectralRadiance]:
        """Two independent estimates of `relight` with the same arguments, from the two halves of the samples.

        Their mean is `relight`'s result; a quarter of the squared difference of any linear function of them is an
        unbiased estimate of that function's Monte Carlo variance. Where an error is larger than the value, a half may
        be under 0: both are `signed`.
        """
        light, _ = self._at_level(self._emission(spectra, powers), luminance_cd_m2, illuminance_lux, lux)
        values, difference = combine(light.maps, self.radiance), combine(light.maps, self.light.difference)
        even, odd = (self._signed(half, light) for half in (values + difference, values - difference))
        return even, odd

    def relight_part(
        self,
        groups: Sequence[str],
        spectra: Spectra | None = None,
        *,
        luminance_cd_m2: float | None = None,
        illuminance_lux: float | None = None,
        lux: float | None = None,
    ) -> SpectralRadiance:
        """What some light groups give of `relight` with the same arguments; parts of all groups sum to it.

        Beside another lamp's line a part may be under 0 in a band, so it is `signed`.
        """
        if not (isinstance(groups, list | tuple) and all(isinstance(name, str) for name in groups)):
            raise InputError(f"groups: a {type(groups).__name__} is not allowed; give a list of light groups' names")
        require_keys("groups: light group", groups, self.groups)
        light, _ = self._at_level(self._emission(spectra), luminance_cd_m2, illuminance_lux, lux)
        chosen = np.array([name in groups for name in self.groups])
        planes = combine(light.maps * chosen[:, None, None], self.radiance)
        return self._signed(planes, light)

    def _signed(self, planes: Planes, light: BandLight) -> SpectralRadiance:
        return SpectralRadiance(
            np.moveaxis(planes, 0, -1),
            self.wavelength_nm,
            width_nm=self.width_nm,
            signed=True,
            light=light.spectrum,
            horizontal_view_deg=self.horizontal_view_deg,
        )

    def relight_variance(self, *, luminance_cd_m2: float) -> Planes:
        """Monte Carlo variance of `relight` at a level of the scene's own lights, shape (band, h, w)."""
        coefficients = self._own_at(luminance_cd_m2).emitted
        independent = combine(coefficients[:, :, None] ** 2 * np.eye(self.wavelength_nm.size), self.variance)
        if self.shared is None:
            return independent
        return np.asarray(np.maximum(independent + self.shared.term(coefficients, self.variance), np.float32(0)))

    def band_error(
        self,
        spectra: Spectra | None = None,
        *,
        powers: Powers | None = None,
        responses: Mapping[str, Spectrum] | None = None,
    ) -> dict[str, float]:
        """Relative error of the light that each curve collects, for want of what happens within bands; RMS over pixels.

        Expected of surfaces as rough over wavelength as these (`render.bands.error`); lamps count to their lines. Of a
        file of radiance whose lamp was named (`render.bands.known_lamp`) what its own bands left is no part of it: of
        chart patches in bands of 20 nm 0.03 % RMS, 0.06 under high-pressure sodium. If the lamp isn't known the light
        is taken to be as smooth within bands as between them. Under a lamp with lines the error is larger than what is
        said then: of chart patches in bands of 20 nm up to 3.0 % under F2, 4.4 under high-pressure sodium, 5.6 under
        F11 (`benchmarks/bands.py`).

        Parameters
        ----------
        spectra, powers
            As `relight`.
        responses : mapping of str to Spectrum, optional
            Electrons per photon of a camera's channels, as ``sensor.responses.curves``; left out, the CIE 1931
            observer's x, y and z.

        Returns
        -------
        dict of str to float
            By curve.
        """
        if responses is not None:
            require_kind("responses", responses, Mapping, "give sensor.responses.curves")
            for name, curve in responses.items():
                require_kind(f"responses[{name!r}]", curve, Spectrum, "give sensor.responses.curves")
            if not responses:
                raise InputError("responses: none given; allowed: one curve or more; give sensor.responses.curves")
        lights = self._lights(spectra, powers)
        return self._curve_error(lights, self._in_bands(lights), responses)

    def level(self, spectra: Spectra | None = None, *, powers: Powers | None = None) -> Level:
        """Mean luminance [cd m^-2] of what is no light, under given lights: what a level in cd/m^2 sets.

        The light that is seen directly is left out of the sum, and what it covers out of the area.

        Raises
        ------
        InputError
            As `relight`, and where lights fill the picture.
        """
        return self.scene_means.luminance_level(self._luminance_weights(self._emission(spectra, powers)))

    def illuminance_lux(self, luminance_cd_m2: float) -> float | None:
        """Illuminance on the reference plane at a mean luminance under the scene's own lights; None without a plane."""
        if self.meter is None:
            return None
        return self.meter().level(self._luminance_weights(self._own_at(luminance_cd_m2))).value

    def mean_radiance(self, *, luminance_cd_m2: float) -> Floats:
        """Mean radiance of what is no light, at a level of the scene's own lights, shape (band,)."""
        own = self._own_at(luminance_cd_m2)
        return np.asarray(np.einsum("gab,gb->a", own.maps, self.scene_means.mean_radiance()))

    def scattered_luminance(self, *, luminance_cd_m2: float | None = None) -> NDArray[np.float64]:
        """Return each pixel's luminance [cd m^-2] without lamps in view, shape (h, w).

        `luminance_cd_m2` is the scene's level under its own lights; None leaves them at their own powers.
        """
        emitted = self._emission()
        weights = self._luminance_weights(self._at_level(emitted, luminance_cd_m2)[0])
        total = np.zeros(self.coverage.mean.shape)
        for of_group, radiance, seen in zip(weights, self.radiance, self.seen, strict=True):
            for weight, plane in zip(of_group, radiance, strict=True):  # no copy of all planes in double precision
                total += weight * plane
            for weight, plane in zip(of_group if len(seen.mean) > 1 else [of_group.sum()], seen.mean, strict=True):
                total -= weight * plane
        return np.maximum(total, 0.0)

    def _repr_png_(self) -> bytes:
        return self.relight()._repr_png_()

    def _lights(self, spectra: Spectra | None, powers: Powers | None) -> dict[str, LightGroup]:
        """Light groups as asked for."""
        if isinstance(spectra, str | Spectrum):
            spectra = self._all_lit_by(illuminant(spectra) if isinstance(spectra, str) else spectra)
        for what, given in (("spectra", spectra), ("powers", powers)):
            if given is not None:
                require_kind(
                    what, given, Mapping, f"give a dict by light group{', or one illuminant' * (what == 'spectra')}"
                )
                require_keys(f"{what}: light group", given, self.groups)
        lights = {}
        for name, group in self.groups.items():
            choice = (spectra or {}).get(name, group.spectrum)
            spectrum = illuminant(choice) if isinstance(choice, str) else choice
            require_kind(f"spectra[{name!r}]", spectrum, Spectrum, "give rodcone.illuminant(name)")
            power = (powers or {}).get(name, group.power)
            require_range(f"powers[{name!r}]", power, 0.0, 1e30, "give a factor of 0 or more")
            if power > 0:
                warn_of_dark_ends(f"light group {name!r}", spectrum, self.wavelength_nm, self.width_nm)
            lights[name] = replace(group, spectrum=spectrum, power=float(power))
        return lights

    def _all_lit_by(self, lamp: Spectrum) -> dict[str, Spectrum | str]:
        """One lamp in the place of every light, at the luminance of that light's own spectrum."""
        unit = unit_luminance(lamp)
        return {
            name: unit * replaceable_luminance(group, f"spectra: one lamp for light group {name!r}, which")
            for name, group in self.groups.items()
        }

    def _emission(self, spectra: Spectra | None = None, powers: Powers | None = None) -> BandLight:
        """Return what the chosen lights emit, in the transport's bands."""
        return self._in_bands(self._lights(spectra, powers))

    def _in_bands(self, lights: Mapping[str, LightGroup]) -> BandLight:
        means = np.maximum(self.scene_means.radiance, 0.0).mean(axis=1)
        return band_light(lights, means, self.wavelength_nm, self.width_nm)

    def _curve_error(
        self, lights: Mapping[str, LightGroup], light: BandLight, responses: Mapping[str, Spectrum] | None = None
    ) -> dict[str, float]:
        return curve_error(lights, light, self.light.mean, self.wavelength_nm, self.width_nm, responses)

    def _own_at(self, luminance_cd_m2: float) -> BandLight:
        """Emission of the scene's own lights brought to a level."""
        return self._at_level(self._emission(), luminance_cd_m2)[0]

    def _at_level(
        self,
        light: BandLight,
        luminance_cd_m2: float | None,
        illuminance_lux: float | None = None,
        lux: float | None = None,
    ) -> tuple[BandLight, float | None]:
        """Emission brought to the level asked for, and the relative error of that level."""
        levels = {"luminance_cd_m2": luminance_cd_m2, "illuminance_lux": illuminance_lux, "lux": lux}
        given = [name for name, value in levels.items() if value is not None]
        if len(given) > 1:
            raise InputError(f"{' and '.join(given)}: both given; allowed: one of them; leave one out")
        illuminance_lux = lux if illuminance_lux is None else illuminance_lux
        weights = self._luminance_weights(light)
        if luminance_cd_m2 is not None:
            require_range("luminance_cd_m2", luminance_cd_m2, 0.0, 1e15, "give a mean luminance of 0 or more")
            target, level = luminance_cd_m2, self.scene_means.luminance_level(weights)
        elif illuminance_lux is not None:
            require_range("illuminance_lux", illuminance_lux, 0.0, 1e15, "give an illuminance of 0 or more")
            if self.meter is None:
                raise InputError("illuminance_lux: the scene states no reference plane; give luminance_cd_m2 instead")
            target, level = illuminance_lux, self.meter().level(weights)
        else:
            return light, None
        if level.value <= 0:
            raise InputError(f"level: {target} can't be reached, the scene gives no light; raise a power or spectrum")
        return light * (target / level.value), level.relative_error

    def _luminance_weights(self, light: BandLight) -> Floats:
        """Luminance of a transport of 1 in each group and band, shape (group, band)."""
        return light.luminance_weights(self.wavelength_nm, self.width_nm)


def relight_by_band(
    transport: Transport,
    spectra: Spectra | None = None,
    *,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
) -> BandRadiance:
    """Return `Transport.relight` one band at a time, of the same bits; parameters, errors and warnings as of it."""
    lights = transport._lights(spectra, None)
    in_bands = transport._in_bands(lights)
    light, level_error = transport._at_level(in_bands, luminance_cd_m2, illuminance_lux)
    warn_of_wide_bands(transport._curve_error(lights, in_bands), transport.width_nm)

    planes = transport.light.mean  # alone: whoever holds the result doesn't hold the variance

    def plane(band: int) -> Planes:
        values = _combined(light, band, planes)
        return np.maximum(values, np.float32(0), out=values) if light.mixed else values

    mc_error = relative_error(light.emitted, transport.light.mean, transport.variance, transport.shared)
    return replace(
        _by_band(transport, light, plane), relative_mc_error=mc_error, relative_level_error=level_error, signed=False
    )


def light_alone(transport: Transport) -> Transport:
    """Return a transport that has let go of all planes but its light's: for what relights it and asks for no error."""
    none = np.zeros((0, 0), np.float32)
    return replace(transport, variance=none, shared=None, coverage=Halves(none, none), seen=(), denoised=None)


def halves_by_band(
    transport: Transport,
    spectra: Spectra | None = None,
    *,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
) -> tuple[BandRadiance, BandRadiance]:
    """Return `Transport.relight_halves` one band at a time, of the same bits; parameters and errors as of it."""
    light, _ = transport._at_level(transport._emission(spectra), luminance_cd_m2, illuminance_lux)

    planes = transport.light

    def half(band: int, add: Callable[[Planes, Planes], Planes]) -> Planes:
        return add(_combined(light, band, planes.mean), _combined(light, band, planes.difference))

    even, odd = (partial(half, add=add) for add in (np.add, np.subtract))
    return _by_band(transport, light, even), _by_band(transport, light, odd)


def _by_band(transport: Transport, light: BandLight, plane: Callable[[int], Planes]) -> BandRadiance:
    height, width = transport.counts.shape
    return BandRadiance(
        plane,
        (height, width),
        transport.wavelength_nm,
        transport.width_nm,
        signed=True,
        light=light.spectrum,
        horizontal_view_deg=transport.horizontal_view_deg,
    )


def _combined(light: BandLight, band: int, planes: Planes) -> Planes:
    """Return one band of `combine`, (h, w), for which the planes that it takes are read alone."""
    chosen = np.argwhere(light.maps[:, band]).tolist()
    if not chosen:
        return np.zeros(planes.shape[2:], np.float32)
    read = [planes[group, of_band] for group, of_band in chosen]
    taken = read[0][None] if len(read) == 1 else np.stack(read)
    factors = np.array([light.maps[group, band, of_band] for group, of_band in chosen])
    return np.asarray(combine(factors[None, None], taken[None])[0])


def replaceable_luminance(group: LightGroup, place: str) -> float:
    """Luminance of a light group's spectrum, which another spectrum takes over.

    Raises
    ------
    InputError
        For a group that is dark or has colours of its own.
    """
    luminance = spectral_luminance(group.spectrum)
    if group.coloured or luminance <= 0:
        why = "has colours of its own" if group.coloured else "is dark"
        raise InputError(f"{place} {why}; allowed: the light that it has; leave it as it is")
    return luminance
