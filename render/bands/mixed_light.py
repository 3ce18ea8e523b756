"""Conversion of several lamps' light to light of one spectrum, which `render.band_weights` needs.

A picture is the sum of its light groups, but the weights of bands follow one spectrum. If the groups' spectra differ,
all are referred to the spectrum of their mixture: each group's light is redistributed among neighbouring bands, so that
its integrals over smooth curves, taken with the mixture's spectrum, equal those with its own spectrum. This is linear
in the transport, so it costs a few more additions in relighting and nothing afterwards. A lamp of few lines is treated
in the same way: the dark bands beside a line say how surfaces reflect at the line, and that goes into the line's band.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from render.band_weights import LEAST_LIGHT, MOST_NOISE, NARROW_NM, band_weights, of_few_lines, transport_weights
from render.combine import emission
from render.scene import LightGroup
from render.spectrum import LUMINOUS_EFFICACY_LM_W, Spectrum, observer_weights
from rodcone.types import Floats

_ALIKE = 1e-9  # largest difference of two spectra that count as one, over their largest value
_LEAST_SINGULAR = 1e-2  # share of the largest singular value; curves as wide as a band don't resolve smaller ones
_LEAST_SHARE = 1e-5  # share of the brightest band's light; smaller amounts aren't moved into another band


@dataclass(frozen=True)
class BandLight:
    """Emission of light groups in bands, referred to one spectrum.

    Attributes
    ----------
    spectrum : Spectrum or None
        Spectrum that all lights share, or that of their mixture, up to a factor. It is None if nothing shines, and for
        different spectra in bands so narrow that the spectrum within them doesn't matter.
    maps : (group, band, band) float64
        Matrix from each group's transport to its part of the picture's bands; diagonal for lights of one spectrum.
    emitted : (group, band) float64
        Band means of each group's emission.
    mixed : bool
        Whether the maps aren't diagonal.
    """

    spectrum: Spectrum | None
    maps: Floats
    emitted: Floats
    mixed: bool

    def __mul__(self, factor: float) -> "BandLight":
        """Return the light times a number."""
        return BandLight(self.spectrum, self.maps * factor, self.emitted * factor, self.mixed)

    def luminance_weights(self, wavelength_nm: Floats, width_nm: Floats) -> Floats:
        """Compute the luminance of a transport of 1 in each group and band, shape (group, band)."""
        luminous = LUMINOUS_EFFICACY_LM_W * observer_weights(wavelength_nm, width_nm, self.spectrum)[1]
        return np.asarray(luminous @ self.maps)


def band_light(
    lights: Mapping[str, LightGroup], transport: Floats, wavelength_nm: Floats, width_nm: Floats
) -> BandLight:
    """Refer the light of several groups to one spectrum.

    Parameters
    ----------
    lights : mapping of str to LightGroup
    transport : (group,) float64
        Mean radiance of each group over the picture at unit emission, which weights the group in the mixture.
    wavelength_nm, width_nm : (band,) float64
    """
    emitted = emission(lights, wavelength_nm, width_nm)
    maps = emitted[:, :, None] * np.eye(wavelength_nm.size)
    groups = list(lights.values())
    shares = emitted.sum(axis=1) * transport
    shining = [index for index in range(len(groups)) if emitted[index].any()]
    if not shining:
        return BandLight(None, maps, emitted, mixed=False)
    spectra = [groups[index].spectrum for index in shining]
    alike = all(_alike(spectra[0], other) for other in spectra[1:])
    lit = (emitted > LEAST_LIGHT * emitted.max(axis=1, keepdims=True))[shining].any(axis=0)
    narrow = width_nm[lit].max() <= NARROW_NM  # bands within which lamps and surfaces don't differ
    if narrow or (alike and not of_few_lines(emitted[shining[0]] * width_nm)):
        return BandLight(spectra[0] if alike else None, maps, emitted, mixed=False)
    powers = [groups[index].power * (transport[index] if shares.any() else 1.0) for index in shining]
    mixture = spectra[0] if alike else _mixture(spectra, powers)

    # Integrals over bell curves as wide as a band: `of_mixture` of the mixture's light, with 1 in each band in turn,
    # and `own` of a lamp's light, with a transport of 1 in each band in turn. The noise that this amplifies is bounded
    # here only for lamps of few lines, whose transport at a line comes from the bands beside it. For others it is
    # bounded where the wider curves of a camera's channels are summed.
    edges = wavelength_nm[0] - width_nm[0] / 2, wavelength_nm[-1] + width_nm[-1] / 2
    centres = np.linspace(*edges, 2 * wavelength_nm.size + 1)
    wide = float(width_nm.max())

    def bells(nm: Floats) -> Floats:
        return np.exp(-(((nm - centres[:, None]) / wide) ** 2) / 2)

    of_mixture = band_weights(bells, np.zeros(0), wavelength_nm, width_nm, mixture, np.inf)[:, lit] / width_nm[lit]
    left, values, right = np.linalg.svd(of_mixture, full_matrices=False)
    inverse = (right.T * (values / (values**2 + (_LEAST_SINGULAR * values[0]) ** 2))) @ left.T
    for index, spectrum in zip(shining, spectra, strict=True):
        energy = (emitted[index] * width_nm)[lit]
        most_noise = MOST_NOISE if of_few_lines(emitted[index] * width_nm) else np.inf
        own, _ = transport_weights(bells, np.zeros(0), wavelength_nm, width_nm, spectrum, most_noise)
        moved = inverse @ (groups[index].power * own - of_mixture @ (np.eye(wavelength_nm.size)[lit] * energy[:, None]))
        moved[np.abs(moved) < _LEAST_SHARE * energy.max()] = 0.0
        maps[index][lit] += moved / width_nm[lit, None]
    return BandLight(mixture, maps, emitted, mixed=True)


def _alike(one: Spectrum, other: Spectrum) -> bool:
    """Return whether two spectra differ only by a factor."""
    if not np.array_equal(one.wavelength_nm, other.wavelength_nm):
        return False
    return bool(np.allclose(one.values * other.values.max(), other.values * one.values.max(), rtol=0.0,
                            atol=_ALIKE * one.values.max() * other.values.max()))  # fmt: skip


def _mixture(spectra: list[Spectrum], powers: list[float]) -> Spectrum:
    nm = np.unique(np.concatenate([spectrum.wavelength_nm for spectrum in spectra]))
    values = [
        power * np.interp(nm, spectrum.wavelength_nm, spectrum.values, left=0.0, right=0.0)
        for spectrum, power in zip(spectra, powers, strict=True)
    ]
    return Spectrum(nm, np.sum(values, axis=0))
