"""What duels between a camera and its opponents show, as sentences and tables computed from the numbers."""

from collections.abc import Sequence
from math import isnan

from studies.pages.duels import (
    AHEAD,
    BEHIND,
    LEVEL,
    METRICS,
    Case,
    Duel,
    Group,
    duels,
    is_ranked,
    lead_over,
    opponents_of,
    snr_db,
)
from studies.pages.report_text import DELTA_E, MISSING, PSNR, Metric, fixed, significant, spans
from studies.study.levels import parse_level

NBSP = "\N{NO-BREAK SPACE}"


def code(text: str) -> str:
    """Write a name as Markdown's code, whatever is in it: in code no sign has a meaning but the backtick and |."""
    return "`" + " ".join(text.split()).replace("`", "'").replace("|", "\\|") + "`"


def level_text(level: str) -> str:
    """Write ``25cd/m2`` as prose does."""
    value, unit = parse_level(level)
    return f"{significant(value)}{NBSP}{unit.replace('m2', 'm²')}"


def group_text(group: Group, groups: Sequence[Group]) -> str:
    """Name what tells a group from the others; the scene in any case."""
    parts = [code(group.scene)]
    for name, before in (("spectrum", ""), ("exposure", "exposure "), ("sensor", "")):
        if len({getattr(other, name) for other in groups}) > 1:
            parts.append(before + code(getattr(group, name)))
    return ", ".join(parts)


def groups_of(cases: Sequence[Case]) -> list[Group]:
    """Return the groups, each once, in the order in which they come."""
    return list(dict.fromkeys(case.group for case in cases))


def place_text(case: Case, cases: Sequence[Case]) -> str:
    """Name one condition."""
    return f"{group_text(case.group, groups_of(cases))} at {level_text(case.level)}"


def amount(metric: Metric, value: float) -> str:
    """Write a difference of a metric, without its sign."""
    return fixed(abs(value), metric.digits, metric.unit)


def in_short(cases: Sequence[Case], camera: str) -> list[str]:
    """Say what the page comes to: over which SNR the camera is the best of all, and how it does beside the first."""
    ranked = [case for case in cases if is_ranked(case, camera)]
    said = [_ranked_sentence(len(ranked), len(cases), camera)]
    if ranked:
        said += [best_by_snr(metric, ranked, camera) for metric in METRICS]
        said.append(beside(cases, camera, opponents_of(cases, camera)[0]))
    return said


def best_by_snr(metric: Metric, ranked: Sequence[Case], camera: str) -> str:
    """Say in how many conditions no opponent's mean is clearly better, and over which SNR of green those lie."""
    first: list[Duel] = []
    behind: list[Duel] = []
    for case in ranked:
        duel = best_duel(case, camera, metric)
        (behind if duel.outcome == BEHIND else first).append(duel)
    parts = []
    if first:
        parts.append(f"best of all, or not to be told apart from the best, in {_where(first, ranked, camera)}")
    if behind:
        most = max(behind, key=lambda duel: -duel.lead.mean)
        by = f"by {amount(metric, most.lead.mean)} at most ({code(most.opponent)}, {place_text(most.case, ranked)})"
        parts.append(f"behind one opponent or more in {_where(behind, ranked, camera)}, {by}")
    return f"**{metric.name}:** {code(camera)} is {'; '.join(parts)}."


def best_lines(cases: Sequence[Case], camera: str) -> list[str]:
    """Say for every metric, and scene and sensor, who is best at which light."""
    ranked = [case for case in cases if is_ranked(case, camera)]
    return [
        f"{metric.name}, {group_text(group, groups_of(cases))}: "
        + best_by_light(metric, [case for case in ranked if case.group == group], camera)
        for metric in METRICS
        for group in groups_of(ranked)
    ]


