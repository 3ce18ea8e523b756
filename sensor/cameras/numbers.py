"""Numbers of a pixel, each with its source, and the preset file that they make."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from render.spectrum import VISIBLE_NM, Spectrum
from rodcone.errors import InputError, require_keys
from sensor.cameras.library import MeasuredCamera
from sensor.cfa import Tile, channels
from sensor.config import SensorConfig
from sensor.pixel import PixelConfig

_STEP_NM = 4.0  # step of curves that another camera lends
_LEAST_SHARE = 0.05  # curves must reach this share of their maximum at the wavelength of a stated quantum efficiency
NEEDED = ("pitch_um", "fill_factor", "full_well_e", "read_noise_e", "dsnu_e", "prnu")  # keys without a default
_OFF = {  # by key, what is assumed if no source states the term
    "dark_current_e_per_s": "no dark current",
    "column_gain_spread": "columns alike",
    "column_offset_e": "columns alike",
    "hot_pixel_share": "no hot pixels",
    "crosstalk": "no crosstalk",
}


@dataclass(frozen=True)
class SourcedValue:
    """A number, and its source on one line."""

    value: float
    source: str


@dataclass(frozen=True)
class PixelNumbers:
    """Numbers of a camera from one source.

    Attributes
    ----------
    source : str
        The source as a whole, on one line.
    pixel, settings : mapping of str to SourcedValue
        Numbers by key of `PixelConfig`, and by key of `SensorConfig`: ``bits``, ``black_level_dn``.
    left_out : mapping of str to str
        For keys that the source can't state, the reason.
    efficiency : (float, float) or None
        Electrons per photon, and the wavelength [nm] at which they were measured.
    cfa : tuple of str
        Mosaic; empty if the source doesn't state it.
    """

    source: str
    pixel: Mapping[str, SourcedValue] = field(default_factory=dict)
    settings: Mapping[str, SourcedValue] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    efficiency: tuple[float, float] | None = None
    cfa: Tile = ()


@dataclass(frozen=True)
class Curves:
    """Response curves for a preset.

    Attributes
    ----------
    name, source : str
        Name of the camera that has them, and their source on one line.
    curves : mapping of str to Spectrum
        Curves by channel, on one grid of wavelengths. A camera's own curves are relative, per photon, with the maximum
        1. Curves that another camera lends are electrons per photon.
    note : str
        What is known or assumed about the ratios between channels.
    lent_cfa : tuple of str
        Mosaic of the preset that lends the curves; empty for the camera's own curves.
    """

    name: str
    source: str
    curves: Mapping[str, Spectrum]
    note: str
    lent_cfa: Tile = ()


def measured_curves(camera: MeasuredCamera) -> Curves:
    """Return the response curves of a measured camera, with their source and a note on their unit."""
    note = "per photon, greatest 1: published per radiant power, divided by the wavelength"
    if not camera.balanced:
        note += (
            "; each channel was divided by its own maximum: their ratios aren't known, so the electrons of each hold "
        )
        note += "up to a factor of its own"
    source = f"{camera.source} ({camera.licence}); {camera.text}"
    return Curves(f"{camera.maker} {camera.model}", source, camera.responses.curves, note)


def borrowed_curves(sensor: SensorConfig, name: str, numbers: PixelNumbers) -> Curves:
    """Scale another camera's curves to a source's quantum efficiency at one wavelength; one value per `_STEP_NM`.

    Only curves of channels in the source's mosaic are returned, or all if it states none. The stated efficiency is
    taken for that of the channel that responds most at the wavelength, such as W for a monochrome chip. If a scaled
    curve would exceed one electron per photon, all are scaled less, because their shape isn't this camera's.

    Raises
    ------
    InputError
        For a wavelength at which the curves hardly respond, or a mosaic's channel that the other camera hasn't.
    """
    assert numbers.efficiency is not None  # the callers' choice
    value, at_nm = numbers.efficiency
    theirs = sensor.responses.curves
    require_keys(f"preset {name}: channel", channels(numbers.cfa) if numbers.cfa else (), theirs)
    first_nm, last_nm = next(iter(theirs.values())).wavelength_nm[[0, -1]]
    nm = np.arange(first_nm, last_nm + 1e-6, _STEP_NM)
    shape = {
        channel: np.interp(nm, theirs[channel].wavelength_nm, theirs[channel].values)
        for channel in (channels(numbers.cfa) if numbers.cfa else theirs)
    }
    at = {channel: float(np.interp(at_nm, nm, values, left=0.0, right=0.0)) for channel, values in shape.items()}
    spoken_of = max(at, key=lambda channel: at[channel])
    if not at[spoken_of] > _LEAST_SHARE:
        raise InputError(
            f"anchor: {value:g} electrons a photon at {at_nm:g} nm, where {name} responds with {at[spoken_of]:.3g}, is "
            "not allowed; give a quantum efficiency near a peak, such as 0.5@530"
        )
    factor = value / at[spoken_of]
    most = 1.0 / max(float(values.max()) for values in shape.values())
    note = f"scaled by {factor:.4g}, so that {spoken_of} has the quantum efficiency {_anchor(numbers)}"
    if factor > most:
        note = f"scaled by {most:.4g}, to 1 electron a photon at most; {spoken_of} would need {factor:.4g} to have "
        note += f"the quantum efficiency {_anchor(numbers)}"
    scaled = {channel: Spectrum(nm, values * min(factor, most)) for channel, values in shape.items()}
    return Curves(name, f"shape of {name}'s curves, not of this camera", scaled, note, numbers.cfa or sensor.cfa)


def bits_of(white_dn: float, black_dn: float, source: str) -> SourcedValue:
    """Return the fewest bits of a converter that reaches a white level, and a note of where this comes from.

    The white level stays the same number of electrons. If the simulated converter ends above it, K [DN/e-] therefore
    rises as the range above black does: by (top - black) / (white - black).
    """
    bits = int(white_dn).bit_length()
    top = 2**bits - 1
    factor = (top - black_dn) / (white_dn - black_dn)
    finer = "" if top == white_dn else f"; the simulated converter ends at {top}, so its K is {factor:.3f} times that"
    return SourcedValue(bits, f"white level {white_dn:g} of {source}{finer}")


def missing(numbers: PixelNumbers) -> list[str]:
    """Return the keys that a camera needs and that the source doesn't state."""
    return [key for key in NEEDED if key not in numbers.pixel]


