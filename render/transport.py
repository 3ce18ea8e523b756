"""Light transport of a scene, rendered once, and its relighting by any spectrum, power and level of the lights."""

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
# A spectrum or an illuminant's name for each light group, or one in place of all lights.
Spectra: TypeAlias = Mapping[str, Spectrum | str] | Spectrum | str
Powers: TypeAlias = Mapping[str, float]  # factor of each light group


@dataclass(frozen=True)
class Transport:
    """Radiance of each light group at unit spectral emission, with its Monte Carlo error.

    Attributes
    ----------
    light : Halves of (group, band, h, w)
        Radiance at unit spectral emission. For a large photograph its mean isn't an array, but computes one band at a
        time (`render.radiance_files.photo.PhotoPlanes`).
    variance : (group, band, h, w) float32
        Variance of the light, from the difference of the halves, pooled over 3x3 pixels.
    coverage : Halves of (h, w)
        Share of each pixel's samples that see a light directly.
    seen : tuple of Halves of (1 or band, h, w)
        The directly visible part of each group's `light`: one plane for all bands, or one per band if the group is
        `coloured`.
    scene_means : SceneMeans
        Means from which levels are computed.
    groups : mapping of str to LightGroup
        The scene's own spectra and powers, in the order of the first axis.
    wavelength_nm, width_nm : (band,) float64
    counts : (h, w) uint32
        Samples of each pixel, both halves together; a pixel that is noisier than others has more.
    stopped_by : "samples", "noise", "seconds" or "interrupt"
    seconds : float
        Time of all calls of `render` that made it.
    integrator, variant : str
    relative_mc_error : float
        Error reached under the scene's own lights: median over pixels and bands of standard error over mean.
    shared : SharedPaths or None
        Two groups whose errors are correlated, since a constant environment is rendered along with another group.
    meter : callable or None
        Function that returns the irradiance on the scene's reference plane, which is traced at the first call; None
        without a plane.
    denoised : Denoised or None
        Denoised light beside the unbiased light, if it was asked for (`render.denoised.relight`).
    horizontal_view_deg : float or None
        Angle of view of the scene's camera across the picture; None if it has none.
    compile_s : float
        Time in which kernels were compiled for this render; 0 if kernels or light already existed.
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
        """Return the mean of both halves, (group, band, h, w) float32; times a spectral emission it is radiance."""
        return np.asarray(self.light.mean)

    @property
    def spp(self) -> float:
        """Return the samples per pixel of both halves together, averaged over the picture."""
        return float(self.counts.mean())

    @property
    def irradiance(self) -> Floats | None:
        """Return the reference plane's irradiance at unit spectral emission, (group, band); None without a plane."""
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
        """Compute the radiance under given lights; it is linear in emission, so that nothing is rendered again.

        Parameters
        ----------
        spectra : mapping of group name to Spectrum or illuminant name, or one of these alone, or float, optional
            A mapping replaces the groups' own spectral emission. One lamp alone, such as ``"A"``, takes the place of
            all lights, each at that light's luminance, as ``--light A`` does. A number is the power of all groups.
        powers : mapping of group name to float, optional
            Replaces the groups' own powers.
        luminance_cd_m2 : float, optional
            Mean luminance to reach, without the lights themselves (`level`); all groups are scaled by one factor.
        illuminance_lux : float, optional
            Illuminance to reach on the scene's reference plane, likewise. It is traced when it is first asked for.
        lux : float, optional
            A shorter name for `illuminance_lux`.

        Returns
        -------
        SpectralRadiance
            Values in float32, stored band by band, each rounded once from float64. `relative_level_error` is the error
            of the level that was asked for.

        Raises
        ------
        InputError
            For an unknown group or illuminant, a negative power or level, two levels at once, a level of a scene
            without light, or illuminance without a reference plane; for one lamp in place of a light that is dark or
            coloured.

        Warns
        -----
        UserWarning
            If a light's spectrum ends within the bands at a value other than 0; beyond its end it is dark.
        WideBandsWarning
            If `band_error` of the CIE observer is over 1 %.
        """
        if isinstance(spectra, float | int):
            powers = dict.fromkeys(self.groups, spectra)
            spectra = None
        lights = self._lights(spectra, powers)
        in_bands = self._in_bands(lights)
        light, level_error = self._at_level(in_bands, luminance_cd_m2, illuminance_lux, lux)
        planes = combine(light.maps, self.radiance)
        if light.mixed:  # the map of a lamp with lines may subtract light from the bands beside a line
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
        """Compute two independent estimates of `relight` with the same arguments, from the two halves of the samples.

        Their mean is the result of `relight`. A quarter of the squared difference of any linear function of them is an
        unbiased estimate of that function's Monte Carlo variance. Both are `signed`, because a half is negative where
        its error exceeds the light.
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
        """Compute the part of `relight` that some light groups give; the parts of all groups add up to it.

        The part is `signed`, because in a band beside another lamp's line it may be negative.
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
        """Compute the Monte Carlo variance of `relight` at a level of the scene's own lights, shape (band, h, w)."""
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
        """Estimate the relative error, by the bands' width, of the light that each curve collects, RMS over pixels.

        It is the error that is expected for surfaces as rough over wavelength as those of the scene
        (`render.bands.error`); lamps are known to their lines.

        For a file of radiance whose lamp was named (`render.bands.known_lamp`), the error of the file's own bands isn't
        included. For chart patches in bands of 20 nm that error is 0.03 % RMS, and 0.06 % under high-pressure sodium.

        If the lamp isn't known, the light is assumed to be as smooth within bands as between them. Under a lamp with
        lines the true error is then larger than this estimate: for chart patches in bands of 20 nm up to 3.0 % under
        F2, 4.4 % under high-pressure sodium and 5.6 % under F11 (`benchmarks/bands.py`).

        Parameters
        ----------
        spectra, powers
            As in `relight`.
        responses : mapping of str to Spectrum, optional
            Electrons per photon of a camera's channels, as ``sensor.responses.curves``; by default the CIE 1931
            observer's x, y and z.

        Returns
        -------
        dict of str to float
            Relative error by curve.
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
        """Compute the mean luminance [cd m^-2] that a level in cd/m^2 sets, under given lights.

        Directly visible light is left out of the sum of light, and the part of the picture that it covers is left out
        of the area.

        Raises
        ------
        InputError
            As `relight`, and if lights fill the picture.
        """
        return self.scene_means.luminance_level(self._luminance_weights(self._emission(spectra, powers)))

    def illuminance_lux(self, luminance_cd_m2: float) -> float | None:
        """Compute the reference plane's illuminance at a mean luminance of the scene's lights; None without a plane."""
        if self.meter is None:
            return None
        return self.meter().level(self._luminance_weights(self._own_at(luminance_cd_m2))).value

    def mean_radiance(self, *, luminance_cd_m2: float) -> Floats:
        """Compute the mean radiance, without visible lights, at a level of the scene's own lights, shape (band,)."""
        own = self._own_at(luminance_cd_m2)
        return np.asarray(np.einsum("gab,gb->a", own.maps, self.scene_means.mean_radiance()))

    def scattered_luminance(self, *, luminance_cd_m2: float | None = None) -> NDArray[np.float64]:
        """Compute each pixel's luminance [cd m^-2] without directly visible lamps, shape (h, w).

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
        """Return the light groups with the spectra and powers asked for."""
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
        """Give every light the spectrum of one lamp, scaled to the luminance of that light's own spectrum."""
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
        """Scale the emission of the scene's own lights to a level."""
        return self._at_level(self._emission(), luminance_cd_m2)[0]

    def _at_level(
        self,
        light: BandLight,
        luminance_cd_m2: float | None,
        illuminance_lux: float | None = None,
        lux: float | None = None,
    ) -> tuple[BandLight, float | None]:
        """Scale emission to the level asked for; also return that level's relative error."""
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
        """Compute the luminance of a transport of 1 in each group and band, shape (group, band)."""
        return light.luminance_weights(self.wavelength_nm, self.width_nm)


