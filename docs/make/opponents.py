"""`ple_rgbw` beside every other processor: ``opponents.py SWEEP`` writes the page's table, its figure and its CSV."""

import json
import sys
from collections.abc import Iterable
from functools import partial

import numpy as np
from page_parts import RESULTS, Parts, csv_text, run, write_swept

from rodcone.errors import InputError
from studies.metrics.metric import DELTA_E, FLIP, PSNR, Metric
from studies.pages.plots import light_charts, svg_text
from studies.pages.report_text import markdown_table, significant
from studies.pages.verdict import OUTCOMES, leads
from studies.sweep.row import Row

PAGE = RESULTS.parent / "opponents.md"
OURS = "ple_rgbw"
METRICS = (PSNR, DELTA_E, FLIP)
MARGINS = {PSNR.key: 0.1, DELTA_E.key: 0.1, FLIP.key: 0.003}  # a camera no further behind is no worse
LINES = (OURS, "ple_bayer", "bayer_residual_bm3d", "interleaved")  # of the figure


def parts(rows: Iterable[Row], version: str) -> Parts:
    """Return the page's generated parts, its figure as SVG, and every figure as CSV.

    Raises
    ------
    InputError
        Where a processor lacks a picture that `OURS` has, or there is one seed.
    """
    # Pictures by condition (white balance, scene, sensor, level) and processor, in the order of the seeds.
    places: dict[tuple[str, str, str, str], dict[str, list[Row]]] = {}
    for row in sorted(rows, key=lambda row: (row.luminance_cd_m2, row.seed)):
        cameras = places.setdefault((row.white_balance, row.scene, row.sensor, row.level), {})
        cameras.setdefault(row.processor, []).append(row)
    names = list(dict.fromkeys(name for cameras in places.values() for name in cameras if name != OURS))
    seeds = {len(of.get(name, [])) for of in places.values() for name in (OURS, *names)}
    if len(seeds) != 1 or seeds <= {0, 1}:
        raise InputError(
            f"study: it has {sorted(seeds)} seeds a picture; allowed: a whole sweep of the study opponents"
        )
    balances = list(dict.fromkeys(place[0] for place in places))
    bayer = [
        name
        for name in names
        if all(set(json.loads(of[name][0].mean_electrons)) == set("RGB") for of in places.values())
    ]

    def figures(place: tuple[str, str, str, str], name: str, metric: Metric) -> np.ndarray:
        return np.array([getattr(row, metric.key) for row in places[place][name]])

    lead = {
        (place, name, metric.key): leads(metric, figures(place, OURS, metric), figures(place, name, metric))
        for place in places
        for name in names
        for metric in METRICS
    }

    # The table: conditions ahead, level and behind; then those in which `OURS` is no worse than all of a kind.
    columns = [(metric, balance) for metric in METRICS for balance in balances]
    seconds = {
        name: np.median([row.develop_s for of in places.values() for row in of[name] if row.develop_s is not None])
        for name in (OURS, *names)
    }
    lines = []
    counted: dict[str, list[str]] = {}
    for name in names:
        outcomes = [
            [lead[place, name, metric.key].outcome for place in places if place[0] == balance]
            for metric, balance in columns
        ]
        cells = ["/".join(str(of.count(outcome)) for outcome in OUTCOMES) for of in outcomes]
        lines.append([f"`{name}`", *cells, f"×{significant(seconds[name] / seconds[OURS], digits=2)}"])
    for words, among in (("no worse than every Bayer camera", bayer), ("no worse than all", names)):
        cells = []
        for metric, balance in columns:
            here = [[lead[place, name, metric.key] for name in among] for place in places if place[0] == balance]
            cells.append(str(sum(all(x.mean - x.half >= -MARGINS[metric.key] for x in of) for of in here)))
        lines.append([words, *cells, ""])
        counted[words] = cells

    # The figure: means over scenes, sensors and seeds, as the first balance has them. The CSV: every condition.
    levels = list(dict.fromkeys(place[3] for place in places))
    light = [next(of[OURS][0].luminance_cd_m2 for place, of in places.items() if place[3] == level) for level in levels]
    charts = {
        f"{PSNR.name}, {PSNR.unit}: {balance}": {
            name: [
                np.mean([figures(p, name, PSNR) for p in places if (p[0], p[3]) == (balance, level)])
                for level in levels
            ]
            for name in LINES
            if name in (OURS, *names)
        }
        for balance in balances
    }
    cells = [
        [*place, name, *(f"{figures(place, name, metric).mean():.4g}" for metric in METRICS)]
        + [text for metric in METRICS if name != OURS for x in [lead[place, name, metric.key]]
           for text in (f"{x.mean:.3g}", f"{x.half:.2g}", str(x.outcome))]
        for place in places for name in (OURS, *names)
    ]  # fmt: skip
    keys = [metric.key for metric in METRICS]
    header = ["white balance", "scene", "sensor", "level", "processor", *keys]
    header += [f"{key}: {word}" for key in keys for word in ("lead of ple_rgbw", "half its interval", "outcome")]
    head = ["opponent", *(f"{metric.name.partition(',')[0]}, `{balance}`" for metric, balance in columns), "time"]
    conditions = len(places) // len(balances)
    set_up = f"The numbers are those of rodcone {version}, {conditions} conditions under each balance."
    of_bayer = list(zip(columns, counted["no worse than every Bayer camera"], strict=True))
    by_metric = [
        f"in {metric.name.partition(',')[0]} in "
        + " and ".join(f"{count} under `{balance}`" for (of, balance), count in of_bayer if of is metric)
        for metric in METRICS
    ]
    summary = (
        f"Of {conditions} conditions under each white balance `{OURS}` is no worse than every Bayer camera "
        f"{', '.join(by_metric)}."
    )
    content = {"set-up": set_up, "summary": summary, "ranks": markdown_table(head, lines)}
    return content, svg_text(light_charts(light, charts)), csv_text(header, cells)


if __name__ == "__main__":
    run(partial(write_swept, PAGE, parts), sys.argv[1:], len(sys.argv) == 2, "give the sweep's folder")
