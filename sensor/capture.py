"""A photograph: radiance in, raw image out."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from rodcone.jit import backend
from sensor.config import SensorConfig
from sensor.device import Device
from sensor.kernel.kernel import expected_electrons_single, read_frame
from sensor.optics import SpectralIrradiance, camera_equation, falloff, form_image, spreads
from sensor.raw import RawImage
from sensor.readout import read_out
from sensor.response import electrons_per_irradiance, expected_electrons


def capture(
    radiance: SpectralRadiance,
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    *,
    exact: bool = False,
    samples_per_pixel: int = 1,
) -> RawImage:
    """Take one exposure: optics, expected electrons, readout.

    With Dr.Jit on LLVM or CUDA all of it runs there: signal in single precision, shot noise as
    `sensor.kernel.poisson` says (exact under 30 e-, distribution function within 5e-6 above). Otherwise, and with
    `exact`, it is `read_out` of `expected_electrons` of `form_image`, NumPy's exact sampler. The raw image's `engine`
    names what ran. The two draw different frames with the same statistics; each draws the same frame for a seed.

    Parameters
    ----------
    radiance : SpectralRadiance
        Quickest as float32 with band-planar memory, as renders are.
    sensor : SensorConfig
    exposure_s : float
        0 or more [s].
    device : Device
        The chip, of the frame's size.
    rng : numpy.random.Generator
        Gives one key; draws depend on key, row, column and term alone.
    exact : bool
    samples_per_pixel : int
        As `form_image` takes it.

    Raises
    ------
    InputError
        For a frame that isn't the device's size or doesn't hold a tile, a negative exposure, a window beyond
        380-780 nm that the bands don't reach, bands that leave out more than half of a channel's response, or no
        Generator.

    Warns
    -----
    UserWarning
        Where the bands don't fill the camera's window: what each channel loses.
    """
    if samples_per_pixel == 1 and not spreads(sensor.lens):
        return capture_strips([radiance], sensor, exposure_s, device, rng, exact=exact)
    image = form_image(radiance, sensor, samples_per_pixel)
    _check_frame(image.values.shape[0], image.values.shape[1], device)
    return expose(_expected(image, sensor, exposure_s, exact), sensor, exposure_s, device, rng, exact=exact)


def capture_strips(
    strips: Iterable[SpectralRadiance],
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    *,
    exact: bool = False,
) -> RawImage:
    """Take one exposure of a picture that comes in strips of whole rows, top to bottom; never more than one is held.

    The frame is that of `capture` of the whole picture, bit for bit with Dr.Jit (NumPy's matrix product may round
    otherwise for another strip height).

    Parameters
    ----------
    strips : iterable of SpectralRadiance
        Together as high as the device, each as wide, and at least as high as the mosaic's tile.
    sensor : SensorConfig
        Its lens must not spread light: diffraction, defocus and veiling glare need the whole picture.
    exposure_s, device, rng, exact
        As `capture` takes them.

    Raises
    ------
    InputError
        As `capture` does, and for a lens that spreads light.
    """
    if spreads(sensor.lens):
        raise InputError(
            "lens: diffraction, defocus or veiling_glare reach beyond a strip; set them to 0 or use capture"
        )
    expected_e = np.empty(device.shape, dtype=np.float64 if _numpy_runs(exact) else np.float32)
    row = 0
    for strip in strips:
        if row + strip.shape[0] > device.shape[0] or strip.shape[1] != device.shape[1]:
            _check_frame(row + strip.shape[0], strip.shape[1], device)
        expected_e[row : row + strip.shape[0]] = _expected(strip, sensor, exposure_s, exact, row)
        row += strip.shape[0]
    _check_frame(row, device.shape[1], device)
    if sensor.lens.horizontal_view_deg:
        expected_e *= falloff(sensor.lens, device.shape).astype(expected_e.dtype)
    return expose(expected_e, sensor, exposure_s, device, rng, exact=exact)


def expose(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    *,
    exact: bool = False,
) -> RawImage:
    """Expose and read the chip once, from expected electrons: the second half of `capture`.

    Dr.Jit draws the frame on LLVM or CUDA, in single precision; NumPy's `read_out` does otherwise, and with `exact`.

    Parameters
    ----------
    expected_e : (h, w) array
        Expected photo-electrons of each pixel in `exposure_s`, without dark current.
    sensor, exposure_s, device, rng, exact
        As `capture` takes them.

    Raises
    ------
    InputError
        For a frame that isn't the device's size, negative or non-finite electrons, a negative exposure, or no
        Generator.
    """
    if _numpy_runs(exact):
        return read_out(expected_e, sensor, device, exposure_s, rng)
    return read_out(expected_e, sensor, device, exposure_s, rng, draw=read_frame, engine=backend())


def _check_frame(height: int, width: int, device: Device) -> None:
    if (height, width) != device.shape:
        raise InputError(
            f"radiance: a frame of {(height, width)} is not the device's {device.shape}; "
            "draw the device with the frame's shape"
        )


def _numpy_runs(exact: bool) -> bool:
    return exact or backend() == "numpy"


def _expected(
    light: SpectralRadiance | SpectralIrradiance,
    sensor: SensorConfig,
    exposure_s: float,
    exact: bool,
    first_row: int = 0,
) -> NDArray[np.floating]:
    """Expected electrons of a frame or a strip of it, from irradiance, or from radiance but for the lens's falloff."""
    if _numpy_runs(exact):
        turn = first_row % len(sensor.cfa)  # the row of the tile that a strip starts with
        lens = replace(sensor.lens, horizontal_view_deg=0.0)
        turned = replace(sensor, cfa=sensor.cfa[turn:] + sensor.cfa[:turn], lens=lens)
        irradiance = form_image(light, turned) if isinstance(light, SpectralRadiance) else light
        return expected_electrons(irradiance, turned, exposure_s)
    weights = electrons_per_irradiance(sensor, light.wavelength_nm, light.widths_nm, exposure_s)
    if isinstance(light, SpectralRadiance):
        weights = weights * camera_equation(sensor.lens)
    return expected_electrons_single(light.values, weights, sensor, first_row)
