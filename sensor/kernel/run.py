"""Frames into the Dr.Jit kernel and out of it, as NumPy arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rodcone.jit import arrays, dr
from sensor.cfa import channels, letter_map
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.kernel.kernel import Chip, Divisor, Frame, expected_lanes, letter_lanes, read_lanes
from sensor.kernel.poisson import alias_table
from sensor.readout import spread_charge

BANDS_AT_ONCE = 8  # a CPU reads ahead in some dozen places; 40 at once take a third longer, and fight for its cache
LARGEST = np.finfo(np.float32).max
ALIGNMENT = 64  # bytes; Dr.Jit compiles another kernel, and a slower one, for memory that isn't aligned
COPY_UNDER = 1 << 20  # bytes; large memory of NumPy's lies alike, which makes one more kernel and not one a pattern


def expected_electrons_single(
    values: NDArray[np.floating],
    weights: NDArray[np.float64],
    sensor: SensorConfig,
    first_row: int = 0,
) -> NDArray[np.float32]:
    """Expected photo-electrons behind each pixel's own filter, in single precision.

    Parameters
    ----------
    values : (h, w, band) floating
        Irradiance, or radiance where the weights hold the lens; read where it lies if it is float32 and band-planar.
    weights : (channel, band) float64
        Electrons per unit of `values`, as `sensor.response.electrons_per_irradiance` gives them.
    sensor : SensorConfig
    first_row : int
        Row of the frame that `values` starts with.

    Returns
    -------
    (h, w) float32
        May be infinite where single precision ends, at 3e38.
    """
    jit = arrays()
    height, width, bands = values.shape
    planes = _single(np.moveaxis(values, -1, 0).reshape(bands, -1))
    scalars = [[dr.opaque(jit.Float, float(weight)) for weight in row] for row in weights]
    cells = letter_map(sensor.cfa, (len(sensor.cfa), len(sensor.cfa[0])))
    numbers = np.vectorize(channels(sensor.cfa).index)(cells).astype(np.uint32)
    tile = _upload(numbers, jit.UInt), _divisor(cells.shape[0]), _divisor(cells.shape[1])
    result = np.empty(planes.shape[1], dtype=np.float32)
    for start, piece in _pieces(planes):
        frame = Frame(dr.opaque(jit.UInt, first_row * width + start), _divisor(width))
        letter = letter_lanes(*tile, frame, piece.shape[1])
        lanes = dr.zeros(jit.Float, piece.shape[1])
        for first in range(0, bands, BANDS_AT_ONCE):
            some = np.s_[first : first + BANDS_AT_ONCE]
            lanes += expected_lanes([jit.Float(plane) for plane in piece[some]], [r[some] for r in scalars], letter)
            dr.eval(lanes, letter)
        result[start : start + piece.shape[1]] = lanes.numpy()
    return result.reshape(height, width)


def _single(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """In single precision, what is larger than its largest number as that."""
    if values.dtype == np.float32:
        return values
    return np.asarray(np.minimum(values, np.float64(LARGEST)), dtype=np.float32)


def _divisor(number: int) -> Divisor:
    jit = arrays()
    return Divisor(dr.opaque(jit.UInt, number), dr.opaque(jit.Float64, 1 / number))


def _pieces(planes: NDArray[np.float32]) -> list[tuple[int, NDArray[np.float32]]]:
    """First pixel and aligned band planes of parts that make up the whole.

    Memory of NumPy's starts 16 bytes after a multiple of 64. Read as it is, the lines that 40 planes share with their
    neighbours drive each other out of the cache where planes lie a power of two apart: half the speed. So all but the
    first few pixels are read in place, from the first aligned one on.
    """
    skip = (-planes.ctypes.data % ALIGNMENT) // planes.itemsize
    in_place = planes.strides[0] % ALIGNMENT == 0 and planes.ctypes.data % planes.itemsize == 0
    if not in_place or skip >= planes.shape[1]:
        return [(0, _aligned_rows(planes))]
    head = [(0, _aligned_rows(planes[:, :skip]))] if skip else []
    return [*head, (skip, planes[:, skip:])]


def _aligned_rows(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Copy whose rows all start at a multiple of `ALIGNMENT`."""
    step = ALIGNMENT // planes.itemsize
    padded = _aligned_empty((planes.shape[0], -(-planes.shape[1] // step) * step), planes.dtype)
    copy = padded[:, : planes.shape[1]]
    copy[:] = planes
    return copy


def _aligned_empty(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.empty(size + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    return np.asarray(memory[start : start + size].view(dtype).reshape(shape))


def _upload(values: NDArray[Any], kind: Any) -> Any:
    """Dr.Jit array over the values themselves where they are large or aligned, else over an aligned copy."""
    flat = values.ravel()
    if flat.ctypes.data % ALIGNMENT and flat.nbytes < COPY_UNDER:
        copy = _aligned_empty(flat.shape, flat.dtype)
        copy[:] = flat
        flat = copy
    return kind(flat)


def read_frame(
    expected_e: NDArray[np.float32], sensor: SensorConfig, device: Device, exposure_s: float, key: int
) -> NDArray[np.uint16]:
    """Digital numbers of one exposure, shape (h, w): what `sensor.readout.read_out` does, with other draws."""
    jit = arrays()
    pixel = sensor.pixel
    expected = expected_e
    if pixel.crosstalk:
        expected = _single(spread_charge(np.minimum(expected_e, np.float64(LARGEST)), pixel.crosstalk))
    frame = Frame(dr.opaque(jit.UInt, 0), _divisor(expected.shape[1]))
    lanes = read_lanes(_upload(expected, jit.Float), _chip(sensor, device, exposure_s, key), frame)
    return np.asarray(lanes.numpy().astype(np.uint16).reshape(expected.shape))


def _chip(sensor: SensorConfig, device: Device, exposure_s: float, key: int) -> Chip:
    jit, pixel = arrays(), sensor.pixel
    dark_e = dr.opaque(jit.Float, pixel.dark_current_e_per_s * exposure_s)
    if device.hot is not None:
        hot_e = pixel.hot_pixel_dark_current_e_per_s * exposure_s
        dark_e = dark_e + _upload(np.float32(hot_e) * device.hot, jit.Float)
    return Chip(
        key=(dr.opaque(jit.UInt, key & 0xFFFFFFFF), dr.opaque(jit.UInt, key >> 32)),
        photo_response=_upload(device.photo_response, jit.Float64),
        dark_offset_e=_upload(device.dark_offset_e, jit.Float64),
        column_gain=None if device.column_gain is None else _upload(device.column_gain, jit.Float64),
        dark_e=dark_e,
        # Poisson far above the well is the well with certainty, as in `read_out`.
        most_e=dr.opaque(jit.Float, 2 * pixel.full_well_e + 1e4),
        full_well_e=dr.opaque(jit.Float, pixel.full_well_e),
        read_noise_e=dr.opaque(jit.Float64, pixel.read_noise_e),
        gain_e_per_dn=dr.opaque(jit.Float64, sensor.gain_e_per_dn),
        black_dn=dr.opaque(jit.Float64, sensor.black_dn),
        white_dn=dr.opaque(jit.Float64, float(sensor.white_dn)),
        table=_upload(alias_table(), jit.UInt),
    )
