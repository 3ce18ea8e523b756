"""Take a photograph: make a raw image from radiance."""

import numpy as np
from numpy.typing import NDArray

from render.radiance import SpectralRadiance
from rodcone.jit import backend
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.exposure import AUTO, auto_exposure_s, exposure_of_electrons_s
from sensor.kernel.kernel import expected_electrons_single, read_frame
from sensor.lens.illumination import darkens, falloff
from sensor.optics import SpectralIrradiance, camera_equation, form_image, spreads
from sensor.raw import RawImage
from sensor.readout import read_out
from sensor.response import behind_filters, channel_electrons, electrons_per_irradiance, imaged_electrons
from sensor.shake import shaken


def photograph_radiance(
    radiance: SpectralRadiance | SpectralIrradiance,
    sensor: SensorConfig,
    exposure_s: float | None = None,
    device: Device | None = None,
    rng: np.random.Generator | None = None,
    *,
    exact: bool = False,
    samples_per_pixel: int = 1,
) -> RawImage:
    """Take one exposure: optics, expected electrons, readout.

    Arguments that are left out have the defaults of `rodcone capture`, and every call then gives the same frame. A
    camera that shakes (`LensConfig.shake_um`) takes a path of its own in each exposure.

    With Dr.Jit on LLVM or CUDA all of it runs there: signal in single precision, shot noise as
    `sensor.kernel.poisson` says (exact under 30 e-, distribution function within 5e-6 above). Otherwise, and with
    `exact`, it is `read_out` of `expected_electrons` of `form_image`, NumPy's exact sampler. The raw image's `engine`
    names what ran. The two draw different frames with the same statistics; each draws the same frame for a seed.

    Parameters
    ----------
    radiance : SpectralRadiance or SpectralIrradiance
        Light of the scene; float32 with band-planar memory, as renders have it, is fastest. If an image on the sensor
        from `form_image` is given, it isn't formed again.
    sensor : SensorConfig
    exposure_s : float, optional
        0 or more [s]; left out, by `sensor.exposure.auto_exposure_s`.
    device : Device, optional
        The chip, of the frame's size; left out, the one that ``default_rng([0, 0])`` draws.
    rng : numpy.random.Generator, optional
        Gives one key; draws depend on key, row, column and term alone. Left out, ``default_rng([0, 1])``.
    exact : bool
    samples_per_pixel : int
        As in `form_image`.

    Raises
    ------
    InputError
        For a frame that isn't the device's size or doesn't hold a tile, a negative exposure, a window beyond
        380-780 nm that the bands don't reach, bands that leave out more than half of a channel's response, or no
        Generator.

    Warns
    -----
    UserWarning
        If the bands don't fill the camera's window, on what each channel loses.
    """
    numpy_runs = exact or backend() == "numpy"
    formed = isinstance(radiance, SpectralIrradiance)
    scaled = samples_per_pixel == 1 and not spreads(sensor.lens) and not formed
    metered_s = exposure_s or 1.0
    channels_e = None
    if isinstance(radiance, SpectralRadiance) and (numpy_runs or not scaled or sensor.lens.shake_um):
        channels_e = imaged_electrons(radiance, sensor, metered_s, samples_per_pixel)
    elif isinstance(radiance, SpectralIrradiance) and (numpy_runs or sensor.lens.shake_um):
        channels_e = channel_electrons(radiance, sensor, metered_s)
    (height, width, _) = radiance.values.shape if channels_e is None else channels_e.shape
    device = device or draw_device(sensor, (height, width), np.random.default_rng([0, 0]))
    rng = rng or np.random.default_rng([0, 1])
    if exposure_s is None and channels_e is not None:
        exposure_s = exposure_of_electrons_s(AUTO, channels_e, sensor)
    elif exposure_s is None:
        image = radiance if isinstance(radiance, SpectralIrradiance) else form_image(radiance, sensor)
        exposure_s = auto_exposure_s(image, sensor)
    if channels_e is not None:
        scale = exposure_s / metered_s
        return expose_channels(channels_e * scale if scale != 1 else channels_e, sensor, exposure_s, device, rng, exact)
    view_deg = radiance.horizontal_view_deg if isinstance(radiance, SpectralRadiance) else None
    # A lens that only scales light forms no image: its factors go to the weights and to the electrons.
    weights = electrons_per_irradiance(sensor, radiance.wavelength_nm, radiance.widths_nm, exposure_s, radiance.light)
    weights = weights * camera_equation(sensor.lens) if scaled else weights
    expected_e = expected_electrons_single(radiance.values, weights, sensor)
    if scaled and darkens(sensor.lens):
        expected_e *= falloff(sensor.lens, (height, width), view_deg).astype(expected_e.dtype)
    return expose(expected_e, sensor, exposure_s, device, rng, exact=exact)


def expose_channels(
    channels_e: NDArray[np.float64],
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    exact: bool = False,
) -> RawImage:
    """Expose and read the chip once, from the electrons behind every filter, (h, w, channel): shake, mosaic, `expose`.

    The electrons are those of a still camera in `exposure_s`, of `sensor.response.imaged_electrons`; the rest is as
    `photograph_radiance` takes it.
    """
    if sensor.lens.shake_um:
        channels_e = shaken(channels_e, sensor, exposure_s, rng)
    return expose(behind_filters(channels_e, sensor), sensor, exposure_s, device, rng, exact=exact)


def expose(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    exposure_s: float,
    device: Device,
    rng: np.random.Generator,
    *,
    exact: bool = False,
) -> RawImage:
    """Expose and read the chip once, from expected electrons: the second half of `photograph_radiance`.

    Dr.Jit draws the frame on LLVM or CUDA, in single precision; NumPy's `read_out` does otherwise, and with `exact`.

    Parameters
    ----------
    expected_e : (h, w) array
        Expected photo-electrons of each pixel in `exposure_s`, without dark current.
    sensor, exposure_s, device, rng, exact
        As in `photograph_radiance`.

    Raises
    ------
    InputError
        For a frame that isn't the device's size, negative or non-finite electrons, a negative exposure, or no
        Generator.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> sensor, rng = rodcone.low_noise(), np.random.default_rng(1)
    >>> device = rodcone.draw_device(sensor, (4, 4), rng)
    >>> raw = rodcone.expose(np.full((4, 4), 1000.0), sensor, 0.01, device, rng)
    >>> raw.dn.shape, raw.dn.dtype.name
    ((4, 4), 'uint16')
    """
    if exact or backend() == "numpy":
        return read_out(expected_e, sensor, device, exposure_s, rng)
    return read_out(expected_e, sensor, device, exposure_s, rng, draw=read_frame, engine=backend())
