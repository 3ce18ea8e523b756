"""What a camera is: its chip, lens, mosaic, responses, converter. Set a term to 0 to switch it off."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, hypot
from numbers import Real
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from render.spectrum import LONGEST_NM, SHORTEST_NM, VISIBLE_NM
from rodcone.display import brief
from rodcone.doors import method
from rodcone.errors import InputError, require_fields, require_keys, require_kind, require_range, require_whole
from rodcone.types import Floats
from sensor.cfa import RGBW, Tile, block_sums, channels, check_covers, check_tile, quad, unit_channel
from sensor.curves import Responses, rgbw
from sensor.pixel import MERGED, ChannelReading, Chip, PixelConfig, Reading, pixel_of_readings

BLACK_SIGMAS = 5.0  # black level in standard deviations of dark noise, so that clipping at 0 doesn't bias dark samples
METERED_SHARE = 0.8  # automatic exposure and gain bring a frame's bright end to this share of the well
METERED_PERCENTILE = 99.0
MOST_GAIN = 1024.0
MOST_ROW_US = 1e5  # longest row time; even scanners read a row in less
LONGEST_S = 0.066  # longest time that a rule of exposure chooses by default: Parmar & Wandell 2009, Figure 5, 66 ms


@dataclass(frozen=True)
class LensConfig:
    """A lens.

    Attributes
    ----------
    f_number, transmittance, magnification : float
        The last as its absolute value; 0 for a far scene.
    horizontal_view_deg : float
        Angle of view across the whole picture: light falls off with the fourth power of the cosine off the axis.
    falloff_power : float
        Power of that cosine, 4 for a thin lens; the angle of view is then that of the scene's own camera where
        `horizontal_view_deg` is 0. 0, the default, lets light fall off by a stated angle of view alone.
    vignetting, vignetting_from : float
        Share of the light that a rim takes from the picture's corners, and the image height from which on it cuts the
        pupil, 0 in the middle and 1 in the corners (`sensor.lens.illumination`).
    diffraction : float
        Width of the point image over that of an ideal circular aperture: 1 for a lens without faults.
    defocus_um : float
        Diameter of the disc on the sensor that a point out of focus becomes.
    veiling_glare : float
        Share of the light that scatters evenly over the picture, about the index of ISO 9358.
    scatter : float
        Share of the light that the lens scatters into wings around each lamp (`sensor.lens.scatter`), beside the even
        share of `veiling_glare`.
    scatter_slope, scatter_shoulder_deg : float
        Power by which the wings fall with the angle, and the angle [degrees] from which on they do.
    eye_age_years, eye_pigmentation : float
        Wings of an eye of this age in the lens's place, by the CIE's equation of disability glare; 0 years for a lens.
        The pigmentation is 0 for black eyes, 0.5 for brown, 1 for blue, 1.2 for very light ones.
    shake_um : float
        Standard deviation of the image's place on the sensor along each axis, by the hand (`sensor.shake`).
    table : str
        Lens by data (`sensor.lens.table`): a shipped one's name, or its TOML file. It gives point spread, relative
        illumination, distortion and lateral colour. With wavefronts its diffraction is that of `f_number`, with kernels
        none beside them, whatever `diffraction` says.
    table_digest : str
        Hash of that file's content where it is one's own (`sensor.lens.table.terms_of`), so that stored results of
        another content aren't taken for this one's. Whoever reads the file states it.
    """

    f_number: Annotated[float, (0.1, 1e4, "give focal length over aperture")]
    transmittance: Annotated[float, (0.0, 1.0, "give a fraction")] = 1.0
    magnification: Annotated[float, (0.0, 1e4, "give its absolute value, 0 for a far scene")] = 0.0
    horizontal_view_deg: Annotated[float, (0.0, 175.0, "give degrees, 0 for no falloff")] = 0.0
    falloff_power: Annotated[float, (0.0, 8.0, "give the power of the cosine, 4 for a thin lens")] = 0.0
    vignetting: Annotated[float, (0.0, 0.99, "give the share of light lost in the corners, 0 for none")] = 0.0
    vignetting_from: Annotated[float, (0.0, 0.95, "give an image height, 0 in the middle and 1 in the corners")] = 0.5
    diffraction: Annotated[float, (0.0, 100.0, "give 1 for an ideal lens, 0 for none")] = 0.0
    defocus_um: Annotated[float, (0.0, 1e6, "give micrometres, 0 for none")] = 0.0
    veiling_glare: Annotated[float, (0.0, 1.0, "give a fraction, 0 for none")] = 0.0
    scatter: Annotated[float, (0.0, 0.99, "give a fraction, 0 for none")] = 0.0
    scatter_slope: Annotated[float, (0.5, 6.0, "give the power of the angle, 2 for stars in telescopes")] = 2.0
    scatter_shoulder_deg: Annotated[float, (1e-4, 45.0, "give degrees")] = 0.1
    eye_age_years: Annotated[float, (0.0, 120.0, "give years, 0 for a lens")] = 0.0
    eye_pigmentation: Annotated[float, (0.0, 1.2, "give 0 for black eyes to 1.2 for very light ones")] = 0.5
    shake_um: Annotated[float, (0.0, 1e6, "give micrometres, 0 for a camera that stands still")] = 0.0
    table: str = ""
    table_digest: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)
        if self.scatter and self.eye_age_years:
            raise InputError(
                f"scatter: {self.scatter:g} beside eye_age_years {self.eye_age_years:g}; allowed: a lens's wings or an "
                "eye's; leave one out"
            )
        if not self.table:  # code that removes a table may leave its hash
            object.__setattr__(self, "table_digest", "")


@dataclass(frozen=True)
class SensorConfig:
    """A camera as its raw image shows it: pixel, lens, mosaic, responses and converter.

    Attributes
    ----------
    pixel : PixelConfig
        Of the raw image: of photodiodes that bin, the four together (`sensor.photodiodes.binned`); of several readings,
        `pixel_of_readings`.
    lens : LensConfig
    cfa : tuple of str
        Tile of the raw image's channels, such as ``("RG", "BW")``.
    responses : Responses
        Electrons per photon of each channel.
    bits : int
        Of the converter, 1 to 16.
    black_level_dn : int or None
        Reading of no light; None gives five standard deviations of the dark, rounded up.
    window_nm : (float, float)
        Wavelengths that the camera lets in: an ideal filter in front of the responses.
    white_level_dn : int or None
        Reading of a full well, at which the converter clips; None gives its top.
    chip : Chip
        Photodiodes and readings behind a pixel.
    gain : float
        Amplification between pixel and converter, 1 where a full well reads the converter's top: that is the well over
        the gain (`with_gain`).
    converter_noise_dn : float
        Standard deviation of the noise that comes after the amplifier [DN], beside quantisation: in electrons it falls
        as the gain rises. `PixelConfig.read_noise_e` is what comes before, the same at every gain.
    gain_limit : float
        Gain up to which an automatic exposure amplifies once its time is the longest; 1 for none.
    row_time_us : float
        Time from the start of one row's exposure to that of the next [us]: rows roll from the first to the last, where
        it is negative from the last to the first; 0 exposes all rows together. Lamps that flicker show it
        (`sensor.flicker.rows`), and so does a hand that shakes (`sensor.shake`).
    """

    pixel: PixelConfig
    lens: LensConfig
    cfa: Tile = RGBW
    responses: Responses = field(default_factory=rgbw)
    bits: int = 14
    black_level_dn: int | None = None
    window_nm: tuple[float, float] = VISIBLE_NM
    white_level_dn: int | None = None
    chip: Chip = field(default_factory=Chip)
    gain: float = 1.0
    converter_noise_dn: float = 0.0
    gain_limit: float = 1.0
    row_time_us: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        for name, kind in (("pixel", PixelConfig), ("lens", LensConfig), ("responses", Responses), ("chip", Chip)):
            require_kind(name, getattr(self, name), kind, "keep the sensor's own, or change it by dataclasses.replace")
        object.__setattr__(self, "cfa", check_tile(self.cfa))
        require_whole("bits", self.bits, 1, 16, "give the converter's resolution")
        require_range("gain", self.gain, 1.0, MOST_GAIN, "give a factor; at 1 a full well reads the converter's top")
        require_range("gain_limit", self.gain_limit, 1.0, MOST_GAIN, "give a factor, 1 for none")
        require_range(
            "row_time_us", self.row_time_us, -MOST_ROW_US, MOST_ROW_US, "give microseconds, 0 for all at once"
        )
        require_range("converter_noise_dn", self.converter_noise_dn, 0.0, 2.0**self.bits, "give DN, 0 for none")
        if self.chip.readings and max(self.gain, self.gain_limit) > 1:
            raise InputError(
                f"gain: {max(self.gain, self.gain_limit):g} with several readings, which have gains of their own; "
                "allowed: 1; leave it out, or describe one reading in [pixel]"
            )
        if self.white_level_dn is not None:
            require_whole(
                "white_level_dn", self.white_level_dn, 1, 2**self.bits - 1, "give DN up to the converter's top"
            )
        if self.black_level_dn is not None:
            require_whole("black_level_dn", self.black_level_dn, 0, self.white_dn - 1, "give DN under the white level")
        pair = self.window_nm if isinstance(self.window_nm, tuple | list) and len(self.window_nm) == 2 else (0, 0)
        if not (all(isinstance(nm, Real) for nm in pair) and SHORTEST_NM <= pair[0] < pair[1] <= LONGEST_NM):
            raise InputError(f"window_nm: {self.window_nm!r} is not allowed; give [shortest, longest] in 100-20000 nm")
        object.__setattr__(self, "window_nm", (float(pair[0]), float(pair[1])))
        require_keys("responses: channel", self.channels, self.responses.curves)
        require_keys("channels: channel", (apart.channel for apart in self.chip.channels), self.channels)
        time_shares = [x.time_share for x in self.chip.readings] + [x.time_share for x in self.chip.channels]
        if self.lens.shake_um and min(time_shares, default=1.0) < 1:
            raise InputError(
                f"shake_um: {self.lens.shake_um:g} for a camera that reads some charge after a part of the time, which "
                "the hand would blur less; allowed: 0; leave the shake out, or give every reading the whole time"
            )
        if self.chip.readings and self.pixel != pixel_of_readings(self.pixel, self.chip.readings):
            raise InputError(
                "pixel: its full_well_e, read_noise_e or dsnu_e is not that of its readings; allowed: "
                "with_readings(sensor, readings); change the readings instead"
            )

    @method
    def metered_well_e(self, channel: str) -> float:
        """Return the photo-electrons of the whole pixel at which its most sensitive reading is full.

        An automatic exposure aims at this. Readings with a shorter time or a smaller photodiode take more light, which
        leaves headroom for lamps. If the channel has a time, density or gain of its own, the result is what its own
        reading holds.
        """
        for apart in self.chip.channels:
            if apart.channel == channel:
                return apart.pixel_of(self.pixel).full_well_e / apart.share / self.gain
        readings = self.chip.readings
        most = max((x.share for x in readings), default=1.0)
        return max((x.full_well_e / most for x in readings if x.share == most), default=self.top_e)

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the channels of `cfa` in the order of `sensor.cfa.channels`."""
        return channels(self.cfa)

    @property
    def unit_channel(self) -> str:
        """Return the channel that sets exposure, white balance and a picture's scale (`sensor.cfa.unit_channel`)."""
        return unit_channel(self.cfa)

    @property
    def sites(self) -> int:
        """Return the photodiodes along either side of a raw image's pixel: 2 for a camera that bins, otherwise 1."""
        return self.chip.sites

    @property
    def in_charge(self) -> bool:
        """Return whether the charges of a pixel's photodiodes are summed before they are read."""
        return self.chip.in_charge

    @property
    def site_pitch_um(self) -> float:
        """Return the pitch of the photodiodes [um], the grid on which light is imaged."""
        return self.pixel.pitch_um / self.sites

    @property
    def undivided(self) -> "SensorConfig":
        """Return the camera with one photodiode per pixel, for light that is known no finer than pixels."""
        return self if self.chip.binning is None else replace(self, chip=replace(self.chip, binning=None))

    @property
    def photosites(self) -> "SensorConfig":
        """Return the camera that reads each photodiode by itself: the inverse of `sensor.photodiodes.binned`."""
        binning = self.chip.binning
        if binning is None:
            return self
        return replace(
            self,
            pixel=binning.photodiode,
            cfa=quad(self.cfa),
            bits=binning.bits,
            black_level_dn=binning.black_level_dn,
            white_level_dn=binning.white_level_dn,
            converter_noise_dn=binning.converter_noise_dn,
            chip=Chip(),
        )

    @method
    def pixel_sums(self, values: NDArray[Any]) -> NDArray[Any]:
        """Sum the values of the photodiodes, shape (..., h, w), over each pixel of the raw image.

        Raises
        ------
        InputError
            For an odd height or width of a camera that bins: a picture from a file may have any size.
        """
        _check_even(self, values.shape[-2:])
        return values if self.sites == 1 else block_sums(values)

    @property
    def white_dn(self) -> int:
        """Return the reading of a full well [DN]."""
        return int(2**self.bits - 1 if self.white_level_dn is None else self.white_level_dn)

    @property
    def black_dn(self) -> int:
        """Return the black level [DN], a whole number: raw converters truncate fractions, which tints shadows."""
        if self.black_level_dn is not None:
            return int(self.black_level_dn)
        dark_e = BLACK_SIGMAS * hypot(self.pixel.read_noise_e, self.pixel.fixed_dark_e)
        # White is the black level and the top together, so that black / white = dark / (dark + top). The 1e-9 keeps a
        # rounding error from adding a whole DN.
        least = self.white_dn * dark_e / (self.top_e + dark_e)
        least = hypot(least, BLACK_SIGMAS * self.converter_noise_dn)
        return min(ceil(least - 1e-9), self.white_dn - 1)

    @property
    def top_e(self) -> float:
        """Return the electrons at which the converter reads its greatest value: the full well over the gain."""
        return self.pixel.full_well_e / self.gain

    @property
    def gain_e_per_dn(self) -> float:
        """Return the electrons per DN."""
        return self.top_e / (self.white_dn - self.black_dn)

    @property
    def converter_noise_e(self) -> float:
        """Return the standard deviation of the noise that arises after the amplifier, referred to its input [e-]."""
        return self.converter_noise_dn * self.gain_e_per_dn

    @property
    def read_noise_e(self) -> float:
        """Return the standard deviation of the temporal noise of reading, from before and after the amplifier [e-]."""
        return hypot(self.pixel.read_noise_e, self.converter_noise_e)


