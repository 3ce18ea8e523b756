"""Read an EMVA 1288 report from a short TOML file with the report's own symbols, and get the pixel that it describes.

Equations are numbered as in release 4.0 Linear of the standard.
"""

import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from rodcone.errors import InputError, in_place, read_errors, require_keys, require_range, require_whole
from rodcone.toml_file import read_toml
from sensor.cameras.emva_checks import doubts
from sensor.cameras.numbers import PixelNumbers, SourcedValue

# Symbols, each with its range and its unit. Those of RESULTS follow from the others and only serve as a check.
_SYMBOLS: dict[str, dict[str, tuple[float, float, str]]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text("utf-8")
)
INPUTS, RESULTS = _SYMBOLS["inputs"], _SYMBOLS["results"]
_TEXTS = ("camera", "maker", "source", "date")
_WHOLE = {"bits": (1, 16), "black_level_dn": (0, 65_534)}


@dataclass(frozen=True)
class EmvaReport:
    """Content of a report.

    Attributes
    ----------
    camera, maker, source, date : str
        The camera with its operating point, its maker, the document that states the numbers, and its date.
    bits, black_level_dn : int or None
        The converter's bits and the black level of the operating point; None if the report doesn't state them.
    figures : mapping of str to float
        Values by symbol of `INPUTS` and `RESULTS`.
    """

    camera: str
    maker: str
    source: str
    date: str
    bits: int | None
    black_level_dn: int | None
    figures: Mapping[str, float]

    @property
    def source_note(self) -> str:
        """Return the source with its date on one line."""
        return " ".join(f"{self.source}, {self.date}".split())


def read_report(path: Path) -> EmvaReport:
    """Read a report.

    Parameters
    ----------
    path : Path
        TOML: ``camera``, ``maker``, ``source``, ``date``, optionally ``bits`` and ``black_level_dn``, and a table
        ``[report]`` with symbols of `INPUTS` and `RESULTS`.

    Raises
    ------
    InputError
        For a file that can't be read, an unknown or missing key, or a value out of range; the file is named.

    Warns
    -----
    UserWarning
        For each figure that contradicts others, or looks like another unit (`sensor.cameras.emva_checks.doubts`).
    """
    with read_errors(f"EMVA report: {str(path)!r} can't be read", "give a TOML file with a table [report]"):
        content = read_toml(path)
    with in_place(f"EMVA report {str(path)!r}"):
        report = _report(content)
    for doubt in doubts(report.figures, report.bits, report.black_level_dn):
        warnings.warn(f"EMVA report {str(path)!r}: {doubt}", stacklevel=2)
    return report


