"""Cameras that exist beside the paper's pixel, on sensors of one size: `python -m studies.pages.five_cameras`."""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log10
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from rodcone.errors import InputError
from rodcone.files import replacing
from scenes.catalog import load
from sensor.binning import as_read
from sensor.cameras.emva_report import read_report
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.metrics.confidence import mean_with_confidence
from studies.metrics.truth import Light, light_in_bands
from studies.pages import report_text
from studies.pages.duels import AHEAD, BEHIND, LEVEL, METRICS, Contest, contests_of, duels, opponents_of
from studies.pages.duels_page import lead_table
from studies.pages.plots import CHART, COLOURS, INK, SOFT, STYLE, blank, name_at_ends, plain_ticks, svg_text
from studies.pages.real_cameras import REPORTS
from studies.pages.report_text import (
    DELTA_E,
    MISSING,
    ON_TARGETS,
    PSNR,
    Metric,
    duration,
    fixed,
    level_text,
    percent,
    plain_name,
    significant,
    table,
)
from studies.pages.white_pixel import BAYER, RGBW, white_pixel_tables
from studies.photograph.snr import FIELD_SIDE, even_field
from studies.study.equal_area import EqualArea
from studies.study.study import label
from studies.sweep.database import LastRun, last_run
from studies.sweep.row import Row

SHOWN = tuple(metric for metric in report_text.METRICS if metric not in ON_TARGETS)
LINES = dict(zip((*COLOURS, SOFT, "#9a7d0a", INK), ("-", "-", "-", "-", "-", "--", ":"), strict=True))  # a sensor each
TEXT = Path(__file__).parent / "templates" / "five_cameras.md"
AT_NM = 530.0  # where the quantum efficiency of a sensor without a report is told


@dataclass(frozen=True)
class Entry:
    """One sensor of the study with the mosaic that it has here, and the development that stands for it."""

    name: str
    sensor: SensorConfig
    processor: str

    @property
    def words(self) -> str:
        """Name in tables."""
        return f"{self.name}, {'RGBW' if self.processor == RGBW else 'Bayer'}"


def write_page(run: LastRun, folder: Path, out: Path) -> None:
    """Write the page and its figure, both or neither.

    Parameters
    ----------
    run : LastRun
        Of a study of one scene, spectrum, exposure and white balance, with `BAYER` and `RGBW`.
    folder : Path
        For the page's own command.
    out : Path
        Ends in ``.md``; the figure goes beside it, ending in ``.svg``.

    Raises
    ------
    InputError
        For another study, or one that isn't whole.
    """
    contests = contests_of(run.rows)
    entries = [_entry(given) for given in run.study["sensors"]]
    kinds = {entry.processor for entry in entries}
    if not kinds == {BAYER, RGBW} <= set(contests[0].rows) or not run.study.get("sensor_side_um"):
        raise InputError(
            f"study: {folder} is not of sensors of one size; allowed: one with sensor_side_um, {BAYER} and {RGBW}, "
            "sensors of files and a preset; start from rodcone new study real_cameras"
        )
    if len(entries) > len(LINES):
        raise InputError(f"sensors: {len(entries)} are too many for one figure; allowed: {len(LINES)}; leave some out")
    stops = {entry.name: entry.sensor.lens.f_number for entry in entries}
    if len(set(stops.values())) > 1:
        raise InputError(f"f_number: {stops} are not one; allowed: one aperture for all; correct the sensors' files")
    page, figure = page_of(run.study, entries, contests, folder, out), figure_of(beside_each_other(contests, entries))
    with replacing(out, out.with_suffix(".svg")) as (to_page, to_figure):
        to_page.write_text(page, "utf-8")
        to_figure.write_text(svg_text(figure), "utf-8")


def _entry(given: str) -> Entry:
    """Sensor of a file with Bayer, as it exists, or a preset with RGBW."""
    own, real = preset(given), given.endswith(".toml")
    return Entry(plain_name(label(given)), vary(own, "bayer" if real else "rgbw"), BAYER if real else RGBW)


def beside_each_other(contests: Sequence[Contest], entries: Sequence[Entry]) -> list[Contest]:
    """Contests in which the study's sensors, each with its development, stand where processors do."""
    found: dict[str, dict[str, tuple[Row, ...]]] = {}
    for entry in entries:
        for contest in contests:
            if plain_name(contest.group.sensor) == entry.name:
                found.setdefault(contest.level, {})[entry.words] = contest.rows[entry.processor]
    group = replace(contests[0].group, sensor="sensors of one size")
    return [Contest(group, level, next(iter(rows.values()))[0].luminance_cd_m2, rows) for level, rows in found.items()]


def _light(scene: str) -> Light:
    """Spectrum of the scene's first light, as the study has it."""
    nm = np.arange(380.5, 780.0)
    return light_in_bands(next(iter(load(scene).groups.values())).spectrum, nm, np.ones_like(nm))


