"""Spectral responses of colour channels: electrons per photon at the pixel, quantum efficiency included."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from render.errors import InputError, unknown
from render.spectrum import Floats, Spectrum

# Smooth curves of the project's own: peak * exp(-|(nm - centre) / width|^power), another width and power on each side.
# Peaks and centres are those of ISETCam's interleaved RGBW sensor; widths and powers were fitted so that electrons per
# band (equal energy and D65, 380-780 nm; D65, 400-700 nm) agree with it within 0.2 %.
_RGBW_PARAMETERS = {  # peak, centre [nm], left width [nm], left power, right width [nm], right power
    "R": (0.560, 592.0, 17.795, 1.286, 41.939, 1.748),
    "G": (0.678, 540.0, 49.065, 1.712, 48.684, 2.571),
    "B": (0.415, 476.0, 44.227, 1.846, 32.167, 1.348),
    "W": (1.000, 620.0, 225.131, 1.955, 225.536, 2.052),
}


@dataclass(frozen=True)
class Responses:
    """Response of each channel letter.

    Attributes
    ----------
    curves : mapping of str to Spectrum
        Electrons per photon (0 to 1) over wavelength.
    """

    curves: Mapping[str, Spectrum]

    def __post_init__(self) -> None:
        for letter, curve in self.curves.items():
            if curve.values.max() > 1.0:
                raise InputError(
                    f"responses: {letter} reaches {curve.values.max():g} electrons a photon; allowed: 0 to 1; "
                    "divide per cent by 100"
                )
        object.__setattr__(self, "curves", MappingProxyType(dict(self.curves)))

    def band_average(self, letters: tuple[str, ...], wavelength_nm: ArrayLike, width_nm: ArrayLike) -> Floats:
        """Mean response in each band, shape (letter, band).

        Raises
        ------
        InputError
            Where a letter has no curve.
        """
        for letter in letters:
            if letter not in self.curves:
                raise unknown("responses: letter", letter, self.curves)
        return np.array([self.curves[letter].band_average(wavelength_nm, width_nm) for letter in letters])


@cache
def rgbw() -> Responses:
    """Response of R, G, B and W over 380-1068 nm, the project's own curves (Parmar & Wandell 2009, Figure 2)."""
    nm = np.arange(380.0, 1069.0)
    curves = {}
    for letter, (peak, centre, left, left_power, right, right_power) in _RGBW_PARAMETERS.items():
        distance = np.abs(nm - centre)
        falls = np.where(nm < centre, (distance / left) ** left_power, (distance / right) ** right_power)
        curves[letter] = Spectrum(nm, peak * np.exp(-falls))
    return Responses(curves)


def read_csv(path: str | Path) -> Responses:
    """Read measured responses: a header ``wavelength_nm,R,G,...`` and one row a wavelength, electrons per photon.

    Raises
    ------
    InputError
        For a missing file, a header without ``wavelength_nm``, a cell that is no number, or a response outside 0..1.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            header, *rows = [row for row in csv.reader(file) if row]
        table = np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64)
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(
            f"responses: {str(path)!r} can't be read ({error}); give a CSV of numbers with a header"
        ) from error
    names = [name.strip() for name in header]
    if (
        names[0] != "wavelength_nm"
        or table.ndim != 2
        or table.shape[1] != len(names)
        or len(names) < 2
        or len(set(names)) != len(names)
    ):
        raise InputError(
            f"responses: {str(path)!r} has header {names}; allowed: wavelength_nm and one letter a column; add it"
        )
    return Responses({letter: Spectrum(table[:, 0], table[:, i + 1]) for i, letter in enumerate(names[1:])})
