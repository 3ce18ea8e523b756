"""From expected photo-electrons to digital numbers: every noise source in physical order, and their variance."""

from collections.abc import Callable
from math import hypot, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cfa import block_sums, mask
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.random import NoiseTerm, draw_key, normals, poisson
from sensor.raw import RawImage
from sensor.readings.merge import as_metered, dimmed, merge_readings, of_channel, read_by_channel
from sensor.readings.noise import merged_variance, merged_variances, of_reading, switched_to

# Digital numbers of one exposure from expected electrons, camera, chip, exposure time [s], key, and the reading's
# number among those of one charge.
DrawFrame: TypeAlias = Callable[[NDArray[np.floating], SensorConfig, Device, float, int, int], NDArray[np.uint16]]

# Far above any well, and inside 64-bit integers. One bound for all: what a pixel takes from its row's stream depends on
# its mean, so readings of one charge, whose wells differ, draw the same electrons only from the same means.
_MOST_E = 1e15


def draw_frame(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    key: int,
    reading: int = 0,
    counts: Callable[[int, NoiseTerm, NDArray[np.float64]], NDArray[Any]] = poisson,
) -> NDArray[np.uint16]:
    """Digital numbers of one exposure, shape (h, w), with NumPy's exact Poisson sampler; binned, (h / 2, w / 2).

    In physical order: crosstalk and PRNU move the photo-electrons' means, dark current and hot pixels add to them, then
    one Poisson draw; the well clips; pixels that bin in charge are summed; the rest is `convert`. Of one key, each
    `reading` draws read noise of its own, and the same shot noise.
    """
    pixel, expected = sensor.photosites.pixel, np.asarray(expected_e, dtype=np.float64)

    # PRNU scales the mean: after the draw the variance would be wrong. It is the spread of the whole pixel's response,
    # as a flat field shows it, so crosstalk, which leaves a flat field alone, comes first and doesn't smooth it.
    mean_e = spread_charge(expected, pixel.crosstalk) * device.photo_response
    mean_e += pixel.dark_current_e_per_s * exposure_s  # PRNU is photo-response only
    if device.hot is not None:
        mean_e[device.hot] += pixel.hot_pixel_dark_current_e_per_s * exposure_s
    collected_e = counts(key, NoiseTerm.SHOT, np.minimum(mean_e, _MOST_E)).astype(np.float64)
    np.minimum(collected_e, pixel.full_well_e, out=collected_e)
    return convert(collected_e, sensor, device, key, reading)


def convert(
    collected_e: NDArray[np.float64], sensor: SensorConfig, device: Device, key: int, reading: int = 0
) -> NDArray[np.uint16]:
    """Digital numbers of what the wells hold, shape (h, w); binned, (h / 2, w / 2).

    Pixels that bin in charge are summed, and their floating diffusion clips; the column's amplifier multiplies; fixed
    offsets and read noise are added; the converter rounds and clips; readings that bin in digital numbers are summed.
    """
    converter = sensor
    if sensor.chip.in_charge:
        collected_e = np.minimum(block_sums(collected_e), sensor.pixel.full_well_e)
    else:
        converter = sensor.photosites
    read_e = collected_e if device.column_gain is None else collected_e * device.column_gain
    read_e = read_e + device.dark_offset_e
    if converter.pixel.read_noise_e:
        read_e += converter.pixel.read_noise_e * normals(key, NoiseTerm.READ, read_e.shape, reading)
    dn = np.rint(read_e / converter.gain_e_per_dn + converter.black_dn)
    dn = np.clip(dn, 0, converter.white_dn).astype(np.uint16)
    return dn if sensor.chip.in_charge else sensor.pixel_sums(dn)


def draw_mean_frame(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    key: int,
    reading: int = 0,
) -> NDArray[np.uint16]:
    """`draw_frame` without shot noise: a pixel collects the mean of its Poisson draw, fractions of electrons too.

    No camera does; it shows what the other terms do alone. Both draw the same read noise for a key.
    """
    return draw_frame(expected_e, sensor, device, exposure_s, key, reading, counts=lambda key, term, mean_e: mean_e)


