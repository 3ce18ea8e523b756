"""Read out a chip: digital numbers from expected photo-electrons, with every noise source in physical order."""

from collections.abc import Callable, Sequence
from math import hypot, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError
from sensor.cfa import block_sums
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.pixel import PixelConfig, bent_e
from sensor.random import NoiseTerm, draw_key, normals, philox, poisson
from sensor.raw import RawImage
from sensor.readings.best_estimate import merged_variance, merged_variances
from sensor.readings.channels import join
from sensor.readings.clipping import Moments, clipped_frame
from sensor.readings.merge import merge
from sensor.readings.resolve import PlainReading, at_channel, by_site, law_by_site, light_of, resolve, several

# Digital numbers of one exposure from expected electrons, camera, chip, exposure time [s], key, and the reading's
# number among those of one charge.
DrawFrame: TypeAlias = Callable[[NDArray[np.floating], SensorConfig, Device, float, int, int], NDArray[np.uint16]]

# Far above any well, and inside 64-bit integers. One bound for all: what a pixel takes from its row's stream depends on
# its mean, so readings of one charge, whose wells differ, draw the same electrons only from the same means.
_MOST_E = 1e15
LEAST_SLOPE = 1e-3  # with a smaller slope of its mean over the light, a clipped sample says nothing about the light


def draw_frame(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    key: int,
    reading: int = 0,
    counts: Callable[[int, NoiseTerm, NDArray[np.float64]], NDArray[Any]] = poisson,
) -> NDArray[np.uint16]:
    """Draw the digital numbers of one exposure, shape (h, w); (h / 2, w / 2) for a camera that bins.

    In physical order: crosstalk and PRNU change the photo-electrons' means, dark current and hot pixels add to them,
    then follows one Poisson draw, by NumPy's exact sampler; the well clips; pixels that bin in charge are summed; the
    rest is `convert`. For one key, each `reading` draws read noise of its own and the same shot noise.
    """
    pixel = sensor.photosites.pixel
    expected = np.asarray(expected_e, dtype=np.float64)

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
    """Convert what the wells hold to digital numbers, shape (h, w); (h / 2, w / 2) for a camera that bins.

    Pixels that bin in charge are summed, and their floating diffusion clips; the response bends; the column's amplifier
    multiplies; fixed offsets and read noise, before the gain and after it, are added; the converter, whose top is the
    well over the gain, rounds and clips; readings that bin in digital numbers are summed. Columns of a row that share
    a ramp disturb each other just before rounding.
    """
    converter = sensor
    if sensor.in_charge:
        collected_e = np.minimum(block_sums(collected_e), sensor.pixel.full_well_e)
    else:
        converter = sensor.photosites
    read_e = bent_e(collected_e, converter.pixel) if converter.pixel.response_bend else collected_e
    read_e = read_e if device.column_gain is None else read_e * device.column_gain
    read_e = read_e + device.dark_offset_e
    if converter.read_noise_e:
        read_e += pixel_read_noise_e(converter) * normals(key, NoiseTerm.READ, read_e.shape, reading)
    if converter.pixel.row_noise_e:
        read_e += row_noise_e(converter, key, read_e.shape[0], reading)[:, None]
    if device.telegraph_e is not None:
        read_e += telegraph_noise_e(device.telegraph_e, key, reading)
    if converter.pixel.has_shared_ramp:
        read_e = shared_ramp_e(read_e, converter.pixel)
    dn = np.rint(read_e / converter.gain_e_per_dn + converter.black_dn)
    dn = np.clip(dn, 0, converter.white_dn).astype(np.uint16)
    return dn if sensor.in_charge else sensor.pixel_sums(dn)


def pixel_read_noise_e(converter: SensorConfig) -> float:
    """Return the normal part of the read noise that each pixel has by itself [e-]."""
    parts_e2 = converter.pixel.row_noise_e**2 + converter.pixel.telegraph_noise_e**2
    return sqrt(max(converter.read_noise_e**2 - parts_e2, 0.0)) if parts_e2 else converter.read_noise_e


def row_noise_e(converter: SensorConfig, key: int, rows: int, reading: int) -> NDArray[np.float64]:
    """Draw the part of the read noise that the pixels of each row share [e-], (h,)."""
    return converter.pixel.row_noise_e * normals(key, NoiseTerm.ROW, (rows, 1), reading)[:, 0]


def telegraph_noise_e(height_e: NDArray[np.float64], key: int, reading: int) -> NDArray[np.float64]:
    """Draw the random telegraph noise of a reading [e-], (h, w): -1, 0 or 1 times the height of each pixel's jump.

    The trap is full or empty, each half of the time, when the reset level is sampled and again when the signal is; both
    samples, and those of all frames, are taken to lie further apart than its state lasts.
    """
    rows, columns = np.nonzero(height_e)
    place = columns.astype(np.uint64), rows.astype(np.uint64)
    terms = (np.full(rows.shape, word, dtype=np.uint64) for word in (int(NoiseTerm.TELEGRAPH), reading))
    reset, signal, *_ = philox((*place, *terms), key)
    full = [(word >> np.uint64(31)).astype(np.float64) for word in (reset, signal)]
    noise_e = np.zeros(height_e.shape)
    noise_e[rows, columns] = height_e[rows, columns] * (full[1] - full[0])
    return noise_e


