"""A report as Markdown: the answer in every place, and the leads of one thing over all others by light."""

from math import isnan

from studies.metrics.metric import Metric
from studies.pages.headline import answer, balance_words, best_words, in_light
from studies.pages.report_compare import (
    BALANCE,
    CAMERA,
    axes_of,
    first_comparison,
    groups_of,
    means_over_scenes,
    shown_metrics,
)
from studies.pages.report_data import ReportData
from studies.pages.report_text import MISSING, fixed, lead_text, table
from studies.pages.verdict import AHEAD, BEHIND, OUTCOMES, Leads, counts


def markdown(report: ReportData, command: str, a: int) -> str:
    """Return the page of one value of what the report compares first, beside all the others.

    Parameters
    ----------
    report : ReportData
    command : str
        That makes the page.
    a : int
        The value, by its place.
    """
    of = first_comparison(report)
    axis = axes_of(report)[of.compared]
    b = of.b if a == of.a else next(value for value in range(len(axis.values)) if value != a)
    groups = groups_of(report, of.compared, a, b)
    places = report.by_group if of.compared == CAMERA else [()] * len(groups)
    words = [
        " ".join(
            filter(
                None,
                (
                    "-",
                    code(group.title) if group.title else "",
                    answer(group.pair),
                    in_light(group.pair),
                    balance_words(group) if of.compared != BALANCE else "",
                    best_words(group, place),
                ),
            )
        )
        for group, place in zip(groups, places, strict=True)
    ]
    parts = [
        f"# {code(report.title)}",
        f"    {command}",
        f"rodcone {report.rodcone}, study {code(report.name)}, {len(report.seeds)} seeds. {code(axis.values[a])} "
        f"beside {code(axis.values[b])}:",
        "\n".join(words),
        f"Lead of {code(axis.values[a])}, half the 95 % interval over seeds after ±. **Bold**: behind by what a person "
        "sees. In brackets: less than that, or undecided. Last: light levels ahead, level, behind; equal light once.",
        *(lead_table(report, of.compared, a, metric) for metric in shown_metrics(report.cells)),
    ]
    return "\n\n".join(parts) + "\n"


def lead_table(report: ReportData, axis: int, a: int, metric: Metric) -> str:
    """Return the leads of one value of an axis over the others: others and places down, light across."""
    names, rows = axes_of(report)[axis].values, []
    for other in (value for value in range(len(names)) if value != a):
        groups = groups_of(report, axis, a, other)
        counted = [counts(group.pair.ours, group.pair.theirs)[metric.key] for group in groups]
        last = " / ".join(str(sum(count[outcome] for count in counted)) for outcome in OUTCOMES)
        for group in (*groups, *means_over_scenes(report, groups)):
            title = f"{code(names[other])}, {code(group.title)}" if group.title else code(names[other])
            rows.append([title, *lead_cells(metric, group.pair.leads[metric.key]), last])
    unit = f" [{metric.unit}]" if metric.unit else ""
    return table([f"{metric.name}{unit}", *(code(level.name) for level in report.levels), "counted"], rows)


def lead_cells(metric: Metric, lead: Leads) -> list[str]:
    """Write leads as cells of a table: a loss that is seen in bold, what isn't seen or isn't decided in brackets."""
    cells = []
    for mean, half, outcome in zip(lead.mean, lead.half, lead.outcome, strict=True):
        words = MISSING if isnan(mean) else lead_text(metric, float(mean))
        words += "" if isnan(half) else f" ± {fixed(float(half), metric.digits)}"
        cells.append({BEHIND: f"**{words}**", AHEAD: words}.get(str(outcome), f"({words})"))
    return cells


def code(words: str) -> str:
    """Write a name as Markdown's code, whatever is in it: in code no sign has a meaning but the backtick and |."""
    return "`" + " ".join(words.split()).replace("`", "'").replace("|", "\\|") + "`"
