"""Merge several readings of every pixel into one linear raw image (docs/decisions/0047-several-readings.md)."""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, hypot

import numpy as np

from sensor.config import BLACK_SIGMAS
from sensor.raw import RawImage
from sensor.readings.best_estimate import collected_share, merged_electrons, merged_noise_steps, seams, shares
from sensor.readings.resolve import PlainReading

# The merged image has linear words of 24 bits, as chips that merge write them; single precision holds each exactly.
# Over 256, black and white are whole numbers of 16 bits, in which a digital negative states them.
MERGED_WHITE_DN = 256 * 65_535


def merge(readings: Sequence[PlainReading], raws: Sequence[RawImage]) -> RawImage:
    """Merge all readings of one exposure.

    The raw image's electrons are those of all charges together, so that its shot noise is Poisson's as long as none is
    full. Beyond each seam `RawImage.noise_steps` states the noise of the readings that remain. The exposure time is the
    one in which the whole pixel would collect as many electrons: the whole exposure times `collected_share`.

    Parameters
    ----------
    readings : sequence of PlainReading
    raws : sequence of RawImage
        Raw image of each reading.
    """
    pixel, exposure_s = readings[0].pixel, readings[0].exposure_s
    whole = collected_share(readings)
    last = seams(readings).order[-1]
    dark_current_e = pixel.dark_current_e_per_s * exposure_s
    estimates_e = [raw.electrons / share for raw, share in zip(raws, shares(readings), strict=True)]
    electrons = merged_electrons(np.stack(estimates_e), readings) * whole
    base, *steps = merged_noise_steps(readings)

    full_e = max(pixel.full_well_e - dark_current_e, 1.0) * whole
    dark_e = BLACK_SIGMAS * hypot(base.read_noise_e, base.dsnu_e)
    black_dn = 256 * ceil(65_535 * dark_e / (full_e + dark_e))
    gain_e = full_e / (MERGED_WHITE_DN - black_dn)
    electrons = np.where(raws[last].saturated, full_e, np.minimum(electrons, full_e))
    hot = [raw.defects for raw in raws if raw.defects is not None]
    return replace(
        raws[0],
        dn=(electrons / gain_e + black_dn).astype(np.float32),
        black_dn=black_dn,
        white_dn=MERGED_WHITE_DN,
        gain_e_per_dn=gain_e,
        read_noise_e=base.read_noise_e,
        dsnu_e=base.dsnu_e,
        prnu=base.prnu,
        exposure_s=whole * exposure_s,
        defects=np.concatenate(hot) if hot else None,
        noise_steps=tuple(steps),
        dark_current_e=min(dark_current_e, pixel.full_well_e) * whole,
    )
