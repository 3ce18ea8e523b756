"""A pixel, and what stands behind it: photodiodes that bin, several readings. Set a term to 0 to switch it off."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Annotated, Any

from rodcone.display import brief
from rodcone.errors import InputError, require_fields, require_name, require_range, require_whole

CHARGE, DIGITAL = BINNINGS = ("charge", "digital")
MERGED, SWITCHED = "merged", "switched"  # what is done with several readings
MOST_READINGS = 8


@dataclass(frozen=True)
class PixelConfig:
    """A pixel (Table 1 of Parmar & Wandell 2009 names these parameters).

    Attributes
    ----------
    pitch_um, fill_factor : float
        Width and height [um]; the share of the area that collects light.
    full_well_e : float
        Electrons at which the pixel clips.
    read_noise_e, dsnu_e : float
        Standard deviation of temporal dark noise, and of the fixed dark offset over pixels [e-].
    prnu : float
        Standard deviation over pixels of the relative photo-response.
    dark_current_e_per_s : float
        Of every pixel, collected with the light and Poisson like it.
    conversion_gain_uv_per_e, voltage_swing_v, analog_gain : float
        As Table 1 and data sheets state them: reported, not applied. The well alone decides where pixels clip.
    column_gain_spread : float
        Standard deviation over columns of their amplifiers' relative gain; it acts on what the well gave, so behind the
        Poisson draw and the clip.
    column_offset_e : float
        Standard deviation over columns of their fixed dark offset [e-], added where DSNU is.
    hot_pixel_share, hot_pixel_dark_current_e_per_s : float
        Share of pixels that leak, and the dark current that they have on top of the others'.
    crosstalk : float
        Share of a pixel's photo-electrons that each of its four neighbours collects instead.
    row_noise_e : float
        Part of `read_noise_e` that all pixels of a row have together, anew for each row and frame [e-].
    telegraph_share, telegraph_e : float
        Share of pixels whose source follower holds a trap, which makes their readings jump (random telegraph noise),
        and the mean over these pixels of the jump's height [e-]. It is the part `telegraph_noise_e` of `read_noise_e`,
        which is that of all pixels together, as a report's temporal dark noise is.
    response_bend : float
        c of the response n (1 + c (1 - n / full_well_e)) of n collected electrons: its slope is 1 + c in the dark and
        1 - c at the well, and both ends stay where they are. 0 for a straight one. Development takes any for straight.
    ramp_step_e, ramp_rise : float
        What columns that have converted do to the ramp that all columns of a row are compared with, once the whole row
        has converted: the readings above are raised by `ramp_step_e` [e-], and the ramp is steeper by `ramp_rise`. 0
        for converters that don't disturb each other. Development and `noise_variance` leave both out.
    binned_well_e : float
        Electrons at which the sum of four pixels clips where they bin in charge: what the floating diffusion that they
        share holds. 0 for four times the well.

    Examples
    --------
    >>> import rodcone
    >>> pixel = rodcone.PixelConfig(2.8, 0.9, full_well_e=15_000.0, read_noise_e=1.5, dsnu_e=1.0, prnu=0.01)
    >>> pixel.full_well_e
    15000.0
    """

    pitch_um: Annotated[float, (1e-3, 1e4, "give micrometres")]
    fill_factor: Annotated[float, (0.0, 1.0, "give a fraction")]
    full_well_e: Annotated[float, (1.0, 1e12, "give electrons")]
    read_noise_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    dsnu_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    prnu: Annotated[float, (0.0, 1.0, "give a fraction: 1.7 % is 0.017")]
    dark_current_e_per_s: Annotated[float, (0.0, 1e12, "give electrons per second, 0 for none")] = 0.0
    conversion_gain_uv_per_e: Annotated[float, (1e-6, 1e9, "give microvolts per electron")] = 30.0
    voltage_swing_v: Annotated[float, (1e-6, 1e6, "give volts")] = 1.08
    analog_gain: Annotated[float, (1e-6, 1e6, "give a factor")] = 1.0
    column_gain_spread: Annotated[float, (0.0, 1.0, "give a fraction, 0 for none")] = 0.0
    column_offset_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")] = 0.0
    hot_pixel_share: Annotated[float, (0.0, 1.0, "give a fraction, 0 for none")] = 0.0
    hot_pixel_dark_current_e_per_s: Annotated[float, (0.0, 1e12, "give electrons per second, 0 for none")] = 0.0
    crosstalk: Annotated[float, (0.0, 0.25, "give the share that goes to each of four neighbours, 0 for none")] = 0.0
    row_noise_e: float = 0.0
    telegraph_share: Annotated[float, (0.0, 1.0, "give a fraction, 0 for none")] = 0.0
    telegraph_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")] = 0.0
    response_bend: Annotated[float, (-0.5, 0.5, "give a fraction, 0 for a straight response")] = 0.0
    ramp_step_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")] = 0.0
    ramp_rise: Annotated[float, (0.0, 10.0, "give a fraction, 0 for none")] = 0.0
    binned_well_e: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)
        if self.binned_well_e:
            fix = "the floating diffusion holds one full well at least; give electrons, 0 for four wells"
            require_range("binned_well_e", self.binned_well_e, self.full_well_e, 1e12, fix)
        if self.row_noise_e:
            fix = "it is a part of the read noise; give electrons, 0 for none"
            require_range("row_noise_e", self.row_noise_e, 0.0, self.read_noise_e, fix)
        if self.telegraph_noise_e:
            parts_e = hypot(self.row_noise_e, self.telegraph_noise_e)
            fix = "they are parts of the read noise; make telegraph_e or its share less"
            require_range("telegraph noise with row_noise_e", parts_e, 0.0, self.read_noise_e, fix)
        require_range("prnu with column_gain_spread", self.fixed_gain, 0.0, 1.0, "make the root of their squares less")

    @property
    def fixed_dark_e(self) -> float:
        """Return the standard deviation over pixels of all fixed dark offsets [e-]: DSNU and column offsets."""
        return hypot(self.dsnu_e, self.column_offset_e)

    @property
    def fixed_gain(self) -> float:
        """Return the standard deviation over pixels of all relative gains: PRNU and column gains."""
        return hypot(self.prnu, self.column_gain_spread)

    @property
    def telegraph_noise_e(self) -> float:
        """Return the standard deviation of random telegraph noise over all pixels [e-].

        The share s of pixels has a trap; over these the jump a is exponentially distributed with the mean A. Correlated
        double sampling subtracts two states of the trap, which gives -a, 0 or +a with the probabilities 1/4, 1/2 and
        1/4. So the variance is a^2 / 2 for a pixel with a trap, and s A^2 over all pixels.
        """
        return sqrt(self.telegraph_share) * self.telegraph_e

    @property
    def has_shared_ramp(self) -> bool:
        """Return whether the columns of a row disturb each other when they convert."""
        return self.ramp_step_e > 0 or self.ramp_rise > 0

    @property
    def swing_e(self) -> float:
        """Return the electrons that fill the voltage swing: only reported (Table 1's disagrees with its own well)."""
        return self.voltage_swing_v * 1e6 / self.conversion_gain_uv_per_e


@dataclass(frozen=True)
class ChipTemperature:
    """Temperature of a chip, by which its dark current is another than at the one where it was measured.

    Dark currents double for every `doubling_k`, as EMVA 1288 states the dependence. DSNU and read noise stay.

    Attributes
    ----------
    chip_c, measured_c : float
        Temperature of the chip, and that at which the pixel's dark currents were measured [degrees Celsius].
    doubling_k : float
        Rise of the temperature that doubles them [K].
    """

    chip_c: Annotated[float, (-270.0, 200.0, "give degrees Celsius")]
    measured_c: Annotated[float, (-270.0, 200.0, "give degrees Celsius")]
    doubling_k: Annotated[float, (1.0, 100.0, "give kelvin; data sheets have 5 to 10")]

    def __post_init__(self) -> None:
        require_fields(self, "temperature: ")

    def pixel_of(self, pixel: PixelConfig) -> PixelConfig:
        """Return the pixel with its dark currents, hot pixels' too, at the chip's temperature."""
        factor = 2 ** ((self.chip_c - self.measured_c) / self.doubling_k)
        names = ("dark_current_e_per_s", "hot_pixel_dark_current_e_per_s")
        changed: dict[str, Any] = {name: factor * getattr(pixel, name) for name in names}
        return replace(pixel, **changed)


@dataclass(frozen=True)
class Reading:
    """A reading: another gain, another time, or another part of the pixel.

    Readings of one photodiode and one time are of the same charge, so of one shot noise.

    Attributes
    ----------
    read_noise_e, dsnu_e, full_well_e : float
        As `PixelConfig` has them, in electrons of this reading's own charge.
    light_share : float
        Share of the pixel's light, and of its dark current, that the photodiode collects.
    time_share : float
        Share of the exposure time, the longest's 1.
    photodiode : str
        Which one: readings of another have other shot noise and another PRNU.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.Reading(read_noise_e=1.5, dsnu_e=0.5, full_well_e=2_000.0).full_well_e
    2000.0
    """

    read_noise_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    dsnu_e: Annotated[float, (0.0, 1e9, "give electrons, 0 for none")]
    full_well_e: Annotated[float, (1.0, 1e12, "give electrons")]
    light_share: Annotated[float, (1e-6, 1.0, "give the photodiode's share of the pixel's light")] = 1.0
    time_share: Annotated[float, (1e-6, 1.0, "give a share of the exposure time, the longest's 1")] = 1.0
    photodiode: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self)

    @property
    def share(self) -> float:
        """Return the share of the whole pixel's electrons in the whole exposure that this charge contains."""
        return self.light_share * self.time_share

    @property
    def charge(self) -> tuple[str, float]:
        """Return the photodiode and the share of time, which readings of the same charge have in common."""
        return self.photodiode, self.time_share