def completed(numbers: PixelNumbers, sensor: SensorConfig, name: str) -> PixelNumbers:
    """Fill in the missing numbers from another camera, each with a note that names it."""
    lent = {key: SourcedValue(getattr(sensor.pixel, key), f"of {name}, not of this camera") for key in missing(numbers)}
    return replace(numbers, pixel={**numbers.pixel, **lent})


def preset_text(title: str, numbers: PixelNumbers, shape: Curves | None, curves: str) -> str:
    """Return a preset file that `sensor.config_file.read_sensor` reads, with the source of every number.

    Parameters
    ----------
    title : str
        Description of the camera on one line.
    curves : str
        Name of the CSV of the responses, beside the file; empty for none.
    """
    lines = [f"# {_plain(title)}", f"# Numbers: {_plain(numbers.source)}", ""]
    if numbers.cfa:
        lines.append(
            f"cfa = [{', '.join(f'{chr(34)}{row}{chr(34)}' for row in numbers.cfa)}]  # {_plain(numbers.source)}"
        )
    elif shape is not None and shape.lent_cfa:
        rows = ", ".join(f'"{row}"' for row in shape.lent_cfa)
        lines.append(f"cfa = [{rows}]  # of {_plain(shape.name)}, not of this camera")
    elif shape is not None or numbers.efficiency is None:
        lines.append('cfa = "bayer"  # RG over GB: a choice; another phase of it, or another mosaic, is yours to set')
    else:
        lines.append('cfa = ["W"]  # one channel without a filter, named W: numbers of a monochrome chip')
    lines += [_line(key, number) for key, number in numbers.settings.items()]
    if shape is not None:
        lines.append(f"window_nm = {list(VISIBLE_NM)}  # a choice: a filter that lets visible light in")
    lines += ["", *_responses(numbers, shape, curves), "", "[pixel]"]
    names = [field.name for field in fields(PixelConfig)]
    lines += [_line(key, numbers.pixel[key]) for key in names if key in numbers.pixel]
    words = dict.fromkeys(missing(numbers), "not told: needed, so give a number")
    words |= {key: f"not told: {off}" for key, off in _OFF.items()} | dict(numbers.left_out)
    lines += [f"# {key} =   # {_plain(why)}" for key, why in words.items() if key not in numbers.pixel]
    lines += ["", "[lens]", "f_number = 2.8  # a choice: no source of a sensor tells a lens"]
    return "\n".join([*lines, "diffraction = 1.0  # a choice: an ideal aperture", ""])


