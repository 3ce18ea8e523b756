"""The page's answer in words: who is better in which light, by how much, and how much light that is worth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studies.pages.report_data import ReportCell
from studies.pages.report_text import (
    CHART,
    DELTA_E,
    DELTA_E_95,
    FLIP,
    METRICS,
    MTF50,
    NBSP,
    PATCHES,
    PSNR,
    PU21,
    S_CIELAB,
    S_CIELAB_95,
    SSIM,
    Metric,
    camera_name,
    duration,
    fixed,
    lead_text,
    significant,
)
from studies.pages.verdict import AHEAD, BEHIND, UNKNOWN, Figures, Leads, leads, light_ratio
from studies.study.study import GRAY_WORLD

# Metrics that say much the same: the largest of each family is named, and none is a vote.
FAMILIES = ((PSNR, PU21, PATCHES), (SSIM, MTF50), (DELTA_E, DELTA_E_95, S_CIELAB, S_CIELAB_95, CHART), (FLIP,))
DECIDING = (PSNR, SSIM, DELTA_E, FLIP)  # known on every scene: one that is undecided leaves the level so
CLEARLY = 2.0  # times what a person sees
LIGHT_SEEN = 1.1  # times the light: shot noise then changes by 0.4 dB, less than is seen
THIRD_STOP = 2 ** (1 / 3)  # times the light: the smallest step of a camera's dials
SAME_TIME = 1.01  # exposure times whose ratio is below count as one
# The same method on both mosaics, the one with a white pixel first; and what the paper compares.
WHITE_PIXEL = ("ple_rgbw", "ple_bayer")


@dataclass(frozen=True)
class Pair:
    """Two things that are compared in one place, over light.

    Attributes
    ----------
    names : (str, str)
    ours, theirs : Figures
        Of the first and of the second.
    levels : sequence of str
        Names of the light levels, in the study's order; one alone stands for no light axis.
    light_cd_m2 : sequence of float or None
    """

    names: tuple[str, str]
    ours: Figures
    theirs: Figures
    levels: Sequence[str]
    light_cd_m2: Sequence[float | None]

    @cached_property
    def leads(self) -> dict[str, Leads]:
        """The first one's leads by metric."""
        return {metric.key: leads(metric, self.ours[metric.key], self.theirs[metric.key]) for metric in METRICS}


def answer(pair: Pair) -> str:
    """Say in words how the first of a pair does beside the second: a sentence for each run of levels of one verdict.

    Every difference as large as a person sees is in it, losses as well as gains; of each family of metrics the largest.
    """
    by_metric, levels = pair.leads, pair.levels
    if pair.ours[PSNR.key].shape[-1] == 1:
        return f"One seed can't tell a difference from chance ({_span(PSNR, by_metric[PSNR.key].mean)})."
    words = [
        _word({key: (str(x.outcome[i]), float(x.mean[i])) for key, x in by_metric.items()}) for i in range(len(levels))
    ]
    sentences = []
    for first, last in _runs(words):
        run = {key: Leads(*(part[first : last + 1] for part in vars(x).values())) for key, x in by_metric.items()}
        where = _where(levels, first, last)
        sentences.append(f"{where}: {_said(words[first][0], run)}." if where else f"{_said(words[first][0], run)}.")
    return " ".join(sentence[0].upper() + sentence[1:] for sentence in sentences)


def _word(found: dict[str, tuple[str, float]]) -> tuple[str, frozenset[int], frozenset[int]]:
    """Verdict of one level from each metric's outcome and lead; where it is mixed, with families gained and lost."""
    gained, lost = (
        frozenset(i for i, family in enumerate(FAMILIES) if any(found[metric.key][0] == outcome for metric in family))
        for outcome in (AHEAD, BEHIND)
    )
    if gained and lost:
        return "mixed", gained, lost
    if not gained and not lost:
        undecided = any(found[metric.key][0] == UNKNOWN for metric in DECIDING)
        return "undecided" if undecided else "level", gained, lost
    largest = max(abs(lead) / metric.seen for metric in METRICS for outcome, lead in [found[metric.key]]
                  if outcome in (AHEAD, BEHIND))  # fmt: skip
    return (
        f"{'clearly' if largest >= CLEARLY else 'a little'} {'better' if gained else 'worse'}",
        frozenset(),
        frozenset(),
    )


