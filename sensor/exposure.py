"""Exposure times: auto exposure from the expected signal, and brackets around a given time."""

import warnings
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import require_name, require_range
from sensor.config import LONGEST_S, METERED_PERCENTILE, METERED_SHARE, SensorConfig
from sensor.optics import SpectralIrradiance
from sensor.raw import RawImage
from sensor.readings.resolve import at_channel, chip_readings, resolve, unsaturated
from sensor.readout import frame_variance
from sensor.response import behind_filters, channel_electrons

MOST_FULL = 0.5  # share of the pixels above which an exposure is hardly meant
DARK_SIGMAS, LEAST_LIT = 4.0, 1e-3  # noise alone takes 3e-5 of the dark pixels so far above their mean
AUTO, AUTO_W, AUTO_INFORMATION = "auto", "auto:W", "auto:information"
# What a camera exposes for, by the rule's name; in a mosaic without G `sensor.cfa.unit_channel` is in its place.
RULES: Mapping[str, str] = MappingProxyType(
    {
        AUTO: "the 99th percentile of expected G at 80 % of the well",
        AUTO_W: "the 99th percentile of expected W at 80 % of the well, of G where the mosaic has no W",
        AUTO_INFORMATION: "whichever of these two times gives the samples more information",
    }
)


def auto_exposure_s(
    irradiance: SpectralIrradiance,
    sensor: SensorConfig,
    longest_s: float = LONGEST_S,
    *,
    channel: str | None = None,
    percentile: float = METERED_PERCENTILE,
    well_share: float = METERED_SHARE,
) -> float:
    """Exposure in which a percentile of one channel's light and the dark current fill a share of the well [s].

    Crosstalk and hot pixels are left out. The well is `SensorConfig.metered_well_e`.

    Parameters
    ----------
    irradiance : SpectralIrradiance
    sensor : SensorConfig
    longest_s : float
        Longest exposure allowed; returned where nothing fills the well [s].
    channel : str, optional
        A channel of the mosaic; left out, G, or `sensor.cfa.unit_channel` of a mosaic without G.
    percentile : float
        0 to 100, over all pixels as if each had the channel's filter.
    well_share : float
        Above 0, up to 1.

    Raises
    ------
    InputError
        For a number out of range, or a channel that the mosaic doesn't have.
    """
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    require_range("percentile", percentile, 0.0, 100.0, "give per cent of the pixels")
    require_range("well_share", well_share, 1e-6, 1.0, "give a fraction of the well")
    channel = channel or sensor.unit_channel
    require_name("exposure: channel", channel, sensor.channels)
    per_second_e = channel_electrons(irradiance, sensor, 1.0)[..., sensor.channels.index(channel)]
    return _share_of_well_s(per_second_e, sensor, channel, longest_s, percentile, well_share)


def _share_of_well_s(
    per_second_e: NDArray[np.float64],
    sensor: SensorConfig,
    channel: str,
    longest_s: float,
    percentile: float = METERED_PERCENTILE,
    well_share: float = METERED_SHARE,
) -> float:
    filling = float(np.percentile(sensor.pixel_sums(per_second_e), percentile)) + _dark_per_second_e(sensor, channel)
    return min(longest_s, well_share * sensor.metered_well_e(channel) / filling) if filling > 0 else longest_s


def _dark_per_second_e(sensor: SensorConfig, channel: str) -> float:
    """Dark current that a channel's sites would have in the whole time without a density, as their light is given."""
    reading = at_channel(chip_readings(sensor, exposure_s=1.0), channel)[0]
    return reading.sensor.pixel.dark_current_e_per_s / reading.share


def at_level_s(unit_s: float, level: float, rule: str, sensor: SensorConfig) -> float:
    """Exposure by ``auto`` or ``auto:W`` of `level` times the light whose exposure without a longest one is `unit_s`.

    Dark current, a share f of what fills the well there, doesn't grow with the light: unit_s / (level + (1 - level) f).
    """
    channel = "W" if rule == AUTO_W and "W" in sensor.channels else sensor.unit_channel
    fill_e = METERED_SHARE * sensor.metered_well_e(channel)
    return unit_s / (level + (1 - level) * _dark_per_second_e(sensor, channel) * unit_s / fill_e)