def without_terms(lens: LensConfig, terms: Iterable[str]) -> LensConfig:
    """Return the lens with some of its numbers 0, by their names."""
    none: dict[str, Any] = dict.fromkeys(terms, 0.0)
    return replace(lens, **none)


def check_frame(sensor: SensorConfig, shape: tuple[int, ...]) -> None:
    """Raise `InputError` for a frame of photodiodes that holds no tile of the mosaic, or no whole pixels."""
    check_covers(sensor.cfa, shape)
    _check_even(sensor, shape)


def _check_even(sensor: SensorConfig, shape: tuple[int, ...]) -> None:
    if sensor.chip.binning and any(side % 2 for side in shape):
        even = " x ".join(str(side + side % 2) for side in shape)
        raise InputError(
            f"size: {' x '.join(map(str, shape))} pixels with binning {sensor.chip.binning.way!r}; allowed: even "
            f"height and width; give {even}"
        )


def row_starts_s(sensor: SensorConfig, rows: int) -> Floats:
    """Return the time from the first start of an exposure to that of each row of the raw image [s], shape (rows,)."""
    order = np.arange(rows) if sensor.row_time_us >= 0 else np.arange(rows)[::-1]
    return np.asarray(order * (abs(sensor.row_time_us) * 1e-6))


def frame_interval_s(sensor: SensorConfig, rows: int, exposure_s: float) -> float:
    """Return the time from one frame of a burst to the next [s]: the exposure, or the readout if that is longer."""
    return max(exposure_s, rows * abs(sensor.row_time_us) * 1e-6)


