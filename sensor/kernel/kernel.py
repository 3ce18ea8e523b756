"""Expected electrons and the readout in Dr.Jit, with one thread per pixel and one source for LLVM and CUDA.

Every number that changes between calls is an evaluated array of one value or more, so that one compiled kernel serves
all cameras, keys and frame sizes (of one number of bands and channels). Draws depend on key, row, column and term
alone.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from rodcone.device_arrays import ALIGNMENT, aligned, divide, divisor, tile_cell, upload
from rodcone.jit import Float, UInt, arrays, dr
from sensor.cfa import channel_map, channels, check_covers
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.kernel.poisson import alias_table, poisson_single
from sensor.pixel import bent_e
from sensor.random import MULTIPLIERS, ROUNDS, WEYL, NoiseTerm
from sensor.readout import convert, pixel_read_noise_e, row_noise_e, shared_ramp_e, spread_charge, telegraph_noise_e

BANDS_AT_ONCE = 8  # a CPU prefetches about a dozen streams; 40 at once take a third longer, and compete for its cache
LARGEST = np.finfo(np.float32).max
# Bytes under which unaligned arrays are copied. Larger arrays of NumPy all lie alike, which costs one kernel more.
COPY_UNDER = 1 << 20
_FINITE_E = 1e30  # larger than any well, and still in single precision's range when multiplied by any response


# Expected electrons


def expected_electrons_single(
    values: NDArray[np.floating], weights: NDArray[np.float64], sensor: SensorConfig
) -> NDArray[np.float32]:
    """Return the expected photo-electrons behind each pixel's own filter, in single precision.

    Parameters
    ----------
    values : (h, w, band) floating
        Irradiance, or radiance where the weights hold the lens; not copied if it is float32 and band-planar.
    weights : (channel, band) float64
        Electrons per unit of `values`, as `sensor.response.electrons_per_irradiance` gives them.
    sensor : SensorConfig

    Returns
    -------
    (h, w) float32
        At most single precision's largest number, 3.4e38.

    Raises
    ------
    InputError
        For a frame smaller than the mosaic's tile.
    """
    jit = arrays()
    height, width, bands = values.shape
    mosaic = sensor.photosites.cfa
    check_covers(mosaic, (height, width))
    planes = _single(np.moveaxis(values, -1, 0).reshape(bands, -1))
    scalars = [[dr.opaque(jit.Float, float(weight)) for weight in row] for row in weights]
    tile = channel_map(mosaic, (len(mosaic), len(mosaic[0])))
    tile_channels = upload(np.vectorize(channels(mosaic).index)(tile).astype(np.uint32))
    tile_size = divisor(tile.shape[0]), divisor(tile.shape[1])
    result = np.empty(planes.shape[1], dtype=np.float32)
    for start, piece in _pieces(planes):
        pixel = dr.arange(jit.UInt, piece.shape[1]) + dr.opaque(jit.UInt, start)
        channel = dr.gather(jit.UInt, tile_channels, tile_cell(pixel, divisor(width), tile_size))
        electrons = dr.zeros(jit.Float, piece.shape[1])
        for first in range(0, bands, BANDS_AT_ONCE):
            bands_read = np.s_[first : first + BANDS_AT_ONCE]
            electrons += weighted_sum(
                [jit.Float(plane) for plane in piece[bands_read]], [r[bands_read] for r in scalars], channel
            )
            dr.eval(electrons, channel)
        result[start : start + piece.shape[1]] = electrons.numpy()
    return np.minimum(result, LARGEST).reshape(height, width)


def weighted_sum(planes: list[Float], weights: list[list[Float]], channel: UInt) -> Float:
    """Sum over bands behind each pixel's own filter.

    Parameters
    ----------
    planes : list of Float
        Each band's pixels.
    weights : list of lists of Float
        One value for each channel and band.
    channel : UInt
        Number of each pixel's channel, UInt.
    """
    # The sums of all channels are taken, then one is chosen: reading the bands takes longer than the arithmetic.
    sums = []
    for row in weights:
        total = planes[0] * row[0]
        for plane, weight in zip(planes[1:], row[1:], strict=True):
            total = dr.fma(plane, weight, total)
        sums.append(total)
    result = sums[0]
    for number, total in enumerate(sums[1:], 1):
        result = dr.select(channel == number, total, result)
    return result


def _pieces(planes: NDArray[np.float32]) -> list[tuple[int, NDArray[np.float32]]]:
    """Split `planes` into parts to read, each with its first pixel and its band planes, aligned.

    NumPy's memory starts 16 bytes after a multiple of 64. If it were read from there, the cache lines that 40 planes
    share with their neighbours would evict each other where planes lie a power of two apart, at half the speed. So the
    first few pixels are copied, and the rest is read in place from the first aligned pixel on.
    """
    skip = (-planes.ctypes.data % ALIGNMENT) // planes.itemsize
    in_place = planes.strides[0] % ALIGNMENT == 0 and planes.ctypes.data % planes.itemsize == 0
    if not in_place or skip >= planes.shape[1]:
        return [(0, _aligned_rows(planes))]
    head = [(0, _aligned_rows(planes[:, :skip]))] if skip else []
    return [*head, (skip, planes[:, skip:])]


# Readout


def read_frame(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    key: int,
    reading: int = 0,
) -> NDArray[np.uint16]:
    """Draw the digital numbers of one exposure, as `sensor.readout.draw_frame` does, but with other random numbers.

    If the camera bins in charge, Dr.Jit fills the wells, and NumPy converts the sums, a quarter as many.
    """
    expected_e = np.asarray(expected_e, dtype=np.float32)
    jit = arrays()
    one = sensor.photosites
    pixel = one.pixel
    if pixel.crosstalk:
        expected_e = _single(spread_charge(np.minimum(expected_e, np.float64(LARGEST)), pixel.crosstalk))
    row, column = divide(dr.arange(jit.UInt, expected_e.size), divisor(expected_e.shape[1]))
    halves = dr.opaque(jit.UInt, key & 0xFFFFFFFF), dr.opaque(jit.UInt, key >> 32)
    words = philox_single((column, row, jit.UInt(int(NoiseTerm.EXPOSURE)), jit.UInt(0)), halves)
    shot, read_normal = normal_pair(words[0], words[1])
    if reading:  # shot noise is the charge's, read noise the reading's own
        reading_words = philox_single(
            (column, row, jit.UInt(int(NoiseTerm.EXPOSURE)), dr.opaque(jit.UInt, reading)), halves
        )
        _, read_normal = normal_pair(reading_words[0], reading_words[1])

    # The Poisson mean, PRNU on the light alone. Far above the well the draw is the well with certainty: the bound of
    # the mean, as in `draw_frame`. An infinite sum times a response of 0 would be NaN: the bound of the light.
    dark_e = dr.opaque(jit.Float, pixel.dark_current_e_per_s * exposure_s)
    if device.hot is not None:
        hot_e = pixel.hot_pixel_dark_current_e_per_s * exposure_s
        dark_e = dark_e + upload(np.float32(hot_e) * device.hot, copy_under=COPY_UNDER)
    light_e = dr.minimum(upload(expected_e, copy_under=COPY_UNDER), _FINITE_E)
    mean_e = dr.fma(light_e, jit.Float(upload(device.photo_response, copy_under=COPY_UNDER)), dark_e)
    most_e = dr.opaque(jit.Float, 2 * pixel.full_well_e + 1e4)
    collected_e = poisson_single(dr.minimum(mean_e, most_e), shot, words[2:], upload(alias_table()))

    collected_e = dr.minimum(collected_e, dr.opaque(jit.Float, pixel.full_well_e))
    if sensor.in_charge:
        return convert(collected_e.numpy().astype(np.float64).reshape(expected_e.shape), sensor, device, key)

    # Double precision behind the well: whole electrons lie on the same DN as in the NumPy form.
    read_e = jit.Float64(collected_e)
    if pixel.response_bend:
        read_e = bent_e(read_e, pixel)
    if device.column_gain is not None:
        read_e *= dr.gather(jit.Float64, upload(device.column_gain), column)
    read_noise_e = dr.opaque(jit.Float64, pixel_read_noise_e(one)) * jit.Float64(read_normal)
    if pixel.row_noise_e:
        read_noise_e += dr.gather(jit.Float64, upload(row_noise_e(one, key, expected_e.shape[0], reading)), row)
    offset_e = device.dark_offset_e
    if device.telegraph_e is not None:
        offset_e = offset_e + telegraph_noise_e(device.telegraph_e, key, reading)
    read_e += upload(offset_e, copy_under=COPY_UNDER) + read_noise_e
    if pixel.has_shared_ramp:
        read_e = upload(shared_ramp_e(read_e.numpy().reshape(expected_e.shape), pixel))
    dn = read_e / dr.opaque(jit.Float64, one.gain_e_per_dn) + dr.opaque(jit.Float64, one.black_dn)
    dn = jit.Int(dr.clip(dr.round(dn), 0.0, dr.opaque(jit.Float64, float(one.white_dn))))
    return sensor.pixel_sums(dn.numpy().astype(np.uint16).reshape(expected_e.shape))


def philox_single(counter: tuple[UInt, ...], key: tuple[UInt, UInt]) -> tuple[UInt, ...]:
    """Return four random words for each counter by Philox4x32-10, as `sensor.random.philox` does."""
    (c0, c1, c2, c3), (k0, k1) = counter, key
    first, second = (arrays().UInt(int(multiplier)) for multiplier in MULTIPLIERS)
    for _ in range(ROUNDS):
        c0, c1, c2, c3 = (dr.mul_hi(c2, second) ^ c1 ^ k0, c2 * second, dr.mul_hi(c0, first) ^ c3 ^ k1, c0 * first)
        k0, k1 = k0 + WEYL[0], k1 + WEYL[1]
    return c0, c1, c2, c3


def normal_pair(first: UInt, second: UInt) -> tuple[Float, Float]:
    """Return two independent standard normal draws from two words (Box-Muller); they end at 6.7 standard deviations."""
    jit = arrays()
    radius = dr.sqrt(-2.0 * dr.log(dr.fma(jit.Float(jit.Int(first >> 1)), 2.0**-31, 2.0**-32)))
    sine, cosine = dr.sincos(jit.Float(jit.Int(second >> 1)) * (2.0 * pi * 2.0**-31))
    return radius * sine, radius * cosine


def _single(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Convert values to single precision, bounded by its largest number."""
    if values.dtype == np.float32:
        return values
    return np.asarray(np.minimum(values, np.float64(LARGEST)), dtype=np.float32)


def _aligned_rows(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Copy planes so that all rows start at a multiple of `ALIGNMENT`."""
    step = ALIGNMENT // planes.itemsize
    padded = aligned((planes.shape[0], -(-planes.shape[1] // step) * step), planes.dtype)
    copy = padded[:, : planes.shape[1]]
    copy[:] = planes
    return copy
