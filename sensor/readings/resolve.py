"""Resolve a camera for one exposure into the plain readings of which its raw image is made.

A plain reading describes a camera that reads every pixel once, and how its samples are scaled. A camera that reads each
pixel once has one plain reading, and so has one that bins. If a pixel is read several times, with other gains, times or
photodiodes, each of these is a plain reading of all pixels. If a channel has an exposure time, a neutral density or a
conversion gain of its own, it is a plain reading of that channel's sites.

The raw image holds all in one unit: the electrons e that a pixel would collect of its whole light in the whole time. A
reading that collects the share s of them counts s e electrons, and the pixel's numbers hold for these. Divided by s,
their shot noise has the variance e / s, and their well and dark noise are 1 / s times as large.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cfa import mask
from sensor.config import METERED_PERCENTILE, METERED_SHARE, SensorConfig
from sensor.noise_law import NoiseLaw, total
from sensor.pixel import ChannelReading, Chip, PixelConfig

Values: TypeAlias = NDArray[np.floating]
_COUNTED = ("shot noise", "dark current", "hot pixels", "PRNU")  # sources of noise in the electrons that a well holds
_STEPS = 16.0  # steps per octave of a metered time, so that frames of one scene take the same time


@dataclass(frozen=True)
class PlainReading:
    """One reading of one exposure.

    Attributes
    ----------
    sensor : SensorConfig
        A camera that reads every pixel once, with numbers in the reading's own electrons.
    exposure_s : float
        The whole exposure time [s]. The sensor's dark current is scaled to the reading's share of it.
    pixel : PixelConfig
        Pixel of the raw image, with numbers in the raw image's electrons.
    light_share : float
        Share of a pixel's light that the photodiode collects, or that the density in front of it lets through.
    time_share : float
        Share of the whole time after which the charge is read.
    photodiode : str
        Name of the photodiode; readings of different photodiodes have their own shot noise and PRNU.
    sites : str or None
        Channels at whose sites the raw image holds this reading; None if it reads every pixel.
    patterns : int or None
        Index among `sensor.device.Device.readings`; None for a chip with one set of patterns.
    poisson : float
        Variance of the counted electrons over their mean: 1, or 0 for `sensor.readout.draw_mean_frame`.
    """

    sensor: SensorConfig
    exposure_s: float
    pixel: PixelConfig
    light_share: float = 1.0
    time_share: float = 1.0
    photodiode: str = ""
    sites: str | None = None
    patterns: int | None = None
    poisson: float = 1.0

    @property
    def share(self) -> float:
        """Return the share of a pixel's electrons in the whole time that this reading counts."""
        return self.light_share * self.time_share

    @property
    def charge(self) -> tuple[str, float, str | None]:
        """Return a key of the charge; readings of one charge share its shot noise."""
        return self.photodiode, self.time_share, self.sites

    @property
    def dark_e(self) -> float:
        """Return the mean electrons of dark current and hot pixels, in the raw image's electrons."""
        pixel = self.sensor.pixel
        hot_e_per_s = pixel.hot_pixel_share * pixel.hot_pixel_dark_current_e_per_s
        return (pixel.dark_current_e_per_s + hot_e_per_s) * self.exposure_s / self.share

    @property
    def full_well_e(self) -> float:
        """Return the electrons, dark current included, that reach the converter's top, in the raw image's electrons."""
        return self.sensor.top_e / self.share

    @property
    def headroom_e(self) -> float:
        """Return the photo-electrons that fit below the converter's top, beside the mean of the dark current.

        They are in the raw image's electrons.
        """
        return (self.sensor.top_e - self.sensor.pixel.dark_current_e_per_s * self.exposure_s) / self.share

    @cached_property
    def sources(self) -> dict[str, NoiseLaw]:
        """Return the law of each source of a sample's noise over chips and exposures, in the raw image's electrons."""
        sources = pixel_sources(self.sensor, self.exposure_s, self.poisson)
        return {name: law.over(self.share) for name, law in sources.items()}

    @cached_property
    def law(self) -> NoiseLaw:
        """Return the law of a sample's noise over chips and exposures, in the raw image's electrons; unclipped."""
        return total(self.sources.values())

    @cached_property
    def counted_law(self) -> NoiseLaw:
        """Return the part of `law` that lies in the collected electrons, which the well clips."""
        return total(self.sources[name] for name in _COUNTED)


