"""The page of a camera beside its opponents: tables in Markdown, and PSNR over light as SVG in a file of its own."""

import json
from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from isp.processors.catalogue import FAIR, PROCESSORS
from rodcone.files import replacing
from studies.pages.duels import (
    AHEAD,
    BEHIND,
    LEVEL,
    MARGINS,
    METRICS,
    Contest,
    contests_of,
    duels,
    group_name,
    groups_of,
    is_ranked,
    no_worse,
    opponents_of,
    plain_opponents_of,
    snr_db,
)
from studies.pages.plots import BLUE, CHART, GREEN, ORANGE, STYLE, blank, name_at_ends, plain_ticks, svg_text
from studies.pages.report_text import (
    DELTA_E,
    MISSING,
    PSNR,
    Metric,
    fixed,
    level_text,
    percent,
    signed,
    significant,
    table,
)
from studies.pages.white_pixel import white_pixel_tables
from studies.sweep.row import Row

COLUMNS = 2  # charts beside each other
FEWEST_LEVELS = 2  # that a curve takes
OTHERS = "#9aa0a5"
_GROUPED_BY = ("scene", "spectrum", "sensor", "exposure", "white_balance")


def write_page(rows: Sequence[Row], study: Mapping[str, Any], folder: Path, out: Path, camera: str) -> None:
    """Write page and figure, both or neither.

    Parameters
    ----------
    rows : sequence of Row
    study : mapping
        The study as the results database notes it of the last run.
    folder : Path
        Of the sweep, for the page's own command.
    out : Path
        Ends in ``.md``; the figure goes beside it, ending in ``.svg``.
    camera : str
        That the page compares with the others.

    Raises
    ------
    InputError
        For a sweep with a part missing, one seed, or without the camera.
    OSError
        Where the files can't be written.
    """
    contests = contests_of(rows)
    figure = out.with_suffix(".svg")
    drawing = figure_of(contests, camera)
    page = page_of(contests, study, folder, out, camera, figure.name if drawing else None)
    with replacing(*([out, figure] if drawing else [out])) as places:
        places[0].write_text(page, "utf-8")
        if drawing:
            places[1].write_text(svg_text(drawing), "utf-8")