def exposure_by_rule_s(
    rule: str, irradiance: SpectralIrradiance, sensor: SensorConfig, longest_s: float = LONGEST_S
) -> float:
    """Exposure by one of `RULES` [s].

    Raises
    ------
    InputError
        For an unknown rule, or a mosaic without the channel that it looks at.
    """
    return exposure_of_electrons_s(rule, channel_electrons(irradiance, sensor, 1.0), sensor, longest_s)


def exposure_of_electrons_s(
    rule: str, per_second_e: NDArray[np.float64], sensor: SensorConfig, longest_s: float = LONGEST_S
) -> float:
    """Exposure by one of `RULES` [s], from the electrons of each channel in a second, shape (h, w, channel).

    Raises
    ------
    InputError
        As `exposure_by_rule_s`.
    """
    require_name("exposure", rule, RULES)
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    names = sensor.channels
    unit = sensor.unit_channel
    for_green_s = _share_of_well_s(per_second_e[..., names.index(unit)], sensor, unit, longest_s)
    if rule == AUTO or "W" not in names:
        return for_green_s
    for_white_s = _share_of_well_s(per_second_e[..., names.index("W")], sensor, "W", longest_s)
    if rule == AUTO_W:
        return for_white_s
    return most_informative_s(behind_filters(per_second_e, sensor), sensor, (for_green_s, for_white_s))


def most_informative_s(per_second_e: NDArray[np.float64], sensor: SensorConfig, times_s: Sequence[float]) -> float:
    """Time of several whose samples hold the most information on the light; of equally good ones the first.

    Parameters
    ----------
    per_second_e : (h, w) float64
        Expected electrons behind each pixel's own filter in a second.
    sensor : SensorConfig
    times_s : sequence of float
        Each above 0.
    """
    times_s = list(dict.fromkeys(times_s))
    if len(times_s) == 1:
        return times_s[0]
    per_second_e = sensor.pixel_sums(per_second_e)
    return max(times_s, key=lambda time_s: information_bits(per_second_e * time_s, sensor, time_s))


def information_bits(expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float) -> float:
    """Information of an exposure's samples, mean over the pixels [bit].

    Each is log2(1 + SNR^2) / 2, what a channel with Gaussian noise carries (Shannon 1949); a full one tells nothing. So
    a longer time is worth up to one bit a pixel and doubling under dark noise, half of one under shot noise, none
    beyond the pixels' own unlikeness, and costs all bits of the pixels that it fills.

    Parameters
    ----------
    expected_e : (h, w) float64
        Photo-electrons, as `sensor.response.expected_electrons`.
    """
    readings = resolve(sensor, expected_e, exposure_s)
    variance = frame_variance(expected_e, readings)
    bits = 0.5 * np.log2(1.0 + expected_e**2 / variance)
    return float(np.where(unsaturated(expected_e, readings), bits, 0.0).mean())


def _dark_full(raw: RawImage) -> bool:
    """Whether dark current leaves light less than a tenth of what it takes itself."""
    return raw.full_well_e < 0.1 * raw.dark_current_e


def warn_if_full(raw: RawImage) -> None:
    """Warn of a frame most of whose pixels are saturated, as one of 10 s is that was meant as 10 ms."""
    if _dark_full(raw):
        warnings.warn(
            f"exposure_s: dark current fills the well in {raw.exposure_s:g} s; give less, or a smaller "
            "dark_current_e_per_s",
            stacklevel=4,
        )
    elif (full := float(raw.saturated.mean())) > MOST_FULL:
        warnings.warn(
            f"exposure_s: {full:.0%} of the pixels are saturated at {raw.exposure_s:g} s; give less (a number "
            "is seconds: 10 ms is 0.01 or '10ms'), or leave it out",
            stacklevel=4,
        )


def warn_if_dark(raw: RawImage) -> None:
    """Warn of a frame that shows nothing but its dark noise; one of no time at all is meant so."""
    lit = float(np.mean(raw.electrons > DARK_SIGMAS * raw.dark_noise_e))
    least_lit = max(LEAST_LIT, 1.5 / (raw.dn.size + 1))  # of few pixels one may be lit by chance
    if raw.exposure_s > 0 and not _dark_full(raw) and lit < least_lit:
        warnings.warn(
            f"exposure_s: {1 - lit:.1%} of the pixels read no more than dark noise ({raw.dark_noise_e:.2g} e-) at "
            f"{raw.exposure_s:g} s; give a longer time, or more light",
            stacklevel=4,
        )