def page_of(
    study: Mapping[str, Any], entries: Sequence[Entry], contests: Sequence[Contest], folder: Path, out: Path
) -> str:
    """Return the page's Markdown; parameters as `write_page`."""
    beside = beside_each_other(contests, entries)
    own = next(entry for entry in entries if entry.processor == RGBW)
    area = EqualArea(study["sensor_side_um"], max(as_read(entry.sensor).pixel.pitch_um for entry in entries))
    green, white = (own.sensor.responses.curves[channel] for channel in "GW")
    at_peak = np.interp(green.wavelength_nm[green.values.argmax()], white.wavelength_nm, white.values)
    scene = study["scenes"][0]["source"]
    worst = max(row.mc_share for contest in contests for rows in contest.rows.values() for row in rows)
    tables = {
        "sensors": [sensors_table(entries, area)],
        "summary": [summary_table(beside, own.words)],
        "light": light_tables(entries, beside, _light(scene), area.coarsest_um),
        "metrics": [metric_table(metric, beside) for metric in SHOWN],
        "outcomes": [outcome_table(beside, own.words)],
        "leads": [lead_table(metric, beside, own.words) for metric in METRICS],
        "white_pixel": white_pixel_tables(contests),
    }
    return TEXT.read_text("utf-8").format(
        folder=folder,
        page=out.name,
        figure=out.with_suffix(".svg").name,
        scene=f"`{scene}`",
        side=f"{area.side_um:g}",
        f_number=f"{own.sensor.lens.f_number:g}",
        longest=duration(study["longest_exposure_s"]),
        coarsest=f"{area.coarsest_um:g}",
        green_share=percent(float(green.values.max() / at_peak)),
        field=FIELD_SIDE,
        worst=percent(worst),
        own=own.name,
        **{name: "\n\n".join(parts) for name, parts in tables.items()},
    )


def sensors_table(entries: Sequence[Entry], area: EqualArea) -> str:
    """Return a table of the sensors' numbers as simulated; what no report tells stands in brackets."""
    rows = []
    for entry in entries:
        path, pixel = REPORTS / f"{entry.name}.toml", entry.sensor.pixel
        report = read_report(path) if path.is_file() else None
        told = {} if report is None else report.figures
        dsnu, prnu = f"{pixel.dsnu_e:.3g}", f"{100 * pixel.prnu:.3g}"
        rows.append(
            [
                f"`{entry.name}`" + ("" if report is None else f": {report.camera}"),
                f"{pixel.pitch_um:g}",
                str(area.shape((1, 1), pixel.pitch_um)[0]),
                _efficiency(entry.sensor, told),
                f"{pixel.read_noise_e:.3g}",
                significant(pixel.full_well_e),
                significant(pixel.full_well_e / pixel.pitch_um**2),
                dsnu if report is None or "DSNU1288" in told else f"({dsnu})",
                prnu if report is None or "PRNU1288" in told else f"({prnu})",
            ]
        )
    head = ["sensor", "pitch [µm]", "pixels across", "quantum efficiency", "read noise [e⁻]", "clip [e⁻]"]
    return table([*head, "clip [e⁻/µm²]", "DSNU [e⁻]", "PRNU [%]"], rows)


def _efficiency(sensor: SensorConfig, told: Mapping[str, float]) -> str:
    """Simulated quantum efficiency of W, in brackets without a report; the report's beside it where it differs."""
    at_nm, white = told.get("lambda_nm", AT_NM), sensor.responses.curves["W"]
    value = 100 * sensor.pixel.fill_factor * float(np.interp(at_nm, white.wavelength_nm, white.values))
    if not told:
        return f"({value:.1f} % at {at_nm:g} nm: the paper's W, fill factor {sensor.pixel.fill_factor:g})"
    published = "" if abs(value - told["eta"]) < 0.05 else f"; published: {told['eta']:g} %"  # half of the last digit
    return f"{value:.1f} % at {at_nm:g} nm{published}"