def numbers_of(report: EmvaReport) -> PixelNumbers:
    """Return the numbers of the pixel that a report describes; those that the report doesn't state are left out.

    The pixel clips where the converter does: at (2^bits - 1 - black) / K. Where the report lacks one of these three,
    the clip follows from the saturation capacity (`clip_over_saturation`).
    """
    source_note, figures = report.source_note, report.figures
    pixel: dict[str, SourcedValue] = {}
    settings: dict[str, SourcedValue] = {}
    left_out: dict[str, str] = {}
    # settings
    for key, whole in (("bits", report.bits), ("black_level_dn", report.black_level_dn)):
        if whole is not None:
            settings[key] = SourcedValue(whole, source_note)
    # pixel
    if "pixel_pitch_um" in figures:
        pixel["pitch_um"] = SourcedValue(figures["pixel_pitch_um"], f"pixel pitch; {source_note}")
    included = "an EMVA quantum efficiency is the whole pixel's, its fill factor included"
    pixel["fill_factor"] = SourcedValue(1.0, included)
    if "K" in figures and report.bits is not None and report.black_level_dn is not None:
        top_dn = 2**report.bits - 1 - report.black_level_dn
        pixel["full_well_e"] = SourcedValue(
            top_dn / figures["K"],
            f"where the converter ends: {top_dn} DN above black over K = {figures['K']:g} DN/e- (eq. 50); "
            f"{source_note}",
        )
    elif "mu_e_sat" in figures:
        value = figures["mu_e_sat"]
        clip_e = clip_over_saturation(value, figures.get("sigma_d", 0.0), figures.get("PRNU1288", 0.0) / 100)
        words = f"the clip whose variance is greatest at the saturation capacity, mu_e.sat = {value:g} e-"
        pixel["full_well_e"] = SourcedValue(clip_e, f"{words}; {source_note}")
    if "K" in figures and "K =" not in str(pixel.get("full_well_e")):
        lacking = [name for name in _WHOLE if name not in settings]
        left_out["K"] = (
            f"{figures['K']:g} DN/e- is set aside: without {' and '.join(lacking)} it doesn't tell where the converter "
            "ends"
        )
    if "sigma_d" in figures:
        pixel["read_noise_e"], note = _read_noise(figures, source_note)
        left_out |= note
    if "DSNU1288" in figures:
        pixel["dsnu_e"] = SourcedValue(figures["DSNU1288"], f"DSNU1288 (eq. 66); {source_note}")
    if "PRNU1288" in figures:
        value = figures["PRNU1288"]
        pixel["prnu"] = SourcedValue(value / 100, f"PRNU1288 (eq. 67), {value:g} per cent; {source_note}")
    if "mu_I" in figures:
        pixel["dark_current_e_per_s"] = SourcedValue(
            figures["mu_I"], f"mu_I (eq. 29), at the report's temperature; {source_note}"
        )
    efficiency = None
    if "eta" in figures:
        efficiency = (figures["eta"] / 100, figures["lambda_nm"])
    return PixelNumbers(f"{report.camera}: {source_note}", pixel, settings, left_out, efficiency)


def numbers_at_gains(low: EmvaReport, high: EmvaReport) -> PixelNumbers:
    """Return the pixel of a camera reported at two gains: noise before and after the amplifier, and the gains' ratio.

    In electrons the noise from behind the amplifier falls as the gain rises: at either gain sigma^2 = read^2 +
    (converter / K)^2. DSNU is taken from the higher gain's report, because the amplifier's own offsets fall as well;
    all else is taken from the lower gain's.

    Raises
    ------
    InputError
        Without K and sigma_d in both, for K that doesn't rise, noise that doesn't fall, or other bits or black levels.
    """
    for report in (low, high):
        if lacking := [name for name in ("K", "sigma_d") if name not in report.figures]:
            raise InputError(f"{report.camera}: no {' and '.join(lacking)}; allowed: reports with both; give another")
    if (low.bits, low.black_level_dn) != (high.bits, high.black_level_dn):
        raise InputError(
            f"{high.camera}: bits and black level {high.bits}, {high.black_level_dn}, at the lower gain {low.bits}, "
            f"{low.black_level_dn}; allowed: those of one converter; give reports of one camera"
        )
    numbers = numbers_of(low)
    k, k_high = low.figures["K"], high.figures["K"]
    sigma_e, sigma_high_e = (_read_noise(x.figures, x.source_note)[0].value for x in (low, high))
    if k_high <= k or sigma_high_e >= sigma_e:
        raise InputError(
            f"{high.camera}: K = {k_high:g} DN/e- with a dark noise of {sigma_high_e:.4g} e-, at the lower gain {k:g} "
            f"and {sigma_e:.4g}; allowed: a higher K with less noise; swap the reports, or give one alone"
        )
    converter_dn = min(sqrt((sigma_e**2 - sigma_high_e**2) / (k**-2 - k_high**-2)), sigma_high_e * k_high)
    read_e = sqrt(max(sigma_high_e**2 - (converter_dn / k_high) ** 2, 0.0))
    told = f"sigma_d = {sigma_e:.4g} e- at K = {k:g} DN/e- and {sigma_high_e:.4g} e- at {k_high:g}"
    both = f"of {told}; {low.source_note}"
    pixel = {**numbers.pixel, "read_noise_e": SourcedValue(read_e, f"before the amplifier, {both}")}
    if "DSNU1288" in high.figures:
        pixel["dsnu_e"] = SourcedValue(high.figures["DSNU1288"], f"DSNU1288 at the higher gain; {high.source_note}")
    settings = {
        **numbers.settings,
        "converter_noise_dn": SourcedValue(converter_dn, f"after the amplifier, {both}"),
        "gain_limit": SourcedValue(k_high / k, f"K of the higher gain over that of the lower; {high.source_note}"),
    }
    return replace(numbers, pixel=pixel, settings=settings)


