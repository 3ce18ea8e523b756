"""Numbers as text, and the report's sentences computed from them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import floor, isfinite, isinf, isnan, log10
from typing import Any

from studies.budget.budget import MOST_SHARE, OF_PIXELS
from studies.study.levels import parse_level

MISSING = "—"
NBSP = "\N{NO-BREAK SPACE}"
CAMERA_NAMES = {"interleaved": "Interleaved", "bayer": "Bayer"}
# As the title writes them; elsewhere the short names stand beside their pictures.
CAMERA_TITLES = {"interleaved": "Interleaved RGBW"}
STOPPED_BY = {
    "seconds": "the time it was given was used up",
    "noise": "the error asked for was reached",
    "samples": "the samples asked for were done",
    "interrupt": "it was interrupted",
}


@dataclass(frozen=True)
class Metric:
    """A number that tells cameras apart: its key in a cell, its name, its decimals, its unit, which way is better."""

    key: str
    name: str
    digits: int
    unit: str
    higher: bool


PSNR = Metric("psnr_db", "PSNR", 1, "dB", higher=True)
SSIM = Metric("ssim", "SSIM", 3, "", higher=True)
DELTA_E = Metric("delta_e_median", "ΔE2000, median", 1, "", higher=False)
DELTA_E_95 = Metric("delta_e_p95", "ΔE2000, 95 %", 1, "", higher=False)
S_CIELAB = Metric("s_cielab_median", "S-CIELAB, median", 1, "", higher=False)
S_CIELAB_95 = Metric("s_cielab_p95", "S-CIELAB, 95 %", 1, "", higher=False)
FLIP = Metric("flip_mean", "FLIP", 3, "", higher=False)
PU21 = Metric("pu21_psnr_db", "PU21-PSNR", 1, "dB", higher=True)
MTF50 = Metric("mtf50_cy_per_px", "MTF50", 3, "cy/px", higher=True)
CHART = Metric("chart_delta_e_mean", "ΔE2000 of the chart", 1, "", higher=False)
PATCHES = Metric("patch_snr_db", "SNR of the patches", 1, "dB", higher=True)
ON_TARGETS = (MTF50, CHART, PATCHES)  # known on the scene alone that they are made for
METRICS = (PSNR, SSIM, DELTA_E, DELTA_E_95, S_CIELAB, S_CIELAB_95, FLIP, PU21, *ON_TARGETS)


def fixed(value: float | None, digits: int, unit: str = "") -> str:
    """Write `value` with `digits` decimals and its unit; None and NaN become a dash."""
    if value is None or isnan(value):
        return MISSING
    text = ("-∞" if value < 0 else "∞") if isinf(value) else f"{value:.{digits}f}"
    return text.replace("-", "\N{MINUS SIGN}") + (NBSP + unit if unit else "")


def significant(value: float | None, unit: str = "", digits: int = 3) -> str:
    """Write `value` with `digits` significant digits, no exponent, thousands apart."""
    if value is None or not isfinite(value) or value == 0:
        return fixed(value, 0, unit)
    decimals = digits - 1 - floor(log10(abs(value)))
    rounded = round(value, decimals)
    text = f"{rounded:,.{max(decimals, 0)}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return text.replace(",", "\N{NARROW NO-BREAK SPACE}").replace("-", "\N{MINUS SIGN}") + (NBSP + unit if unit else "")


def level_text(level: str) -> str:
    """Write ``25cd/m2`` as prose does."""
    value, unit = parse_level(level)
    return significant(value, unit.replace("m2", "m²"))


def percent(value: float | None) -> str:
    """Write a fraction as per cent with two significant digits."""
    return significant(None if value is None else 100 * value, "%", 2)


def duration(seconds: float | None) -> str:
    """Write a time in ms below one second, else in s."""
    if seconds is not None and 0 < abs(seconds) < 1:
        return significant(1000 * seconds, "ms", 3)
    return significant(seconds, "s", 3)


def metric_text(metric: Metric, cell: Mapping[str, Any]) -> str:
    """Write a cell's value of `metric`, with the half of its confidence interval where there is one."""
    return interval_text(cell, metric.key, metric.digits, metric.unit)


