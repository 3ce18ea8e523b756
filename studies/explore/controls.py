"""Settings of the explorer's controls as one value: read it from a message, and get lamps and a camera from it."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np

from isp.processors.catalogue import PROCESSORS, Processor
from isp.processors.piecewise import takes
from isp.settings import DEFAULTS, PAPER, Settings
from render.illuminants import illuminant, spectral_luminance
from render.scene import LightGroup
from render.spectrum import Spectrum
from render.transport import Transport, replaceable_luminance
from rodcone.curve_file import is_curve_file
from rodcone.errors import InputError, require_fields, require_keys, require_name, require_range
from rodcone.toml_file import strict_converter, structured
from sensor.cfa import MOSAICS, channels
from sensor.cfa import OWN as OWN_MOSAIC
from sensor.config import LONGEST_S, MOST_GAIN, MOST_ROW_US, SensorConfig
from sensor.exposure import AUTO_INFORMATION, RULES
from sensor.flicker.rows import check_flicker
from sensor.flicker.waveform import Waveform
from sensor.lens.table import shipped, with_lens
from sensor.presets import VARIATIONS, preset_names
from sensor.raw import ISO_RANGE
from studies.metrics.truth import Light, light_in_bands
from studies.study.gain import at_gain, gain_text
from studies.study.scene_source import LIGHT, first_light
from studies.study.study import AS_SHOT, MOST_FRAMES, OWN, WHITE_BALANCES

TIME = "time"  # as an exposure rule, this means the time that `exposure_s` states
LENS = ("f_number", "defocus_um", "diffraction", "veiling_glare")
OF_TABLE = ("f_number", "defocus_um", "diffraction")  # terms that a lens by data decides, so that sliders can't
PIXEL = (
    *("read_noise_e", "dsnu_e", "prnu", "dark_current_e_per_s", "column_gain_spread", "column_offset_e"),
    *("hot_pixel_share", "hot_pixel_dark_current_e_per_s", "crosstalk", "full_well_e"),
)
SETTINGS = ("neighbourhood", "patch", "sigma_d", "sigma_s")
# Processors with adjustable settings, and the defaults of these.
ADJUSTABLE: Mapping[str, Settings] = MappingProxyType({"interleaved": DEFAULTS, "interleaved_paper": PAPER})
MOST_POINTS = 2000  # most points of a spectrum from a file
WIDEST = 41  # most pixels along the side of Omega, the neighbourhood; that many take four times as long as the default


@dataclass(frozen=True)
class Lamp:
    """Emission of a light group.

    Attributes
    ----------
    spectrum : str
        ``own``, or an illuminant's name such as ``A`` or ``3000K``, at the luminance of the group's own spectrum.
    power : float
        Factor on the group's own power. Because the level is fixed, it only changes the group's share of the light.
    table : tuple of (float, float)
        Wavelengths [nm] and values of a spectrum from a file, in place of `spectrum`; at the same luminance.
    """

    spectrum: str = OWN
    power: Annotated[float, (0.0, 1e9, "give a factor of 0 or more")] = 1.0
    table: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Controls:
    """All settings that decide a picture of a rendered scene.

    Attributes
    ----------
    lamps : mapping of str to Lamp
        Lamps by light group; groups that are left out stay as they are.
    level_cd_m2 : float
        Mean luminance of the scene.
    reference_light : str
        Illuminant under which colours are judged if the first light group has colours of its own, as in a file.
    exposure : str
        A rule of `sensor.exposure.RULES`, or ``time``.
    exposure_s : float
        Exposure time if `exposure` is ``time``; else the longest time that the rule may choose.
    sensor : str
        A preset's name, or a ``.toml`` file.
    mosaic : str
        A name of `sensor.cfa.MOSAICS` or `sensor.presets.VARIATIONS`, or ``own`` for the sensor's own mosaic.
    lens, pixel : mapping of str to float
        Fields of `LensConfig` (`LENS`) and `PixelConfig` (`PIXEL`) that differ from the preset's.
    lens_table : str
        A shipped lens by data (`sensor.lens.table.shipped`) in front of the sensor, or ``own`` for the sensor's own.
    bits : int or None
        Bits of the converter; None takes the preset's.
    gain : float or None
        Gain between pixel and converter; None takes the preset's, which an automatic exposure may raise.
    iso : float or None
        Saturation-based speed, from which the gain follows, in place of `gain`.
    shot_noise : bool
        Whether the electrons of light and dark current are Poisson counts. If False they are their means, which no
        camera achieves.
    processor : str
        Name in `isp.processors.catalogue.PROCESSORS`.
    settings : mapping of str to float
        Fields of `isp.settings.Settings` (`SETTINGS`) that differ from the processor's.
    white_balance : str
        One of `studies.study.study.WHITE_BALANCES`.
    seed : int
        Seed of the chip's patterns and of the exposures' noise.
    exposure_number : int
        Number of the exposure among all those that the seed's chip takes; each has noise of its own.
    frames : int
        Exposures of a burst, merged into one (`sensor.burst.merged_raw`).
    flicker_depth, flicker_hz : float
        Amplitude, as a share of the mean, and frequency [Hz] of the cosine with which all lamps flicker; a depth of 0
        is steady light.
    row_time_us : float or None
        Time from one row's exposure to the next one's [us]; None takes the preset's.

    Raises
    ------
    InputError
        For a value that isn't allowed, as far as that can be checked without the scene.
    """

    lamps: Mapping[str, Lamp] = field(default_factory=dict)
    level_cd_m2: Annotated[float, (1e-6, 1e9, "give a mean luminance above 0")] = 25.0
    reference_light: str = LIGHT
    exposure: str = AUTO_INFORMATION
    exposure_s: Annotated[float, (1e-9, 1e4, "give seconds above 0")] = LONGEST_S
    sensor: str = "low_noise"
    mosaic: str = "rgbw"
    lens: Mapping[str, float] = field(default_factory=dict)
    pixel: Mapping[str, float] = field(default_factory=dict)
    lens_table: str = OWN
    bits: int | None = None
    gain: Annotated[float | None, (1.0, MOST_GAIN, "give a factor, 1 where a full well reads the top")] = None
    iso: Annotated[float | None, (*ISO_RANGE, "give a speed such as 400")] = None
    shot_noise: bool = True
    processor: str = "ple"
    settings: Mapping[str, float] = field(default_factory=dict)
    white_balance: str = AS_SHOT
    seed: Annotated[int, (0, 2**31, "give a whole number")] = 0
    exposure_number: Annotated[int, (0, 2**31, "give a whole number")] = 0
    frames: Annotated[int, (1, MOST_FRAMES, "give the exposures of a burst")] = 1
    flicker_depth: Annotated[float, (0.0, 1.0, "give a share of the mean, 0 for steady lamps")] = 0.0
    flicker_hz: Annotated[float, (0.1, 1e6, "give hertz: 100 on mains of 50 Hz, 120 on those of 60")] = 100.0
    row_time_us: Annotated[float | None, (-MOST_ROW_US, MOST_ROW_US, "give microseconds, 0 for all at once")] = None

    def __post_init__(self) -> None:
        require_fields(self)
        require_name("exposure", self.exposure, (*RULES, TIME))
        require_name("processor", self.processor, PROCESSORS)
        require_name("white_balance", self.white_balance, WHITE_BALANCES)
        require_name("mosaic", self.mosaic, (*MOSAICS, *VARIATIONS, OWN_MOSAIC))
        illuminant(self.reference_light)
        for name, lamp in self.lamps.items():
            require_fields(lamp, f"lamps[{name!r}].")
        gain_text(self.gain, self.iso)
        require_keys("lens", self.lens, LENS)
        require_name("lens_table", self.lens_table, (OWN, *shipped()))
        if self.lens_table != OWN and (stated := set(OF_TABLE) & set(self.lens)):
            raise InputError(
                f"lens: {', '.join(sorted(stated))} beside the lens {self.lens_table!r}, whose table has its own; "
                "allowed: veiling_glare; leave the others out"
            )
        require_keys("pixel", self.pixel, PIXEL)
        if self.settings and self.processor not in ADJUSTABLE:
            raise InputError(
                f"settings: {', '.join(self.settings)} with {self.processor!r}, which has none; allowed: those of "
                f"{', '.join(ADJUSTABLE)}; take one of these, or leave settings out"
            )
        require_keys("settings", self.settings, SETTINGS)
        options_of(self)
        if self.mosaic not in mosaics_of(PROCESSORS[self.processor]):
            raise InputError(
                f"mosaic: {self.mosaic!r} is not one that {self.processor} develops; allowed: "
                f"{', '.join(mosaics_of(PROCESSORS[self.processor]))}; take one, or another processor"
            )


def mosaics_of(processor: Processor) -> tuple[str, ...]:
    """List the mosaics that a processor can develop: all that suit it, or only its own one."""
    if processor.mosaic == OWN_MOSAIC:
        any_letters = processor is not PROCESSORS["ple"]
        return (*(name for name, tile in MOSAICS.items() if any_letters or takes(tile)), OWN_MOSAIC)
    if processor.on_backend and processor.mosaic == "rgbw":
        return tuple(name for name, tile in MOSAICS.items() if set(channels(tile)) == set("RGBW"))
    return (processor.mosaic,)


def options_of(controls: Controls) -> dict[str, Any]:
    """Return the processor's options: the settings that differ from its defaults."""
    if not controls.settings:
        return {}
    changed: dict[str, Any] = {
        name: int(x) if name in ("neighbourhood", "patch") else x for name, x in controls.settings.items()
    }
    settings = replace(ADJUSTABLE[controls.processor], **changed)
    require_range("settings.neighbourhood", settings.neighbourhood, 3, WIDEST, "give an odd width in pixels")
    require_range("settings.patch", settings.patch, 1, 9, "give an odd width in pixels")
    return {"settings": settings}


