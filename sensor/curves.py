"""Spectral responses of colour channels, in electrons per photon: the built-in ones, other filters, CSV files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from render.band_weights import band_weights
from render.illuminants import illuminant
from render.spectrum import ELECTRON_C, VISIBLE_NM, Spectrum, even_bands, per_joule, photons_per_joule
from rodcone.curve_file import read_columns
from rodcone.display import Axes, brief, draw_curves
from rodcone.doors import method
from rodcone.errors import InputError, require_keys, require_range
from rodcone.types import Floats

# Smooth curves of the project's own: peak * exp(-|(nm - centre) / width|^power), another width and power on each side.
# Peaks and centres are those of ISETCam's interleaved RGBW sensor; widths and powers were fitted so that electrons per
# band (equal energy and D65, 380-780 nm; D65, 400-700 nm) agree with it within 0.2 %.
_RGBW_PARAMETERS = {  # peak, centre [nm], left width [nm], left power, right width [nm], right power
    "R": (0.560, 592.0, 17.795, 1.286, 41.939, 1.748),
    "G": (0.678, 540.0, 49.065, 1.712, 48.684, 2.571),
    "B": (0.415, 476.0, 44.227, 1.846, 32.167, 1.348),
    "W": (1.000, 620.0, 225.131, 1.955, 225.536, 2.052),
}
_COMPLEMENTS = {"C": "GB", "M": "RB", "Y": "RG"}


@dataclass(frozen=True)
class Responses:
    """Response of each channel.

    Attributes
    ----------
    curves : mapping of str to Spectrum
        By channel: electrons per photon (0 to 1) over wavelength, quantum efficiency included.
    relative : bool
        Whether only their ratios are known: electrons are then known up to a factor that all channels share.
    """

    curves: Mapping[str, Spectrum]
    relative: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        for channel, curve in self.curves.items():
            if curve.values.max() > 1.0:
                raise InputError(
                    f"responses: {channel} reaches {curve.values.max():g} electrons a photon; allowed: 0 to 1; "
                    "divide per cent by 100"
                )
        object.__setattr__(self, "curves", MappingProxyType(dict(self.curves)))

    def __reduce__(self) -> tuple[type["Responses"], tuple[dict[str, Spectrum], bool]]:
        """Return what pickle needs, with the curves as a dict: a mapping proxy can't be pickled."""
        return Responses, (dict(self.curves), self.relative)

    @method
    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw each channel's curve into Matplotlib's axes, new ones by default."""
        curves = {name: (curve.wavelength_nm, curve.values) for name, curve in self.curves.items()}
        return draw_curves(curves, axes, x="wavelength, nm", y="electrons a photon")

    def band_average(self, channels: tuple[str, ...], wavelength_nm: ArrayLike, width_nm: ArrayLike) -> Floats:
        """Return the mean response in each band, shape (channel, band).

        Raises
        ------
        InputError
            Where a channel has no curve.
        """
        require_keys("responses: channel", channels, self.curves)
        return np.array([self.curves[channel].band_average(wavelength_nm, width_nm) for channel in channels])


@cache
def rgbw() -> Responses:
    """Return the project's own responses of R, G, B and W, 380-1068 nm (Parmar & Wandell 2009, Figure 2)."""
    nm = np.arange(380.0, 1069.0)
    curves = {}
    for channel, (peak, centre, left, left_power, right, right_power) in _RGBW_PARAMETERS.items():
        distance = np.abs(nm - centre)
        falls = np.where(nm < centre, (distance / left) ** left_power, (distance / right) ** right_power)
        curves[channel] = Spectrum(nm, peak * np.exp(-falls))
    return Responses(curves)


@cache
def built_in() -> Responses:
    """Return the project's own curves: R, G, B and W of `rgbw`, and C and Y as `with_channels` derives them."""
    return with_channels(rgbw(), ("C", "Y"))


def with_channels(responses: Responses, names: Sequence[str]) -> Responses:
    """Add C (the clear pixel of RCCC and RCCB) as W, and Y as R plus G, where they are named and missing."""
    curves = dict(responses.curves)
    if "C" in names and "W" in curves:
        curves.setdefault("C", curves["W"])
    if "Y" in names and "Y" not in curves and {"R", "G"} <= curves.keys():
        curves["Y"] = _sum(curves["R"], curves["G"])
    return Responses(curves, responses.relative)


