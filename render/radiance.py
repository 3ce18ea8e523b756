"""Spectral radiance of an image, which is the light that enters a camera."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from render.illuminants import unit_luminance
from render.spectrum import LUMINOUS_EFFICACY_LM_W, Spectrum, band_widths, luminance, observer_weights, tristimulus
from rodcone.colour_spaces import XYZ_TO_SRGB_ROUNDED
from rodcone.display import Axes, brief, draw_line, preview_png
from rodcone.doors import method
from rodcone.errors import InputError, require_fields, require_range
from rodcone.types import Floats, Planes, real_array


@dataclass(frozen=True)
class SpectralRadiance:
    """Radiance per pixel and wavelength band.

    Attributes
    ----------
    values : (h, w, band) floating
        Band means [W m^-2 sr^-1 nm^-1], finite and, unless `signed`, not negative.
    wavelength_nm : (band,) float64
        Band centres, increasing.
    relative_mc_error : float
        Median over pixels and bands of the Monte Carlo standard error over the mean; 0 if nothing was rendered.
    width_nm : (band,) float64
        Band widths, by default the spacing of evenly spaced centres.
    relative_level_error : float, optional
        Monte Carlo standard error of the level to which the light was scaled, over that level; None if no level was
        asked for or there is no estimate.
    signed : bool
        Whether values may be negative, as in half of a render, whose noise may exceed its light.
    light : Spectrum, optional
        The lamp behind the values, up to a factor; integrals over bands then follow its lines and slopes. If it is None
        (unknown, or not one lamp on smooth surfaces), the values themselves are assumed to be smooth over wavelength.
    horizontal_view_deg : float, optional
        Field of view across the picture [degrees], as an ISETCam scene states it.

    Raises
    ------
    InputError
        If the shape is wrong, a value is negative, NaN or infinite (the message names its position), or bands reach
        beyond 100 to 20 000 nm or overlap (`render.spectrum.band_widths`).

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.ones((2, 3, 4)), np.array([450.0, 500.0, 550.0, 600.0]))
    >>> light.shape
    (2, 3)
    >>> light.luminance().shape
    (2, 3)
    """

    values: NDArray[np.floating]
    wavelength_nm: Floats
    relative_mc_error: float = 0.0
    width_nm: Floats | None = None
    relative_level_error: float | None = None
    signed: bool = False
    light: Spectrum | None = None
    horizontal_view_deg: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)
        values = real_array("radiance", self.values)
        least = np.float32 if values.dtype.kind == "f" else np.float64  # half floats would overflow
        values = values.astype(np.result_type(values, least), copy=False)
        centres = np.array(real_array("wavelength_nm", self.wavelength_nm), dtype=np.float64)
        widths = band_widths(centres, self.width_nm)
        if values.ndim != 3 or values.shape[2] != centres.size or 0 in values.shape:
            raise InputError(f"radiance: shape {values.shape} is not (h, w, {centres.size}); give one value a band")
        check_values("radiance", values, self.signed)
        require_range("relative_mc_error", self.relative_mc_error, 0.0, np.inf, "give a standard error over the mean")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "wavelength_nm", centres)
        object.__setattr__(self, "width_nm", widths)

    @property
    def widths_nm(self) -> Floats:
        """Return the width of each band [nm], shape (band,)."""
        assert self.width_nm is not None  # `__post_init__` has set it
        return self.width_nm

    @property
    def shape(self) -> tuple[int, int]:
        """Return the height and width in pixels."""
        return self.values.shape[0], self.values.shape[1]

    def luminance(self) -> NDArray[np.float64]:
        """Compute the luminance of each pixel [cd m^-2], shape (h, w)."""
        return luminance(self.values, self.wavelength_nm, self.widths_nm, self.light)

    @method
    def relight(
        self, light: Spectrum | None = None, *, luminance_cd_m2: float | None = None, lux: float | None = None
    ) -> "SpectralRadiance":
        """Replace the lamp behind the values by another one of the same luminance.

        Each value is divided by the old lamp's mean in its band and multiplied by the new lamp's. What surfaces reflect
        stays the same.

        Parameters
        ----------
        light : Spectrum, optional
            The new lamp, or an illuminant's name. If it is left out, the lamp stays.
        luminance_cd_m2 : float, optional
            Mean luminance to which the picture is scaled. If it is left out, the lamp keeps its luminance.
        lux : float, optional
            Always refused, because a picture has no plane on which illuminance is measured; the message says what to
            give instead.

        Raises
        ------
        InputError
            If the old lamp isn't known, or gives nothing in a band in which there is light; for a level of a dark
            picture.
        """
        if lux is not None:
            raise InputError(
                f"lux: {lux:g} needs a reference plane, which a picture hasn't; allowed: luminance_cd_m2, or the "
                "transport's own relight(lux=...), which knows the scene's plane; give luminance_cd_m2"
            )
        lit = self if light is None else self._under(light)
        if luminance_cd_m2 is None:
            return lit
        require_range("luminance_cd_m2", luminance_cd_m2, 0.0, 1e15, "give a mean luminance of 0 or more")
        mean = float(lit.luminance().mean())
        if mean <= 0:
            raise InputError(f"level: {luminance_cd_m2} can't be reached, the picture is dark; give one that has light")
        return replace(lit, values=(lit.values * (luminance_cd_m2 / mean)).astype(lit.values.dtype))

    def _under(self, light: Spectrum) -> "SpectralRadiance":
        if self.light is None:
            raise InputError(
                "light: it isn't known which lamp is behind these values; allowed: radiance that states it, such as an "
                "ISETCam scene; give light=, or a cube of reflectances"
            )
        own, other = (
            unit_luminance(lamp).band_average(self.wavelength_nm, self.widths_nm) for lamp in (self.light, light)
        )
        dark = np.flatnonzero((own <= 0) & (self.values.max(axis=(0, 1)) > 0))
        if dark.size:
            raise InputError(
                f"light: the lamp behind the values gives nothing at {self.wavelength_nm[dark[0]]:g} nm, where they "
                "hold light; allowed: a lamp that explains it; correct the lamp"
            )
        ratio = np.divide(other, own, out=np.zeros_like(own), where=own > 0)
        return replace(self, values=(self.values * ratio).astype(self.values.dtype), light=unit_luminance(light))

    @method
    def plot_line(self, row: int | None = None, axes: Axes | None = None) -> Axes:
        """Draw the luminance along a row, the middle one by default, into Matplotlib's axes."""
        return draw_line({"": self.luminance()}, row, axes, "luminance, cd/m²")

    def _repr_png_(self) -> bytes:
        return preview_png(
            tristimulus(self.values, self.wavelength_nm, self.widths_nm, self.light) @ XYZ_TO_SRGB_ROUNDED.T
        )