def read_out(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    rng: np.random.Generator,
    *,
    draw: DrawFrame = draw_frame,
    engine: str = "numpy",
) -> RawImage:
    """Expose and read the chip once; of a pixel with several readings all are drawn and merged, or one is chosen.

    Parameters
    ----------
    expected_e : (h, w) array
        Expected photo-electrons of each pixel, without dark current; before binning.
    sensor : SensorConfig
    device : Device
        The chip; its patterns are not drawn again.
    exposure_s : float
        For the dark current, and noted in the raw image [s].
    rng : numpy.random.Generator
        Gives one key; draws depend on key, row, column and term alone (shot noise: one stream a row).
    draw : callable
        What draws the frame: `draw_frame`, or `sensor.kernel.kernel.read_frame` in Dr.Jit.
    engine : str
        What it runs on, noted in the raw image.

    Raises
    ------
    InputError
        For a frame that isn't the device's size.
    """
    expected = np.asarray(expected_e)
    if expected.shape != device.shape:
        raise InputError(
            f"expected_e: shape {expected.shape} is not the device's {device.shape}; "
            "draw the device with the frame's shape"
        )

    def once(light_e: NDArray[np.floating], camera: SensorConfig, patterns: Device = device) -> RawImage:
        dn = draw(light_e, camera, patterns, exposure_s, draw_key(rng), 0)
        return as_raw(dn, camera, exposure_s, engine, patterns.hot)

    if sensor.chip.channels:
        return read_by_channel(expected, as_read(sensor, expected, exposure_s), once)
    if not sensor.chip.readings:
        return once(expected, sensor)
    if sensor.chip.switched:
        index = switched_to(sensor, expected, exposure_s)
        return once(expected, of_reading(sensor, index), device.readings[index])
    readings = sensor.chip.readings
    keys = {charge: draw_key(rng) for charge in dict.fromkeys(x.charge for x in readings)}
    raws = []
    for number, (reading, patterns) in enumerate(zip(readings, device.readings, strict=True)):
        alone = of_reading(sensor, number)
        dn = draw(expected * reading.share, alone, patterns, exposure_s, keys[reading.charge], number)
        raws.append(as_raw(dn, alone, exposure_s, engine, patterns.hot))
    return merge_readings(raws, sensor, exposure_s)


def spread_charge(expected_e: NDArray[np.float64], crosstalk: float) -> NDArray[np.float64]:
    """Expected photo-electrons after each pixel gave `crosstalk` of its own to each of its four neighbours.

    It belongs before the Poisson draw: electrons that go separate ways are thinned, and thinned Poisson counts are
    Poisson and independent again. At the frame's edge the charge stays, so the total is kept. Charge beyond a full
    well is lost, not handed on: blooming isn't modelled.

    Parameters
    ----------
    expected_e : (h, w) float64
    crosstalk : float
        0 to 0.25; 0 returns the frame as it is.

    Returns
    -------
    (h, w) float64
    """
    if crosstalk == 0:
        return expected_e
    around = np.pad(expected_e, 1, mode="edge")
    neighbours = around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]
    return np.asarray((1 - 4 * crosstalk) * expected_e + crosstalk * neighbours)


def noise_variance(
    expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float, channel: str | None = None
) -> NDArray[np.float64]:
    """Variance of one pixel of one chip drawn at random [e-^2], shape of `expected_e`; clipping left out.

    Shot noise of signal and dark current, PRNU on the signal, hot pixels, column gains on all that was collected, DSNU
    and column offsets, read noise and quantisation (gain^2 / 12). Of several readings, that of the merge over the share
    of the pixel that all hold together; a camera that switches its gain looks at `expected_e` as one frame.

    Parameters
    ----------
    expected_e : (h, w) float64
        Expected photo-electrons of the raw image's pixels, before crosstalk; of photodiodes that bin,
        `SensorConfig.pixel_sums`.
    sensor : SensorConfig
    exposure_s : float
        For the dark current [s].
    channel : str, optional
        Channel of all of them; left out, they are a mosaic's, (h, w). Cameras that read all channels alike don't ask.
    """
    sensor = as_read(sensor, np.asarray(expected_e), exposure_s, channel)
    if sensor.chip.channels:
        return _variance_by_channel(np.asarray(expected_e), sensor, exposure_s, channel)
    pixel = sensor.pixel
    signal = spread_charge(np.asarray(expected_e, dtype=np.float64), pixel.crosstalk)
    if sensor.chip.readings:
        return merged_variance(signal, sensor, exposure_s)
    hot_e, hot_share = pixel.hot_pixel_dark_current_e_per_s * exposure_s, pixel.hot_pixel_share
    collected = signal + pixel.dark_current_e_per_s * exposure_s + hot_share * hot_e
    variance = collected + (pixel.prnu * signal) ** 2 + hot_share * (1 - hot_share) * hot_e**2
    # a product of independent factors: E[gain^2] E[collected^2] - E[collected]^2
    variance = variance + pixel.column_gain_spread**2 * (variance + collected**2)
    dark = pixel.read_noise_e**2 + pixel.fixed_dark_e**2 + sensor.gain_e_per_dn**2 / 12
    return np.asarray(variance + dark)


