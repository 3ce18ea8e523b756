"""Light spectra by name, each scaled to a luminance of 1 cd/m^2 (1 lux for an irradiance)."""

from functools import cache

import numpy as np

from render.errors import unknown
from render.photometry import luminance
from render.spectrum import Spectrum, black_body, flat
from render.tables import colour_science

# CIE 015:2018 tables as colour-science holds them; F11 stands for narrow-band fluorescent lamps.
_TABULATED = {"A": "A", "D50": "D50", "D55": "D55", "D65": "D65", "D75": "D75", "F2": "FL2", "F11": "FL11"}
MOONLIGHT_K = 4200.0  # sunlight reddened by the lunar albedo looks like 4100-4200 K (Kieffer & Stone 2005)


def names() -> tuple[str, ...]:
    """Names that `illuminant` knows."""
    return (*sorted(_TABULATED), "E", "moonlight")


@cache
def illuminant(name: str) -> Spectrum:
    """Spectrum of a named light with a luminance of 1 cd/m^2.

    Raises
    ------
    InputError
        Where `name` is unknown.
    """
    if name not in names():
        raise unknown("illuminant", name, names())
    if name == "E":
        return unit_luminance(flat())
    if name == "moonlight":
        return unit_luminance(black_body(MOONLIGHT_K))
    table = colour_science().SDS_ILLUMINANTS[_TABULATED[name]]
    return unit_luminance(Spectrum(table.wavelengths, table.values))


def unit_luminance(spectrum: Spectrum) -> Spectrum:
    """Scale a spectrum so that its luminance, summed in 1 nm bands over 360-830 nm, is 1."""
    nm = np.arange(360.5, 830.0)
    width = np.ones_like(nm)
    return spectrum * (1.0 / float(luminance(spectrum.band_average(nm, width), nm, width)))
