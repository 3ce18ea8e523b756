"""The answer of a sweep's report in words: who is better in which light, by how much, and how much light that saves."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studies.metrics.metric import DELTA_E, HEADLINE, METRICS, PSNR, Metric
from studies.pages.report_data import ReportCell
from studies.pages.report_text import NBSP, camera_name, duration_text, fixed, lead_text, significant
from studies.pages.verdict import AHEAD, BEHIND, LEVEL, UNKNOWN, Figures, Leads, leads, light_ratio
from studies.study.study import GRAY_WORLD

CLEARLY = 2.0  # a lead is clear if it is at least this many times the smallest visible difference
SAME_TIME = 1.01  # ratio of exposure times below which they count as one
# The same method on both mosaics; the mosaic with a white pixel is the first.
WHITE_PIXEL = ("ple_rgbw", "ple_bayer")


@dataclass(frozen=True)
class Pair:
    """Two cameras (or two values of another axis) that are compared under the same conditions, over light.

    Attributes
    ----------
    names : (str, str)
    ours, theirs : Figures
        Figures of the first and of the second.
    levels : sequence of str
        Names of the light levels, in the study's order; a study without an axis of light has one.
    light_cd_m2 : sequence of float or None
    """

    names: tuple[str, str]
    ours: Figures
    theirs: Figures
    levels: Sequence[str]
    light_cd_m2: Sequence[float | None]

    @cached_property
    def leads(self) -> dict[str, Leads]:
        """Return by how much the first one leads, by metric."""
        return {metric.key: leads(metric, self.ours[metric.key], self.theirs[metric.key]) for metric in METRICS}


def answer(pair: Pair) -> str:
    """Say in words whether the first of a pair is better than the second.

    Neighbouring levels with the same verdict share one sentence. It mentions every difference in a `HEADLINE` metric
    that a person can see, losses as well as gains.
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


def _word(outcomes: dict[str, tuple[str, float]]) -> tuple[str, tuple[int, ...], tuple[int, ...]]:
    """Return the verdict on one level from each metric's outcome and lead.

    Where the verdict is mixed, also return the indices of the metrics in which the first is ahead, and behind.
    """
    gained, lost = (
        tuple(i for i, metric in enumerate(HEADLINE) if outcomes[metric.key][0] == outcome)
        for outcome in (AHEAD, BEHIND)
    )
    if gained and lost:
        return "mixed", gained, lost
    if not gained and not lost:
        undecided = any(outcomes[metric.key][0] == UNKNOWN for metric in HEADLINE)
        return "undecided" if undecided else "level", (), ()
    cases = [(metric, *outcomes[metric.key]) for metric in HEADLINE]
    largest = max(abs(lead) / metric.threshold for metric, outcome, lead in cases if outcome in (AHEAD, BEHIND))
    return f"{'clearly' if largest >= CLEARLY else 'a little'} {'better' if gained else 'worse'}", (), ()


def _seen(run: dict[str, Leads], outcome: str) -> str:
    """Write the leads of a run of levels in those metrics that have a given outcome."""
    here = {metric: run[metric.key].outcome == outcome for metric in HEADLINE}
    return ", ".join(_span(metric, run[metric.key].mean[at]) for metric, at in here.items() if at.any())


def _said(word: str, run: dict[str, Leads]) -> str:
    gained, lost = (_seen(run, outcome) for outcome in (AHEAD, BEHIND))
    if word == "mixed":
        return f"better in part ({gained}), worse in part ({lost})"
    if word in ("level", "undecided"):
        words = {"level": "no visible difference", "undecided": "these seeds can't tell"}[word]
        return f"{words} ({_span(PSNR, run[PSNR.key].mean)})"
    return f"{word} ({gained or lost})"


def _span(metric: Metric, lead: NDArray[np.float64]) -> str:
    """Write the leads of a run of levels as differences of the figure itself, such as "FLIP lower by 0.02 to 0.03"."""
    sizes = np.sort(lead[np.isfinite(lead)])
    if not sizes.size:
        return f"{metric.name} unknown"
    name = metric.name.replace(",", "")
    unit = f"{NBSP}{metric.unit}" if metric.unit else ""
    if metric.higher:
        return f"{name} {_to(metric, sizes)}{unit}"
    by = _to(metric, np.sort(np.abs(sizes))).replace("+", "")
    return f"{name} {'lower' if sizes[0] > 0 else 'higher'} by {by}{unit}"


def _to(metric: Metric, rising: NDArray[np.float64]) -> str:
    """Write the first and the last of rising values, or only one if both are written alike."""
    return " to ".join(dict.fromkeys(lead_text(metric, float(end)) for end in (rising[0], rising[-1])))


def _runs(words: Sequence[object]) -> list[tuple[int, int]]:
    """Return the first and last index of each run of equal words."""
    starts = [i for i, word in enumerate(words) if i == 0 or word != words[i - 1]]
    return list(zip(starts, [*(start - 1 for start in starts[1:]), len(words) - 1], strict=True))


def _where(levels: Sequence[str], first: int, last: int) -> str:
    """Name a run of levels; return an empty text if there is only one level."""
    if len(levels) == 1:
        return ""
    if last == first:
        return levels[first]
    if last == len(levels) - 1:
        return f"from {levels[first]} on" if first else "at every level"
    return f"{levels[first]} to {levels[last]}"