@dataclass(frozen=True)
class ChannelReading:
    """How the sites of one channel are read, where that is another way than the pixel's.

    What is left out is as the pixel has it.

    Attributes
    ----------
    channel : str
        Of the mosaic.
    time_share : float
        Share of the exposure time after which its sites are read; where `metered`, the most.
    light_share : float
        Of what a neutral density in front of its filter lets through.
    metered : bool
        Whether each frame takes the share of the time that puts the channel's bright end at 80 % of its well.
    full_well_e, read_noise_e, dsnu_e : float or None
        Of a conversion gain of its own, in electrons of these sites.

    Examples
    --------
    >>> import rodcone
    >>> rodcone.ChannelReading("W", time_share=0.25).time_share
    0.25
    """

    channel: str
    time_share: Annotated[float, (1e-6, 1.0, "give a share of the exposure time")] = 1.0
    light_share: Annotated[float, (1e-6, 1.0, "give what the density lets through, 1 for none")] = 1.0
    metered: bool = False
    full_well_e: Annotated[float | None, (1.0, 1e12, "give electrons")] = None
    read_noise_e: Annotated[float | None, (0.0, 1e9, "give electrons, 0 for none")] = None
    dsnu_e: Annotated[float | None, (0.0, 1e9, "give electrons, 0 for none")] = None

    __repr__ = brief

    def __post_init__(self) -> None:
        require_fields(self, f"channel {self.channel!r}: ")

    @property
    def share(self) -> float:
        """Return the share that the sites collect of what they would in the whole time without the density."""
        return self.time_share * self.light_share

    def pixel_of(self, pixel: PixelConfig) -> PixelConfig:
        """Return the pixel as this channel's sites have it, in their own electrons.

        Its dark current is the share that collects in the channel's time, spread over the whole time.
        """
        changed = {"full_well_e": self.full_well_e, "read_noise_e": self.read_noise_e, "dsnu_e": self.dsnu_e}
        return replace(
            pixel,
            dark_current_e_per_s=pixel.dark_current_e_per_s * self.time_share,
            hot_pixel_dark_current_e_per_s=pixel.hot_pixel_dark_current_e_per_s * self.time_share,
            **{name: value for name, value in changed.items() if value is not None},
        )