def best_by_light(metric: Metric, of_group: Sequence[Case], camera: str) -> str:
    """Say at which light the camera is best of all, and which opponent is elsewhere, by how much."""
    levels = [level_text(case.level) for case in of_group]
    places: dict[str, list[tuple[int, float]]] = {}
    for index, case in enumerate(of_group):
        duel = best_duel(case, camera, metric)
        best = code(duel.opponent)
        who = {AHEAD: code(camera), LEVEL: f"{code(camera)} level with {best}", BEHIND: best}[duel.outcome]
        places.setdefault(who, []).append((index, abs(duel.lead.mean)))
    parts = []
    for who, found in places.items():
        by = f", by {amount(metric, max(lead for _, lead in found))}{' at most' if len(found) > 1 else ''}"
        parts.append(f"{who} {spans(levels, [index for index, _ in found])}{'' if ' level ' in who else by}")
    return "; ".join(parts) + "."


def best_duel(case: Case, camera: str, metric: Metric) -> Duel:
    """Lead over the opponent of the best mean in one condition."""
    sign = 1 if metric.higher else -1
    best = max((name for name in case.rows if name != camera), key=lambda name: sign * case.mean(name, metric))
    return Duel(case, best, lead_over(case, camera, best, metric))


def beside(cases: Sequence[Case], camera: str, opponent: str) -> str:
    """Say in each metric how often a camera is ahead of one opponent and how often behind."""
    clauses = [clause(metric, duels(cases, camera, opponent, metric), cases) for metric in METRICS]
    return f"**Beside {code(opponent)}.** {' '.join(clauses)}"


def clause(metric: Metric, found: Sequence[Duel], cases: Sequence[Case]) -> str:
    """Say one opponent's part in one metric: how often, by how much in the median and at most, and where."""
    parts = []
    for outcome, words in ((AHEAD, "ahead"), (BEHIND, "behind")):
        these = sorted((duel for duel in found if duel.outcome == outcome), key=lambda duel: abs(duel.lead.mean))
        if not these:
            continue
        most = these[-1]
        middle = f", by {amount(metric, these[len(these) // 2].lead.mean)} in the median" if len(these) > 2 else ""
        interval = f"{amount(metric, most.lead.mean)}{NBSP}±{NBSP}{significant(_half(most), digits=1)}"
        where = place_text(most.case, cases)
        parts.append(f"{words} in {len(these)} of {len(found)}{middle}, by {interval} at most ({where})")
    even = sum(duel.outcome == LEVEL for duel in found)
    parts += [f"not to be told apart in {even}"] if even else []
    return f"{metric.name}: {'; '.join(parts)}."


def duel_table(cases: Sequence[Case], camera: str) -> list[str]:
    """Markdown table: in how many conditions the camera is ahead of, level with, behind each opponent; times."""
    heads = [f"{metric.name}: ahead / level / behind" for metric in METRICS]
    lines = [f"| opponent | {' | '.join(heads)} | time to develop |", "|---" * (len(METRICS) + 2) + "|"]
    own_s = _develop_s(cases, camera)
    for name in opponents_of(cases, camera):
        cells = []
        for metric in METRICS:
            outcomes = [duel.outcome for duel in duels(cases, camera, name, metric)]
            cells.append(" / ".join(str(outcomes.count(outcome)) for outcome in (AHEAD, LEVEL, BEHIND)))
        time = f"× {significant(_develop_s(cases, name) / own_s, digits=2)}"
        lines.append(f"| {code(name)} | {' | '.join(cells)} | {time} |")
    return lines


def loss_table(cases: Sequence[Case], camera: str) -> list[str]:
    """Markdown table of every loss: at which light, by how much; empty where the camera is behind nobody."""
    lines = []
    for name in opponents_of(cases, camera):
        for group in groups_of(cases):
            of_group = [case for case in cases if case.group == group]
            cells = [_losses(metric, of_group, camera, name) for metric in METRICS]
            if set(cells) != {MISSING}:
                lines.append(f"| {code(name)} | {group_text(group, groups_of(cases))} | {' | '.join(cells)} |")
    head = f"| opponent | where | {' | '.join(metric.name for metric in METRICS)} |"
    return [head, "|---" * (len(METRICS) + 2) + "|", *lines] if lines else []


