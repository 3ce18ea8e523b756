"""Radiance under a known lamp, converted to transport, so that a file's light follows the lamp to its lines.

A file of another program, or of a spectrometer, holds the mean of the light in each band. Which share of it lies at a
lamp's lines depends on how surfaces vary within the band, which `render.band_weights` estimates from all bands at once.
It is kept in bands of at most 10 nm: in bands of 20 nm electrons of chart patches would be up to 2 % off under F11 and
the weights would raise noise by up to 29 %; in bands of 10 nm they are within 0.2 % and 5 % (`benchmarks/bands.py`).
"""

import warnings

import numpy as np

from render.band_weights import of_few_lines, transport_of_light
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from rodcone.types import Floats

WIDEST_NM = 10.0  # largest width of the bands in which transport is kept
MOST_UNEXPLAINED = 1e-3  # share of a picture's light in bands that its lamp leaves dark; with more it is another lamp


class OtherLampWarning(UserWarning):
    """Warning that a picture holds light at wavelengths where the named lamp gives none."""


def over_lamp(radiance: SpectralRadiance, lamp: Spectrum) -> SpectralRadiance | None:
    """Convert radiance to the transport that gives this radiance under a lamp.

    Return None if the lamp can't be behind the picture, or if its spectrum is constant, so that there are no lines to
    follow.

    Parameters
    ----------
    radiance : SpectralRadiance
        If it states its lamp itself, as a relit picture does, its values are products of band means. Otherwise they are
        true means of the light in each band.
    lamp : Spectrum

    Warns
    -----
    OtherLampWarning
        Where the lamp leaves bands dark in which there is light.
    """
    if np.ptp(lamp.values) == 0:
        return None
    nm, width = radiance.wavelength_nm, radiance.widths_nm
    emitted = lamp.band_average(nm, width)
    light = np.array([radiance.values[:, :, band].mean(dtype=np.float64) for band in range(nm.size)]) * width
    unexplained = np.where(emitted > 0, 0.0, light)
    if not emitted.any() or unexplained.sum() > MOST_UNEXPLAINED * light.sum():
        warnings.warn(
            f"the lamp gives nothing at {nm[unexplained.argmax()]:g} nm, where the picture holds "
            f"{unexplained.max() / light.sum():.1%} of its light, so that it isn't taken for the picture's lamp",
            OtherLampWarning,
            stacklevel=2,
        )
        return None
    if radiance.light is not None and not of_few_lines(emitted * width):
        finer, widths = nm, width
        weights = np.diag(np.divide(1.0, emitted, out=np.zeros_like(emitted), where=emitted > 0))
    else:
        finer, widths = _finer(nm, width)
        weights = transport_of_light(nm, width, lamp, finer, widths)
    planes = np.moveaxis(radiance.values, -1, 0)
    made = np.tensordot(weights.astype(np.float32), planes.astype(np.float32, copy=False), 1)
    np.maximum(made, np.float32(0), out=made)
    return SpectralRadiance(
        np.moveaxis(made, 0, -1),
        finer,
        radiance.relative_mc_error,
        width_nm=widths,
        horizontal_view_deg=radiance.horizontal_view_deg,
    )


def _finer(nm: Floats, width_nm: Floats) -> tuple[Floats, Floats]:
    """Split bands into equal parts of at most `WIDEST_NM`; return their centres and widths."""
    parts = np.ceil(width_nm / WIDEST_NM - 1e-9).astype(np.intp)
    widths = np.repeat(width_nm / parts, parts)
    place = np.concatenate([np.arange(count) + 0.5 for count in parts])
    return np.repeat(nm - width_nm / 2, parts) + place * widths, widths
