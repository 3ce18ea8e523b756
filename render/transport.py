"""Light transport of a scene, rendered once; any spectrum, power and level of its lights afterwards."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from render.errors import InputError, require_keys, require_range
from render.illuminants import illuminant
from render.photometry import luminance
from render.radiance import SpectralRadiance
from render.scene import LightGroup
from render.spectrum import Floats, Spectrum

Stop = Literal["samples", "noise", "seconds"]


@dataclass(frozen=True)
class Transport:
    """Radiance of each light group at unit spectral emission, with its Monte Carlo error.

    Attributes
    ----------
    radiance : (group, band, h, w) float32
        Mean over passes; times a spectral emission it is radiance.
    half_difference : (group, band, h, w) float32
        Half the difference between even and odd passes: one draw of the error of `radiance`, all correlations kept.
    variance : (group, band, h, w) float32
        Variance of `radiance`, from the scatter of the passes.
    irradiance : (group, band) float64 or None
        On the scene's reference plane, at unit spectral emission; None where the scene states no plane.
    emitter_visible : (h, w) bool
        Pixels in which a light is seen directly.
    groups : mapping of str to LightGroup
        The scene's own spectra and powers, in the order of the first axis.
    wavelength_nm, width_nm : (band,) float64
    spp, passes : int
        Samples a pixel, all passes together, and the number of passes.
    stopped_by : "samples", "noise" or "seconds"
    seconds : float
    integrator, variant : str
    """

    radiance: NDArray[np.float32]
    half_difference: NDArray[np.float32]
    variance: NDArray[np.float32]
    irradiance: Floats | None
    emitter_visible: NDArray[np.bool_]
    groups: Mapping[str, LightGroup]
    wavelength_nm: Floats
    width_nm: Floats
    spp: int
    passes: int
    stopped_by: Stop
    seconds: float
    integrator: str
    variant: str

    def relight(
        self,
        spectra: Mapping[str, Spectrum | str] | None = None,
        *,
        powers: Mapping[str, float] | None = None,
        luminance_cd_m2: float | None = None,
        illuminance_lux: float | None = None,
    ) -> SpectralRadiance:
        """Radiance under given lights: linear in emission, so no new render.

        Parameters
        ----------
        spectra : mapping of group name to Spectrum or illuminant name, optional
            Replaces the groups' own spectral emission.
        powers : mapping of group name to float, optional
            Replaces the groups' own powers.
        luminance_cd_m2 : float, optional
            Mean luminance to reach, pixels that see a light directly left out; all groups are scaled together.
        illuminance_lux : float, optional
            Illuminance to reach on the scene's reference plane; the same.

        Returns
        -------
        SpectralRadiance
            float32, each value rounded once from float64.

        Raises
        ------
        InputError
            For an unknown group or illuminant, a negative power or level, both levels at once, a level of a scene
            that gives no light, or illuminance without a reference plane.
        """
        coefficients = self._coefficients_at(spectra, powers, luminance_cd_m2, illuminance_lux)
        values = self._combine(coefficients, self.radiance)
        error = relative_error(values, self._combine(coefficients**2, self.variance))
        return self._as_radiance(values, error)

    def relight_halves(
        self,
        spectra: Mapping[str, Spectrum | str] | None = None,
        *,
        powers: Mapping[str, float] | None = None,
        luminance_cd_m2: float | None = None,
        illuminance_lux: float | None = None,
    ) -> tuple[SpectralRadiance, SpectralRadiance]:
        """Two independent estimates of `relight` with the same arguments, from even and from odd passes.

        Their mean is `relight`'s result; a quarter of the squared difference of any linear function of them is an
        unbiased estimate of that function's Monte Carlo variance.
        """
        coefficients = self._coefficients_at(spectra, powers, luminance_cd_m2, illuminance_lux)
        even, odd = (
            self._as_radiance(np.maximum(self._combine(coefficients, self.radiance + sign * self.half_difference), 0.0))
            for sign in (np.float32(1), np.float32(-1))
        )
        return even, odd

    def illuminance_lux(self, luminance_cd_m2: float) -> float | None:
        """Illuminance on the reference plane at a mean luminance under the scene's own lights; None without a plane."""
        if self.irradiance is None:
            return None
        return self._plane_lux(self._coefficients_at(None, None, luminance_cd_m2, None))

    def _coefficients_at(
        self,
        spectra: Mapping[str, Spectrum | str] | None,
        powers: Mapping[str, float] | None,
        luminance_cd_m2: float | None,
        illuminance_lux: float | None,
    ) -> NDArray[np.float64]:
        """Spectral emission of each group and band at the level asked for, shape (group, band)."""
        coefficients = self._coefficients(spectra, powers)
        return coefficients * self._level(coefficients, luminance_cd_m2, illuminance_lux)

    def _coefficients(
        self, spectra: Mapping[str, Spectrum | str] | None, powers: Mapping[str, float] | None
    ) -> NDArray[np.float64]:
        """Spectral emission of each group and band, shape (group, band)."""
        require_keys("spectra: light group", spectra or {}, self.groups)
        require_keys("powers: light group", powers or {}, self.groups)
        rows = []
        for name, group in self.groups.items():
            own = (spectra or {}).get(name, group.spectrum)
            spectrum = illuminant(own) if isinstance(own, str) else own
            power = float((powers or {}).get(name, group.power))
            require_range(f"powers[{name!r}]", power, 0.0, 1e30, "give a factor of 0 or more")
            rows.append(spectrum.band_average(self.wavelength_nm, self.width_nm) * power)
        return np.array(rows)

    def _level(self, coefficients: Floats, luminance_cd_m2: float | None, illuminance_lux: float | None) -> float:
        """Factor that brings the lights to the level asked for."""
        if luminance_cd_m2 is not None and illuminance_lux is not None:
            raise InputError("luminance_cd_m2 and illuminance_lux: both given; allowed: one of them; leave one out")
        if luminance_cd_m2 is not None:
            require_range("luminance_cd_m2", luminance_cd_m2, 0.0, 1e15, "give a mean luminance of 0 or more")
            asked, present = luminance_cd_m2, self._mean_luminance(coefficients)
        elif illuminance_lux is not None:
            require_range("illuminance_lux", illuminance_lux, 0.0, 1e15, "give an illuminance of 0 or more")
            asked, present = illuminance_lux, self._plane_lux(coefficients)
        else:
            return 1.0
        if present <= 0:
            raise InputError(f"level: {asked} can't be reached, the scene gives no light; raise a power or spectrum")
        return asked / present

    def _mean_luminance(self, coefficients: Floats) -> float:
        kept = ~self.emitter_visible
        if not kept.any():
            raise InputError(
                "luminance_cd_m2: every pixel sees a light directly; give illuminance_lux or powers instead"
            )
        mean = self.radiance[:, :, kept].mean(axis=2, dtype=np.float64)
        return float(luminance((coefficients * mean).sum(axis=0), self.wavelength_nm, self.width_nm))

    def _plane_lux(self, coefficients: Floats) -> float:
        if self.irradiance is None:
            raise InputError("illuminance_lux: the scene states no reference plane; give luminance_cd_m2 instead")
        return float(luminance((coefficients * self.irradiance).sum(axis=0), self.wavelength_nm, self.width_nm))

    @staticmethod
    def _combine(coefficients: Floats, planes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Sum over groups, shape (band, h, w); in float64 band by band, rounded once."""
        result = np.empty(planes.shape[1:], dtype=np.float32)
        for band, factors in enumerate(coefficients.T):
            result[band] = sum(c * plane.astype(np.float64) for c, plane in zip(factors, planes[:, band], strict=True))
        return result

    def _as_radiance(self, planes: NDArray[np.float32], error: float = 0.0) -> SpectralRadiance:
        """Band-planar memory behind the (h, w, band) view that the type promises: every later step sums over bands."""
        return SpectralRadiance(np.moveaxis(planes, 0, -1), self.wavelength_nm, error, self.width_nm)


def relative_error(values: NDArray[np.float32], variance: NDArray[np.float32]) -> float:
    """Median over pixels and bands of standard error over mean, the variance pooled over 3x3 pixels; dark values out.

    Shapes (band, h, w). Pooling steadies an estimate that has few passes behind it.
    """
    pooled = uniform_filter(variance, size=(1, 3, 3), mode="nearest")
    lit = values > 0
    return float(np.median(np.sqrt(np.maximum(pooled[lit], 0)) / values[lit])) if lit.any() else 0.0