@dataclass(frozen=True)
class BandRadiance:
    """Radiance whose bands are computed one at a time, on request, so that no array holds all of them.

    Attributes
    ----------
    make : callable
        Function that computes a band's values, (h, w) float32, from its number.
    shape : (int, int)
        Height and width in pixels.
    wavelength_nm, widths_nm : (band,) float64
    relative_mc_error, relative_level_error, signed, light, horizontal_view_deg
        As in `SpectralRadiance`.
    """

    make: Callable[[int], Planes]
    shape: tuple[int, int]
    wavelength_nm: Floats
    widths_nm: Floats
    relative_mc_error: float = 0.0
    relative_level_error: float | None = None
    signed: bool = False
    light: Spectrum | None = None
    horizontal_view_deg: float | None = None

    __repr__ = brief

    def plane(self, band: int) -> Planes:
        """Compute a band's values, (h, w) float32; raise `InputError` as `SpectralRadiance` does for wrong values."""
        plane = self.make(band)
        check_values("radiance", plane[..., None], self.signed, band)
        return plane

    @cached_property
    def extents(self) -> Floats:
        """Return the largest absolute value, the mean absolute value and the mean of each band, shape (3, band)."""
        planes = (self.plane(band) for band in range(self.wavelength_nm.size))
        return np.transpose([(*_extent(plane), plane.mean(dtype=np.float64)) for plane in planes])

    @property
    def mean_luminance(self) -> float:
        """Return the mean luminance of the picture [cd m^-2]."""
        weights = observer_weights(self.wavelength_nm, self.widths_nm, self.light)[1]
        return float(LUMINOUS_EFFICACY_LM_W * (self.extents[2] @ weights))

    def whole(self) -> SpectralRadiance:
        """Compute all bands at once."""
        planes = np.empty((self.wavelength_nm.size, *self.shape), np.float32)
        for band in range(self.wavelength_nm.size):
            planes[band] = self.make(band)
        return SpectralRadiance(
            np.moveaxis(planes, 0, -1),
            self.wavelength_nm,
            relative_mc_error=self.relative_mc_error,
            width_nm=self.widths_nm,
            relative_level_error=self.relative_level_error,
            signed=self.signed,
            light=self.light,
            horizontal_view_deg=self.horizontal_view_deg,
        )


def band_plane(radiance: SpectralRadiance | BandRadiance, band: int) -> NDArray[np.floating]:
    """Return the values of one band, (h, w)."""
    return radiance.plane(band) if isinstance(radiance, BandRadiance) else radiance.values[..., band]


def band_extents(radiance: SpectralRadiance | BandRadiance) -> Floats:
    """Return the largest and the mean absolute value of each band, shape (2, band)."""
    if isinstance(radiance, BandRadiance):
        return radiance.extents[:2]
    return np.transpose([_extent(plane) for plane in np.moveaxis(radiance.values, -1, 0)])


def _extent(plane: NDArray[np.floating]) -> tuple[float, float]:
    size = np.abs(plane)
    return float(size.max()), float(size.mean(dtype=np.float64))


def check_values(name: str, values: NDArray[np.floating], signed: bool = False, first_band: int = 0) -> None:
    """Raise `InputError` at the first value of (h, w, band) that is NaN, infinite or, unless `signed`, negative.

    If `values` holds only some bands, `first_band` is the number of the first of them.
    """
    # Two passes without a temporary array; NaN propagates through both.
    least = float(values.min())
    most = float(values.max())
    if least >= (-np.finfo(values.dtype).max if signed else 0) and most < np.inf:
        return
    row, column, band = (int(i) for i in np.argwhere(~(np.isfinite(values) & ((values >= 0) | signed)))[0])
    raise InputError(
        f"{name}: {values[row, column, band]} at row {row}, column {column}, band {first_band + band}; "
        f"allowed: finite numbers{'' if signed else ' >= 0'}; repair or mask that pixel"
    )
