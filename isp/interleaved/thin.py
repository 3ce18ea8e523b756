"""Planes that average few samples: light of which a channel has none, and noise that stands for a colour.

A bar on a column of R and B is on no site of G and W. Their planes are means of the samples that resemble the bar most,
and those are as dark as what lies around, so that a grey bar becomes pink (docs/decisions/0066-bars-of-a-pixel.md).
"""

import numpy as np
from numpy.typing import NDArray

from isp.interleaved.kernel.edges import APART, TINY, channel_noise
from isp.interleaved.kernel.thin import CONTRAST, DIM, NOISY, follow_frame
from isp.interleaved.panchromatic import at_pixels
from isp.settings import WhiteReading
from rodcone.jit import backend
from sensor.cfa import mask


def follow_samples(
    white: WhiteReading, planes: NDArray[np.floating], noise_gain: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Move planes to the light of each pixel's own sample, where they average no sample of such light.

    Let S be the sample of a pixel, of channel o, P the planes, G their noise gains, and u the shares of the window
    (`.panchromatic`). W would read v = S / u_o by the sample, and w_c = P_c / u_c by a plane. With k the variance of
    shot noise per electron and s the dark noise, the difference d_c = v - w_c has the variance

        N_c = (k_o max(v, P_W, 0) + s_o^2 / u_o) / u_o + G_c (k_c max(P_c, 0) + s_c^2) / u_c^2.

    A plane that averages many samples knows its light, and has a small G. Therefore the result is

        P'_c = P_c + G_c max(0, 1 - 9 N_c / d_c^2) min(1, max(0, |d_c| / max(v, w_c) - 0.4) / 0.3) u_c d_c.

    The last factor keeps colours that change within the window of u. In the dark, planes of few samples have the colour
    of their noise. Let a_c = P'_c - u_c P'_W be their difference from the window's colour, L_c = max(0, u_c P'_W),
    M_c = k_c L_c + s_c^2 the variance of a sample, and V_c = G_c M_c + u_c^2 G_W M_W that of a_c. If noise explains the
    difference, the window's colour takes its place (docs/decisions/0070-noise-beside-lamps.md):

        P''_c = P'_c - max(0, 1 - L_c^2 / (10 M_c)) q_c min(1, 9 V_c / a_c^2) a_c.

    The first factor is 0 in good light, where a single sample shows a colour. q_c rises from 0 to 1 where G_c rises
    from 0.02 to 0.1, because a plane that averages more than 50 samples has little noise. Where the sample or a plane
    is full, there may be more light than was read, and planes stay.

    Parameters
    ----------
    white : WhiteReading
        The frame, and the shares u.
    planes, noise_gain : (h, w, 4) float
        R, G, B and W [e-], and noise gains, of `isp.interleaved.reconstruction.reconstruct_with_noise`.

    Returns
    -------
    (h, w, 4) float32
        P'' [e-].
    """
    raw = white.raw
    if backend() != "numpy":
        single = [np.ascontiguousarray(values, dtype=np.float32) for values in (planes, noise_gain)]
        return follow_frame(white, single[0], single[1])
    shot, dark, full_e = channel_noise(raw)
    site = np.argmax([mask(raw.cfa, name, raw.shape) for name in raw.channels], axis=0)[..., None]
    shares = at_pixels(white.window_shares, raw).astype(np.float64)
    own = np.take_along_axis(shares, site, axis=2)
    sample = raw.electrons[..., None]
    value, of_planes = sample / own, planes / shares
    light = np.maximum(np.maximum(value, planes[..., 3:]), 0.0)
    of_means = noise_gain * (shot * np.maximum(planes, 0.0) + dark) / shares**2
    noise = np.maximum((shot[site] * light + dark[site] / own) / own + of_means, TINY)
    difference = value - of_planes
    seen = np.maximum(1.0 - APART * noise / np.maximum(difference**2, TINY), 0.0)
    contrast = np.abs(difference) / np.maximum(np.maximum(value, of_planes), TINY)
    clear = np.clip((contrast - CONTRAST[0]) / np.ptp(CONTRAST), 0.0, 1.0)
    moved = planes + noise_gain * seen * clear * shares * difference

    # A colour that noise hides becomes that of the window.
    expected = shares * moved[..., 3:]
    light, away = np.maximum(expected, 0.0), moved - expected
    of_sample = shot * light + dark
    of_colour = noise_gain * of_sample + shares**2 * (noise_gain * of_sample)[..., 3:]
    dim = np.maximum(1.0 - light**2 / np.maximum(DIM * of_sample, TINY), 0.0)
    hidden = np.minimum(APART * of_colour / np.maximum(away**2, TINY), 1.0)
    noisy = np.clip((noise_gain - NOISY[0]) / np.ptp(NOISY), 0.0, 1.0)
    moved = moved - dim * noisy * hidden * away
    is_full = (sample >= full_e[site]) | (planes >= full_e).any(axis=2, keepdims=True)
    return np.where(is_full, planes, moved).astype(np.float32)