def interval_text(cell: Mapping[str, Any], key: str, digits: int, unit: str = "") -> str:
    """Write a cell's figure as "20.1 ± 0.3 dB" where seeds give an interval, else as "20.1 dB"."""
    interval = cell.get("intervals", {}).get(key)
    if interval is None:
        return fixed(cell[key], digits, unit)
    return f"{fixed(cell[key], digits)}{NBSP}±{NBSP}{fixed((interval[1] - interval[0]) / 2, digits, unit)}"


def substitution_text(share: float | None) -> str:
    """Say for which part of the seeds (or whether, with one) luminance was substituted."""
    if share is None:
        return "not applicable"
    return "on" if share == 1 else f"on for {percent(share)} of the seeds" if share else "off"


def camera_name(camera: str) -> str:
    """Return a camera's name as prose writes it."""
    return CAMERA_NAMES.get(camera, camera)


def join(parts: Sequence[str]) -> str:
    """Join with commas and a last "and"."""
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1] if parts else ""


def leader(metric: Metric, cells: Sequence[Mapping[str, Any]]) -> tuple[Mapping[str, Any] | None, float]:
    """Return the cell that is best in `metric` and its lead over the next; None where nothing is to be told apart.

    That is where the written numbers tie, or where the confidence intervals over seeds overlap. (A test of the
    difference would find a lead in some cases in which 95 % intervals overlap: overlap is the stricter rule.)
    """
    known = [cell for cell in cells if cell[metric.key] is not None and not isnan(cell[metric.key])]
    ranked = sorted(known, key=lambda cell: float(cell[metric.key]), reverse=metric.higher)
    if len(ranked) < 2:
        return None, 0.0
    first, second = (float(cell[metric.key]) for cell in ranked[:2])
    # Judged on the numbers as printed: nobody should read "leads" beside two equal figures.
    if fixed(first, metric.digits) == fixed(second, metric.digits):
        return None, 0.0
    spans_of_two = [cell.get("intervals", {}).get(metric.key) for cell in ranked[:2]]
    if None not in spans_of_two and max(low for low, _ in spans_of_two) <= min(high for _, high in spans_of_two):
        return None, 0.0
    return ranked[0], abs(first - second)


def spans(levels: Sequence[str], chosen: Iterable[int]) -> str:
    """Write a set of level numbers as runs: "from moonlight to dusk and at office"."""
    wanted = sorted(chosen)
    if len(wanted) == len(levels) > 1:
        return "at every level"
    runs = []
    for _, group in groupby(enumerate(wanted), key=lambda pair: pair[1] - pair[0]):
        run = [index for _, index in group]
        runs.append(f"at {levels[run[0]]}" if len(run) == 1 else f"from {levels[run[0]]} to {levels[run[-1]]}")
    return join(runs)


def _lead_sentence(metric: Metric, levels: Sequence[str], rows: Sequence[Sequence[Mapping[str, Any]]]) -> str:
    """Say where each camera leads in `metric`, and by how much."""
    led: dict[str, list[tuple[int, float]]] = {}
    for index, cells in enumerate(rows):
        best, margin = leader(metric, cells)
        led.setdefault("" if best is None else best["camera"], []).append((index, margin))
    clauses = []
    for camera in [cell["camera"] for cell in rows[0] if cell["camera"] in led]:
        margins = [margin for _, margin in led[camera]]
        low, high = fixed(min(margins), metric.digits), fixed(max(margins), metric.digits)
        by = high if low == high else f"{low} to {high}"
        where = spans(levels, [index for index, _ in led[camera]])
        clauses.append(f"{camera_name(camera)} leads {where}, by {by}{NBSP + metric.unit if metric.unit else ''}")
    if "" in led:
        clauses.append(f"no camera leads {spans(levels, [index for index, _ in led['']])}")
    return f"{metric.name}: {'; '.join(clauses)}."


def sensor_sentences(levels: Sequence[str], rows: Sequence[Sequence[Mapping[str, Any]]]) -> list[str]:
    """Say in words what one sensor's cells show; `rows` holds one sequence of cells (a camera each) for each level."""
    sentences = [_lead_sentence(metric, levels, rows) for metric in (PSNR, SSIM, DELTA_E)]
    for slot, camera in enumerate(cell["camera"] for cell in rows[0]):
        states = [cells[slot]["substitution"] for cells in rows]
        if any(state is not None for state in states):
            sentences.append(f"Luminance substitution ({camera_name(camera)}): {_substituted(levels, states)}.")
        fallen = [index for index, cells in enumerate(rows) if "calibrated" in (cells[slot]["balance"] or {}).values()]
        if fallen:
            where = spans(levels, fallen)
            sentences.append(f"White balance ({camera_name(camera)}): falls back to calibrated gains {where}.")
    return sentences