# From and to JSON


def controls_from(content: object, dropped: Iterable[str] = ()) -> Controls:
    """Check and read the controls of a message.

    Parameters
    ----------
    content : decoded JSON
        An object with fields of `Controls`; those that are left out have their defaults.
    dropped : iterable of str
        Sensor files that were dropped on the page. A message may not make the program read other files.

    Raises
    ------
    InputError
        For content that isn't allowed.
    """
    if not isinstance(content, dict):
        raise InputError(f"controls: {content!r} is not allowed; give an object of keys and values")
    lamps = content.get("lamps")
    emitters = lamps.values() if isinstance(lamps, dict) else ()
    spectra = [lamp.get("spectrum") for lamp in emitters if isinstance(lamp, dict)]
    for light in (content.get("reference_light"), *spectra):  # checked here, before anything uses it
        if isinstance(light, str) and is_curve_file(light):
            raise InputError(
                f"light: {light!r} is a file on this machine; allowed: an illuminant's name; load the "
                "file on the page, as a table"
            )
    controls = controls_of(content, "send what the page is told first")
    require_name("sensor", controls.sensor, (*preset_names(), *dropped))
    for name, lamp in controls.lamps.items():
        if len(lamp.table) > MOST_POINTS:
            raise InputError(f"lamps[{name!r}].table: {len(lamp.table)} points; allowed: {MOST_POINTS}; thin it out")
    return controls