def _sum(one: Spectrum, other: Spectrum) -> Spectrum:
    nm = np.union1d(one.wavelength_nm, other.wavelength_nm)
    values = [np.interp(nm, part.wavelength_nm, part.values, left=0.0, right=0.0) for part in (one, other)]
    return Spectrum(nm, values[0] + values[1])


def complementary(responses: Responses) -> Responses:
    """Return the responses of C, M and Y, and of G and W where `responses` has them.

    Each filter is assumed to pass what two of the primary filters pass together: C = G + B, M = R + B, Y = R + G. A
    matrix then takes C, M and Y exactly back to R, G and B.

    Raises
    ------
    InputError
        Where R, G or B is missing, or two of them add up to more than one electron a photon.
    """
    _require_channels(responses, "RGB")
    primaries = responses.curves
    curves = {channel: _sum(*(primaries[primary] for primary in pair)) for channel, pair in _COMPLEMENTS.items()}
    curves |= {name: curve for name, curve in primaries.items() if name in "GW"}
    return Responses(curves, responses.relative)


def matched_transmittance(responses: Responses) -> float:
    """Return the transmittance of a neutral density with which W collects as much as G from grey under D65.

    The density is assumed to pass the same share of every wavelength.

    Raises
    ------
    InputError
        Where G or W is missing, or W collects less than G.
    """
    _require_channels(responses, "GW")
    green, white = electrons_from_neutral(responses, ("G", "W"), illuminant("D65"))
    if not 0 < green <= white:
        raise InputError(
            f"responses: W collects {white:g} where G does {green:g}; allowed: W more than G; correct a curve"
        )
    return float(green / white)


def electrons_from_neutral(responses: Responses, names: Sequence[str], light: Spectrum) -> Floats:
    """Return each channel's electrons, in any unit, from a surface that reflects `light` evenly over 380-780 nm.

    Raises
    ------
    InputError
        Where a channel has no curve.
    """
    require_keys("responses: channel", names, responses.curves)
    curves = [responses.curves[name] for name in names]
    corners = np.concatenate([curve.wavelength_nm for curve in curves])
    one, width = even_bands(VISIBLE_NM, 1)
    return band_weights(partial(per_joule, curves), corners, one, width, light)[:, 0]


def neutral_density(responses: Responses) -> Responses:
    """Return the responses with W behind the neutral density of `matched_transmittance`."""
    transmittance = matched_transmittance(responses)
    return Responses({**responses.curves, "W": responses.curves["W"] * transmittance}, responses.relative)


def _require_channels(responses: Responses, channels: str) -> None:
    missing = [channel for channel in channels if channel not in responses.curves]
    if missing:
        raise InputError(f"responses: no curve of {', '.join(missing)}; allowed: R, G, B and W; add it")


class RelativeResponsesWarning(UserWarning):
    """A camera whose responses are known up to a factor: so are its electrons, and all that follows from them."""


def read_csv(
    path: str | Path,
    *,
    range_nm: tuple[float, float] | None = None,
    ir_cut: float | Spectrum | None = None,
    quantum_efficiency: float | Spectrum | None = None,
    unit: str = "per_photon",
    relative: bool = False,
) -> Responses:
    """Read measured responses: a header ``wavelength_nm,R,G,...`` and one row a wavelength.

    Parameters
    ----------
    path : str or Path
        Electrons per photon; transmittances of the filters where `quantum_efficiency` is given.
    range_nm : (float, float), optional
        Wavelengths to use, which the file must reach; None for all of the file's. Outside, the response is 0.
    ir_cut : float or Spectrum, optional
        Filter in front: the wavelength from which it lets nothing through, or its transmittance.
    quantum_efficiency : float or Spectrum, optional
        Quantum efficiency of the photodiode, by which every curve is multiplied. None if the file's curves include it.
    unit : str
        ``per_photon``; or ``per_watt`` for responses per radiant power, which are divided by the wavelength. These are
        amperes per watt, and so give electrons per photon, unless they are relative or a quantum efficiency is given:
        then the greatest of them becomes 1.
    relative : bool
        Whether only their ratios are known.

    Raises
    ------
    InputError
        For a missing file, a header without ``wavelength_nm``, a cell that is no number, a response outside 0..1, or a
        range that the file doesn't reach.
    """
    curves = _table(path)
    nm = next(iter(curves.values())).wavelength_nm
    if unit == "per_watt":
        curves = _per_photon(curves, amperes=not relative and quantum_efficiency is None)
    if range_nm is not None:
        curves = {channel: _within(curve, range_nm, str(path)) for channel, curve in curves.items()}
    if quantum_efficiency is not None:
        Responses(curves)  # refuses a transmittance over 1 before the product hides it
    for factor in (ir_cut if isinstance(ir_cut, Spectrum) else None, quantum_efficiency):
        if factor is not None:
            curves = {channel: _times(curve, factor) for channel, curve in curves.items()}
    if isinstance(ir_cut, int | float):
        require_range("ir_cut", ir_cut, nm[0] + 1e-9, 1e5, "give nm within the file's wavelengths, or a curve")
        last = min(float(ir_cut), float(nm[-1]) if range_nm is None else range_nm[1])
        curves = {name: _within(curve, (float(curve.wavelength_nm[0]), last), "") for name, curve in curves.items()}
    return Responses(curves, relative)