def check_readings(readings: Sequence[Reading], readout: str) -> None:
    """Raise `InputError` for readings that no pixel has, or a readout that they can't have."""
    require_name("readout", readout, (MERGED, SWITCHED))
    if not readings:
        if readout == SWITCHED:
            raise InputError(f"readout: {SWITCHED!r} without readings; allowed: with two or more; add [[readings]]")
        return
    require_whole("readings", len(readings), 2, MOST_READINGS, "give two or more, or describe the one in [pixel]")
    lights = {x.photodiode: x.light_share for x in readings}
    if any(lights[x.photodiode] != x.light_share for x in readings) or sum(lights.values()) > 1 + 1e-9:
        raise InputError(
            f"light_share: {[x.light_share for x in readings]} of the photodiodes {[x.photodiode for x in readings]}; "
            "allowed: one share for each photodiode, 1 together; name photodiodes apart, or correct their shares"
        )
    times = [x.time_share for x in readings]
    if max(times) != 1.0:
        raise InputError(
            f"time_share: {times}; allowed: shares of the longest time, one of 1; divide by {max(times):g}"
        )
    if readout == SWITCHED and {x.share for x in readings} != {1.0}:
        raise InputError(f"readout: {SWITCHED!r} between shares of light or time; allowed: gains; write {MERGED!r}")