def clip_over_saturation(saturation_e: float, sigma_d: float, prnu: float) -> float:
    """Return the electrons at which pixels clip, from mu_e.sat, the light at which their temporal variance is greatest.

    The variance of min(n, clip) for a normal n of variance mean + sigma_d^2, averaged over pixels whose means spread by
    PRNU, falls as soon as some pixels clip: mu_e.sat lies two to three standard deviations under the clip.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(15)
    light_e = saturation_e * np.linspace(0.5, 1.5, 2001)  # a step is 0.05 %
    mean_e = light_e[:, None] * (1 + prnu * nodes)
    variance_e2 = np.maximum(mean_e, 0.0) + sigma_d**2
    clip_e = saturation_e
    for _ in range(8):  # the first correction is a few per cent; each later one removes what is left
        z = (clip_e - mean_e) / np.sqrt(variance_e2)
        above = scipy.special.ndtr(-z)
        density = np.exp(-(z**2) / 2) / sqrt(2 * pi)
        first = z * above - density
        second = 1 - above - z * density + z**2 * above
        variance = (variance_e2 * (second - first**2)) @ weights
        clip_e += saturation_e - light_e[np.argmax(variance)]
    return float(clip_e)


def _read_noise(figures: Mapping[str, float], source_note: str) -> tuple[SourcedValue, dict[str, str]]:
    """Return the read noise, which is sigma_d less the dark current's shot noise, and a note if that isn't known."""
    sigma_d, current, exposure_s = (figures.get(key) for key in ("sigma_d", "mu_I", "exposure_s"))
    sigma_d = float(sigma_d or 0.0)
    if current is None:
        why = "not told; its shot noise at the report's exposure is in read_noise_e"
        return SourcedValue(sigma_d, f"temporal dark noise sigma_d; {source_note}"), {"dark_current_e_per_s": why}
    if exposure_s is None or sigma_d**2 <= current * exposure_s:
        return SourcedValue(sigma_d, f"temporal dark noise sigma_d, mu_I's shot noise in it; {source_note}"), {}
    value = float((sigma_d**2 - current * exposure_s) ** 0.5)
    return SourcedValue(
        value, f"root of sigma_d^2 = {sigma_d:g}^2 less mu_I t = {current * exposure_s:g} (eq. 30); {source_note}"
    ), {}


def _report(content: Mapping[str, Any]) -> EmvaReport:
    require_keys("key", content, [*_TEXTS, *_WHOLE, "report"])
    for key in _TEXTS:
        value = content.get(key)
        if not isinstance(value, str) or not 0 < len(value.strip()) <= 1000:
            raise InputError(
                f"{key}: {value!r} is no text; allowed: words in quotes, which every number's source needs"
            )
    for key, (least, most) in _WHOLE.items():
        if key in content:
            require_whole(key, content[key], least, most, "give the report's own")
    table = content.get("report")
    if not isinstance(table, dict):
        raise InputError(f"report: {table!r} is not a table; allowed: [report] and its symbols; add it")
    limits = {**INPUTS, **RESULTS}
    require_keys("symbol", table, limits)
    for key, value in table.items():
        low, high, unit = limits[key]
        require_range(key, None if isinstance(value, bool) else value, low, high, f"give {unit}")
    if ("eta" in table) != ("lambda_nm" in table):
        raise InputError(
            "eta: a quantum efficiency and its wavelength belong together; allowed: eta and lambda_nm; add"
        )
    figures = {key: float(value) for key, value in table.items()}
    bits, black = (content.get(key) for key in _WHOLE)
    if bits is not None and black is not None and black >= 2**bits - 1:
        raise InputError(f"black_level_dn: {black!r} is not under the converter's {2**bits - 1}; correct one")
    camera, maker, source, date = (content[key].strip() for key in _TEXTS)
    return EmvaReport(camera, maker, source, date, bits, black, figures)