def controls_of(content: Mapping[str, Any], fix: str) -> Controls:
    """Build checked controls from plain values, lists and dicts by field name; absent fields have their defaults.

    Raises
    ------
    InputError
        For an unknown name, a value of another type, or one that `Controls` refuses.
    """
    return structured(content, Controls, _CONVERTER, fix)


def to_json(controls: Controls) -> dict[str, Any]:
    """Write controls as `controls_from` reads them."""
    result: dict[str, Any] = json.loads(json.dumps(asdict(controls), allow_nan=False))
    return result


def _number(value: object, _: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not -1e300 <= value <= 1e300:
        raise InputError(f"{value!r} is not a number")
    return float(value)


_CONVERTER = strict_converter()
_CONVERTER.register_structure_hook(float, _number)


def lit_transport(transport: Transport, lamps: dict[str, Lamp], reference_light: str) -> tuple[Transport, Light, float]:
    """Return the transport with the lamps' spectra and powers, the light to which colours are balanced, and a factor.

    The factor scales the lamps' powers so that the scene's mean luminance is 1 cd/m^2.
    """
    groups = {name: lit_group(group, lamps[name]) for name, group in transport.groups.items()}
    lit = replace(transport, groups=groups)
    level = lit.level().value
    if level <= 0:
        raise InputError("lamps: all are off; allowed: one power above 0; raise one")
    white = first_light(groups, illuminant(reference_light))
    light = light_in_bands(white, transport.wavelength_nm, transport.width_nm)
    return lit, light, 1.0 / level


def only_group(lit: Transport, name: str) -> Transport:
    """Return the transport in which one light group alone shines, at power 1."""
    groups = {group_name: replace(group, power=float(group_name == name)) for group_name, group in lit.groups.items()}
    return replace(lit, groups=groups)


def lit_group(group: LightGroup, lamp: Lamp) -> LightGroup:
    """Give a light group a lamp's spectrum, at the luminance of its own one, and the lamp's power.

    Raises
    ------
    InputError
        For another spectrum if the group has colours of its own or is dark, and for a spectrum without light.
    """
    power = group.power * lamp.power
    if lamp.spectrum == OWN and not lamp.table:
        return replace(group, power=power)
    group_luminance = replaceable_luminance(group, f"lamps: {lamp.spectrum!r} for a light group that")
    spectrum = Spectrum(*np.transpose(lamp.table)) if lamp.table else illuminant(lamp.spectrum)
    luminance = spectral_luminance(spectrum)
    if luminance <= 0:
        raise InputError("lamps: the table gives no light that an eye sees; allowed: values above 0 within 380-780 nm")
    return replace(group, spectrum=spectrum * (group_luminance / luminance), power=power)


def lamps_of(controls: Controls) -> tuple[Waveform, ...]:
    """Return the one waveform of all lamps; return an empty tuple if they are steady."""
    return (Waveform(controls.flicker_hz, controls.flicker_depth),) if controls.flicker_depth else ()


def camera_of(controls: Controls, base: SensorConfig) -> SensorConfig:
    """Return the sensor and lens that the controls state; `base` is the sensor with the controls' mosaic.

    Raises
    ------
    InputError
        For a file that describes no camera, or a term out of range.
    """
    if base.chip.binning:
        raise InputError(
            f"sensor: {controls.sensor!r} bins; allowed in the explorer: sensors without binning; take "
            "binning out of its file"
        )
    if base.chip.readings and (fixed := {"full_well_e", "read_noise_e", "dsnu_e"} & set(controls.pixel)):
        raise InputError(
            f"pixel: {', '.join(sorted(fixed))} with {controls.sensor!r}, whose readings have their own; allowed: the "
            "preset's; reset it, or take another sensor"
        )
    if base.chip.readings and not controls.shot_noise:
        raise InputError(
            f"shot_noise: False with {controls.sensor!r}, whose readings are merged by it; allowed: True; switch it on"
        )
    terms: Mapping[str, Any] = controls.lens
    if controls.lens_table != OWN:
        base = with_lens(base, controls.lens_table)
    camera = replace(
        base,
        lens=replace(base.lens, **terms),
        pixel=replace(base.pixel, **controls.pixel),
        bits=base.bits if controls.bits is None else controls.bits,
        row_time_us=base.row_time_us if controls.row_time_us is None else controls.row_time_us,
    )
    if controls.flicker_depth:
        check_flicker(camera)
    return at_gain(camera, gain_text(controls.gain, controls.iso))
