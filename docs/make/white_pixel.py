"""What the white pixel brings, as a page: `docs/make/white_pixel.py SWEEP`, of the study white_pixel."""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from page_parts import RESULTS, csv_text, fill

from rodcone.errors import InputError
from rodcone.files import replacing
from studies.metrics.metric import DELTA_E, FLIP, PSNR, Metric
from studies.pages.headline import WHITE_PIXEL, Group
from studies.pages.plots import light_charts, svg_text
from studies.pages.report_compare import CAMERA, groups_of, means_over_scenes, shown_metrics
from studies.pages.report_data import ReportData
from studies.pages.report_markdown import lead_cells
from studies.pages.report_sweep import sweep_report
from studies.pages.report_text import table

PAGE = Path(__file__).resolve().parents[1] / "white_pixel.md"
METRICS = (PSNR, DELTA_E, FLIP)  # that the page shows; the CSV has all


def parts(report: ReportData) -> tuple[dict[str, str], str, str]:
    """Return the page's generated parts, its figure as SVG, and every lead as CSV."""
    missing = set(WHITE_PIXEL) - set(report.cameras)
    if missing:
        raise InputError(
            f"study: it lacks {', '.join(sorted(missing))}; allowed: the study white_pixel; sweep that one"
        )
    groups = groups_of(report, CAMERA, *(report.cameras.index(camera) for camera in WHITE_PIXEL))
    means, levels = means_over_scenes(report, groups), [level.name for level in report.levels]
    content = {
        "set-up": f"The numbers are those of rodcone {report.environment['rodcone']}: scenes of "
        f"{max(report.scenes[0].height, report.scenes[0].width)} pixels on the longer side, {len(report.seeds)} seeds. "
        "**Bold**: RGBW is behind by what a person sees (0.5 dB, 1 ΔE2000, 0.02 of FLIP). In brackets: less than "
        "that, or undecided.",
        **{metric.key: table([_with_unit(metric), *levels], lead_rows(metric, means)) for metric in METRICS},
    }
    rows = [[_with_unit(x), *row] for x in shown_metrics(report.cells) for row in lead_rows(x, [*groups, *means])]
    return content, svg_text(light_charts(*_charts(means))), csv_text(["metric", "where", *levels], rows)


def lead_rows(metric: Metric, groups: Sequence[Group]) -> list[list[str]]:
    """Return leads of RGBW over Bayer with half their intervals: places down, light across."""
    return [[group.title, *lead_cells(metric, group.pair.leads[metric.key])] for group in groups]


def _charts(means: Sequence[Group]) -> tuple[list[float], dict[str, dict[str, np.ndarray]]]:
    """Leads in PSNR over light: a chart for the named and one for the drawn scenes, a line for each other condition."""
    charts: dict[str, dict[str, np.ndarray]] = {}
    for group in means:
        scenes, _, condition = group.title.partition(", ")
        charts.setdefault(f"PSNR, dB: lead, {scenes}", {})[condition] = group.pair.leads[PSNR.key].mean
    return [light or np.nan for light in means[0].pair.light_cd_m2], charts


def _with_unit(metric: Metric) -> str:
    return f"{metric.name} [{metric.unit}]" if metric.unit else metric.name


def main(arguments: Sequence[str]) -> None:
    """Write the page's parts, its figure and its table, all or none."""
    try:
        if len(arguments) != 1:
            raise InputError(f"arguments: {list(arguments)} are not allowed; give the sweep's folder")
        content, figure, leads = parts(sweep_report(Path(arguments[0]), 0)[0])
    except InputError as error:
        raise SystemExit(f"white_pixel: {error}") from error
    with replacing(PAGE, PAGE.with_suffix(".svg"), RESULTS / "white_pixel.csv") as (page, drawing, file):
        page.write_text(fill(PAGE.read_text("utf-8"), content), "utf-8")
        drawing.write_text(figure, "utf-8")
        file.write_text(leads, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
