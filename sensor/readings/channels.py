"""Join channels that are read apart into one raw image, in electrons of the whole light and time."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensor.calibration import ChannelNoise
from sensor.cfa import mask
from sensor.raw import RawImage
from sensor.readings.resolve import PlainReading


def join(readings: Sequence[PlainReading], raws: Sequence[RawImage]) -> RawImage:
    """Join frames, each at the sites that its reading covers; the first frame is on the converter's own scale.

    The samples are floats on the scale of the first frame. They are whole numbers except for channels with a time,
    density or gain of their own.
    """
    plain = raws[0]
    dn: NDArray[Any] = plain.dn.astype(np.float32)
    noise = []
    for reading, raw in zip(readings[1:], raws[1:], strict=True):
        share = reading.share
        channel = str(reading.sites)
        at = mask(plain.cfa, channel, plain.shape)
        dn[at] = raw.electrons[at] / share / plain.gain_e_per_dn + plain.black_dn
        noise.append(
            ChannelNoise(
                channel=channel,
                full_well_e=raw.full_well_e / share,
                shot=1 / share,
                read_noise_e=hypot(raw.read_noise_e, sqrt(raw.rounding_e2)) / share,
                dsnu_e=raw.dsnu_e / share,
                prnu=raw.prnu,
                dark_current_e=raw.dark_current_e / share,
                light_share=reading.light_share,
            )
        )
    read_noise_e = hypot(plain.read_noise_e, sqrt(plain.rounding_e2))
    return replace(plain, dn=dn, read_noise_e=read_noise_e, channel_noise=tuple(noise))