def _variance_by_channel(
    expected_e: NDArray[np.float64], sensor: SensorConfig, exposure_s: float, channel: str | None
) -> NDArray[np.float64]:
    if channel is not None:
        alone, share = of_channel(sensor, channel)
        return noise_variance(expected_e * share, alone, exposure_s) / share**2
    light = dimmed(expected_e, sensor)
    variance = noise_variance(light, of_channel(sensor, "")[0], exposure_s)
    for reading in sensor.chip.channels:
        at, alone = mask(sensor.cfa, reading.channel, light.shape), of_channel(sensor, reading.channel)[0]
        variance[at] = noise_variance(light * reading.time_share, alone, exposure_s)[at] / reading.share**2
    return variance


def noise_sources(
    expected_e: float, sensor: SensorConfig, exposure_s: float, channel: str | None = None
) -> dict[str, float]:
    """Standard deviation of each source of a pixel's noise in an even field [e-], by name.

    Their squares sum to `noise_variance`, which says what each of them is.
    """
    sensor = as_read(sensor, np.array([expected_e]), exposure_s, channel)
    if sensor.chip.channels:
        alone, share = of_channel(sensor, channel)
        return {name: noise / share for name, noise in noise_sources(expected_e * share, alone, exposure_s).items()}
    if sensor.chip.readings:
        merged_e2 = merged_variances(np.array([expected_e]), sensor, exposure_s)
        return {name: float(value[0]) ** 0.5 for name, value in merged_e2.items()}
    pixel = sensor.pixel
    hot_e, hot_share = pixel.hot_pixel_dark_current_e_per_s * exposure_s, pixel.hot_pixel_share
    dark_e = pixel.dark_current_e_per_s * exposure_s
    variance_e2 = {
        "shot noise": expected_e,
        "dark current": dark_e,
        "hot pixels": hot_share * hot_e + hot_share * (1 - hot_share) * hot_e**2,
        "PRNU": (pixel.prnu * expected_e) ** 2,
    }
    collected_e2 = sum(variance_e2.values()) + (expected_e + dark_e + hot_share * hot_e) ** 2
    variance_e2 |= {
        "column gains": pixel.column_gain_spread**2 * collected_e2,
        "DSNU": pixel.dsnu_e**2,
        "column offsets": pixel.column_offset_e**2,
        "read noise": pixel.read_noise_e**2,
        "quantisation": sensor.gain_e_per_dn**2 / 12,
    }
    return {name: value**0.5 for name, value in variance_e2.items()}


def as_read(
    sensor: SensorConfig, expected_e: NDArray[Any], exposure_s: float, channel: str | None = None
) -> SensorConfig:
    """Camera with the gain and the channels' times that it takes for a frame; `channel` as of `noise_variance`."""
    if sensor.chip.channels:
        return as_metered(sensor, expected_e, exposure_s, channel)
    return of_reading(sensor, switched_to(sensor, expected_e, exposure_s)) if sensor.chip.switched else sensor


def as_raw(
    dn: NDArray[np.uint16], sensor: SensorConfig, exposure_s: float, engine: str, hot: NDArray[np.bool_] | None = None
) -> RawImage:
    """Raw image of a frame that `engine` drew, with the camera's calibration and the chip's list of hot pixels.

    Black is the mean that covered pixels read. Dark current raises it and adds to both kinds of dark noise: its own
    shot noise, and what the columns' gains make of it.
    """
    hot = None if hot is None else sensor.pixel_sums(hot)
    pixel = sensor.pixel
    dark_e = min(pixel.dark_current_e_per_s * exposure_s, pixel.full_well_e)
    return RawImage(
        dn=dn,
        cfa=sensor.cfa,
        black_dn=min(sensor.black_dn + dark_e / sensor.gain_e_per_dn, sensor.white_dn - 1),
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=hypot(pixel.read_noise_e, sqrt(dark_e)),
        dsnu_e=hypot(pixel.fixed_dark_e, pixel.column_gain_spread * dark_e),
        prnu=pixel.fixed_gain,
        column_gain_spread=pixel.column_gain_spread,
        exposure_s=float(exposure_s),
        engine=engine,
        defects=None if hot is None else np.argwhere(hot),
        dark_current_e=dark_e,
    )
