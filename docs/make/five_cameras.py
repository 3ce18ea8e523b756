"""Cameras that exist beside the paper's pixel, on sensors of one size: `docs/make/five_cameras.py SWEEP`."""

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
from page_parts import RESULTS, csv_text, fill
from real_cameras import REPORTS

from rodcone.errors import InputError
from rodcone.files import replacing
from scenes.catalog import load
from sensor.cameras.emva_report import read_report
from sensor.capture import expose
from sensor.cfa import channels
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.presets import preset
from sensor.variations import vary
from studies.metrics.confidence import half_width
from studies.metrics.metric import DELTA_E, FLIP, METRICS, ON_TARGETS, PSNR, Metric
from studies.metrics.truth import Light, light_in_bands
from studies.pages.plots import CHART, COLOURS, INK, SOFT, STYLE, blank, name_at_ends, plain_ticks, svg_text
from studies.pages.report_text import (
    MISSING,
    duration,
    fixed,
    lead_text,
    level_text,
    percent,
    plain_name,
    significant,
    table,
)
from studies.pages.verdict import Floats, Leads, leads
from studies.photograph.snr import channel_e, snr
from studies.study.equal_area import EqualArea
from studies.study.study import label
from studies.sweep.database import LastRun, last_run
from studies.sweep.provenance import require_alike
from studies.sweep.row import Row

PAGE = Path(__file__).resolve().parents[1] / "five_cameras.md"
RGBW, BAYER = "ple_rgbw", "ple_bayer"
SHOWN = tuple(metric for metric in METRICS if metric not in ON_TARGETS)
LINES = dict(zip((*COLOURS, SOFT, "#9a7d0a", INK), ("-", "-", "-", "-", "-", "--", ":"), strict=True))  # a sensor each
FIELD_SIDE = 512  # pixels of a simulated even field
AT_NM = 530.0  # where the quantum efficiency of a sensor without a report is told


@dataclass(frozen=True)
class EvenField:
    """An even neutral field on the pixels of one channel.

    Attributes
    ----------
    electrons : float
        Expected photo-electrons of a pixel.
    snr_db : float
        In closed form (`snr`).
    simulated_db : float
        Mean over standard deviation of `FIELD_SIDE` squared pixels of one simulated chip, from one frame; NaN where the
        mean is not above the dark's.
    """

    electrons: float
    snr_db: float
    simulated_db: float


def even_field(
    sensor: SensorConfig, channel: str, light: Light, luminance_cd_m2: float, exposure_s: float
) -> EvenField:
    """Electrons and SNR of a channel's pixels in an even neutral field: closed form, and one simulated frame."""
    alone = replace(sensor, cfa=(channel,))
    electrons, shape = float(channel_e(alone, light, luminance_cd_m2, exposure_s)[0]), (FIELD_SIDE, FIELD_SIDE)
    rng = np.random.default_rng(0)
    device = draw_device(alone, shape, rng)
    raw = expose(np.full(shape, electrons / alone.chip.sites**2), alone, exposure_s, device, rng)
    pixel = alone.pixel
    dark_e_per_s = pixel.dark_current_e_per_s + pixel.hot_pixel_share * pixel.hot_pixel_dark_current_e_per_s
    mean_e = float(raw.electrons.mean()) - dark_e_per_s * raw.exposure_s
    simulated_db = 20 * log10(mean_e / float(raw.electrons.std())) if mean_e > 0 else float("nan")
    return EvenField(electrons, 20 * log10(float(snr(np.array(electrons), alone, exposure_s))), simulated_db)


@dataclass(frozen=True)
class Condition:
    """One light level: rows by name, of a sensor or a processor, each in the order of the seeds."""

    level: str
    luminance_cd_m2: float
    rows: Mapping[str, tuple[Row, ...]]

    def figures(self, name: str, metric: Metric) -> Floats:
        """Figures of a metric, (seed,)."""
        return np.array([getattr(row, metric.key) for row in self.rows[name]])

    def mean(self, name: str, metric: Metric) -> float:
        """Mean of a metric over the seeds."""
        return float(self.figures(name, metric).mean())


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