def read_curve(path: str | Path) -> Spectrum:
    """Read one curve, such as a filter's transmittance or a quantum efficiency: ``wavelength_nm`` and one more column.

    Raises
    ------
    InputError
        As `read_csv` does, and for more columns than two.
    """
    curves = Responses(_table(path)).curves
    if len(curves) != 1:
        raise InputError(f"curve: {str(path)!r} has {len(curves)} columns beside wavelength_nm; allowed: 1; keep one")
    return next(iter(curves.values()))


def _table(path: str | Path) -> dict[str, Spectrum]:
    """Read the columns of a CSV of responses by their names."""
    columns = read_columns(path, "responses")
    nm = columns.pop("wavelength_nm")
    return {name: Spectrum(nm, column) for name, column in columns.items()}


def _per_photon(curves: dict[str, Spectrum], *, amperes: bool) -> dict[str, Spectrum]:
    """Convert responses per radiant power to responses per photon: 1 A/W is h c / (e wavelength) electrons per photon.

    Unless the responses are in amperes per watt, the greatest becomes 1.
    """
    per_photon = {
        name: Spectrum(x.wavelength_nm, x.values / (photons_per_joule(x.wavelength_nm) * ELECTRON_C))
        for name, x in curves.items()
    }
    greatest = max(float(curve.values.max()) for curve in per_photon.values())
    return per_photon if amperes or greatest <= 0 else {n: x * (1.0 / greatest) for n, x in per_photon.items()}


def _within(curve: Spectrum, range_nm: tuple[float, float], path: str) -> Spectrum:
    """Cut a curve to a range, with a point at each end."""
    first, last = range_nm
    nm = curve.wavelength_nm
    if not nm[0] <= first < last <= nm[-1]:
        raise InputError(
            f"range_nm: {range_nm!r} is not inside the wavelengths of {path!r}, {nm[0]:g} to {nm[-1]:g} nm; "
            "give a range that the file reaches"
        )
    points = np.unique(np.concatenate([[first], nm[(nm > first) & (nm < last)], [last]]))
    return Spectrum(points, np.interp(points, nm, curve.values))


def _times(curve: Spectrum, factor: float | Spectrum) -> Spectrum:
    """Multiply a curve by a number or by another curve, at the points of both, over the range that they share."""
    if not isinstance(factor, Spectrum):
        require_range("quantum_efficiency", factor, 0.0, 1.0, "give electrons per photon")
        return curve * float(factor)
    first = max(curve.wavelength_nm[0], factor.wavelength_nm[0])
    last = min(curve.wavelength_nm[-1], factor.wavelength_nm[-1])
    nm = np.union1d(curve.wavelength_nm, factor.wavelength_nm)
    nm = nm[(nm >= first) & (nm <= last)]
    if nm.size < 2:
        raise InputError(
            f"responses: curves over {curve.wavelength_nm[0]:g}-{curve.wavelength_nm[-1]:g} nm and a filter over "
            f"{factor.wavelength_nm[0]:g}-{factor.wavelength_nm[-1]:g} nm share no range; give curves that overlap"
        )
    values = [np.interp(nm, one.wavelength_nm, one.values) for one in (curve, factor)]
    return Spectrum(nm, values[0] * values[1])