def shared_ramp_e(read_e: NDArray[np.float64], pixel: PixelConfig) -> NDArray[np.float64]:
    """Return what columns read that compare their signals with one ramp and disturb it when they convert [e-], (h, w).

    Each row converts by itself, and a column converts when the ramp has risen to its signal x. If F(x) is the share of
    the row's columns that have converted before, then the reading is y with dy = (dx + step dF) / (1 + rise F): each
    conversion raises later readings, and the ramp is steeper afterwards. So readings are right up to a row's dimmest
    signal. In an even field, noise and fixed pattern are changed, but the mean over light hardly is, because most
    columns convert after half of the others at every light. O(h w log w).
    """
    columns = read_e.shape[1]
    order = np.argsort(read_e, axis=1, kind="stable")
    sorted_e = np.take_along_axis(read_e, order, axis=1)
    share = np.arange(1, columns) / columns
    steps_e = (np.diff(sorted_e, axis=1) + pixel.ramp_step_e / columns) / (1 + pixel.ramp_rise * share)
    sorted_e[:, 1:] = sorted_e[:, :1] + np.cumsum(steps_e, axis=1)
    changed_e = np.empty_like(read_e)
    np.put_along_axis(changed_e, order, sorted_e, axis=1)
    return changed_e


def draw_mean_frame(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    key: int,
    reading: int = 0,
) -> NDArray[np.uint16]:
    """Draw a frame as `draw_frame` does, but without shot noise: pixels collect the mean electrons, fractions included.

    No camera does this; it shows the effect of the other terms alone. Both draw the same read noise for a key.
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
    """Expose and read the chip once; draw all readings of a pixel and merge them, or choose one.

    Parameters
    ----------
    expected_e : (h, w) array
        Expected photo-electrons of each pixel, without dark current; before binning.
    sensor : SensorConfig
    device : Device
        The chip; its patterns are not drawn again.
    exposure_s : float
        Exposure time [s], for the dark current; the raw image states it.
    rng : numpy.random.Generator
        Gives one key; draws depend on key, row, column and term alone (shot noise: one stream a row).
    draw : callable
        Function that draws the frame: `draw_frame`, or `sensor.kernel.kernel.read_frame` in Dr.Jit.
    engine : str
        Name of the engine on which `draw` runs; the raw image states it.

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
    readings = resolve(sensor, expected, exposure_s)
    return read(expected, readings, device, rng, draw=draw, engine=engine)


def read(
    expected_e: NDArray[np.floating],
    readings: Sequence[PlainReading],
    device: Device,
    rng: np.random.Generator,
    *,
    draw: DrawFrame = draw_frame,
    engine: str = "numpy",
) -> RawImage:
    """Draw each reading of one exposure and merge them; parameters are as in `read_out`, with the camera resolved."""
    keys = {charge: draw_key(rng) for charge in dict.fromkeys(x.charge for x in readings)}
    raws = []
    for number, (x, light_e) in enumerate(zip(readings, light_of(expected_e, readings), strict=True)):
        patterns = device if x.patterns is None else device.readings[x.patterns]
        # Readings of every pixel draw read noise by their number; each channel that is read apart has a key of its own.
        dn = draw(light_e, x.sensor, patterns, x.exposure_s, keys[x.charge], number if x.sites is None else 0)
        raws.append(as_raw(dn, x.sensor, x.exposure_s, engine, patterns.hot))
    if len(raws) == 1:
        return raws[0]
    return merge(readings, raws) if several(readings) else join(readings, raws)


def spread_charge(expected_e: NDArray[np.float64], crosstalk: float) -> NDArray[np.float64]:
    """Return the expected photo-electrons after each pixel gave `crosstalk` of its own to each of its four neighbours.

    This has to happen before the Poisson draw: electrons that go separate ways are thinned, and thinned Poisson counts
    are again Poisson and independent. At the frame's edge the charge stays, so the total is kept. Charge beyond a full
    well is lost and not handed on, because blooming isn't modelled.

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
    """Compute the variance of each sample over chips and exposures [e-^2], in the shape of `expected_e`.

    It is the sum of shot noise of signal and dark current, PRNU on the signal, hot pixels, column gains on all that was
    collected, DSNU and column offsets, read noise, of which rows and telegraph noise are parts, and quantisation (a
    DN^2 / 12). Of a bent response it is the variance of its samples, which development takes for straight. Near the
    full well, the converter's top and 0 DN, it is the variance that clipping leaves (`sensor.readings.clipping`).

    For a camera that merges several readings, a sample is the merged electrons over the share of the pixel's electrons
    that the readings hold together; clipping is left out. A camera that switches its gain chooses it by `expected_e`,
    taken as one frame.

    Parameters
    ----------
    expected_e : (h, w) float64
        Expected photo-electrons of the raw image's pixels, before crosstalk; of photodiodes that bin,
        `SensorConfig.pixel_sums`.
    sensor : SensorConfig
    exposure_s : float
        Exposure time [s], for the dark current.
    channel : str, optional
        Channel of all pixels; left out, they are those of a mosaic, (h, w). It changes nothing for a camera that reads
        all channels alike.
    """
    expected = np.asarray(expected_e, dtype=np.float64)
    return frame_variance(expected, resolve(sensor, expected, exposure_s, channel))


def frame_variance(expected_e: NDArray[np.float64], readings: Sequence[PlainReading]) -> NDArray[np.float64]:
    """Compute `noise_variance` for a frame whose camera is resolved into readings."""
    return frame_moments(expected_e, readings).variance_e2


def frame_moments(expected_e: NDArray[np.float64], readings: Sequence[PlainReading]) -> Moments:
    """Return mean, variance and slope of a frame's clipped samples; clipping is left out for several readings."""
    light_e = collected_e(expected_e, readings)
    if several(readings):
        return Moments(light_e, merged_variance(light_e, readings), np.ones_like(light_e))
    return clipped_frame(light_e, readings)