def write_page(run: LastRun, folder: Path, out: Path, table_out: Path) -> None:
    """Write the page's parts, its figure and its table, all or none.

    Parameters
    ----------
    run : LastRun
        Of a study of one scene, spectrum, exposure and white balance, with `BAYER` and `RGBW`.
    folder : Path
        That the study was swept into.
    out : Path
        The page, which is there; the figure goes beside it, ending in ``.svg``.
    table_out : Path
        For every figure, as CSV.

    Raises
    ------
    InputError
        For another study, or one that isn't whole.
    """
    require_alike(run.rows)
    entries = [_entry(given) for given in run.study["sensors"]]
    conditions = {entry.name: conditions_of(run.rows, entry.name) for entry in entries}
    kinds = {entry.processor for entry in entries}
    there = set.intersection(*(set(x.rows) for of_sensor in conditions.values() for x in of_sensor))
    if not kinds == {BAYER, RGBW} <= there or not run.study.get("sensor_side_um"):
        raise InputError(
            f"study: {folder} is not of sensors of one size; allowed: one with sensor_side_um, {BAYER} and {RGBW}, "
            "sensors of files and a preset; start from rodcone new study real_cameras"
        )
    if len(entries) > len(LINES):
        raise InputError(f"sensors: {len(entries)} are too many for one figure; allowed: {len(LINES)}; leave some out")
    stops = {entry.name: entry.sensor.lens.f_number for entry in entries}
    if len(set(stops.values())) > 1:
        raise InputError(f"f_number: {stops} are not one; allowed: one aperture for all; correct the sensors' files")
    parts, figures = results(run.study, entries, conditions)
    figure = figure_of(beside_each_other(conditions, entries))
    with replacing(out, out.with_suffix(".svg"), table_out) as (to_page, to_figure, to_table):
        to_page.write_text(fill(out.read_text("utf-8"), parts), "utf-8")
        to_figure.write_text(svg_text(figure), "utf-8")
        to_table.write_text(figures, "utf-8")


def _entry(given: str) -> Entry:
    """Sensor of a file with Bayer, as it exists, or a preset with RGBW."""
    sensor, real = preset(given), given.endswith(".toml")
    return Entry(plain_name(label(given)), vary(sensor, "bayer" if real else "rgbw"), BAYER if real else RGBW)


def conditions_of(rows: Sequence[Row], sensor: str) -> list[Condition]:
    """Return the light levels of one sensor, from dark to bright, with its rows by processor.

    Raises
    ------
    InputError
        Where a processor lacks a picture that another has, or there are fewer than two seeds.
    """
    by_level: dict[str, dict[str, dict[int, Row]]] = {}
    for row in rows:
        if plain_name(row.sensor) == sensor:
            by_level.setdefault(row.level, {}).setdefault(row.processor, {})[row.seed] = row
    seeds = sorted({row.seed for row in rows})
    lacking = [level for level, of in by_level.items() for by_seed in of.values() if sorted(by_seed) != seeds]
    if len(seeds) < 2 or lacking:
        raise InputError(
            f"seeds: {seeds} of {sensor} lack pictures at {lacking}; allowed: two seeds or more, and a whole sweep; "
            "run rodcone sweep again, which makes what is missing"
        )
    conditions = [
        Condition(
            level,
            next(iter(of.values()))[seeds[0]].luminance_cd_m2,
            {name: tuple(by_seed[seed] for seed in seeds) for name, by_seed in of.items()},
        )
        for level, of in by_level.items()
    ]
    return sorted(conditions, key=lambda condition: condition.luminance_cd_m2)


def beside_each_other(conditions: Mapping[str, Sequence[Condition]], entries: Sequence[Entry]) -> list[Condition]:
    """Conditions in which the study's sensors, each with its development, stand where processors do."""
    levels = zip(*(conditions[entry.name] for entry in entries), strict=True)
    return [
        replace(at[0], rows={entry.words: x.rows[entry.processor] for entry, x in zip(entries, at, strict=True)})
        for at in levels
    ]


def leads_of(metric: Metric, conditions: Sequence[Condition], ours: str, theirs: str) -> Leads:
    """Leads of one over another, by level."""
    return leads(metric, *(np.array([x.figures(name, metric) for x in conditions]) for name in (ours, theirs)))


def lead_rows(metric: Metric, leads_by_name: Mapping[str, Leads]) -> list[list[str]]:
    """Return leads with half their intervals: a line each, light across."""
    return [
        [
            name,
            *(
                f"{lead_text(metric, mean)} ± {fixed(half, metric.digits)}"
                for mean, half in zip(x.mean, x.half, strict=True)
            ),
        ]
        for name, x in leads_by_name.items()
    ]


def _light(scene: str) -> Light:
    """Spectrum of the scene's first light, as the study has it."""
    nm = np.arange(380.5, 780.0)
    return light_in_bands(next(iter(load(scene).groups.values())).spectrum, nm, np.ones_like(nm))


