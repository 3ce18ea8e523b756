"""Filters of other cameras, made from a camera's own curves: complementary colours, and a neutral density on W.

Assumptions, since no such sensor's curves are at hand. A complementary filter passes what two of the camera's primary
filters pass together: C = G + B, M = R + B, Y = R + G, so a matrix takes the three exactly back to R, G and B. A
neutral density passes the same share of every wavelength.
"""

import numpy as np

from render.errors import InputError
from render.illuminants import illuminant
from render.photometry import photons_per_joule
from render.spectrum import DEFAULT_WAVELENGTH_NM, Spectrum, band_widths
from sensor.curves import Responses

COMPLEMENTS = {"C": "GB", "M": "RB", "Y": "RG"}


def complementary(responses: Responses) -> Responses:
    """Curves of C, M, Y, and W where `responses` holds it.

    Raises
    ------
    InputError
        Where R, G or B is missing, or two of them add up to more than one electron a photon.
    """
    _require(responses, "RGB")
    curves = {letter: _sum(responses, pair) for letter, pair in COMPLEMENTS.items()}
    return Responses({**curves, **{letter: responses.curves[letter] for letter in "W" if letter in responses.curves}})


def matched_transmittance(responses: Responses) -> float:
    """Transmittance of the neutral density with which W collects what G does from a neutral under D65.

    Raises
    ------
    InputError
        Where G or W is missing, or W collects less than G.
    """
    _require(responses, "GW")
    nm = DEFAULT_WAVELENGTH_NM
    width = band_widths(nm)
    photons = illuminant("D65").band_average(nm, width) * photons_per_joule(nm) * width
    green, white = responses.band_average(("G", "W"), nm, width) @ photons
    if not 0 < green <= white:
        raise InputError(
            f"responses: W collects {white:g} where G does {green:g}; allowed: W more than G; correct a curve"
        )
    return float(green / white)


def neutral_density(responses: Responses) -> Responses:
    """Curves with W behind the neutral density of `matched_transmittance`; the other letters stay as they are."""
    return Responses({**responses.curves, "W": responses.curves["W"] * matched_transmittance(responses)})


def _sum(responses: Responses, letters: str) -> Spectrum:
    nm = np.unique(np.concatenate([responses.curves[letter].wavelength_nm for letter in letters]))
    parts = [responses.curves[letter] for letter in letters]
    return Spectrum(nm, sum(np.interp(nm, one.wavelength_nm, one.values, left=0.0, right=0.0) for one in parts))


def _require(responses: Responses, letters: str) -> None:
    missing = [letter for letter in letters if letter not in responses.curves]
    if missing:
        raise InputError(f"responses: no curve of {', '.join(missing)}; allowed: R, G, B and W; add it")