def light_variance(expected_e: NDArray[np.float64], readings: Sequence[PlainReading]) -> NDArray[np.float64]:
    """Return the variance of an estimate of the light from each sample [e-^2].

    It is the clipped sample's variance over the square of the slope of the sample's mean over the light.
    Near the full well this slope falls towards 0, so that the variance grows without bound.
    """
    moments = frame_moments(expected_e, readings)
    return np.asarray(moments.variance_e2 / np.maximum(moments.slope, LEAST_SLOPE) ** 2)


def unclipped_variance(expected_e: NDArray[np.float64], readings: Sequence[PlainReading]) -> NDArray[np.float64]:
    """Return the variance that a frame's samples would have without clipping [e-^2].

    Callers use its root as the unit for the distance of a pixel's mean from the full well.
    """
    light_e = collected_e(expected_e, readings)
    if several(readings):
        return merged_variance(light_e, readings)
    return law_by_site(readings, expected_e.shape).variance(light_e)


def collected_e(expected_e: NDArray[np.float64], readings: Sequence[PlainReading]) -> NDArray[np.float64]:
    """Return the photo-electrons that each pixel is expected to collect, with its neighbours' crosstalk.

    `expected_e` and the result are in the raw image's electrons, which count the light before a density takes its
    share.
    """
    density = by_site([1.0 if several(readings) else x.light_share for x in readings], readings, expected_e.shape)
    return np.asarray(spread_charge(expected_e * density, readings[0].pixel.crosstalk) / density)


def noise_sources(
    expected_e: float, sensor: SensorConfig, exposure_s: float, channel: str | None = None
) -> dict[str, float]:
    """Return the standard deviation of each source of a pixel's noise in an even field [e-], by name.

    Their squares sum to `noise_variance` where nothing clips or bends; its docstring explains each of them.
    """
    return sources_of(expected_e, at_channel(resolve(sensor, np.array([expected_e]), exposure_s, channel), channel))


def sources_of(expected_e: float, readings: Sequence[PlainReading]) -> dict[str, float]:
    """Return `noise_sources` for readings of every pixel."""
    light = np.array([expected_e])
    if several(readings):
        variances_e2 = merged_variances(light, readings)
    else:
        variances_e2 = {name: law.variance(light) for name, law in readings[0].sources.items()}
    return {name: float(value[0]) ** 0.5 for name, value in variances_e2.items()}


def as_raw(
    dn: NDArray[np.uint16], sensor: SensorConfig, exposure_s: float, engine: str, hot: NDArray[np.bool_] | None = None
) -> RawImage:
    """Make a raw image of a frame that `engine` drew, with the camera's calibration and the chip's list of hot pixels.

    Black is the mean reading of covered pixels. A shared ramp raises it by half of its step, because half of a row's
    columns convert before the average one. Dark current raises it, and adds to both kinds of dark noise: its shot noise
    to the temporal one, and its differences by the columns' gains to the fixed one.
    """
    hot = None if hot is None else sensor.pixel_sums(hot)
    pixel = sensor.pixel
    dark_e = min(pixel.dark_current_e_per_s * exposure_s, pixel.full_well_e)
    read_dark_e = bent_e(dark_e, pixel) if pixel.response_bend else dark_e
    raised_e = read_dark_e + pixel.ramp_step_e / 2
    return RawImage(
        dn=dn,
        cfa=sensor.cfa,
        black_dn=min(sensor.black_dn + raised_e / sensor.gain_e_per_dn, sensor.white_dn - 1),
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=hypot(sensor.read_noise_e, sqrt(dark_e)),
        dsnu_e=hypot(pixel.fixed_dark_e, pixel.column_gain_spread * dark_e),
        prnu=pixel.fixed_gain,
        column_gain_spread=pixel.column_gain_spread,
        exposure_s=float(exposure_s),
        engine=engine,
        defects=None if hot is None else np.argwhere(hot),
        dark_current_e=dark_e,
        crosstalk=pixel.crosstalk,
    )
