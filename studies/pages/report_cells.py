"""A report's cells: the rows of one picture under all seeds, as means with intervals."""

import json
from collections.abc import Sequence
from math import isfinite

from studies.metrics.confidence import mean_with_confidence
from studies.pages.report_data import ReportCell
from studies.pages.report_text import METRICS
from studies.sweep.row import Row

# What seeds scatter: every figure of a row but its exposure and its electrons, which noise doesn't touch.
SCATTERED = (*(metric.key for metric in METRICS), "snr_db", "saturated", "mc_share")


def over_seeds(
    rows: Sequence[Row | None], group: str, level: int, camera: str, light: tuple[float | None, float | None]
) -> ReportCell:
    """Return the cell of one picture under several seeds.

    With several seeds a figure that is unknown or not finite for one of them is unknown; with one it stays as it is.

    Parameters
    ----------
    rows : sequence of Row or None
        One for each seed; None for one that isn't made yet.
    group, level, camera
        As `ReportCell`.
    light : (float or None, float or None)
        The level in cd/m^2 and in lux.
    """
    figures: dict[str, float | None] = {}
    intervals: dict[str, tuple[float, float]] = {}
    for key in SCATTERED:
        values = [value for row in rows if row and (value := getattr(row, key)) is not None]
        figures[key] = values[0] if len(rows) == len(values) == 1 else None
        if len(rows) > 1 and len(values) == len(rows) and all(map(isfinite, values)):
            estimate = mean_with_confidence(values)
            figures[key], intervals[key] = estimate.mean, (estimate.low, estimate.high)
    states = [row.substitution for row in rows if row is not None and row.substitution is not None]
    balances = [json.loads(row.balance) for row in rows if row is not None]
    fallen = {channel: how for balance in balances for channel, how in balance.items() if how == "calibrated"}
    first = rows[0]
    return ReportCell(
        group=group,
        level=level,
        camera=camera,
        luminance_cd_m2=light[0],
        illuminance_lux=light[1],
        first=first,
        figures=figures,
        intervals=intervals,
        substitution=sum(states) / len(states) if len(states) == len(rows) else None,
        balance=(balances[0] if first else {}) | fallen,
        picture=first.picture if first else None,
    )
