"""Exposure times: auto exposure from the expected signal, and brackets around a given time."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from math import ceil, floor, log2
from types import MappingProxyType

import numpy as np
import scipy
from numpy.typing import NDArray

from rodcone.errors import require_name, require_range
from rodcone.types import Mosaic
from sensor.cfa import mask
from sensor.config import LONGEST_S, METERED_PERCENTILE, METERED_SHARE, SensorConfig
from sensor.optics import SpectralIrradiance
from sensor.photodiodes import with_gain
from sensor.raw import RawImage
from sensor.readings.resolve import at_channel, by_site, chip_readings, resolve
from sensor.readout import spread_charge, unclipped_variance
from sensor.response import behind_filters, channel_electrons, mixing_of

MOST_FULL = 0.5  # share of full pixels above which a warning says that the exposure is probably a mistake
# A pixel counts as lit from this many standard deviations of dark noise on, which 3e-5 of dark pixels reach by chance.
# If the share of lit pixels is below the second number, a warning says that the frame is dark.
DARK_SIGMAS, LEAST_LIT = 4.0, 1e-3
AUTO, AUTO_W, AUTO_INFORMATION = "auto", "auto:W", "auto:information"
# Rules by which a camera chooses its exposure; in a mosaic without G, `sensor.cfa.unit_channel` replaces G.
RULES: Mapping[str, str] = MappingProxyType(
    {
        AUTO: "the 99th percentile of expected G at 80 % of the well",
        AUTO_W: "the 99th percentile of expected W at 80 % of the well, of G where the mosaic has no W",
        AUTO_INFORMATION: "the time of a ladder that leaves the least expected error in the picture",
    }
)
# For `picture_error`: how much a neighbourhood's colour and a pixel's detail are expected to vary, before measurement.
_COLOUR, _DETAIL = 0.2, 0.3  # relative standard deviations
_TILES = 4  # tiles whose samples together determine a neighbourhood's colour
_CLEAR_SIGMAS = 3.0  # a sample this many standard deviations below the full well surely isn't clipped
_GAMMA = 2.4  # exponent of sRGB's encoding
_DARKEST = 0.003  # share of white below which sRGB's encoding is a line
_LADDER_THIRDS = -6, 19  # thirds of a stop below green's time: the first step of the ladder, and one past the last
_METERED_TILES = 512  # tiles that a meter looks at, at most


def auto_exposure_s(
    irradiance: SpectralIrradiance,
    sensor: SensorConfig,
    longest_s: float = LONGEST_S,
    *,
    channel: str | None = None,
    percentile: float = METERED_PERCENTILE,
    well_share: float = METERED_SHARE,
) -> float:
    """Return the exposure [s] in which a percentile of a channel's light, with dark current, fills a share of the well.

    Crosstalk is counted as if each pixel's neighbours showed the same light as the pixel itself; hot pixels are left
    out. The well is `SensorConfig.metered_well_e`.

    Parameters
    ----------
    irradiance : SpectralIrradiance
    sensor : SensorConfig
    longest_s : float
        Longest exposure allowed; returned where nothing fills the well [s].
    channel : str, optional
        A channel of the mosaic; left out, G, or `sensor.cfa.unit_channel` of a mosaic without G.
    percentile : float
        Percentile of the light, 0 to 100, over all pixels as if each had the channel's filter.
    well_share : float
        Share of the well that this percentile fills, above 0 and up to 1.

    Raises
    ------
    InputError
        For a number out of range, or a channel that the mosaic doesn't have.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.full((8, 8, 4), 1e-6), np.arange(430.0, 780.0, 100.0))
    >>> image = rodcone.form_image(light, rodcone.low_noise())
    >>> rodcone.auto_exposure_s(image, rodcone.low_noise())
    0.066
    """
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    require_range("percentile", percentile, 0.0, 100.0, "give per cent of the pixels")
    require_range("well_share", well_share, 1e-6, 1.0, "give a fraction of the well")
    channel = channel or sensor.unit_channel
    require_name("exposure: channel", channel, sensor.channels)
    read_e = channel_electrons(irradiance, sensor, 1.0) @ mixing_of(sensor)[sensor.channels.index(channel)]
    return _share_of_well_s(read_e, sensor, channel, longest_s, percentile, well_share)


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
    """Return the dark current [e-/s] at a channel's sites in the unit of its light: full time, no density."""
    reading = at_channel(chip_readings(sensor, exposure_s=1.0), channel)[0]
    return reading.sensor.pixel.dark_current_e_per_s / reading.share


