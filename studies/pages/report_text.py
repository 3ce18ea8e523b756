"""Write numbers and names as the texts that pages show."""

from collections.abc import Sequence
from math import floor, isfinite, isinf, isnan, log10

from isp.processors.own import user_file
from sensor.exposure import AUTO, AUTO_INFORMATION, AUTO_W
from sensor.presets import preset_names
from studies.metrics.metric import Metric
from studies.pages.report_data import ReportCell
from studies.study.gain import ISO
from studies.study.levels import parse_exposure, parse_level
from studies.study.study import AS_SHOT, GRAY_WORLD, OWN

MISSING = "—"
NBSP = "\N{NO-BREAK SPACE}"
AUTOMATIC = {AUTO: "automatic", AUTO_W: "automatic for W", AUTO_INFORMATION: "automatic by information"}
CAMERA_NAMES = {
    "interleaved": "RGBW (interleaved)",
    "bayer": "Bayer (bilinear)",
    "ple_rgbw": "RGBW (PLE)",
    "ple_bayer": "Bayer (PLE)",
    "ple_rgbw_net": "RGBW (PLE and network)",
    "ple_bayer_net": "Bayer (PLE and network)",
}
BALANCE_NAMES = {AS_SHOT: "balanced as shot", GRAY_WORLD: "balanced by Gray World"}
BALANCE_MEANINGS = {AS_SHOT: "the scene's light is known", GRAY_WORLD: "the picture's mean is taken for grey"}


def fixed(value: float | None, digits: int, unit: str = "") -> str:
    """Write `value` with `digits` decimals and its unit; None and NaN become a dash."""
    if value is None or isnan(value):
        return MISSING
    text = ("-∞" if value < 0 else "∞") if isinf(value) else f"{value:.{digits}f}"
    return text.replace("-", "\N{MINUS SIGN}") + (NBSP + unit if unit else "")


def significant(value: float | None, unit: str = "", digits: int = 3) -> str:
    """Write `value` with `digits` significant digits, without exponent, with narrow spaces between thousands."""
    if value is None or not isfinite(value) or value == 0:
        return fixed(value, 0, unit)
    decimals = digits - 1 - floor(log10(abs(value)))
    rounded = round(value, decimals)
    text = f"{rounded:,.{max(decimals, 0)}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return text.replace(",", "\N{NARROW NO-BREAK SPACE}").replace("-", "\N{MINUS SIGN}") + (NBSP + unit if unit else "")


def lead_text(metric: Metric, lead: float) -> str:
    """Write a lead with its sign and without its unit; a lead that rounds to 0 has no sign."""
    digits = fixed(abs(lead), metric.digits)
    return digits if not float(digits) else ("+" if lead > 0 else "\N{MINUS SIGN}") + digits


def level_text(level: str) -> str:
    """Write ``25cd/m2`` as prose does."""
    value, unit = parse_level(level)
    return significant(value, unit.replace("m2", "m²"))


def percent(value: float | None) -> str:
    """Write a fraction as per cent with two significant digits."""
    return significant(None if value is None else 100 * value, "%", 2)


def duration_text(seconds: float | None) -> str:
    """Write a time in ms below one second, else in s."""
    if seconds is not None and 0 < abs(seconds) < 1:
        return significant(1000 * seconds, "ms", 3)
    return significant(seconds, "s", 3)


def figure_text(cell: ReportCell, key: str, digits: int, unit: str = "") -> str:
    """Write a cell's figure as "20.1 ± 0.3 dB" if there are several seeds, else as "20.1 dB"."""
    mean = cell.mean(key)
    half = cell.half(key)
    if isnan(half):
        return fixed(mean, digits, unit)
    return f"{fixed(mean, digits)}{NBSP}±{NBSP}{fixed(half, digits, unit)}"


def substitution_text(share: float | None) -> str:
    """Say for which share of the seeds (with one seed, whether) W replaced the luminance."""
    if share is None:
        return "not applicable"
    return "on" if share == 1 else f"on for {percent(share)} of the seeds" if share else "off"


def camera_name(camera: str) -> str:
    """Return a camera's name as prose writes it; a user's processor goes by its file, without ``develop``."""
    own = user_file(camera)
    if own is None:
        return CAMERA_NAMES.get(camera, camera)
    path, function = own
    plain = path.stem.split("-")[0] if path.suffix == ".whl" else path.stem  # without the wheel's version
    return plain.replace("_", " ") + ("" if function == "develop" else f" ({function.replace('_', ' ')})")


def plain_name(name: str) -> str:
    """Return a sensor's name without its file's ending, unless the shorter name is that of a preset."""
    plain = name.removesuffix(".toml")
    return name if plain in preset_names() else plain


def with_signs(words: str) -> str:
    """Write the units and powers in a text of this package as a page does: um^2 as µm²."""
    for plain, sign in (("um^2", "µm²"), ("cos^4", "cos⁴"), ("cd/m^2", "cd/m²"), ("m2", "m²")):
        words = words.replace(plain, sign)
    return words


def exposure_name(exposure: str) -> str:
    """Write an exposure as prose does: ``auto`` as "automatic", ``10ms`` as "10 ms"; words after a comma stay."""
    time, comma, balance = exposure.partition(", ")
    seconds = parse_exposure(time)
    return (AUTOMATIC[time] if seconds is None else duration_text(seconds)) + comma + balance


def way_name(exposure: str, frames: int = 1, gain: str = OWN) -> str:
    """Write an exposure, frames of a burst, and a gain that isn't the sensor's own."""
    burst = "" if frames == 1 else f", {frames} frames"
    return exposure + burst + ("" if gain == OWN else f", {gain}" if gain.startswith(ISO) else f", gain {gain}")


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table."""
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in (head, ["---"] * len(head), *rows))
