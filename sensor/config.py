"""What a camera is: pixel, lens, mosaic, responses, converter. Zero switches a term off; there are no mode flags."""

from dataclasses import dataclass, field
from math import inf

from render.errors import InputError, require_range, require_whole
from render.spectrum import VISIBLE_NM
from sensor.cfa import RGBW, Tile, channels, check_tile
from sensor.curves import Responses, rgbw

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
    conversion_gain_uv_per_e, voltage_swing_v, analog_gain : float
        Reported and used to convert noise given in volts; the well alone decides where pixels clip.
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
        }
        for name, (low, high, fix) in limits.items():
            require_range(name, getattr(self, name), low, high, fix)

    @property
    def swing_e(self) -> float:
        """Electrons that fill the voltage swing: reported, not applied (Table 1's disagrees with its own well)."""
        return self.voltage_swing_v * 1e6 / self.conversion_gain_uv_per_e


@dataclass(frozen=True)
class LensConfig:
    """A lens: f-number, transmittance, and |magnification| (0 for a far scene)."""

    f_number: float
    transmittance: float = 1.0
    magnification: float = 0.0

    def __post_init__(self) -> None:
        require_range("f_number", self.f_number, 0.1, 1e4, "give focal length over aperture")
        require_range("transmittance", self.transmittance, 0.0, 1.0, "give a fraction")
        require_range("magnification", self.magnification, 0.0, 1e4, "give its absolute value, 0 for a far scene")


def _increasing(window_nm: tuple[float, float]) -> bool:
    return 0 < window_nm[0] < window_nm[1] < inf


@dataclass(frozen=True)
class SensorConfig:
    """A camera: pixel, lens, mosaic, responses and converter.

    Attributes
    ----------
    pixel : PixelConfig
    lens : LensConfig
    cfa : tuple of str
        Tile of letters, such as ``("RG", "BW")``.
    responses : Responses
        Electrons per photon of each letter.
    bits : int
        Of the converter, 1 to 16.
    black_level_dn : float or None
        Reading of no light; None gives five standard deviations of the dark.
    window_nm : (float, float)
        Wavelengths that the camera lets in: an ideal filter in front of the responses.
    """

    pixel: PixelConfig
    lens: LensConfig
    cfa: Tile = RGBW
    responses: Responses = field(default_factory=rgbw)
    bits: int = 14
    black_level_dn: float | None = None
    window_nm: tuple[float, float] = VISIBLE_NM

    def __post_init__(self) -> None:
        object.__setattr__(self, "cfa", check_tile(self.cfa))
        require_whole("bits", self.bits, 1, 16, "give the converter's resolution")
        if self.black_level_dn is not None:
            require_range(
                "black_level_dn", self.black_level_dn, 0.0, self.white_dn - 0.5, "give DN under the white level"
            )
        if not (isinstance(self.window_nm, tuple | list) and len(self.window_nm) == 2 and _increasing(self.window_nm)):
            raise InputError(f"window_nm: {self.window_nm!r} is not allowed; give (shortest, longest) in nm")
        self.responses.band_average(channels(self.cfa), [550.0], [1.0])  # every letter has a curve

    @property
    def white_dn(self) -> int:
        """Reading of a full well: the converter's top."""
        return int(2**self.bits - 1)

    @property
    def black_e(self) -> float:
        """Black level in electrons."""
        if self.black_level_dn is not None:
            return self.black_level_dn * self.gain_e_per_dn
        return float(BLACK_SIGMAS * (self.pixel.read_noise_e**2 + self.pixel.dsnu_e**2) ** 0.5)

    @property
    def gain_e_per_dn(self) -> float:
        """Electrons per DN: black level and full well span the converter."""
        if self.black_level_dn is not None:
            return self.pixel.full_well_e / (self.white_dn - self.black_level_dn)
        return (self.pixel.full_well_e + self.black_e) / self.white_dn

    @property
    def black_dn(self) -> float:
        """Black level in DN (a fraction is allowed, as in DNG)."""
        return self.black_e / self.gain_e_per_dn