def with_readings(sensor: SensorConfig, readings: Sequence[Reading], readout: str = MERGED) -> SensorConfig:
    """Return the camera whose pixel is read several times in an exposure; the readings set its well and dark noise.

    Raises
    ------
    InputError
        For readings that no pixel has, or a camera that bins.

    Examples
    --------
    >>> import rodcone
    >>> dark, bright = rodcone.Reading(1.0, 0.5, 2_000.0), rodcone.Reading(8.0, 2.0, 15_000.0)
    >>> sensor = rodcone.with_readings(rodcone.low_noise(), [dark, bright])
    >>> len(sensor.chip.readings), sensor.pixel.full_well_e
    (2, 15000.0)
    """
    chip = replace(sensor.chip, readings=tuple(readings), readout=readout)
    return replace(sensor, pixel=pixel_of_readings(sensor.pixel, readings), chip=chip)


def with_channel_readings(sensor: SensorConfig, readings: Sequence[ChannelReading]) -> SensorConfig:
    """Return the camera with some channels that have an exposure time, a neutral density or a gain of their own.

    Its raw image holds all channels in one unit: the electrons that each would collect in the whole time without
    density.

    Raises
    ------
    InputError
        For a channel that the mosaic lacks or that is listed twice, a camera that bins or one of several readings.

    Examples
    --------
    >>> import rodcone
    >>> sensor = rodcone.with_channel_readings(rodcone.low_noise(), [rodcone.ChannelReading("W", time_share=0.25)])
    >>> [reading.channel for reading in sensor.chip.channels]
    ['W']
    """
    return replace(sensor, chip=replace(sensor.chip, channels=tuple(readings)))


def with_tile(sensor: SensorConfig, tile: Tile, responses: Responses) -> SensorConfig:
    """Return the camera with another mosaic, without the settings of channels that this mosaic lacks."""
    readings = tuple(x for x in sensor.chip.channels if x.channel in channels(tile))
    return replace(sensor, cfa=tile, responses=responses, chip=replace(sensor.chip, channels=readings))
