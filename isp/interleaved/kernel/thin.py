"""The formula of `isp.interleaved.thin` in Dr.Jit: one thread per pixel, whose four channels form a packet."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.kernel.accumulate import larger
from isp.interleaved.kernel.edges import APART, TINY, at_site, channel_noise
from isp.settings import WhiteReading
from rodcone.device_arrays import divide, divisor, upload
from rodcone.jit import arrays, dr

# Difference between sample and plane, over the larger of the two, from which on the plane begins to follow, and follows
# fully. From 0.3 to 0.6, photographs lose 0.03 dB; bars in drawn house fronts gain 0.1 dB.
CONTRAST = 0.4, 0.7
# Noise gains from which on a plane's colour may be taken for noise, and fully. From 0 to 0.05, even surfaces have fewer
# clouds, and things are paler.
NOISY = 0.02, 0.1
# Squared ratio of light to a sample's noise from which on a colour isn't taken for noise. With 30, a chart by day loses
# 0.07 dB; without it, six pictures lose 0.1 dB.
DIM = 10.0


def follow_frame(white: WhiteReading, planes: NDArray[Any], noise_gain: NDArray[Any]) -> NDArray[np.float32]:
    """Move planes like `isp.interleaved.thin.follow_samples`."""
    jit = arrays()
    raw = white.raw
    (height, width), (down, across) = raw.shape, (len(raw.cfa), len(raw.cfa[0]))
    frame, noise_gains, share_planes = (upload(x) for x in (planes, noise_gain, white.window_shares))
    electrons = upload((raw.dn.astype(np.float32) - np.float32(raw.black_dn)) * np.float32(raw.gain_e_per_dn))
    cells = upload(np.array([[raw.channels.index(name) for name in line] for line in raw.cfa], np.uint32))
    shot, dark, full_e = (jit.Array4f([dr.opaque(jit.Float, float(x)) for x in row]) for row in channel_noise(raw))

    pixel = dr.arange(jit.UInt, height * width)
    row, column = divide(pixel, divisor(width))
    (tile_row, cell_row), (tile_column, cell_column) = (
        divide(line, divisor(size)) for line, size in ((row, down), (column, across))
    )
    site = dr.gather(jit.UInt, cells, cell_row * np.uint32(across) + cell_column)
    of_tile = tile_row * dr.opaque(jit.UInt, white.window_shares.shape[1]) + tile_column
    plane, gain, shares = (
        dr.gather(jit.Array4f, source, place)
        for source, place in ((frame, pixel), (noise_gains, pixel), (share_planes, of_tile))
    )
    sample = dr.gather(jit.Float, electrons, pixel)
    own, of_shot, of_dark = (at_site([*values], site) for values in (shares, shot, dark))

    # What W would read by the sample and by the planes, and the noise of the difference.
    value, of_planes = sample / own, plane / shares
    light = larger(larger(value, plane[3]), 0.0)
    of_means = gain * (shot * larger(plane, 0.0) + dark) / dr.square(shares)
    noise = larger((of_shot * light + of_dark / own) / own + of_means, TINY)
    difference = value - of_planes
    seen = larger(1.0 - APART * noise / larger(dr.square(difference), TINY), 0.0)
    contrast = dr.abs(difference) / larger(larger(of_planes, value), TINY)
    clear = dr.minimum(larger((contrast - CONTRAST[0]) / (CONTRAST[1] - CONTRAST[0]), 0.0), 1.0)
    moved = plane + gain * seen * clear * shares * difference

    # A colour that noise hides becomes that of the window.
    expected = shares * moved[3]
    away, light = moved - expected, larger(expected, 0.0)
    of_sample = shot * light + dark
    of_planes_noise = gain * of_sample
    of_colour = of_planes_noise + dr.square(shares) * of_planes_noise[3]
    dim = larger(1.0 - dr.square(light) / larger(DIM * of_sample, TINY), 0.0)
    hidden = dr.minimum(APART * of_colour / larger(dr.square(away), TINY), 1.0)
    noisy = dr.minimum(larger((gain - NOISY[0]) / (NOISY[1] - NOISY[0]), 0.0), 1.0)
    moved -= dim * noisy * hidden * away
    is_full = (sample >= at_site([*full_e], site)) | dr.any(plane >= full_e)
    result = dr.empty(jit.Float, planes.size)
    dr.scatter(result, dr.select(is_full, plane, moved), pixel, mode=dr.ReduceMode.NoConflicts)
    dr.eval(result)
    return np.asarray(result.numpy().reshape(planes.shape))