def at_level_s(unit_s: float, level: float, rule: str, sensor: SensorConfig) -> float:
    """Return the exposure [s] by ``auto`` or ``auto:W`` at a level, if at level 1 it is `unit_s`, without a limit.

    Dark current doesn't grow with the light. If it makes up the share f of what fills the well in `unit_s`, the
    exposure is unit_s / (level + (1 - level) f).
    """
    channel = "W" if rule == AUTO_W and "W" in sensor.channels else sensor.unit_channel
    fill_e = METERED_SHARE * sensor.metered_well_e(channel)
    return unit_s / (level + (1 - level) * _dark_per_second_e(sensor, channel) * unit_s / fill_e)


def exposure_by_rule_s(
    rule: str, irradiance: SpectralIrradiance, sensor: SensorConfig, longest_s: float = LONGEST_S
) -> float:
    """Return the exposure [s] that one of `RULES` gives.

    Raises
    ------
    InputError
        For an unknown rule, or a mosaic without the channel that the rule uses.
    """
    return exposure_of_electrons_s(rule, channel_electrons(irradiance, sensor, 1.0), sensor, longest_s)


def exposure_of_electrons_s(
    rule: str, per_second_e: NDArray[np.float64], sensor: SensorConfig, longest_s: float = LONGEST_S
) -> float:
    """Return the exposure [s] that one of `RULES` gives, from the electrons per second (h, w, channel).

    Raises
    ------
    InputError
        As `exposure_by_rule_s`.
    """
    return exposed_by_rule(rule, per_second_e, sensor, longest_s)[0]


def exposed_by_rule(
    rule: str, per_second_e: NDArray[np.float64], sensor: SensorConfig, longest_s: float = LONGEST_S
) -> tuple[float, SensorConfig]:
    """Return the exposure [s] that one of `RULES` gives, and the camera at its gain.

    The gain rises if the rule would need more than the longest time (`amplified`).

    Parameters
    ----------
    per_second_e : (h, w, channel) float64
        Electrons of each channel in a second.

    Raises
    ------
    InputError
        As `exposure_by_rule_s`.
    """
    require_name("exposure", rule, RULES)
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    names = sensor.channels
    unit = sensor.unit_channel
    # Crosstalk is counted as if each pixel's neighbours had the same light as the pixel itself.
    read_e = per_second_e @ mixing_of(sensor).T if sensor.pixel.crosstalk else per_second_e
    metered = "W" if rule == AUTO_W and "W" in names else unit
    wish_s = _share_of_well_s(read_e[..., names.index(metered)], sensor, metered, np.inf)
    if rule != AUTO_INFORMATION:
        return amplified(sensor, wish_s, longest_s)
    return best_exposure(behind_filters(per_second_e, sensor), sensor, wish_s, longest_s)


def amplified(sensor: SensorConfig, wish_s: float, longest_s: float) -> tuple[float, SensorConfig]:
    """Limit the time of an automatic exposure [s], and raise the camera's gain instead.

    Beyond the longest time the gain rises in thirds of a stop, up to `SensorConfig.gain_limit`: light that would have
    reached the converter's top in the longer time reaches it, or ends less than a third of a stop below it.

    Parameters
    ----------
    wish_s : float
        Time that fills the converter's range at the sensor's own gain; inf without light.
    """
    times = min(wish_s / longest_s, sensor.gain_limit / sensor.gain)
    if times <= 1:
        return min(wish_s, longest_s), sensor
    return longest_s, with_gain(sensor, sensor.gain * 2 ** (floor(3 * log2(times) + 1e-9) / 3))


def best_exposure(
    per_second_e: NDArray[np.float64], sensor: SensorConfig, green_s: float, longest_s: float = LONGEST_S
) -> tuple[float, SensorConfig]:
    """Choose the exposure [s] and gain, from a ladder, with the least expected error in the picture.

    Of exposures with equal errors it is the longest. The ladder rises in thirds of a stop from a 64th of `green_s` to
    four times `green_s`; beyond `longest_s` its steps are gains (`amplified`). Twice the light has half of all times.

    Parameters
    ----------
    per_second_e : (h, w) float64
        Expected electrons behind each pixel's own filter in a second.
    sensor : SensorConfig
    green_s : float
        Time by the rule ``auto``, without a limit.
    longest_s : float
    """
    read_e = sensor.pixel_sums(spread_charge(per_second_e, sensor.photosites.pixel.crosstalk))
    few_e = _few_tiles(read_e, len(sensor.cfa), len(sensor.cfa[0]))
    wishes_s: list[float] = (green_s * 2.0 ** (np.arange(*_LADDER_THIRDS) / -3.0)).tolist()
    rungs = [amplified(sensor, wish_s, longest_s) for wish_s in wishes_s]
    apart = {(time_s, camera.gain): (time_s, camera) for time_s, camera in rungs}.values()

    def error(rung: tuple[float, SensorConfig]) -> float:
        time_s, camera = rung
        spread = replace(camera, pixel=replace(camera.pixel, crosstalk=0.0))  # `read_e` includes crosstalk already
        return picture_error(few_e * time_s, spread, time_s)

    return min(apart, key=error)