def relight_by_band(
    transport: Transport,
    spectra: Spectra | None = None,
    *,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
) -> BandRadiance:
    """Relight one band at a time; bits, parameters, errors and warnings are those of `Transport.relight`."""
    lights = transport._lights(spectra, None)
    in_bands = transport._in_bands(lights)
    light, level_error = transport._at_level(in_bands, luminance_cd_m2, illuminance_lux)
    warn_of_wide_bands(transport._curve_error(lights, in_bands), transport.width_nm)

    planes = transport.light.mean  # the closure holds this alone, so that the variance can be freed

    def plane(band: int) -> Planes:
        values = _combined(light, band, planes)
        return np.maximum(values, np.float32(0), out=values) if light.mixed else values

    mc_error = relative_error(light.emitted, transport.light.mean, transport.variance, transport.shared)
    return replace(
        _by_band(transport, light, plane), relative_mc_error=mc_error, relative_level_error=level_error, signed=False
    )


def light_alone(transport: Transport) -> Transport:
    """Drop all planes of a transport except its light's, for a caller that relights it and needs no error."""
    none = np.zeros((0, 0), np.float32)
    return replace(transport, variance=none, shared=None, coverage=Halves(none, none), seen=(), denoised=None)


def mean_alone(transport: Transport) -> Transport:
    """Drop all planes of a transport except its light's mean, for a caller that has its errors already."""
    light = transport.light
    return replace(light_alone(transport), light=Halves(light.mean, np.zeros((0, 0, 0, 0), np.float32)))


def halves_by_band(
    transport: Transport,
    spectra: Spectra | None = None,
    *,
    luminance_cd_m2: float | None = None,
    illuminance_lux: float | None = None,
) -> tuple[BandRadiance, BandRadiance]:
    """Relight halves one band at a time; bits, parameters and errors are those of `Transport.relight_halves`."""
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
    """Compute one band of `combine`, (h, w), and read only the planes that it needs."""
    chosen = np.argwhere(light.maps[:, band]).tolist()
    if not chosen:
        return np.zeros(planes.shape[2:], np.float32)
    read = [planes[group, of_band] for group, of_band in chosen]
    taken = read[0][None] if len(read) == 1 else np.stack(read)
    factors = np.array([light.maps[group, band, of_band] for group, of_band in chosen])
    return np.asarray(combine(factors[None, None], taken[None])[0])


def replaceable_luminance(group: LightGroup, place: str) -> float:
    """Return the luminance of a light group's spectrum, so that another spectrum can take its place.

    Raises
    ------
    InputError
        For a group that is dark or coloured.
    """
    luminance = spectral_luminance(group.spectrum)
    if group.coloured or luminance <= 0:
        why = "has colours of its own" if group.coloured else "is dark"
        raise InputError(f"{place} {why}; allowed: the light that it has; leave it as it is")
    return luminance