def page_of(
    contests: Sequence[Contest], study: Mapping[str, Any], folder: Path, out: Path, camera: str, figure: str | None
) -> str:
    """Return the page's Markdown; parameters as `write_page`."""
    groups = groups_of(contests)
    of_groups = [
        (f"### {code(group_name(group, groups))}", [contest for contest in contests if contest.group == group])
        for group in groups
    ]
    ranked = sum(is_ranked(contest, camera) for contest in contests)
    worst = max((row.mc_share, contest.level) for contest in contests for rows in contest.rows.values() for row in rows)
    parts = [
        f"# {code(camera)} beside its opponents",
        f"    rodcone sweep STUDY.toml -o {folder} --as-stated\n"
        f"    rodcone opponents {folder} -o {out.name} --camera {camera}",
        facts_table(contests, study),
        f"{ranked} of {len(contests)} conditions are ranked: those in which W's SNR under {code(camera)} is 1 or more, "
        "or not known. Pictures are measured against the noise-free truth at the known exposure scale.",
        *white_pixel_tables(contests),
        f"![{description(contests, camera)}]({figure})" if figure else "",
        "## Won, level and lost",
        *duel_tables(contests, camera),
        "Conditions by the outcome of the 95 % interval over seeds, and the leads' range: below 0 "
        f"{code(camera)} is behind. Level by a margin: the interval's far end is within it. Times are medians over all "
        f"pictures, in units of {code(camera)}'s, on the machine "
        "of the sweep.",
        "## Lead in every condition",
        f"Positive: {code(camera)} is better. **Bold**: it is behind, and the whole interval is below 0. In brackets: "
        f"the interval holds 0. {MISSING}: not ranked.",
    ]
    for title, of_group in of_groups:
        parts += [title, *(lead_table(metric, of_group, camera) for metric in METRICS)]
    parts.append("## Every condition")
    for title, of_group in of_groups:
        parts += [f"{title}: figures", level_table(of_group, camera)]
    parts.append(
        "Means over seeds; the best of each column in bold. The render's own noise, which counts as texture, has at "
        f"most {percent(worst[0])} of the sensor's variance (at {level_text(worst[1])})."
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def code(text: str) -> str:
    """Write a name as Markdown's code, whatever is in it: in code no sign has a meaning but the backtick and |."""
    return "`" + " ".join(text.split()).replace("`", "'").replace("|", "\\|") + "`"


def facts_table(contests: Sequence[Contest], study: Mapping[str, Any]) -> str:
    """Return a table of what the numbers come from."""
    rows = next(iter(contests[0].rows.values()))
    groups = groups_of(contests)
    facts = {
        "study": [str(study.get("name", "study"))],
        **{name: [getattr(group, name) for group in groups] for name in _GROUPED_BY},
        "seeds": [str(row.seed) for row in rows],
        "pixels on the longer side": [str(study.get("render", {}).get("size") or MISSING)],
        "rodcone": [json.loads(rows[0].versions)["rodcone"]],
    }
    return table(
        ["source", "value"],
        [[name.replace("_", " "), ", ".join(code(value) for value in dict.fromkeys(of))] for name, of in facts.items()],
    )


def duel_tables(contests: Sequence[Contest], camera: str) -> list[str]:
    """Return `duel_table` for each exposure and white balance, with titles where there are several.

    First over the opponents that count, then over those whose colour matrix knows nothing of noise.
    """
    ways = list(dict.fromkeys((contest.group.exposure, contest.group.white_balance) for contest in contests))
    parts = []
    for way in ways:
        of_way = [contest for contest in contests if (contest.group.exposure, contest.group.white_balance) == way]
        title = f"### exposure {code(way[0])}, white balance {code(way[1])}" if len(ways) > 1 else ""
        plain = plain_opponents_of(of_way, camera)
        words = f"With the plain colour matrix, as published; the rows above rank `NAME{FAIR}`:" if plain else ""
        opponents = opponents_of(of_way, camera)
        parts += [title, duel_table(of_way, camera, opponents), no_worse_table(of_way, camera, opponents), words]
        parts += [duel_table(of_way, camera, plain)] if plain else []
    return parts


def no_worse_table(contests: Sequence[Contest], camera: str, opponents: Sequence[str]) -> str:
    """Return a table of the conditions in which the camera is ahead or level: by opponent, and beside all at once."""
    bayer = [name for name in opponents if name in PROCESSORS and PROCESSORS[name].mosaic == "bayer"]
    of_rows = {code(name): [name] for name in opponents} | {"every Bayer camera": bayer, "every one": opponents}
    ranked = sum(is_ranked(contest, camera) for contest in contests)
    margins = (f"{fixed(MARGINS[metric.key], metric.digits)} {metric.unit}".strip() for metric in METRICS)
    heads = (f"{metric.name}, worse by {margin} at most" for metric, margin in zip(METRICS, margins, strict=True))
    return table(
        [f"ahead or level, of {ranked} conditions", *heads],
        [
            [name, *(str(no_worse(contests, camera, among, metric)) for metric in METRICS)]
            for name, among in of_rows.items()
            if among
        ],
    )


def duel_table(contests: Sequence[Contest], camera: str, opponents: Sequence[str]) -> str:
    """Return a table of the camera's leads over each opponent: how often ahead, level, behind, from where to where."""
    own_s = _develop_s(contests, camera)
    rows = []
    for name in opponents:
        cells = [code(name)]
        for metric in METRICS:
            found = duels(contests, camera, name, metric)
            outcomes = [duel.outcome for duel in found]
            counts = " / ".join(str(outcomes.count(outcome)) for outcome in (AHEAD, LEVEL, BEHIND))
            leads = [duel.lead.mean for duel in found]
            span = f"{signed(metric, min(leads))} to {signed(metric, max(leads))}" if leads else MISSING
            cells += [counts, span]
        rows.append([*cells, f"× {significant(_develop_s(contests, name) / own_s, digits=2)}"])
    heads = [head for metric in METRICS for head in (f"{metric.name}: ahead / level / behind", _lead_head(metric))]
    return table(["opponent", *heads, "time to develop"], rows)


def lead_table(metric: Metric, of_group: Sequence[Contest], camera: str) -> str:
    """Return a table of the camera's leads in one group: opponents down, light across."""
    rows = []
    for name in opponents_of(of_group, camera):
        leads = {duel.contest.level: duel for duel in duels(of_group, camera, name, metric)}
        cells = []
        for contest in of_group:
            duel = leads.get(contest.level)
            shown = signed(metric, duel.lead.mean) if duel else MISSING
            way = {BEHIND: f"**{shown}**", LEVEL: f"({shown})"}
            cells.append(way.get(duel.outcome, shown) if duel else shown)
        rows.append([code(name), *cells])
    return table([_lead_head(metric), *(level_text(contest.level) for contest in of_group)], rows)


def level_table(of_group: Sequence[Contest], camera: str) -> str:
    """Return a table of one group: processors down, light across, PSNR and CIEDE2000; the best of each in bold."""
    rows = [[code(name), *(_both(contest, name) for contest in of_group)] for name in of_group[0].rows]
    for channel, words in (("G", "SNR of mean green [dB]"), ("W", "SNR of mean W [dB]")):
        values = [snr_db(contest, camera, channel) for contest in of_group]
        if not all(isnan(value) for value in values):
            # whole decibels, 0 without a sign
            rows.append([f"*{words}*", *(fixed(value if isnan(value) else round(value), 0) for value in values)])
    return table(["PSNR [dB], ΔE2000", *(level_text(contest.level) for contest in of_group)], rows)


def _lead_head(metric: Metric) -> str:
    return f"lead in {metric.name}" + (f" [{metric.unit}]" if metric.unit else "")


def _both(contest: Contest, name: str) -> str:
    shown = []
    for metric in (PSNR, DELTA_E):
        means = {other: fixed(contest.mean(other, metric), metric.digits) for other in contest.rows}
        sign = 1 if metric.higher else -1
        best = max(contest.rows, key=lambda other: sign * contest.mean(other, metric))
        shown.append(f"**{means[name]}**" if means[name] == means[best] else means[name])
    return ", ".join(shown)


def _develop_s(contests: Sequence[Contest], name: str) -> float:
    times = sorted(row.develop_s for contest in contests for row in contest.rows[name])
    return times[len(times) // 2]


def hardest(contests: Sequence[Contest], camera: str) -> str | None:
    """Return the opponent that is ahead of the camera in PSNR most often; None where none ever is."""
    lost = {
        name: sum(duel.outcome == BEHIND for duel in duels(contests, camera, name, PSNR))
        for name in opponents_of(contests, camera)
    }
    most = max(lost, key=lambda name: lost[name])
    return most if lost[most] else None


def description(contests: Sequence[Contest], camera: str) -> str:
    """Say what the figure shows, for those who don't see it."""
    most = hardest(contests, camera)
    tail = f"and {most}, which is ahead of it most often" if most else "of which no other is ahead of it anywhere"
    return f"PSNR over light for every processor: {camera}, {tail}"


@rc_context(STYLE)
def figure_of(contests: Sequence[Contest], camera: str) -> Figure | None:
    """Draw the charts; None where no group has two levels.

    The camera, the first of its opponents and the one that is ahead of it most often have colours, the others are grey.
    """
    groups = groups_of(contests)
    of_groups = [[contest for contest in contests if contest.group == group] for group in groups]
    charted = [of_group for of_group in of_groups if len(of_group) >= FEWEST_LEVELS]
    if not charted:
        return None
    names, most = opponents_of(contests, camera), hardest(contests, camera)
    colours = dict.fromkeys(names, OTHERS) | ({most: GREEN} if most else {}) | {names[0]: ORANGE, camera: BLUE}
    columns, rows = min(len(charted), COLUMNS), -(-len(charted) // COLUMNS)
    figure = blank(columns * CHART[0], rows * CHART[1])
    for index, of_group in enumerate(charted, 1):
        axes = figure.add_subplot(rows, columns, index)
        light = [contest.luminance_cd_m2 for contest in of_group]
        for name, colour in colours.items():
            psnr_db = [contest.mean(name, PSNR) for contest in of_group]
            axes.semilogx(light, psnr_db, color=colour, label=name, zorder=2.0 if colour == OTHERS else 3.0)
        axes.set(
            title=f"PSNR [dB], {group_name(of_group[0].group, groups)}", xlabel="cd/m²", xlim=(light[0], light[-1])
        )
        plain_ticks(axes)
        name_at_ends(axes, [(name, of_group[-1].mean(name, PSNR), colour) for name, colour in colours.items()])
    return figure
