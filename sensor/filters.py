"""Filters of other cameras, made from a camera's own curves.

Complementary colours, broader or narrower ones, those of the CIE observer; W behind a neutral density; dyes that open
in the infrared, and the filter that keeps it out.

Assumptions, since no such sensor's curves are at hand. A complementary filter passes what two of the camera's primary
filters pass together: C = G + B, M = R + B, Y = R + G, so a matrix takes the three exactly back to R, G and B. A
neutral density passes the same share of every wavelength. Dyes of R, G and B are transparent in the near infrared, as
the responses in data sheets of sensors without an infrared filter show, where R, G and B meet the clear pixel by
about 800 nm; where theirs open, and where an infrared filter closes, are round numbers of this kind, of no product.
"""

from collections.abc import Mapping

import numpy as np
from scipy.special import expit

from render.illuminants import illuminant
from render.photometry import colour_matching_functions, photons_per_joule
from render.spectrum import DEFAULT_WAVELENGTH_NM, Floats, Spectrum, band_widths
from rodcone.errors import InputError, require_range
from sensor.curves import Responses

DYES_OPEN_NM, DYES_WIDTH_NM = 760.0, 12.0  # half open, and the logistic's width: 10 to 90 % within 53 nm
CUT_NM, CUT_WIDTH_NM = 660.0, 5.0  # half closed; 90 to 10 % within 22 nm, as interference filters do
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


def stretched(responses: Responses, factor: float) -> Responses:
    """Curves of R, G and B broader by a factor about their peaks, which stay; W as it is.

    Raises
    ------
    InputError
        Where R, G or B is missing, or the factor is outside 0.1 to 10.
    """
    _require(responses, "RGB")
    require_range("factor", factor, 0.1, 10.0, "give 2 for curves twice as broad")
    curves = dict(responses.curves)
    for letter in "RGB":
        nm, values = curves[letter].wavelength_nm, curves[letter].values
        peak = nm[np.argmax(values)]
        curves[letter] = Spectrum(nm, np.interp(peak + (nm - peak) / factor, nm, values, left=0.0, right=0.0))
    return Responses(curves)


def colorimetric(responses: Responses) -> Responses:
    """Curves of R, G and B in proportion to the CIE 1931 observer's x, y and z a joule, at their own peaks; W as it is.

    Such a camera meets the Luther condition: what looks alike to the observer reads alike, under any light.
    """
    _require(responses, "RGB")
    curves = dict(responses.curves)
    for letter, matching in zip("RGB", colour_matching_functions(), strict=True):
        per_photon = matching.values / matching.wavelength_nm
        peak = responses.curves[letter].values.max()
        curves[letter] = Spectrum(matching.wavelength_nm, peak * per_photon / per_photon.max())
    return Responses(curves)


def infrared_open(responses: Responses) -> Responses:
    """Curves of R, G and B whose dyes open in the near infrared and leave what silicon, W's curve, collects there.

    Raises
    ------
    InputError
        Where R, G, B or W is missing.
    """
    _require(responses, "RGBW")
    clear = responses.curves["W"]
    nm = clear.wavelength_nm
    opened = _logistic((nm - DYES_OPEN_NM) / DYES_WIDTH_NM)
    curves = dict(responses.curves)
    for letter in "RGB":
        own = np.interp(nm, curves[letter].wavelength_nm, curves[letter].values, left=0.0, right=0.0)
        curves[letter] = Spectrum(nm, own + (np.maximum(clear.values, own) - own) * opened)
    return Responses(curves)


def infrared_cut(wavelength_nm: Floats) -> Spectrum:
    """Transmittance of a filter that keeps the infrared out, to be used as `sensor.curves.read_csv`'s ``ir_cut``."""
    return Spectrum(wavelength_nm, _logistic((CUT_NM - wavelength_nm) / CUT_WIDTH_NM))


def as_csv(curves: Mapping[str, Spectrum], wavelength_nm: Floats) -> str:
    """Curves as `sensor.curves.read_csv` and `read_curve` read them: a row a wavelength, to six places."""
    columns = [np.interp(wavelength_nm, one.wavelength_nm, one.values, left=0.0, right=0.0) for one in curves.values()]
    rows = [",".join([f"{nm:g}", *(f"{x:.6f}" for x in row)]) for nm, *row in zip(wavelength_nm, *columns, strict=True)]
    return "\n".join([",".join(["wavelength_nm", *curves]), *rows, ""])


def _logistic(at: Floats) -> Floats:
    return np.asarray(expit(at))


def _sum(responses: Responses, letters: str) -> Spectrum:
    nm = np.unique(np.concatenate([responses.curves[letter].wavelength_nm for letter in letters]))
    parts = [responses.curves[letter] for letter in letters]
    return Spectrum(nm, sum(np.interp(nm, one.wavelength_nm, one.values, left=0.0, right=0.0) for one in parts))


def _require(responses: Responses, letters: str) -> None:
    missing = [letter for letter in letters if letter not in responses.curves]
    if missing:
        raise InputError(f"responses: no curve of {', '.join(missing)}; allowed: R, G, B and W; add it")
