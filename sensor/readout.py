"""From expected photo-electrons to digital numbers: every noise source, in physical order."""

import numpy as np
from numpy.typing import NDArray

from render.errors import InputError, require_range
from sensor.config import SensorConfig
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
    _check(expected, device)
    pixel, key = sensor.pixel, draw_key(rng)

    mean_e = expected * device.photo_response  # PRNU scales the mean: after the draw the variance would be wrong
    mean_e += pixel.dark_current_e_per_s * exposure_s  # PRNU is photo-response only
    # Poisson far above the well is the well with certainty; the bound keeps the draw inside 64-bit integers.
    collected_e = poisson(key, Term.SHOT, np.minimum(mean_e, 2 * pixel.full_well_e + 1e4)).astype(np.float64)
    np.minimum(collected_e, pixel.full_well_e, out=collected_e)
    collected_e += device.dark_offset_e
    if pixel.read_noise_e:
        collected_e += pixel.read_noise_e * normals(key, Term.READ, expected.shape)
    dn = np.rint(collected_e / sensor.gain_e_per_dn + sensor.black_dn)
    return RawImage(
        dn=np.clip(dn, 0, sensor.white_dn).astype(np.uint16),
        cfa=sensor.cfa,
        black_dn=sensor.black_dn,
        white_dn=sensor.white_dn,
        gain_e_per_dn=sensor.gain_e_per_dn,
        read_noise_e=pixel.read_noise_e,
        dsnu_e=pixel.dsnu_e,
        prnu=pixel.prnu,
        exposure_s=float(exposure_s),
    )


def _check(expected: NDArray[np.float64], device: Device) -> None:
    if expected.shape != device.shape:
        raise InputError(
            f"expected_e: shape {expected.shape} is not the device's {device.shape}; "
            "draw the device with the frame's shape"
        )
    bad = ~(np.isfinite(expected) & (expected >= 0))
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise InputError(
            f"expected_e: {expected[row, column]} at row {row}, column {column}; "
            "allowed: finite numbers >= 0; repair the radiance"
        )