@dataclass(frozen=True)
class Binning:
    """Four photodiodes of one channel behind each pixel of the raw image.

    Attributes
    ----------
    way : {"charge", "digital"}
        Summed as charge on their floating diffusion and read once, or read one by one and summed in digital numbers.
    photodiode : PixelConfig
        One of the four.
    bits, black_level_dn, white_level_dn : int, and int or None
        Numbers of the converter, as in `SensorConfig`, when it reads one photodiode.
    converter_noise_dn : float
        Noise after the amplifier, as in `SensorConfig`, when it reads one photodiode.
    """

    way: str
    photodiode: PixelConfig
    bits: int
    black_level_dn: int | None
    white_level_dn: int | None
    converter_noise_dn: float = 0.0


@dataclass(frozen=True)
class Chip:
    """What stands behind a pixel of the raw image, where that is more than one photodiode that is read once.

    Attributes
    ----------
    binning : Binning or None
    readings : tuple of Reading
        Two or more; none for a pixel that is read once.
    readout : str
        ``merged``: all are read, and become one linear raw image; ``switched``: the one whose gain suits the light.
    channels : tuple of ChannelReading
        Channels that are read apart, of a pixel that is read once.
    """

    binning: Binning | None = None
    readings: tuple[Reading, ...] = ()
    readout: str = MERGED
    channels: tuple[ChannelReading, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        check_readings(self.readings, self.readout)
        if self.readings and self.binning:
            raise InputError(
                f"binning: {self.binning.way!r} with several readings; allowed: one of the two; leave one out"
            )
        names = [x.channel for x in self.channels]
        if len(set(names)) < len(names):
            raise InputError(f"channels: {names}; allowed: each once; leave one out")
        if names and (self.readings or self.binning):
            other = "several readings" if self.readings else "binning"
            raise InputError(f"channels: {names} with {other}; allowed: one of the two; leave one out")

    @property
    def sites(self) -> int:
        """Return the number of photodiodes along either side of a pixel."""
        return 1 if self.binning is None else 2

    @property
    def in_charge(self) -> bool:
        """Return whether the charges of a pixel's photodiodes are summed before they are read."""
        return self.binning is not None and self.binning.way == CHARGE

    @property
    def switched(self) -> bool:
        """Return whether each frame is read with one of several gains."""
        return self.readout == SWITCHED


def pixel_of_readings(pixel: PixelConfig, readings: Sequence[Reading]) -> PixelConfig:
    """Return the pixel with the deepest well and the least dark noise of its readings, divided by their shares."""
    return replace(
        pixel,
        full_well_e=max(x.full_well_e / x.share for x in readings),
        read_noise_e=min(x.read_noise_e / x.share for x in readings),
        dsnu_e=min(x.dsnu_e / x.share for x in readings),
    )


def bent_e(collected_e: Any, pixel: PixelConfig) -> Any:
    """Return the electrons that are read from those collected, by `response_bend`, for arrays of NumPy or Dr.Jit."""
    return collected_e * ((1.0 + pixel.response_bend) - collected_e * (pixel.response_bend / pixel.full_well_e))


def bent_slope(collected_e: Any, pixel: PixelConfig) -> Any:
    """Return the slope of `bent_e`."""
    return (1.0 + pixel.response_bend) - collected_e * (2.0 * pixel.response_bend / pixel.full_well_e)
