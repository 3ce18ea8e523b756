"""Channel names and attributes of spectral OpenEXR files.

The layout is that of Fichet, Pacanowski and Wilkie, "An OpenEXR Layout for Spectral Images", Journal of Computer
Graphics Techniques 10(3), 2021: one channel a wavelength, ``S0.<number>nm`` with a decimal comma for radiance, ``S1``
to ``S3`` for the rest of the Stokes vector, ``T`` for reflectance. What the layout has no place for stands in
attributes whose names begin with ``rodcone``.
"""

import re
import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from render.radiance_files.file_checks import bands_between
from render.spectrum import band_widths
from rodcone.errors import InputError, require_range
from rodcone.types import Floats

VERSION = "1.0"
LAYOUT_UNITS = "W.m^-2.sr^-1"  # what the layout prescribes, though its values are spectral: per nm
TRUE_UNITS = "W.m^-2.sr^-1.nm^-1"
UNITS, OWN_UNITS, BANDS = "emissiveUnits", "rodconeUnits", "rodconeBands_nm"
_MEASUREMENT = ("lensTransmission", "cameraResponse")  # of the camera that took the picture, which rodcone doesn't undo
_SPECTRAL = re.compile(r"(S[0-3]|T)\.([0-9]*,?[0-9]*(?:[Ee][+-]?[0-9]+)?)(\w{,2}(?:m|Hz)(?:\..*)?)")


def channel_name(wavelength_nm: float) -> str:
    """Name of a radiance channel; of fixed width, so that the alphabet orders channels by wavelength."""
    require_range("wavelength_nm", wavelength_nm, 1.0, 9999.0, "OpenEXR channel names hold 1 to 9999 nm")
    number = f"{wavelength_nm:011.6f}".replace(".", ",")
    return f"S0.{number}nm"


def radiance_channels(names: Iterable[str]) -> dict[str, float]:
    """Wavelength [nm] of each S0 channel, in the order of wavelength; S1 to S3 and other channels are left out.

    Raises
    ------
    InputError
        Where there is none, where two have the same wavelength, or where the picture has reflectance channels, which
        need a light before there is radiance.
    """
    names = list(names)
    matches = {name: match for name in names if (match := _SPECTRAL.fullmatch(name))}
    kinds = {match[1] for match in matches.values()}
    if "T" in kinds:
        raise InputError(
            "it holds reflectances (T channels); allowed: radiance (S0 channels); light it, then save that"
        )
    nm = {name: _to_nm(name, match) for name, match in matches.items() if match[1] == "S0"}
    if not nm:
        shown = ", ".join(sorted(names)[:8]) + (", ..." if len(names) > 8 else "")
        raise InputError(f"it has the channels {shown}; allowed: spectral ones such as S0.550,0nm; save it as spectral")
    ordered = dict(sorted(nm.items(), key=lambda item: item[1]))
    if len(set(ordered.values())) < len(ordered):
        raise InputError(f"two of the channels {', '.join(ordered)} have one wavelength; allowed: one each; remove one")
    return ordered


def _to_nm(name: str, match: re.Match[str]) -> float:
    """Wavelength of a channel from its number; the layout's other units are refused."""
    _, number, unit = match.groups()
    try:
        nm = float(number.replace(",", "."))
    except ValueError:
        nm = np.nan
    if unit != "nm" or not 0 < nm < np.inf:
        raise InputError(f"channel {name!r} has no wavelength in nm; allowed: names such as S0.550,0nm; rename it")
    return nm


def write_bands(wavelength_nm: Floats, width_nm: Floats) -> str:
    """Centres and widths as text that reads back to the same float64."""
    return ";".join(f"{c!r}:{w!r}" for c, w in zip(wavelength_nm.tolist(), width_nm.tolist(), strict=True))


def read_bands(channels: Mapping[str, float], header: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Band centres and widths [nm] of a file's radiance channels.

    As rodcone's own attribute states them, if it still fits the channels; else the names' wavelengths, as
    `bands_between` takes them. A `UserWarning` names what has to be assumed.

    Raises
    ------
    InputError
        For a single band without a stated width.
    """
    stated = header.get(BANDS)
    if stated is not None:
        bands = _parsed(str(stated))
        if bands is not None and [channel_name(centre) for centre in bands[0]] == list(channels):
            return bands
        warnings.warn(f"the attribute {BANDS} doesn't fit the channels and is left aside", UserWarning, stacklevel=3)
    nm = np.array(list(channels.values()))
    if nm.size == 1:
        raise InputError(
            f"one band at {nm[0]:g} nm has no width; allowed: two bands or more, or the attribute {BANDS}; "
            f"add it, such as '{nm[0]:.1f}:10.0'"
        )
    return bands_between(nm)


def _parsed(text: str) -> tuple[Floats, Floats] | None:
    """Centres and widths from text, None where it isn't that."""
    try:
        pairs = np.array([[float(part) for part in pair.split(":")] for pair in text.split(";")])
        centres, widths = pairs.T
        return centres, band_widths(centres, widths)
    except ValueError:  # InputError is one
        return None


def check_units(header: Mapping[str, Any], channels: Iterable[str]) -> None:
    """Raise `InputError` for units that aren't spectral radiance; a `UserWarning` names what is assumed."""
    stated = header.get(OWN_UNITS, header.get(UNITS))
    if stated is None:
        warnings.warn(f"it states no {UNITS}: {TRUE_UNITS} is assumed", UserWarning, stacklevel=3)
    elif stated not in (LAYOUT_UNITS, TRUE_UNITS):
        raise InputError(f"its units are {stated!r}; allowed: {LAYOUT_UNITS} or {TRUE_UNITS}; convert it")
    present = [name for name in (*_MEASUREMENT, *channels) if name in header]
    if present:
        warnings.warn(f"the camera described by {', '.join(present)} is not undone", UserWarning, stacklevel=3)
