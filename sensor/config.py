"""What a camera is: pixel, lens, mosaic, responses, converter. Zero switches a term off."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import ceil, hypot
from numbers import Real

from render.spectrum import LONGEST_NM, SHORTEST_NM, VISIBLE_NM
from rodcone.brief import brief
from rodcone.errors import InputError, require_range, require_whole, unknown
from rodcone.notebook import html_of
from rodcone.plots import png_of
from sensor.cfa import RGBW, Tile, binned_tile, channels, check_tile
from sensor.curves import Responses, rgbw
from sensor.readings.reading import MERGED, Reading, check_readings

SHOWN_EXPOSURE_S = 0.033  # of the noise that a notebook shows
CHARGE, DIGITAL = BINNINGS = ("charge", "digital")
MOST_BITS_SUMMED = 14  # of a converter whose readings are summed by four: a raw image holds 16
BLACK_SIGMAS = 5.0  # black level in dark standard deviations, so that clipping at 0 doesn't bias darks


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
        Reported and used to convert noise given in volts; the well alone decides where pixels clip.
    column_gain_spread : float
        Standard deviation over columns of their amplifiers' relative gain; it acts on what the well gave, so behind the
        Poisson draw and the clip.
    column_offset_e : float
        Standard deviation over columns of their fixed dark offset [e-], added where DSNU is.
    hot_pixel_share, hot_pixel_dark_current_e_per_s : float
        Share of pixels that leak, and the dark current that they have on top of the others'.
    crosstalk : float
        Share of a pixel's photo-electrons that each of its four neighbours collects instead.
    binned_well_e : float
        Electrons at which the sum of four pixels clips where they bin in charge: what the floating diffusion that they
        share holds. 0 for four times the well.
    """

    pitch_um: float
    fill_factor: float
    full_well_e: float
    read_noise_e: float
    dsnu_e: float
    prnu: float
    dark_current_e_per_s: float = 0.0
    conversion_gain_uv_per_e: float = 30.0
    voltage_swing_v: float = 1.08
    analog_gain: float = 1.0
    column_gain_spread: float = 0.0
    column_offset_e: float = 0.0
    hot_pixel_share: float = 0.0
    hot_pixel_dark_current_e_per_s: float = 0.0
    crosstalk: float = 0.0
    binned_well_e: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        limits = {
            "pitch_um": (1e-3, 1e4, "give micrometres"),
            "fill_factor": (0.0, 1.0, "give a fraction"),
            "full_well_e": (1.0, 1e12, "give electrons"),
            "read_noise_e": (0.0, 1e9, "give electrons, 0 for none"),
            "dsnu_e": (0.0, 1e9, "give electrons, 0 for none"),
            "prnu": (0.0, 1.0, "give a fraction: 1.7 % is 0.017"),
            "dark_current_e_per_s": (0.0, 1e12, "give electrons per second, 0 for none"),
            "conversion_gain_uv_per_e": (1e-6, 1e9, "give microvolts per electron"),
            "voltage_swing_v": (1e-6, 1e6, "give volts"),
            "analog_gain": (1e-6, 1e6, "give a factor"),
            "column_gain_spread": (0.0, 1.0, "give a fraction, 0 for none"),
            "column_offset_e": (0.0, 1e9, "give electrons, 0 for none"),
            "hot_pixel_share": (0.0, 1.0, "give a fraction, 0 for none"),
            "hot_pixel_dark_current_e_per_s": (0.0, 1e12, "give electrons per second, 0 for none"),
            "crosstalk": (0.0, 0.25, "give the share that goes to each of four neighbours, 0 for none"),
        }
        for name, (low, high, fix) in limits.items():
            require_range(name, getattr(self, name), low, high, fix)
        if self.binned_well_e:
            fix = "the floating diffusion holds one full well at least; give electrons, 0 for four wells"
            require_range("binned_well_e", self.binned_well_e, self.full_well_e, 1e12, fix)
        require_range("prnu with column_gain_spread", self.fixed_gain, 0.0, 1.0, "make the root of their squares less")

    @property
    def fixed_dark_e(self) -> float:
        """Standard deviation over pixels of all fixed dark offsets [e-]: DSNU and column offsets."""
        return hypot(self.dsnu_e, self.column_offset_e)

    @property
    def fixed_gain(self) -> float:
        """Standard deviation over pixels of all relative gains: PRNU and column gains."""
        return hypot(self.prnu, self.column_gain_spread)

    @property
    def swing_e(self) -> float:
        """Electrons that fill the voltage swing: reported, not applied (Table 1's disagrees with its own well)."""
        return self.voltage_swing_v * 1e6 / self.conversion_gain_uv_per_e


