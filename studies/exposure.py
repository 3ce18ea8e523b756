"""Choice of the exposure time from the expected signal, never from a noisy picture."""

import numpy as np

from render.errors import InputError, require_range
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.optics import SpectralIrradiance
from sensor.response import channel_electrons

PERCENTILE = 99.0
WELL_SHARE = 0.8
LONGEST_S = 0.066  # Parmar & Wandell 2009, Figure 5: 66 ms
RULE = "the 99th percentile of expected G at 80 % of the well, never longer than {longest:g} ms"


def auto_exposure_s(irradiance: SpectralIrradiance, sensor: SensorConfig, longest_s: float = LONGEST_S) -> float:
    """Exposure that puts the 99th percentile of expected green at 80 % of the well, at most `longest_s` [s].

    Raises
    ------
    InputError
        For a longest time that isn't positive, or a mosaic without G.
    """
    require_range("longest_s", longest_s, 1e-9, 1e7, "give seconds above 0")
    if "G" not in channels(sensor.cfa):
        raise InputError(f"cfa: {sensor.cfa!r} has no G; allowed: a mosaic with G; set the exposure yourself")
    per_second = channel_electrons(irradiance, sensor, 1.0)[..., channels(sensor.cfa).index("G")]
    bright = float(np.percentile(per_second, PERCENTILE))
    return min(longest_s, WELL_SHARE * sensor.pixel.full_well_e / bright) if bright > 0 else longest_s