def pixel_sources(sensor: SensorConfig, exposure_s: float, poisson: float = 1.0) -> dict[str, NoiseLaw]:
    """Return the law of each noise source of a pixel that is read once, for a chip drawn at random, without clipping.

    The sources are shot noise of signal and dark current, PRNU on the signal, hot pixels, column gains on all that was
    collected, DSNU and column offsets, read noise, noise after the amplifier, and quantisation (a DN^2 / 12).
    """
    pixel = sensor.pixel
    dark_e = pixel.dark_current_e_per_s * exposure_s
    hot_e = pixel.hot_pixel_dark_current_e_per_s * exposure_s
    hot_share = pixel.hot_pixel_share
    collected = {
        "shot noise": NoiseLaw(shot=poisson),
        "dark current": NoiseLaw(dark_e=sqrt(poisson * dark_e)),
        "hot pixels": NoiseLaw(
            dark_e=sqrt(poisson * hot_share * hot_e), fixed_e=sqrt(hot_share * (1 - hot_share)) * hot_e
        ),
        "PRNU": NoiseLaw(prnu=pixel.prnu),
    }
    # Gain and collected electrons (mean e + m) are independent: variance E[gain^2] E[collected^2] - E[collected]^2.
    of_all = total(collected.values())
    mean_dark_e = dark_e + hot_share * hot_e
    spread = pixel.column_gain_spread
    column_gains = NoiseLaw(
        shot=spread**2 * (of_all.shot + 2 * mean_dark_e),
        dark_e=spread * of_all.dark_e,
        fixed_e=spread * np.hypot(of_all.fixed_e, mean_dark_e),
        prnu=spread * np.hypot(of_all.prnu, 1.0),
    )
    return collected | {
        "column gains": column_gains,
        "DSNU": NoiseLaw(fixed_e=pixel.dsnu_e),
        "column offsets": NoiseLaw(fixed_e=pixel.column_offset_e),
        "read noise": NoiseLaw(dark_e=pixel.read_noise_e),
        "converter noise": NoiseLaw(dark_e=sensor.converter_noise_e),
        "quantisation": NoiseLaw(dark_e=sensor.gain_e_per_dn / sqrt(12)),
    }


def chip_readings(sensor: SensorConfig, exposure_s: float) -> tuple[PlainReading, ...]:
    """List every reading that the chip can take: each gain, and metered channels at their longest time."""
    chip, pixel = sensor.chip, sensor.pixel
    if chip.readings:
        return tuple(
            PlainReading(
                sensor=replace(
                    sensor,
                    pixel=replace(
                        pixel,
                        read_noise_e=reading.read_noise_e,
                        dsnu_e=reading.dsnu_e,
                        full_well_e=reading.full_well_e,
                        dark_current_e_per_s=pixel.dark_current_e_per_s * reading.share,
                        hot_pixel_dark_current_e_per_s=pixel.hot_pixel_dark_current_e_per_s * reading.share,
                    ),
                    chip=Chip(),
                ),
                exposure_s=exposure_s,
                pixel=pixel,
                light_share=reading.light_share,
                time_share=reading.time_share,
                photodiode=reading.photodiode,
                patterns=number,
            )
            for number, reading in enumerate(chip.readings)
        )
    if not chip.channels:
        return (PlainReading(sensor, exposure_s, pixel),)
    apart = [reading.channel for reading in chip.channels]
    alike = "".join(name for name in sensor.channels if name not in apart)
    plain = PlainReading(replace(sensor, chip=replace(chip, channels=())), exposure_s, pixel, sites=alike)
    own = (
        PlainReading(
            sensor=replace(sensor, pixel=reading.pixel_of(pixel), chip=Chip()),
            exposure_s=exposure_s,
            pixel=pixel,
            light_share=reading.light_share,
            time_share=reading.time_share,
            sites=reading.channel,
        )
        for reading in chip.channels
    )
    return (plain, *own)


def resolve(
    sensor: SensorConfig, expected_e: Values, exposure_s: float, channel: str | None = None
) -> tuple[PlainReading, ...]:
    """Return the readings that a camera takes of a frame, at the gain that it chooses and the times that it meters.

    Parameters
    ----------
    sensor : SensorConfig
    expected_e : array
        Expected photo-electrons of the raw image's pixels in the whole time, of a mosaic, (h, w); with `channel`, of
        that channel, any shape.
    exposure_s : float
        The whole time [s].
    channel : str, optional
        Channel to which all of `expected_e` belong. Only its readings are returned, as if they read every pixel.
    """
    chip = sensor.chip
    if chip.channels and channel is None and expected_e.ndim < 2:
        raise _no_channel(sensor, apart=[x.channel for x in chip.channels])
    if chip.switched:
        every = chip_readings(sensor, exposure_s)
        return (every[_switched(every, expected_e)],)
    if any(reading.metered for reading in chip.channels):
        timed = tuple(_timed(x, sensor, expected_e, exposure_s, channel) for x in chip.channels)
        sensor = replace(sensor, chip=replace(chip, channels=timed))
    readings = chip_readings(sensor, exposure_s)
    return readings if channel is None else at_channel(readings, channel)