def _substituted(levels: Sequence[str], states: Sequence[float | None]) -> str:
    """Say at which levels luminance was substituted; a state is the share of the seeds with it."""
    on = [index for index, state in enumerate(states) if state == 1]
    some = [index for index, state in enumerate(states) if state and state < 1]
    if not on and not some:
        return "off at every level"
    said = [f"on {spans(levels, on)}"] if on else []
    said += [f"on for some seeds {spans(levels, some)}"] if some else []
    return ", ".join(said) + (", off elsewhere" if len(on) + len(some) < len(levels) else "")


def headline(levels: Sequence[str], cells: Sequence[Sequence[Mapping[str, Any]]]) -> str:
    """Count the conditions in which each camera leads in PSNR (sensor, exposure, level), with its largest lead."""
    won: dict[str, list[tuple[float, Mapping[str, Any]]]] = {cell["camera"]: [] for cell in cells[0]}
    for condition in cells:
        best, margin = leader(PSNR, condition)
        if best is not None:
            won[best["camera"]].append((margin, best))
    counts = []
    for camera, leads in won.items():
        most = max(leads, key=lambda pair: pair[0], default=None)
        tail = ""
        if most:
            cell = most[1]
            tail = f" (by {fixed(most[0], 1, 'dB')} at most: {levels[cell['level']]}, {cell['group']})"
        counts.append(f"{camera_name(camera)} in {len(leads)}{tail}")
    tied = len(cells) - sum(len(leads) for leads in won.values())
    ending = f"; in {tied} no camera leads" if tied else ""
    return f"Of {len(cells)} conditions, PSNR is higher for {join(counts)}{ending}."


def render_sentence(render: Mapping[str, Any]) -> str:
    """Say how long the render ran, why it stopped and what error it reached."""
    why = STOPPED_BY.get(str(render["stopped_by"]), f"of: {render['stopped_by']}")
    return (
        f"The render made {render['passes']} passes, {render['spp']} samples a pixel, in {duration(render['seconds'])} "
        f"and stopped because {why}. The relative Monte Carlo error it reached is "
        f"{percent(render['relative_mc_error'])}. In the brightest light its noise variance is at most "
        f"{percent(render['brightest_share'])} of the sensor's own in {percent(OF_PIXELS)} of the pixels "
        f"({percent(MOST_SHARE)} is the aim)."
    )


def budget_sentence(cells: Sequence[Mapping[str, Any]]) -> str:
    """Say what a plan predicts that its approximations add; empty where the pictures follow none."""
    known = [cell["budget_share"] for cell in cells if cell.get("budget_share") is not None]
    if not known:
        return ""
    return (
        f"By the plan that the pictures follow, all its approximations together add at most {percent(max(known))} to "
        "the variance of the sensor's own noise."
    )


def seeds_sentence(seeds: Sequence[int]) -> str:
    """Say how many seeds the numbers come from, and what that means for them."""
    if len(seeds) == 1:
        return f"One seed ({seeds[0]}): how far another draw of the noise would move the numbers is not known here."
    return (
        f"Means over {len(seeds)} seeds; ± and bands are the 95{NBSP}% confidence interval of the mean (Student's t), "
        f"and where the intervals of two cameras overlap none leads. Pictures are those of seed {seeds[0]}."
    )


def share_sentence(levels: Sequence[str], cells: Sequence[Mapping[str, Any]]) -> str:
    """Judge the Monte Carlo share of all cells against the aim."""
    known = [cell for cell in cells if cell["mc_share"] is not None and isfinite(cell["mc_share"])]
    if not known:
        return "The Monte Carlo share is not known for any picture."
    worst = max(known, key=lambda cell: float(cell["mc_share"]))
    where = f"{levels[worst['level']]}, {worst['group']}, {camera_name(worst['camera'])}"
    over = sum(cell["mc_share"] > MOST_SHARE for cell in known)
    most = f"The largest Monte Carlo share is {percent(worst['mc_share'])} ({where})"
    if not over:
        return f"{most}: all {len(known)} pictures keep the {percent(MOST_SHARE)} aim."
    return (
        f"{most}: {over} of {len(known)} pictures miss the {percent(MOST_SHARE)} aim. "
        "In those, noise of the render counts as texture of the scene, and the metrics see it."
    )