def _few_tiles(mosaic: Mosaic, height: int, width: int) -> NDArray[np.float64]:
    """Return a mosaic of at most `_METERED_TILES` tiles, picked evenly from a larger one."""
    rows, columns = mosaic.shape[0] // height, mosaic.shape[1] // width
    if rows * columns <= _METERED_TILES:
        return mosaic
    step = ceil((rows * columns / _METERED_TILES) ** 0.5)
    tiles = mosaic[: rows * height, : columns * width].reshape(rows, height, columns, width)[::step, :, ::step]
    return tiles.reshape(tiles.shape[0] * height, -1)


def picture_error(expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float) -> float:
    """Return the expected squared error of the developed, encoded picture that comes from noise and full wells.

    A picture consists of two parts: a colour for each neighbourhood, which all samples of a channel there determine
    together, and fine detail, which only a pixel's own sample determines. Before they are measured, both are known to a
    relative standard deviation, k and d. A sample whose relative variance is q leaves them with the posterior variances
    of Gaussians,

        k^2 q_4 / (k^2 + q_4)    and    d^2 q / (d^2 + q),        q_4 = q / samples in four tiles.

    A sample counts by the share of its readings that stay three standard deviations below the full well; a full one
    leaves k^2 and d^2 as they were. The picture is encoded by about the 2.4th root, so errors are weighted by the
    light's power 2 / 2.4.

    k, d and the number of tiles were chosen so that the error follows `studies.design.expect` over exposure times for
    RGBW and Bayer (0.2 dB root mean square over seven octaves, the same best time); they are no free settings.

    Parameters
    ----------
    expected_e : (h, w) float64
        Photo-electrons of a mosaic, as `sensor.response.expected_electrons`.
    """
    readings = resolve(sensor, expected_e, exposure_s)
    variance_e2 = unclipped_variance(expected_e, readings)
    full_e = (
        max(x.headroom_e for x in readings)
        if readings[0].sites is None
        else by_site([x.headroom_e for x in readings], readings, expected_e.shape)
    )
    clear = np.maximum(scipy.special.ndtr((full_e - expected_e) / np.sqrt(variance_e2) - _CLEAR_SIGMAS), 1e-12)
    noise_to_light = variance_e2 / (clear * np.maximum(expected_e, 1e-9) ** 2)
    # Light over that of a white surface, which has the mean's colour and the brightness of the frame's bright end.
    shape, names = expected_e.shape, sensor.channels
    sites = {name: mask(sensor.cfa, name, shape) for name in names}
    relative = np.zeros(shape)
    for at in sites.values():
        relative[at] = expected_e[at] / max(expected_e[at].mean(), 1e-12)
    relative = np.clip(relative / max(np.percentile(relative, METERED_PERCENTILE), 1e-12), _DARKEST, 1.2)
    weight = relative ** (2 / _GAMMA)

    def left(prior: float, noise: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(prior**2 * noise / (prior**2 + noise))

    detail = float((weight * left(_DETAIL, noise_to_light)).mean())
    coloured = [name for name in names if name != "W"] or list(names)
    colour = 0.0
    for name in coloured:
        at = sites[name]
        samples = _TILES * sum(row.count(name) for row in sensor.cfa)
        colour += float((weight[at] * left(_COLOUR, noise_to_light[at] / samples)).mean()) / len(coloured)
    return (colour + detail) / _GAMMA**2


def _dark_full(raw: RawImage) -> bool:
    """Return whether dark current leaves less room in the well for light than a tenth of its own electrons."""
    return raw.full_well_e < 0.1 * raw.dark_current_e


def warn_if_full(raw: RawImage) -> None:
    """Warn of a frame with mostly saturated pixels, such as one of 10 s that was meant to be 10 ms."""
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
    """Warn of a frame that shows nothing but its dark noise, unless its exposure is 0 s, which is deliberate."""
    lit = float(np.mean(raw.electrons > DARK_SIGMAS * raw.dark_noise_e))
    least_lit = max(LEAST_LIT, 1.5 / (raw.dn.size + 1))  # of few pixels one may be lit by chance
    if raw.exposure_s > 0 and not _dark_full(raw) and lit < least_lit:
        warnings.warn(
            f"exposure_s: {1 - lit:.1%} of the pixels read no more than dark noise ({raw.dark_noise_e:.2g} e-) at "
            f"{raw.exposure_s:g} s; give a longer time, or more light",
            stacklevel=4,
        )