def _seen(run: dict[str, Leads], outcome: str) -> str:
    """Write what a run of levels has gained or lost: of each family PSNR, or else the metric with the largest lead."""
    named = []
    for family in FAMILIES:
        sizes = {
            metric: float("inf") if metric == PSNR else float(np.abs(run[metric.key].mean[here]).max()) / metric.seen
            for metric in family
            if (here := run[metric.key].outcome == outcome).any()
        }
        if sizes:
            metric = max(sizes, key=lambda one: sizes[one])
            named.append(_span(metric, run[metric.key].mean[run[metric.key].outcome == outcome]))
    return ", ".join(named)


def _said(word: str, run: dict[str, Leads]) -> str:
    gained, lost = (_seen(run, outcome) for outcome in (AHEAD, BEHIND))
    if word == "mixed":
        return f"better in part ({gained}), worse in part ({lost})"
    if word in ("level", "undecided"):
        said = {"level": "no visible difference", "undecided": "these seeds can't tell"}[word]
        return f"{said} ({_span(PSNR, run[PSNR.key].mean)})"
    return f"{word} ({gained or lost})"


def _span(metric: Metric, lead: NDArray[np.float64]) -> str:
    """Write the leads of a run of levels as differences of the figure itself, such as "FLIP lower by 0.02 to 0.03"."""
    known = np.sort(lead[np.isfinite(lead)])
    if not known.size:
        return f"{metric.name} unknown"
    name, unit = metric.name.replace(",", ""), f"{NBSP}{metric.unit}" if metric.unit else ""
    if metric.higher:
        return f"{name} {_to(metric, known)}{unit}"
    by = _to(metric, np.sort(np.abs(known))).replace("+", "")
    return f"{name} {'lower' if known[0] > 0 else 'higher'} by {by}{unit}"


def _to(metric: Metric, rising: NDArray[np.float64]) -> str:
    """Write the ends of rising values, and one of them where they are written alike."""
    return " to ".join(dict.fromkeys(lead_text(metric, float(end)) for end in (rising[0], rising[-1])))


def _runs(words: Sequence[object]) -> list[tuple[int, int]]:
    """First and last index of each run of equal words."""
    starts = [i for i, word in enumerate(words) if i == 0 or word != words[i - 1]]
    return list(zip(starts, [*(start - 1 for start in starts[1:]), len(words) - 1], strict=True))


def _where(levels: Sequence[str], first: int, last: int) -> str:
    """Name a run of levels; one level alone needs no name, nor does a comparison of levels themselves."""
    if len(levels) == 1:
        return ""
    if last == first:
        return levels[first]
    if last == len(levels) - 1:
        return f"from {levels[first]} on" if first else "at every level"
    return f"{levels[first]} to {levels[last]}"


def in_light(pair: Pair) -> str:
    """Say how much more light the worse one needs for the other's PSNR.

    Nothing is said of a level where the sweep can't tell, nor where levels don't rise or one isn't known.
    """
    known = [light for light in pair.light_cd_m2 if light]
    if len(known) < max(2, len(pair.levels)) or known != sorted(set(known)):
        return ""
    (a, b), psnr = pair.names, (pair.ours[PSNR.key], pair.theirs[PSNR.key])
    needed = {b: light_ratio(known, *psnr), a: light_ratio(known, *psnr[::-1])}
    ahead = psnr[0].mean(axis=1) >= psnr[1].mean(axis=1)
    more: dict[str, list[str]] = {}
    alike = []
    for level, name in enumerate(pair.levels):
        worse = b if ahead[level] else a
        ratio = needed[worse][level]
        if ratio is not None and ratio.low > 1 and ratio.mean >= LIGHT_SEEN:
            mean, *ends = (significant(value, digits=2) for value in (ratio.mean, ratio.low, ratio.high))
            interval = f" ({' to '.join(ends)})" if len(set(ends)) > 1 else ""
            more.setdefault(worse, []).append(f"{mean} times at {name}{interval}")
        elif ratio is not None and ratio.high < THIRD_STOP:
            alike.append(name)
    parts = [f"{worse} needs more light for the same PSNR: {', '.join(times)}" for worse, times in more.items()]
    parts += [f"as much light gives the same PSNR: {', '.join(alike)}"] if alike else []
    return "".join(f"{part[0].upper()}{part[1:]}. " for part in parts).strip()