def in_light(pair: Pair) -> str:
    """Say with how much less light the better of a pair has the other's PSNR, and where nobody sees a difference.

    The text is empty if no difference is visible at any level, or if light can't be compared, because the study's
    levels don't rise or one of them isn't known.
    """
    lights = [light for light in pair.light_cd_m2 if light]
    if len(lights) < max(2, len(pair.levels)) or lights != sorted(set(lights)):
        return ""
    outcomes = pair.leads[PSNR.key].outcome.tolist()
    ours, theirs = pair.ours[PSNR.key], pair.theirs[PSNR.key]
    sentences = []
    for outcome, better, curves in ((AHEAD, pair.names[0], (ours, theirs)), (BEHIND, pair.names[1], (theirs, ours))):
        shares = []
        for name, here, ratio in zip(pair.levels, outcomes, light_ratio(lights, *curves).tolist(), strict=True):
            if here == outcome and ratio[0] > 1:
                mean, *ends = (significant(1 / value, digits=2) for value in ratio)
                interval = f" ({' to '.join(reversed(ends))})" if len(set(ends)) > 1 else ""
                word = next(
                    (word for share, word in _SHARES.items() if abs(share * ratio[0] - 1) < _ROUND), f"{mean} times"
                )
                shares.append(f"{word} the light{interval} at {name}")
        if shares:
            sentences.append(f"For the same PSNR {better} needs {', '.join(shares)}.")
    if not sentences:
        return ""
    alike = [_where(pair.levels, *run) for run in _runs(outcomes) if outcomes[run[0]] == LEVEL]
    if alike:
        where = ", ".join(alike)
        sentences.append(f"{where[0].upper()}{where[1:]}: nobody sees a difference in it.")
    return " ".join(sentences)


_SHARES = {1 / 2: "half", 1 / 3: "a third", 1 / 4: "a quarter"}
_ROUND = 0.05  # a share within this relative difference of a half, a third or a quarter is named by that word


# Words on pairs and their conditions


@dataclass(frozen=True)
class Group:
    """A pair under one combination of a study's other axes: scene, lamp, sensor and so on, over all light levels.

    `title` names the values of those axes that vary in the study.
    """

    title: str
    pair: Pair
    ours: tuple[ReportCell, ...] = ()
    theirs: tuple[ReportCell, ...] = ()


def pair_words(group: Group) -> str:
    """Say in what the two cameras of a pair are alike and in what they differ: method, exposure times."""
    differ = []
    for ours, theirs in zip(group.ours, group.theirs, strict=True):
        times = [cell.first.exposure_s for cell in (ours, theirs) if cell.first]
        if len(times) == 2 and max(times) > SAME_TIME * min(times):
            differ.append(
                f"{group.pair.levels[ours.level]} {duration_text(times[0])} against {duration_text(times[1])}"
            )
    cameras = tuple(cells[0].camera for cells in (group.ours, group.theirs))
    reference = "bayer" in cameras and _balances(*group.ours, *group.theirs) == {GRAY_WORLD}
    sentences = ["Bayer (bilinear) with Gray World is the paper's reference."] if reference else []
    if cameras == WHITE_PIXEL:
        alone = "" if differ else ", and the same exposure times: they differ by the mosaic alone"
        sentences.append(f"One method, prior and colour rule on both mosaics{alone}.")
    if differ:
        sentences.append(f"Exposure times differ: {'; '.join(differ)}.")
    return " ".join(sentences)


def _balances(*cells: ReportCell) -> set[str]:
    return {cell.first.white_balance for cell in cells if cell.first}


def best_words(group: Group, cells: Sequence[ReportCell]) -> str:
    """Say which Bayer camera has the best PSNR at each level, and RGBW's lead over it; empty if there is only one.

    Parameters
    ----------
    group : Group
        A pair of one method on both mosaics; the text is empty for any other pair.
    cells : sequence of ReportCell
        Cells of all cameras under the same conditions. A camera with electrons in R, G and B alone is a Bayer camera.
    """
    if not group.ours or (group.ours[0].camera, group.theirs[0].camera) != WHITE_PIXEL:
        return ""
    bayer = [cell for cell in cells if cell.first and json.loads(cell.first.mean_electrons).keys() == set("RGB")]
    if len(bayer) < 2 * len(group.ours):
        return ""
    best = [max((x for x in bayer if x.level == ours.level), key=lambda x: x.mean(PSNR.key)) for ours in group.ours]
    lead = np.array([ours.mean(PSNR.key) - cell.mean(PSNR.key) for ours, cell in zip(group.ours, best, strict=True)])
    parts = [
        f"{camera_name(best[first].camera)}{f' {where}' if (where := _where(group.pair.levels, first, last)) else ''} "
        f"({_span(PSNR, lead[first : last + 1])})"
        for first, last in _runs([cell.camera for cell in best])
    ]
    return f"Beside the best Bayer: {'; '.join(parts)}."


def balance_words(group: Group) -> str:
    """Say at which levels Gray World is off by a visible colour difference, and by more than the pair's lead.

    Both are CIEDE2000: the error of the balance is that of the worse camera, the lead is the difference of the
    pictures' medians. The text is empty if there is no such level.
    """
    lead = group.pair.leads[DELTA_E.key].mean
    cases = []
    for level, cells in enumerate(zip(group.ours, group.theirs, strict=True)):
        misses = [cell.mean("balance_delta_e") if _balances(cell) == {GRAY_WORLD} else 0.0 for cell in cells]
        miss = np.nanmax([0.0, *misses])
        cell = cells[int(np.argmax(np.nan_to_num(misses)))]
        if miss >= DELTA_E.threshold and miss > abs(lead[level]):
            cases.append((miss, camera_name(cell.camera), group.pair.levels[level], float(lead[level])))
    if not cases:
        return ""
    miss, camera, level_name, lead_there = max(cases, key=lambda case: case[0])
    return (
        f"Gray World misses this scene's light by ΔE {fixed(miss, 1)} ({camera}, {level_name}); the lead is "
        f"{fixed(abs(lead_there), 1)}. It misses by more than the lead at {len(cases)} of {len(lead)} light levels."
    )