@dataclass(frozen=True)
class LensConfig:
    """A lens.

    Attributes
    ----------
    f_number, transmittance, magnification : float
        The last as its absolute value; 0 for a far scene.
    horizontal_view_deg : float
        Angle of view across the whole picture: light falls off with the fourth power of the cosine off the axis.
    diffraction : float
        Width of the point image over that of an ideal circular aperture: 1 for a lens without faults.
    defocus_um : float
        Diameter of the disc on the sensor that a point out of focus becomes.
    veiling_glare : float
        Share of the light that scatters evenly over the picture, about the index of ISO 9358.
    """

    f_number: float
    transmittance: float = 1.0
    magnification: float = 0.0
    horizontal_view_deg: float = 0.0
    diffraction: float = 0.0
    defocus_um: float = 0.0
    veiling_glare: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        limits = {
            "f_number": (0.1, 1e4, "give focal length over aperture"),
            "transmittance": (0.0, 1.0, "give a fraction"),
            "magnification": (0.0, 1e4, "give its absolute value, 0 for a far scene"),
            "horizontal_view_deg": (0.0, 175.0, "give degrees, 0 for no falloff"),
            "diffraction": (0.0, 100.0, "give 1 for an ideal lens, 0 for none"),
            "defocus_um": (0.0, 1e6, "give micrometres, 0 for none"),
            "veiling_glare": (0.0, 1.0, "give a fraction, 0 for none"),
        }
        for name, (low, high, fix) in limits.items():
            require_range(name, getattr(self, name), low, high, fix)