def curves_csv(numbers: PixelNumbers, shape: Curves | None) -> str:
    """Write responses as CSV: curves, or the efficiency at the one wavelength that is known; empty without both."""
    if shape is not None:
        return responses_csv(shape.curves)
    if numbers.efficiency is not None:
        value, at_nm = numbers.efficiency
        return responses_csv({"W": Spectrum(np.array([at_nm - 1, at_nm + 1]), np.array([value, value]))})
    return ""


def responses_csv(curves: Mapping[str, Spectrum]) -> str:
    """Write the curves of all channels as CSV, at the wavelengths of the first one."""
    nm = next(iter(curves.values())).wavelength_nm
    columns = [np.interp(nm, curve.wavelength_nm, curve.values) for curve in curves.values()]
    rows = [[f"{x:g}", *(f"{column[index]:.6f}" for column in columns)] for index, x in enumerate(nm)]
    return "\n".join(",".join(row) for row in [["wavelength_nm", *curves], *rows]) + "\n"


def greatest_response(numbers: PixelNumbers, shape: Curves) -> float | None:
    """Return the electrons per photon at the peak of relative curves, from a source's value at one wavelength.

    The source's value is taken to be that of the channel that responds most at this wavelength. The result is None if
    the source states no value.

    Raises
    ------
    InputError
        For a wavelength at which the curves hardly respond, or a product over one electron a photon.
    """
    if numbers.efficiency is None:
        return None
    value, at_nm = numbers.efficiency
    share = max(
        float(np.interp(at_nm, curve.wavelength_nm, curve.values, left=0.0, right=0.0))
        for curve in shape.curves.values()
    )
    if not share > _LEAST_SHARE or value / share > 1:
        raise InputError(
            f"anchor: {value:g} electrons a photon at {at_nm:g} nm, where {shape.name} responds with "
            f"{share:.3g} of its greatest, is not allowed; give a quantum efficiency near a peak, such as 0.5@530"
        )
    return value / share


def _responses(numbers: PixelNumbers, shape: Curves | None, curves: str) -> Sequence[str]:
    if shape is not None:
        known = '"relative"  # no anchor: electrons hold up to one factor; a number here fixes it'
        if shape.lent_cfa:
            known = '"included"'
        elif (greatest := greatest_response(numbers, shape)) is not None:
            known = f"{greatest:.6g}  # of the greatest response: {_anchor(numbers)}"
        nm = next(iter(shape.curves.values())).wavelength_nm
        return [
            "[responses]",
            f'csv = "{curves}"  # {_plain(shape.source)}',
            f"# {shape.note}",
            _range_line(*nm[[0, -1]]),
            f"quantum_efficiency = {known}",
        ]
    if numbers.efficiency is None:
        return ["# [responses] is left out: not told. The project's own curves stand in, not this camera's."]
    value, at_nm = numbers.efficiency
    return [
        "[responses]",
        f'csv = "{curves}"  # {value:g} electrons a photon at {at_nm:g} nm: {_plain(numbers.source)}',
        "# Elsewhere the response isn't told, and is 0: put a whole curve in its place before you photograph a scene.",
        _range_line(at_nm - 1, at_nm + 1),
        'quantum_efficiency = "included"',
    ]


def _range_line(first_nm: float, last_nm: float) -> str:
    return f"range_nm = [{float(first_nm)!r}, {float(last_nm)!r}]"


def _anchor(numbers: PixelNumbers) -> str:
    value, at_nm = numbers.efficiency or (0.0, 0.0)
    return f"{value:g} at {at_nm:g} nm, {_plain(numbers.source)}"


def _line(key: str, number: SourcedValue) -> str:
    whole = key in ("bits", "black_level_dn")
    return f"{key} = {int(number.value) if whole else repr(float(number.value))}  # {_plain(number.source)}"


def _plain(text: str) -> str:
    """Return a text on one line, without the characters that TOML forbids in a comment."""
    return " ".join("".join(x if x.isprintable() else " " for x in text).split())
