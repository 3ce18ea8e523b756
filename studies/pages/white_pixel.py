"""What the W pixel brings: one method on both mosaics, by light, with intervals over seeds."""

from collections.abc import Sequence

import numpy as np

from studies.metrics.confidence import SeedMean, mean_with_confidence
from studies.pages.duels import METRICS, Contest
from studies.pages.report_text import MISSING, Metric, fixed, level_text, signed, table
from studies.study.study import OWN

RGBW, BAYER = "ple_rgbw", "ple_bayer"
DRAWN = "generated"  # how the names of scenes begin that are drawn from a number


def white_pixel_tables(contests: Sequence[Contest]) -> list[str]:
    """Return a title and a table for each metric; nothing where a sweep lacks one of the two processors.

    A cell is the lead of `RGBW` over `BAYER`: the mean over scenes of each seed's pair of pictures, with the half width
    of its 95 % interval over seeds.
    """
    if not {RGBW, BAYER} <= set(contests[0].rows):
        return []
    light = {contest.level: contest.luminance_cd_m2 for contest in contests}
    levels = sorted(light, key=lambda level: light[level])
    drawn = any(_group(contest)[-1] for contest in contests)
    parts = ["## What the W pixel brings", f"{TEXT} {DRAWN_TEXT}" if drawn else TEXT]
    for metric in METRICS:
        unit = f" [{metric.unit}]" if metric.unit else ""
        head = [f"{metric.name}{unit}", "exposure", "white balance", "scenes", *map(level_text, levels)]
        parts.append(table(head, _rows(contests, levels, metric)))
    return parts


TEXT = (
    f"`{RGBW}` beside `{BAYER}`: one method, prior and colour rule on both mosaics, which differ in nothing else. "
    "Positive: RGBW is better. Means over scenes, with half the 95 % interval over seeds, in brackets where"
    " it holds 0."
)
DRAWN_TEXT = "*Drawn* scenes come from a number that nobody chose, after prior and settings were fixed."


def _rows(contests: Sequence[Contest], levels: Sequence[str], metric: Metric) -> list[list[str]]:
    rows = []
    for group in dict.fromkeys(map(_group, contests)):
        sensor, exposure, balance, spectrum, drawn = group
        own = [x for x in contests if _group(x) == group]
        scenes = len({x.group.scene for x in own})
        cells = [_cell([x for x in own if x.level == level], metric) for level in levels]
        told = f"{scenes} {'drawn' if drawn else 'named'}" + (f", `{spectrum}`" if spectrum != OWN else "")
        rows.append([f"`{sensor}`", f"`{exposure}`", f"`{balance}`", told, *cells])
    return rows


def lead(contests: Sequence[Contest], metric: Metric) -> SeedMean:
    """Mean over scenes of the lead, with its interval over seeds."""
    sign = 1 if metric.higher else -1
    figures = np.array(
        [[[getattr(row, metric.key) for row in x.rows[name]] for name in (RGBW, BAYER)] for x in contests]
    )
    return mean_with_confidence(sign * (figures[:, 0] - figures[:, 1]).mean(axis=0))


def _cell(contests: Sequence[Contest], metric: Metric) -> str:
    if not contests:
        return MISSING
    found = lead(contests, metric)
    shown = f"{signed(metric, found.mean)} ± {fixed((found.high - found.low) / 2, metric.digits)}"
    return f"({shown})" if found.low <= 0 <= found.high else shown


def _group(contest: Contest) -> tuple[str, str, str, str, bool]:
    """Sensor, exposure, white balance, light, and whether the scene was drawn."""
    of = contest.group
    return of.sensor, of.exposure, of.white_balance, of.spectrum, of.scene.startswith(DRAWN)
