"""Spectral radiance of an image: what a camera looks at."""

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
        Median over pixels and bands of the Monte Carlo standard error over the mean; 0 where nothing was rendered.
    width_nm : (band,) float64
        Band widths; left out, the spacing of evenly spaced centres.
    relative_level_error : float, optional
        Monte Carlo standard error over the value of the level that the light was brought to; None where none was asked
        for, or there is no estimate.
    signed : bool
        Whether values may be negative: half of a render, whose noise may cross 0.
    light : Spectrum, optional
        The lamp behind the values, up to a factor: with it integrals over bands follow its lines and slopes. None where
        it isn't known, or the values aren't a lamp's on smooth surfaces: they are then taken as smooth themselves.
    horizontal_view_deg : float, optional
        Field of view across the picture [degrees], as an ISETCam scene states it.

    Raises
    ------
    InputError
        Where the shape is wrong, a value is negative, NaN or infinite (its position is named), or bands reach beyond
        100 to 20 000 nm or overlap (`render.spectrum.band_widths`).

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
        """Width of each band, shape (band,)."""
        assert self.width_nm is not None  # since construction
        return self.width_nm

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.values.shape[0], self.values.shape[1]

    def luminance(self) -> NDArray[np.float64]:
        """Luminance of each pixel [cd m^-2], shape (h, w)."""
        return luminance(self.values, self.wavelength_nm, self.widths_nm, self.light)

    @method
    def relight(
        self, light: Spectrum | None = None, *, luminance_cd_m2: float | None = None, lux: float | None = None
    ) -> "SpectralRadiance":
        """Radiance under another lamp of the same luminance in the place of the one that is behind the values.

        Each value is divided by the lamp's mean in its band and multiplied by the other's: what surfaces reflect stays.

        Parameters
        ----------
        light : Spectrum, optional
            Or an illuminant's name; left out, the lamp stays.
        luminance_cd_m2 : float, optional
            Mean luminance of the picture to reach; left out, the lamp keeps its luminance.
        lux : float, optional
            Refused, with what to give in its place: a picture has no plane on which an illuminance could be measured.

        Raises
        ------
        InputError
            Where the lamp isn't known, or gives nothing in a band in which there is light; for a level of a dark
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
    """Radiance of which one band at a time is made, whenever it's asked for: no array holds all bands.

    Attributes
    ----------
    make : callable
        Gives a band's values, (h, w) float32, by its number.
    shape : (int, int)
        Height and width in pixels.
    wavelength_nm, widths_nm : (band,) float64
    relative_mc_error, relative_level_error, signed, light, horizontal_view_deg
        As of `SpectralRadiance`.
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
        """Return a band's values, (h, w) float32; `InputError` for one that `SpectralRadiance` doesn't take."""
        plane = self.make(band)
        check_values("radiance", plane[..., None], self.signed, band)
        return plane

    @cached_property
    def extents(self) -> Floats:
        """Largest absolute value, its mean, and the mean of each band, shape (3, band)."""
        planes = (self.plane(band) for band in range(self.wavelength_nm.size))
        return np.transpose([(*_extent(plane), plane.mean(dtype=np.float64)) for plane in planes])

    @property
    def mean_luminance(self) -> float:
        """Mean luminance of the picture [cd m^-2]."""
        weights = observer_weights(self.wavelength_nm, self.widths_nm, self.light)[1]
        return float(LUMINOUS_EFFICACY_LM_W * (self.extents[2] @ weights))

    def whole(self) -> SpectralRadiance:
        """Return all bands together."""
        planes = np.stack([self.make(band) for band in range(self.wavelength_nm.size)])
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
    """Return the largest absolute value of each band and its mean, shape (2, band)."""
    if isinstance(radiance, BandRadiance):
        return radiance.extents[:2]
    return np.transpose([_extent(plane) for plane in np.moveaxis(radiance.values, -1, 0)])


def _extent(plane: NDArray[np.floating]) -> tuple[float, float]:
    size = np.abs(plane)
    return float(size.max()), float(size.mean(dtype=np.float64))


def check_values(name: str, values: NDArray[np.floating], signed: bool = False, first_band: int = 0) -> None:
    """Raise `InputError` at the first value of (h, w, band) that is NaN, infinite or, unless `signed`, negative.

    Where only a part of the bands is given, `first_band` is the number of its first one.
    """
    # two passes without a temporary; NaN carries through
    least = float(values.min())
    most = float(values.max())
    if least >= (-np.finfo(values.dtype).max if signed else 0) and most < np.inf:
        return
    row, column, band = (int(i) for i in np.argwhere(~(np.isfinite(values) & ((values >= 0) | signed)))[0])
    raise InputError(
        f"{name}: {values[row, column, band]} at row {row}, column {column}, band {first_band + band}; "
        f"allowed: finite numbers{'' if signed else ' >= 0'}; repair or mask that pixel"
    )