def _switched(readings: Sequence[PlainReading], expected_e: Values) -> int:
    """Choose the gain of a camera that switches it: the number of the quietest reading that holds the bright end."""
    dark_e = readings[0].pixel.dark_current_e_per_s * readings[0].exposure_s
    bright_e = float(np.percentile(expected_e, METERED_PERCENTILE)) + dark_e
    wells_e = [x.sensor.pixel.full_well_e for x in readings]
    quiet_first = sorted(range(len(readings)), key=lambda i: readings[i].sensor.pixel.read_noise_e)
    holding = [i for i in quiet_first if bright_e <= METERED_SHARE * wells_e[i]]
    return holding[0] if holding else max(quiet_first, key=lambda i: wells_e[i])


def _timed(
    reading: ChannelReading, sensor: SensorConfig, expected_e: Values, exposure_s: float, channel: str | None
) -> ChannelReading:
    """Return the reading with the time that puts its channel's bright end where the exposure rule puts it."""
    if not reading.metered or channel not in (None, reading.channel):
        return reading
    seen_e = expected_e[mask(sensor.cfa, reading.channel, expected_e.shape)] if channel is None else expected_e
    bright_e = float(np.percentile(seen_e, METERED_PERCENTILE)) * reading.light_share
    filling_e = max(bright_e + sensor.pixel.dark_current_e_per_s * exposure_s, 1e-9)
    share = METERED_SHARE * reading.pixel_of(sensor.pixel).full_well_e / sensor.gain / filling_e
    steps = np.floor(_STEPS * np.log2(min(share, 1.0)) + 1e-6) / _STEPS
    return replace(reading, time_share=max(min(reading.time_share, float(2**steps)), 1e-6), metered=False)


def at_channel(readings: Sequence[PlainReading], channel: str | None) -> tuple[PlainReading, ...]:
    """Return the readings that cover a channel's sites, as if each covered every pixel.

    Raises
    ------
    InputError
        Without a channel for a camera that reads channels apart.
    """
    if readings[0].sites is None:
        return tuple(readings)
    if channel is None:
        raise _no_channel(readings[0].sensor, apart=[str(x.sites) for x in readings[1:]])
    return tuple(replace(x, sites=None) for x in readings if channel in str(x.sites))


def _no_channel(sensor: SensorConfig, apart: Sequence[str]) -> InputError:
    return InputError(
        f"channel: none given for a camera that reads {', '.join(apart)} apart; allowed: "
        f"{', '.join(sensor.channels)}; give one"
    )


def several(readings: Sequence[PlainReading]) -> bool:
    """Return whether every pixel is read several times, so that the readings are merged."""
    return len(readings) > 1 and readings[0].sites is None


def by_site(
    values: Sequence[float], readings: Sequence[PlainReading], shape: tuple[int, ...]
) -> float | NDArray[np.float64]:
    """Place each reading's value at the sites that it covers, (h, w); return a number if one covers every pixel."""
    if readings[0].sites is None:
        return values[0]
    result = np.empty(shape)
    for value, reading in zip(values, readings, strict=True):
        result[mask(reading.sensor.cfa, str(reading.sites), (shape[0], shape[1]))] = value
    return result


def law_by_site(readings: Sequence[PlainReading], shape: tuple[int, ...]) -> NoiseLaw:
    """Return the law of the samples of a frame whose pixels are read once; its terms are numbers or arrays (h, w)."""
    laws = [x.law for x in readings]
    names = [field.name for field in fields(NoiseLaw)]
    return NoiseLaw(**{name: by_site([getattr(law, name) for law in laws], readings, shape) for name in names})


def behind_densities(expected_e: Values, readings: Sequence[PlainReading]) -> Values:
    """Attenuate the electrons of the whole time by each site's density, before crosstalk moves them between pixels."""
    return np.asarray(expected_e * by_site([x.light_share for x in readings], readings, expected_e.shape))


def light_of(expected_e: Values, readings: Sequence[PlainReading]) -> tuple[Values, ...]:
    """Return the expected photo-electrons of every pixel for each reading, in that reading's own electrons."""
    if readings[0].sites is None:
        return tuple(expected_e if x.share == 1 else expected_e * x.share for x in readings)
    lit_e = behind_densities(expected_e, readings)
    return tuple(lit_e * x.time_share for x in readings)


def unsaturated(expected_e: Values, readings: Sequence[PlainReading]) -> NDArray[np.bool_]:
    """Return the pixels of a frame that light and dark current together don't fill, (h, w)."""
    if readings[0].sites is None:
        return np.asarray(expected_e < max(x.headroom_e for x in readings))
    return np.asarray(expected_e < by_site([x.headroom_e for x in readings], readings, expected_e.shape))