def _losses(metric: Metric, of_group: Sequence[Case], camera: str, opponent: str) -> str:
    lost = [duel for duel in duels(of_group, camera, opponent, metric) if duel.outcome == BEHIND]
    if not lost:
        return MISSING
    names = [level_text(case.level) for case in of_group]
    by = sorted(fixed(abs(duel.lead.mean), metric.digits) for duel in lost)
    by.sort(key=float)
    much = by[0] if by[0] == by[-1] else f"{by[0]} to {by[-1]}"
    unit = NBSP + metric.unit if metric.unit else ""
    return f"{spans(names, [of_group.index(duel.case) for duel in lost])}, by {much}{unit}"


def level_table(of_group: Sequence[Case], camera: str) -> list[str]:
    """Markdown table of one group: processors down, light across, PSNR and CIEDE2000; the best of each in bold."""
    lines = [
        f"| PSNR [dB], ΔE2000 | {' | '.join(level_text(case.level) for case in of_group)} |",
        "|---" * (len(of_group) + 1) + "|",
    ]
    for name in of_group[0].rows:
        lines.append(f"| {code(name)} | {' | '.join(_both(case, name) for case in of_group)} |")
    for letter, words in (("G", "SNR of mean green [dB]"), ("W", "SNR of mean W [dB]")):
        values = [snr_db(case, camera, letter) for case in of_group]
        if not all(isnan(value) for value in values):
            lines.append(f"| *{words}* | {' | '.join(_whole(value) for value in values)} |")
    return lines


def scatter_sentence(cases: Sequence[Case], camera: str) -> str:
    """Say how wide the leads' intervals are: half of the median and of the widest; empty where nothing is ranked."""
    parts = []
    for metric in METRICS:
        halves = sorted(
            _half(duel) for name in opponents_of(cases, camera) for duel in duels(cases, camera, name, metric)
        )
        if not halves:
            return ""
        middle, most = halves[len(halves) // 2], halves[-1]
        parts.append(
            f"{metric.name} ±{NBSP}{significant(middle, digits=2)} in the median, {significant(most, digits=2)} at most"
        )
    return f"Half the 95{NBSP}% interval of a lead: {'; '.join(parts)}."


def _ranked_sentence(ranked: int, count: int, camera: str) -> str:
    if ranked == count:
        return f"{count} conditions; W's SNR is 1 or more in all of them, or not known, so that all are ranked."
    return f"{ranked} of {count} conditions are ranked; in the others W's SNR under {code(camera)} is under 1."


def _where(found: Sequence[Duel], ranked: Sequence[Case], camera: str) -> str:
    """How many conditions these are, and the SNR of green in them, where it is known."""
    count = f"{len(found)} of {len(ranked)} conditions"
    snrs = sorted(snr_db(duel.case, camera, "G") for duel in found)
    if any(isnan(snr) for snr in snrs):
        return count
    low, high = _whole(snrs[0]), _whole(snrs[-1])
    return f"{count}, where mean green has an SNR of {high if low == high else f'{low} to {high}'}{NBSP}dB"


def _whole(decibels: float) -> str:
    """Write whole decibels, 0 without a sign."""
    return fixed(decibels if isnan(decibels) else round(decibels), 0)


def _both(case: Case, name: str) -> str:
    shown = []
    for metric in (PSNR, DELTA_E):
        means = {other: fixed(case.mean(other, metric), metric.digits) for other in case.rows}
        sign = 1 if metric.higher else -1
        best = max(case.rows, key=lambda other: sign * case.mean(other, metric))
        shown.append(f"**{means[name]}**" if means[name] == means[best] else means[name])
    return ", ".join(shown)


def _half(duel: Duel) -> float:
    return (duel.lead.high - duel.lead.low) / 2


def _develop_s(cases: Sequence[Case], name: str) -> float:
    times = sorted(row.develop_s for case in cases for row in case.rows[name])
    return times[len(times) // 2]