def results(
    study: Mapping[str, Any], entries: Sequence[Entry], conditions: Mapping[str, Sequence[Condition]]
) -> tuple[dict[str, str], str]:
    """Return the page's generated parts, and every figure as CSV; parameters as `write_page`."""
    beside = beside_each_other(conditions, entries)
    levels = [level_text(x.level) for x in beside]
    rgbw = next(entry for entry in entries if entry.processor == RGBW)
    area = EqualArea(study["sensor_side_um"], max(entry.sensor.pixel.pitch_um for entry in entries))
    green, white = (rgbw.sensor.responses.curves[channel] for channel in "GW")
    at_peak = np.interp(green.wavelength_nm[green.values.argmax()], white.wavelength_nm, white.values)
    scene = study["scenes"][0]["source"]
    worst = max(row.mc_share for x in beside for rows in x.rows.values() for row in rows)
    paper = {
        metric: lead_rows(
            metric, {x.words: leads_of(metric, beside, rgbw.words, x.words) for x in entries if x != rgbw}
        )
        for metric in (PSNR, DELTA_E, FLIP)
    }
    white_pixel = {
        metric: lead_rows(metric, {name: leads_of(metric, at, RGBW, BAYER) for name, at in conditions.items()})
        for metric in (PSNR, DELTA_E, FLIP)
    }
    tables = {
        **light_rows(entries, beside, _light(scene), area.coarsest_um),
        **{_with_unit(metric): metric_rows(metric, beside) for metric in SHOWN},
        **{f"lead of {rgbw.words}: {_with_unit(metric)}": rows for metric, rows in paper.items()},
        **{f"lead of {RGBW} over {BAYER}: {_with_unit(metric)}": rows for metric, rows in white_pixel.items()},
    }
    parts = {
        "set-up": f"Here: scene `{scene}`, {area.side_um:g} µm, f/{rgbw.sensor.lens.f_number:g}, at most "
        f"{duration(study['longest_exposure_s'])}, compared at {area.coarsest_um:g} µm. Green's filter passes "
        f"{percent(float(green.values.max() / at_peak))}. The render's own noise, which counts as texture, has at most "
        f"{percent(worst)} of the sensor's variance.",
        "sensors": sensors_table(entries, area),
        "summary": summary_table(beside, rgbw.words),
        "white pixel": table([f"lead in {_with_unit(PSNR)}", *levels], white_pixel[PSNR]),
    }
    rows = [[name, *cells] for name, of_table in tables.items() for cells in of_table]
    return parts, csv_text(["table", "camera", *levels], rows)


def sensors_table(entries: Sequence[Entry], area: EqualArea) -> str:
    """Return a table of the sensors' numbers as simulated; what no report tells stands in brackets."""
    rows = []
    for entry in entries:
        path, pixel = REPORTS / f"{entry.name}.toml", entry.sensor.pixel
        report = read_report(path) if path.is_file() else None
        figures = {} if report is None else report.figures
        dsnu, prnu = f"{pixel.dsnu_e:.3g}", f"{100 * pixel.prnu:.3g}"
        rows.append(
            [
                f"`{entry.name}`" + ("" if report is None else f": {report.camera}"),
                f"{pixel.pitch_um:g}",
                str(area.shape((1, 1), pixel.pitch_um)[0]),
                _efficiency(entry.sensor, figures),
                f"{pixel.read_noise_e:.3g}",
                significant(pixel.full_well_e),
                significant(pixel.full_well_e / pixel.pitch_um**2),
                dsnu if report is None or "DSNU1288" in figures else f"({dsnu})",
                prnu if report is None or "PRNU1288" in figures else f"({prnu})",
            ]
        )
    head = ["sensor", "pitch [µm]", "pixels across", "quantum efficiency", "read noise [e⁻]", "clip [e⁻]"]
    return table([*head, "clip [e⁻/µm²]", "DSNU [e⁻]", "PRNU [%]"], rows)


def _efficiency(sensor: SensorConfig, figures: Mapping[str, float]) -> str:
    """Simulated quantum efficiency of W, in brackets without a report; the report's beside it where it differs."""
    at_nm, white = figures.get("lambda_nm", AT_NM), sensor.responses.curves["W"]
    value = 100 * sensor.pixel.fill_factor * float(np.interp(at_nm, white.wavelength_nm, white.values))
    if not figures:
        return f"({value:.1f} % at {at_nm:g} nm: the paper's W, fill factor {sensor.pixel.fill_factor:g})"
    alike = abs(value - figures["eta"]) < 0.05  # half of the last digit
    published = "" if alike else f"; published: {figures['eta']:g} %"
    return f"{value:.1f} % at {at_nm:g} nm{published}"


