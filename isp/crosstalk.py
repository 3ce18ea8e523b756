"""Removal of crosstalk: each pixel gets back the charge that went to its neighbours, before all other development.

A pixel loses the share c of its charge x to each of its four neighbours, and the samples are y = H x
(`sensor.readout.spread_charge`). H doesn't depend on the filters, because it acts on charges, whatever colour of light
brought them. At the frame's edge the charge stays, as if the frame continued as its mirror image. The waves of the
cosine transform (DCT-II) continue in the same way. Therefore they are the eigenvectors of H, with the eigenvalues

    h(k, l) = 1 - 2 c (2 - cos(pi k / height) - cos(pi l / width)),   k < height, l < width,

and x = H^-1 y is a division in that basis. What every later step reads is then what the pixels behind each filter
collected alone, so that colours, prior and matrix are those of a camera without crosstalk.
"""

import warnings
from dataclasses import replace
from math import hypot, pi, sqrt

import numpy as np
import scipy

from rodcone.types import Floats, Mosaic
from sensor.cfa import mask
from sensor.raw import RawImage, full_at_sites

# Largest crosstalk that is undone, which leaves at least a fifth of every wave. From 0.125 on some waves vanish.
MOST_UNDONE = 0.1
LEAST_COUNTED = 0.05  # a share of nine pixels below this is rounding, because one pixel is a ninth


def is_undone(crosstalk: float) -> bool:
    """Return whether development undoes this crosstalk."""
    return 0.0 < crosstalk <= MOST_UNDONE


def without_crosstalk(raw: RawImage, neutral: Floats) -> RawImage:
    """Return a raw image in which each pixel has the charge that it collected behind its own filter.

    A saturated sample stays as it is, and so does one that would become saturated. The charge that saturated pixels
    lost to their neighbours is estimated by `beyond_the_well`. In the noise profile, dark noise becomes that of the new
    samples, which is larger by a share of about 4 c. Shot noise and PRNU stay those of the old samples, because most of
    the added noise lies in the finest detail.

    Parameters
    ----------
    raw : RawImage
        Raw image, which is returned unchanged if it has no crosstalk or more than `MOST_UNDONE`.
    neutral : (channel,) float64
        The channels' readings of a neutral, in any unit.

    Warns
    -----
    UserWarning
        For more than `MOST_UNDONE`.
    """
    if not is_undone(raw.crosstalk):
        if raw.crosstalk:
            warnings.warn(
                f"crosstalk: {raw.crosstalk:g} isn't undone: edges look pale; allowed: {MOST_UNDONE:g} or less",
                UserWarning,
                stacklevel=3,
            )
        return raw
    density = np.ones(raw.shape)
    for noise in raw.channel_noise:
        density[mask(raw.cfa, noise.channel, raw.shape)] = noise.light_share
    charge_e = unspread_charge(beyond_the_well(raw, neutral) * density, raw.crosstalk) / density
    dn = charge_e / raw.gain_e_per_dn + raw.black_dn
    dn = np.where(raw.saturated | full_at_sites(raw, dn), raw.dn, dn)
    larger = float(np.sqrt(np.mean(left_of_waves(raw.shape, raw.crosstalk) ** -2)))  # factor on dark noise
    apart = (
        replace(noise, read_noise_e=larger * noise.read_noise_e, dsnu_e=larger * noise.dsnu_e)
        for noise in raw.channel_noise
    )
    read_noise_e = larger * hypot(raw.read_noise_e, sqrt(raw.rounding_e2))
    dsnu_e = larger * raw.dsnu_e
    return replace(raw, dn=dn, read_noise_e=read_noise_e, dsnu_e=dsnu_e, channel_noise=tuple(apart), crosstalk=0.0)  # type: ignore[arg-type]  # floats are allowed


def beyond_the_well(raw: RawImage, neutral: Floats) -> Mosaic:
    """Return a raw image's electrons, where saturated samples are raised to an estimate from their neighbours.

    The light there is assumed to be neutral. Its level is the mean, over the channels, of their unsaturated samples in
    3x3 pixels, each divided by its channel's reading of a neutral. A lower estimate doesn't count. Without this, the
    neighbours of a full W would keep the charge that came from W beyond its well.
    """
    electrons, full = raw.electrons, raw.saturated
    if not full.any():
        return electrons
    levels = np.zeros((len(neutral), *raw.shape))  # level of the neutral by each channel; 0 if it has no sample
    read = np.ones(raw.shape)
    for level, name, of_neutral in zip(levels, raw.channels, neutral, strict=True):
        sites = mask(raw.cfa, name, raw.shape)
        read[sites] = of_neutral
        counted = sites & ~full
        share = scipy.ndimage.uniform_filter(counted.astype(np.float64), 3, mode="mirror")
        total = scipy.ndimage.uniform_filter(np.where(counted, electrons / of_neutral, 0.0), 3, mode="mirror")
        np.divide(total, share, out=level, where=share > LEAST_COUNTED)
    light = np.sum(levels, axis=0) / np.maximum(np.sum(levels > 0, axis=0), 1)
    return np.where(full, np.maximum(electrons, light * read), electrons)


def unspread_charge(electrons: Mosaic, crosstalk: float) -> Mosaic:
    """Return the charges x that `sensor.readout.spread_charge` would spread to `electrons`, shape (h, w)."""
    waves = scipy.fft.dctn(electrons, type=2)
    waves /= left_of_waves(electrons.shape, crosstalk)
    return np.asarray(scipy.fft.idctn(waves, type=2, overwrite_x=True))


def left_of_waves(shape: tuple[int, ...], crosstalk: float) -> Floats:
    """Return h(k, l), the share of each wave's amplitude that crosstalk leaves, shape (h, w)."""
    down, across = (np.cos(pi * np.arange(side) / side) for side in shape)
    return np.asarray(1.0 - 2.0 * crosstalk * (2.0 - down[:, None] - across))
