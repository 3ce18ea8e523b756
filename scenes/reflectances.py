"""Spectral reflectances: the ColorChecker, and smooth curves for everything else."""

from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np

from render.spectrum import Spectrum, published_spectra
from rodcone.curve_file import read_columns
from rodcone.errors import InputError, in_place
from rodcone.types import Floats

LONGEST_NM = 1100.0  # longest wavelength at which lights are known (`render.spectrum.flat`), beyond any response here
_NM = np.arange(380.0, 781.0, 5.0)  # the chart's own grid: one grid for all materials keeps scenes quick to compile


@cache
def color_checker_reflectances() -> tuple[tuple[str, Spectrum], ...]:
    """Return the name and reflectance of each of the 24 patches, row by row, 380-780 nm (Ohta 1997)."""
    tables = published_spectra("color_checker")
    return tuple((name, Spectrum(nm, np.clip(values, 0, 1))) for name, (nm, values) in tables.items())


def read_reflectances(path: str | Path) -> tuple[tuple[str, Spectrum], ...]:
    """Read the name and reflectance of each column of a CSV, except the first one, ``wavelength_nm``.

    Raises
    ------
    InputError
        For a file that isn't such a CSV, or values outside 0 to 1.
    """
    columns = read_columns(path, "chart")
    nm = columns.pop("wavelength_nm")
    for name, values in columns.items():
        if not ((values >= 0) & (values <= 1)).all():
            raise InputError(
                f"chart: {str(path)!r}: {name} has values of {values.min():g} to {values.max():g}; allowed: "
                "reflectances from 0 to 1; divide per cent by 100"
            )
    with in_place(f"chart: {str(path)!r}"):
        return tuple((name, Spectrum(nm, values)) for name, values in columns.items())


def held(curve: Spectrum) -> Spectrum:
    """Continue a curve to 1100 nm at its last value, in its own steps; this is an assumption, not a measurement."""
    step = curve.wavelength_nm[-1] - curve.wavelength_nm[-2]
    beyond = np.arange(curve.wavelength_nm[-1] + step, LONGEST_NM + step / 2, step)
    values = np.concatenate([curve.values, np.full(beyond.shape, curve.values[-1])])
    return Spectrum(np.concatenate([curve.wavelength_nm, beyond]), values)


def grey(reflectance: Annotated[float, (0.0, 1.0, "give a share of the light")]) -> Spectrum:
    """Return the same reflectance, 0 to 1, at every wavelength.

    Examples
    --------
    >>> import rodcone
    >>> set(rodcone.grey(0.18).values.tolist())
    {0.18}
    """
    return Spectrum(_NM, np.full_like(_NM, reflectance))


def edge(centre_nm: float, width_nm: float, low: float, high: float) -> Spectrum:
    """Return a reflectance that rises smoothly from `low` to `high` around `centre_nm`: yellows, oranges, reds."""
    return Spectrum(_NM, low + (high - low) / (1 + np.exp(-(_NM - centre_nm) / width_nm)))


def band(centre_nm: float, width_nm: float, low: float, high: float) -> Spectrum:
    """Return a reflectance with one Gaussian bump of standard deviation `width_nm`: greens, blues."""
    return Spectrum(_NM, low + (high - low) * np.exp(-0.5 * ((_NM - centre_nm) / width_nm) ** 2))


def resampled(wavelength_nm: Floats, values: Floats) -> Spectrum:
    """Resample a measured curve to the common grid; outside its range its end values are kept."""
    return Spectrum(_NM, np.interp(_NM, wavelength_nm, values))