def light_rows(
    entries: Sequence[Entry], beside: Sequence[Condition], light: Light, coarsest_um: float
) -> dict[str, list[list[str]]]:
    """Return rows over light: exposure time, electrons, SNR of a pixel and per area."""
    times, electrons, snr, area = (
        "exposure time",
        f"electrons a pixel: even field of {FIELD_SIDE} x {FIELD_SIDE}, mean of the picture",
        "SNR of a pixel [dB]: closed form, simulated",
        f"SNR of {coarsest_um:g} µm squared [dB]",
    )
    rows: dict[str, list[list[str]]] = {times: [], electrons: [], snr: [], area: []}
    for entry in entries:
        rows[times].append(
            [entry.words, *(duration(condition.rows[entry.words][0].exposure_s) for condition in beside)]
        )
        gain_db = 20 * log10(coarsest_um / entry.sensor.pixel.pitch_um)
        for channel in [name for name in channels(entry.sensor.cfa) if name in "GW"]:
            for name in (electrons, snr, area):
                rows[name].append([f"{entry.words}, {channel}"])
            for condition in beside:
                row = condition.rows[entry.words][0]
                field = even_field(entry.sensor, channel, light, row.luminance_cd_m2, row.exposure_s)
                in_picture = json.loads(row.mean_electrons)[channel]
                full = field.electrons >= entry.sensor.pixel.full_well_e
                rows[electrons][-1].append(f"{significant(field.electrons)}, {significant(in_picture)}")
                rows[snr][-1].append(MISSING if full else f"{fixed(field.snr_db, 1)}, {fixed(field.simulated_db, 1)}")
                rows[area][-1].append(MISSING if full else fixed(field.snr_db + gain_db, 1))
    return rows


def metric_rows(metric: Metric, beside: Sequence[Condition]) -> list[list[str]]:
    """Return means over seeds of one metric with half their intervals: sensors down, light across."""
    rows = []
    for name in beside[0].rows:
        seeds = [np.array([getattr(row, metric.key) for row in condition.rows[name]]) for condition in beside]
        halves = [fixed(float(half_width(x)), metric.digits) for x in seeds]
        rows.append([name, *(f"{fixed(x.mean(), metric.digits)} ± {y}" for x, y in zip(seeds, halves, strict=True))])
    return rows


def summary_table(beside: Sequence[Condition], rgbw: str) -> str:
    """Return the first two sensors by PSNR at each level, and the place of one."""
    rows = []
    for condition in beside:
        psnr_db = {name: condition.mean(name, PSNR) for name in condition.rows}
        order = sorted(psnr_db, key=lambda name: -psnr_db[name])
        cells = [f"{order.index(name) + 1}. {name}: {fixed(psnr_db[name], 1)} dB" for name in (*order[:2], rgbw)]
        rows.append([level_text(condition.level), *cells])
    return table(["by PSNR", "first", "second", "the paper's pixel"], rows)


def _with_unit(metric: Metric) -> str:
    return f"{metric.name} [{metric.unit}]" if metric.unit else metric.name


@rc_context(STYLE)
def figure_of(beside: Sequence[Condition]) -> Figure:
    """Draw PSNR and median CIEDE2000 over light, a line a sensor."""
    figure = blank(2.6 * CHART[0], 1.2 * CHART[1])
    light = [condition.luminance_cd_m2 for condition in beside]
    for axes, metric in zip(figure.subplots(1, 2), (PSNR, DELTA_E), strict=True):
        values = {name: [condition.mean(name, metric) for condition in beside] for name in beside[0].rows}
        for of_sensor, (colour, line) in zip(values.values(), LINES.items(), strict=False):
            axes.semilogx(light, of_sensor, line, color=colour)
        axes.set(title=_with_unit(metric), xlabel="cd/m²", xlim=(light[0], light[-1]))
        plain_ticks(axes)
        name_at_ends(axes, [(name, of[-1], colour) for (name, of), colour in zip(values.items(), LINES, strict=False)])
    return figure


def main(arguments: Sequence[str]) -> None:
    """Write the page of a sweep's folder, from where the sweep ran: its sensors' files are told as it was told them."""
    try:
        if len(arguments) != 1:
            raise InputError(f"arguments: {list(arguments)} are not allowed; give the sweep's folder")
        folder = Path(arguments[0])
        write_page(last_run(folder), folder, PAGE, RESULTS / "five_cameras.csv")
    except InputError as error:
        raise SystemExit(f"five_cameras: {error}") from error


if __name__ == "__main__":
    main(sys.argv[1:])