@dataclass(frozen=True)
class SensorConfig:
    """A camera: pixel, lens, mosaic, responses and converter.

    Attributes
    ----------
    pixel : PixelConfig
    lens : LensConfig
    cfa : tuple of str
        Tile of channels, such as ``("RG", "BW")``.
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
    binning : {"", "charge", "digital"}
        How 2x2 pixels of one channel become one of the raw image: summed as charge on their floating diffusion and
        read once, or read one by one and summed in digital numbers. Empty: not at all. `sensor.binning` says more.
    readings : tuple of Reading
        Two or more; none for a pixel that is read once, as `pixel` says. The pixel is `pixel_of_readings` of them then.
    readout : str
        ``merged``: all are read, and become one linear raw image; ``switched``: the one whose gain suits the light.
    """

    pixel: PixelConfig
    lens: LensConfig
    cfa: Tile = RGBW
    responses: Responses = field(default_factory=rgbw)
    bits: int = 14
    black_level_dn: int | None = None
    window_nm: tuple[float, float] = VISIBLE_NM
    white_level_dn: int | None = None
    binning: str = ""
    readings: tuple[Reading, ...] = ()
    readout: str = MERGED

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "cfa", check_tile(self.cfa))
        require_whole("bits", self.bits, 1, 16, "give the converter's resolution")
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
        self.responses.band_average(channels(self.cfa), [550.0], [1.0])  # every channel needs a curve
        if self.binning != "":
            if self.binning not in BINNINGS:
                raise unknown("binning", self.binning, BINNINGS)
            binned_tile(self.cfa)
            if self.binning == DIGITAL and self.bits > MOST_BITS_SUMMED:
                raise InputError(
                    f"bits: {self.bits} with binning {DIGITAL!r}: four readings sum to two bits more than a raw file's "
                    f"16; allowed: up to {MOST_BITS_SUMMED}; give fewer bits, or binning {CHARGE!r}"
                )
        check_readings(self.readings, self.readout)
        if self.readings and self.binning:
            raise InputError(f"binning: {self.binning!r} with several readings; allowed: one of the two; leave one out")
        if self.readings and self.pixel != pixel_of_readings(self.pixel, self.readings):
            raise InputError(
                "pixel: its full_well_e, read_noise_e or dsnu_e is not that of its readings; allowed: "
                "pixel_of_readings(pixel, readings); change the readings instead"
            )

    def _repr_html_(self) -> str:
        from sensor.readout import noise_sources  # late: it imports this module

        signals_e = (0.0, 100.0, self.pixel.full_well_e / 2)
        sources = [noise_sources(signal_e, self, SHOWN_EXPOSURE_S) for signal_e in signals_e]
        facts: dict[str, str | Sequence[str]] = {
            "mosaic": " / ".join(self.cfa),
            "pixel": f"{self.pixel.pitch_um:g} µm, full well {self.pixel.full_well_e:g} e⁻",
            "lens": f"f/{self.lens.f_number:g}",
            "converter": f"{self.bits} bits, "
            + (f"{len(self.readings)} readings" if self.readings else f"{self.gain_e_per_dn:.3g} e⁻/DN")
            + f", black at {self.black_dn} DN",
            f"noise in {1e3 * SHOWN_EXPOSURE_S:g} ms": [f"of {signal_e:g} e⁻" for signal_e in signals_e],
        }
        facts |= {name: [f"{each[name]:.3g} e⁻" for each in sources] for name in sources[0]}
        facts["all"] = [f"{hypot(*each.values()):.3g} e⁻" for each in sources]
        own = {name: self.responses.curves[name] for name in channels(self.cfa)}
        return html_of("SensorConfig", facts, png_of(Responses(own).plot))

    @property
    def metered_well_e(self) -> float:
        """Photo-electrons of the whole pixel that fill its most sensitive photodiode: what an exposure aims at.

        What shorter times and smaller photodiodes hold beyond it is room for lamps.
        """
        most = max((x.share for x in self.readings), default=1.0)
        return max((x.full_well_e / most for x in self.readings if x.share == most), default=self.pixel.full_well_e)

    @property
    def white_dn(self) -> int:
        """Reading of a full well."""
        return int(2**self.bits - 1 if self.white_level_dn is None else self.white_level_dn)

    @property
    def black_dn(self) -> int:
        """Black level in DN: whole, for raw converters cut a fraction off and tint the dark by what they cut."""
        if self.black_level_dn is not None:
            return int(self.black_level_dn)
        dark_e = BLACK_SIGMAS * hypot(self.pixel.read_noise_e, self.pixel.fixed_dark_e)
        # The converter spans black and well: b / white = dark / (dark + well). Rounding errors make no DN more.
        least = self.white_dn * dark_e / (self.pixel.full_well_e + dark_e)
        return min(ceil(least - 1e-9), self.white_dn - 1)

    @property
    def gain_e_per_dn(self) -> float:
        """Electrons per DN: the full well reads the converter's top."""
        return self.pixel.full_well_e / (self.white_dn - self.black_dn)


def pixel_of_readings(pixel: PixelConfig, readings: Sequence[Reading]) -> PixelConfig:
    """Pixel with the deepest well and the least dark noise that one of its readings has, over that one's share."""
    return replace(
        pixel,
        full_well_e=max(x.full_well_e / x.share for x in readings),
        read_noise_e=min(x.read_noise_e / x.share for x in readings),
        dsnu_e=min(x.dsnu_e / x.share for x in readings),
    )
