"""From expected photo-electrons to digital numbers: every noise source, in physical order."""

import numpy as np
from numpy.typing import NDArray

from rodcone.errors import InputError, require_range
from sensor.config import SensorConfig
from sensor.crosstalk import spread_charge
from sensor.device import Device
from sensor.random import Term, draw_key, normals, poisson
from sensor.raw import RawImage


def read_out(
    expected_e: NDArray[np.floating],
    sensor: SensorConfig,
    device: Device,
    exposure_s: float,
    rng: np.random.Generator,
) -> RawImage:
    """Expose and read the chip once.

    In physical order: crosstalk and PRNU move the photo-electrons' means, dark current and hot pixels add to them, then
    one Poisson draw; the well clips; the column's amplifier multiplies what the well gave; fixed offsets and read noise
    are added; the converter rounds and clips.

    Parameters
    ----------
    expected_e : (h, w) array
        Expected photo-electrons of each pixel, without dark current.
    sensor : SensorConfig
    device : Device
        The chip; its patterns are not drawn again.
    exposure_s : float
        For the dark current, and noted in the raw image [s].
    rng : numpy.random.Generator
        Gives one key; draws depend on key, row, column and term alone (shot noise: one stream a row).

    Raises
    ------
    InputError
        For a frame that isn't the device's size, negative or non-finite electrons, or a negative exposure.
    """
    require_range("exposure_s", exposure_s, 0.0, 1e7, "give seconds, 0 or more")
    expected = np.asarray(expected_e, dtype=np.float64)
    check_expected(expected, device)
    pixel, key = sensor.pixel, draw_key(rng)

    # PRNU scales the mean: after the draw the variance would be wrong. It is the spread of the whole pixel's response,
    # as a flat field shows it, so crosstalk, which leaves a flat field alone, comes first and doesn't smooth it.
    mean_e = spread_charge(expected, pixel.crosstalk) * device.photo_response
    mean_e += pixel.dark_current_e_per_s * exposure_s  # PRNU is photo-response only
    if device.hot is not None:
        mean_e[device.hot] += pixel.hot_pixel_dark_current_e_per_s * exposure_s
    # Poisson far above the well is the well with certainty; the bound keeps the draw inside 64-bit integers.
    collected_e = poisson(key, Term.SHOT, np.minimum(mean_e, 2 * pixel.full_well_e + 1e4)).astype(np.float64)
    np.minimum(collected_e, pixel.full_well_e, out=collected_e)
    if device.column_gain is not None:
        collected_e *= device.column_gain
    collected_e += device.dark_offset_e
    if pixel.read_noise_e:
        collected_e += pixel.read_noise_e * normals(key, Term.READ, expected.shape)
    dn = np.rint(collected_e / sensor.gain_e_per_dn + sensor.black_dn)
    dn = np.clip(dn, 0, sensor.white_dn).astype(np.uint16)
    return as_raw(dn, sensor, exposure_s, engine="numpy", hot=device.hot)


def as_raw(
    dn: NDArray[np.uint16],
    sensor: SensorConfig,
    exposure_s: float,
    engine: str,
    hot: NDArray[np.bool_] | None = None,
) -> RawImage:
    """Raw image of a frame that `engine` drew, with the camera's calibration and the chip's list of hot pixels."""
    pixel = sensor.pixel
    return RawImage(
        dn=dn,
        cfa=sensor.cfa,
        black_dn=sensor.black_dn,
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=pixel.read_noise_e,
        dsnu_e=pixel.fixed_dark_e,
        prnu=pixel.fixed_gain,
        column_gain_spread=pixel.column_gain_spread,
        exposure_s=float(exposure_s),
        engine=engine,
        defects=None if hot is None else np.argwhere(hot),
    )


def check_expected(expected: NDArray[np.floating], device: Device) -> None:
    """Raise `InputError` for a frame of another size than the device, or electrons that are negative or not finite."""
    if expected.shape != device.shape:
        raise InputError(
            f"expected_e: shape {expected.shape} is not the device's {device.shape}; "
            "draw the device with the frame's shape"
        )
    if not (expected.min() >= 0 and expected.max() < np.inf):  # false for NaN too
        row, column = (int(i) for i in np.argwhere(~(np.isfinite(expected) & (expected >= 0)))[0])
        raise InputError(
            f"expected_e: {expected[row, column]} at row {row}, column {column}; "
            "allowed: finite numbers >= 0; repair the radiance"
        )