def light_tables(entries: Sequence[Entry], beside: Sequence[Contest], light: Light, coarsest_um: float) -> list[str]:
    """Return tables over light: exposure time, electrons, SNR of a pixel and per area."""
    levels = [level_text(contest.level) for contest in beside]
    rows: dict[str, list[list[str]]] = {"exposure": [], "electrons": [], "snr": [], "area": []}
    for entry in entries:
        shown = [each for each in channels(entry.sensor.cfa) if each in "GW"]
        rows["exposure"].append([entry.words, *(duration(each.rows[entry.words][0].exposure_s) for each in beside)])
        for channel in shown:
            cells: dict[str, list[str]] = {"electrons": [], "snr": [], "area": []}
            for contest in beside:
                row = contest.rows[entry.words][0]
                field = even_field(entry.sensor, channel, light, row.luminance_cd_m2, row.exposure_s)
                in_picture = json.loads(row.mean_electrons)[channel]
                cells["electrons"].append(f"{significant(field.electrons)}, {significant(in_picture)}")
                full = field.electrons >= entry.sensor.pixel.full_well_e
                cells["snr"].append(MISSING if full else f"{fixed(field.snr_db, 1)}, {fixed(field.simulated_db, 1)}")
                gain_db = 20 * log10(coarsest_um / entry.sensor.pixel.pitch_um)
                cells["area"].append(MISSING if full else fixed(field.snr_db + gain_db, 1))
            for key, values in cells.items():
                rows[key].append([f"{entry.words}, {channel}", *values])
    heads = {
        "exposure": "exposure time",
        "electrons": "electrons a pixel: even field, mean of the picture",
        "snr": "SNR of a pixel [dB]: closed form, simulated",
        "area": f"SNR of {coarsest_um:g} µm squared [dB]",
    }
    return [table([heads[key], *levels], of_key) for key, of_key in rows.items()]


def metric_table(metric: Metric, beside: Sequence[Contest]) -> str:
    """Return a table of one metric: sensors down, light across; the best of each column in bold."""
    sign = 1 if metric.higher else -1
    best = [sign * max(sign * contest.mean(name, metric) for name in contest.rows) for contest in beside]
    rows = []
    for name in beside[0].rows:
        cells = []
        for contest, most in zip(beside, best, strict=True):
            found = mean_with_confidence([getattr(row, metric.key) for row in contest.rows[name]])
            shown = fixed(found.mean, metric.digits)
            shown = f"**{shown}**" if shown == fixed(most, metric.digits) else shown
            cells.append(f"{shown} ± {fixed((found.high - found.low) / 2, metric.digits)}")
        rows.append([name, *cells])
    return table([_with_unit(metric), *(level_text(contest.level) for contest in beside)], rows)


def summary_table(beside: Sequence[Contest], own: str) -> str:
    """Return the first two sensors by PSNR at each level, and the place of one."""
    rows = []
    for contest in beside:
        psnr_db = {name: contest.mean(name, PSNR) for name in contest.rows}
        order = sorted(psnr_db, key=lambda name: -psnr_db[name])
        cells = [f"{order.index(name) + 1}. {name}: {fixed(psnr_db[name], 1)} dB" for name in (*order[:2], own)]
        rows.append([level_text(contest.level), *cells])
    return table(["by PSNR", "first", "second", "the paper's pixel"], rows)


def _with_unit(metric: Metric) -> str:
    return f"{metric.name} [{metric.unit}]" if metric.unit else metric.name


def outcome_table(beside: Sequence[Contest], own: str) -> str:
    """Return how often a sensor is ahead, level and behind each other one, by metric."""
    rows = []
    for other in opponents_of(beside, own):
        found = [[duel.outcome for duel in duels(beside, own, other, metric)] for metric in SHOWN]
        counts = [" / ".join(str(each.count(way)) for way in (AHEAD, LEVEL, BEHIND)) for each in found]
        rows.append([other, *counts])
    return table(["beside", *(metric.name for metric in SHOWN)], rows)


@rc_context(STYLE)
def figure_of(beside: Sequence[Contest]) -> Figure:
    """Draw PSNR and median CIEDE2000 over light, a line a sensor."""
    figure = blank(2.6 * CHART[0], 1.2 * CHART[1])
    light = [contest.luminance_cd_m2 for contest in beside]
    for axes, metric in zip(figure.subplots(1, 2), (PSNR, DELTA_E), strict=True):
        values = {name: [contest.mean(name, metric) for contest in beside] for name in beside[0].rows}
        for of_sensor, (colour, line) in zip(values.values(), LINES.items(), strict=False):
            axes.semilogx(light, of_sensor, line, color=colour)
        axes.set(title=_with_unit(metric), xlabel="cd/m²", xlim=(light[0], light[-1]))
        plain_ticks(axes)
        name_at_ends(axes, [(name, of[-1], colour) for (name, of), colour in zip(values.items(), LINES, strict=False)])
    return figure


def main(arguments: Sequence[str]) -> None:
    """Write the page of a sweep's folder, from where the sweep ran: its sensors' files are told as it was told them."""
    try:
        if len(arguments) != 2 or not arguments[1].endswith(".md"):
            raise InputError(f"arguments: {list(arguments)} are not allowed; give the sweep's folder and a page.md")
        folder, out = map(Path, arguments)
        write_page(last_run(folder), folder, out)
    except InputError as error:
        raise SystemExit(f"five_cameras: {error}") from error


if __name__ == "__main__":
    main(sys.argv[1:])