# Words of pairs in their places


@dataclass(frozen=True)
class Group:
    """A pair in one place of the study: scene, light, sensor, ... but for what is compared and the light level.

    `title` names what varies besides.
    """

    title: str
    pair: Pair
    ours: tuple[ReportCell, ...] = ()
    theirs: tuple[ReportCell, ...] = ()


def pair_words(group: Group) -> str:
    """Say what the two have in common and what not: method, exposure times, the paper's reference."""
    differ = []
    for ours, theirs in zip(group.ours, group.theirs, strict=True):
        times = [cell.first.exposure_s for cell in (ours, theirs) if cell.first]
        if len(times) == 2 and max(times) > SAME_TIME * min(times):
            differ.append(f"{group.pair.levels[ours.level]} {duration(times[0])} against {duration(times[1])}")
    cameras = tuple(cells[0].camera for cells in (group.ours, group.theirs))
    reference = "bayer" in cameras and _balances(*group.ours, *group.theirs) == {GRAY_WORLD}
    said = ["Bayer, bilinear + Gray World, is the paper's reference."] if reference else []
    if cameras == WHITE_PIXEL:
        alone = "" if differ else ", and the same exposure times: they differ by the mosaic alone"
        said.append(f"One method, prior and colour rule on both mosaics{alone}.")
    if differ:
        said.append(f"Exposure times differ: {'; '.join(differ)}.")
    return " ".join(said)


def _balances(*cells: ReportCell) -> set[str]:
    return {cell.first.white_balance for cell in cells if cell.first}


def balance_words(group: Group) -> str:
    """Say where a white balance found in the picture misses the light visibly, and by more than the lead; else empty.

    Both are of colour, CIEDE2000: the miss of the worse of the two cameras, and the lead in the pictures' median.
    """
    lead, cases = group.pair.leads[DELTA_E.key].mean, []
    for level, cells in enumerate(zip(group.ours, group.theirs, strict=True)):
        misses = [cell.figures["balance_delta_e"] or 0.0 if _balances(cell) == {GRAY_WORLD} else 0.0 for cell in cells]
        miss, cell = max(misses), cells[int(np.argmax(misses))]
        if miss >= DELTA_E.seen and miss > abs(lead[level]):
            cases.append((miss, camera_name(cell.camera), group.pair.levels[level], float(lead[level])))
    if not cases:
        return ""
    miss, camera, level_name, there = max(cases, key=lambda case: case[0])
    return (
        f"Gray World misses this scene's light by ΔE {fixed(miss, 1)} ({camera}, {level_name}); the lead is "
        f"{fixed(abs(there), 1)}. It misses by more than the lead at {len(cases)} of {len(lead)} light levels."
    )


def over_groups(groups: Sequence[Group]) -> str:
    """Say of several groups in how many one is better and worse somewhere, with the largest of each; else empty."""
    if len(groups) < 2:
        return ""
    parts = []
    for outcome, word in ((AHEAD, "better"), (BEHIND, "worse")):
        sizes = []
        for group in groups:
            cases = [
                (abs(lead.mean[level]) / metric.seen, metric, float(lead.mean[level]), group.pair.levels[level])
                for metric in METRICS
                for lead in [group.pair.leads[metric.key]]
                for level in np.flatnonzero(lead.outcome == outcome).tolist()
            ]
            if cases:
                sizes.append((*max(cases, key=lambda case: case[0]), group.title))
        if sizes:
            _, metric, lead, level, title = max(sizes, key=lambda case: case[0])
            size = lead_text(metric, lead) + (f"{NBSP}{metric.unit}" if metric.unit else "")
            parts.append(f"{word} somewhere in {len(sizes)} (most: {metric.name} {size}, {title}, {level})")
    return f"Of {len(groups)} places: {'; '.join(parts) or 'in none a difference that is seen'}."
