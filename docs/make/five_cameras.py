"""Cameras that exist beside the paper's pixel, on sensors of one size: `docs/make/five_cameras.py SWEEP`."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log10
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from page_parts import RESULTS, Parts, csv_text, run, write_page
from real_cameras import REPORTS

from rodcone.errors import InputError
from rodcone.types import Floats
from scenes.catalogue import load
from sensor.cameras.emva_report import read_report
from sensor.config import SensorConfig
from sensor.presets import preset, vary
from studies.metrics.confidence import half_width
from studies.metrics.metric import DELTA_E, METRICS, ON_TARGETS, PSNR, Metric
from studies.metrics.truth import light_in_bands
from studies.pages.plots import CHART, COLOURS, INK, SOFT, STYLE, blank, name_at_ends, plain_ticks, svg_text
from studies.pages.report_text import (
    duration_text,
    fixed,
    lead_text,
    level_text,
    markdown_table,
    percent,
    plain_name,
    significant,
)
from studies.pages.verdict import leads
from studies.photograph.snr import channel_e, snr
from studies.study.equal_area import EqualArea
from studies.study.study import label
from studies.sweep.database import LastRun, last_run
from studies.sweep.provenance import require_alike
from studies.sweep.row import Row

PAGE = RESULTS.parent / "five_cameras.md"
RGBW, BAYER = "ple_rgbw", "ple_bayer"
SHOWN = tuple(metric for metric in METRICS if metric not in ON_TARGETS)
LINES = dict(zip((*COLOURS, SOFT, "#9a7d0a", INK), ("-", "-", "-", "-", "-", "--", ":"), strict=True))  # a sensor each
AT_NM = 530.0  # where the quantum efficiency of a sensor without a report is stated


@dataclass(frozen=True)
class Entry:
    """One sensor of the study with the mosaic that it has here, and the processor that develops it.

    Attributes
    ----------
    name : str
    sensor : SensorConfig
    processor : str
    pictures : mapping from (processor, level) to list of Row
        In the order of the seeds.
    """

    name: str
    sensor: SensorConfig
    processor: str
    pictures: Mapping[tuple[str, str], Sequence[Row]]

    @property
    def words(self) -> str:
        """Name in tables."""
        return f"{self.name}, {'RGBW' if self.processor == RGBW else 'Bayer'}"

    def figures(self, metric: Metric, level: str, processor: str | None = None) -> Floats:
        """Figures of a metric at a level, (seed,), by its own processor or another."""
        return np.array([getattr(row, metric.key) for row in self.pictures[processor or self.processor, level]])


def parts(swept: LastRun) -> Parts:
    """Return the page's generated parts, its figure as SVG, and every figure as CSV.

    Parameters
    ----------
    swept : LastRun
        Of a study of one scene, spectrum, exposure and white balance, with `BAYER` and `RGBW`.

    Raises
    ------
    InputError
        For another study, or one that isn't whole.
    """
    study, seeds = swept.study, {row.seed for row in swept.rows}
    require_alike(swept.rows)
    levels = list(dict.fromkeys(row.level for row in sorted(swept.rows, key=lambda row: row.luminance_cd_m2)))
    entries = [_entry(given, swept.rows) for given in study["sensors"]]
    rgbw = next((entry for entry in entries if entry.processor == RGBW), None)
    if rgbw is None or not study.get("sensor_side_um") or len(entries) > len(LINES):
        raise InputError(
            f"study: {study.get('name')} is not of sensors of one size; allowed: one with sensor_side_um, at most "
            f"{len(LINES)} sensors of files and a preset; start from rodcone new study real_cameras"
        )
    places = [(entry, processor, level) for entry in entries for processor in (BAYER, RGBW) for level in levels]
    lacking = sorted({e.words for e, p, level in places if len(e.pictures.get((p, level), ())) != len(seeds)})
    if len(seeds) < 2 or lacking:
        raise InputError(
            f"seeds: {sorted(seeds)}; pictures are missing of {lacking or 'none'}; allowed: two seeds or more, and a "
            "whole sweep; run rodcone sweep again, which makes what is missing"
        )
    stops = {entry.name: entry.sensor.lens.f_number for entry in entries}
    if len(set(stops.values())) > 1:
        raise InputError(f"f_number: {stops} are not one; allowed: one aperture for all; correct the sensors' files")

    # What is equal, and the sensors.
    area = EqualArea(study["sensor_side_um"], max(entry.sensor.pixel.pitch_um for entry in entries))
    green, white = (rgbw.sensor.responses.curves[channel] for channel in "GW")
    at_peak = np.interp(green.wavelength_nm[green.values.argmax()], white.wavelength_nm, white.values)
    scene = study["scenes"][0]["source"]
    worst = max(row.mc_share for row in swept.rows)
    set_up = (
        f"Here: scene `{scene}`, {area.side_um:g} µm, f/{rgbw.sensor.lens.f_number:g}, at most "
        f"{duration_text(study['longest_exposure_s'])}, compared at {area.coarsest_um:g} µm. Green's filter passes "
        f"{percent(float(green.values.max() / at_peak))}. The render's own noise, which counts as texture, has at most "
        f"{percent(worst)} of the sensor's variance."
    )

    # The first two sensors by PSNR at each level, and the place of the paper's; what W brings each sensor.
    summary = []
    for level in levels:
        psnr_db = {entry.words: float(entry.figures(PSNR, level).mean()) for entry in entries}
        order = sorted(psnr_db, key=lambda name: -psnr_db[name])
        cells = [f"{order.index(x) + 1}. {x}: {fixed(psnr_db[x], 1)} dB" for x in (*order[:2], rgbw.words)]
        summary.append([level_text(level), *cells])
    white_pixel = []
    for entry in entries:
        by_level = [leads(PSNR, entry.figures(PSNR, x, RGBW), entry.figures(PSNR, x, BAYER)) for x in levels]
        white_pixel.append(
            [entry.name, *(f"{lead_text(PSNR, float(x.mean))} ± {fixed(float(x.half), 1)}" for x in by_level)]
        )

    # Every figure: exposure, electrons and SNR of an even field in closed form, means over seeds with their intervals.
    nm = np.arange(380.5, 780.0)
    light = light_in_bands(next(iter(load(scene).groups.values())).spectrum, nm, np.ones_like(nm))
    rows = []
    for entry, processor, level in places:
        row = entry.pictures[processor, level][0]
        cells = [entry.name, processor, level, f"{row.exposure_s:.4g}"]
        sensor = vary(entry.sensor, "rgbw" if processor == RGBW else "bayer")
        electrons = dict(
            zip(sensor.channels, channel_e(sensor, light, row.luminance_cd_m2, row.exposure_s), strict=True)
        )
        for channel in "GW":
            e = electrons.get(channel)
            known = e is not None and e < sensor.pixel.full_well_e
            cells += [
                "" if e is None else f"{e:.4g}",
                f"{20 * log10(float(snr(np.array(e), sensor, row.exposure_s))):.1f}" if known else "",
            ]
        for metric in SHOWN:
            figures = entry.figures(metric, level, processor)
            cells += [f"{figures.mean():.4g}", f"{half_width(figures):.2g}"]
        rows.append(cells)
    head = ["sensor", "processor", "level", "exposure_s"]
    head += [f"{channel}: {words}" for channel in "GW" for words in ("electrons of an even field", "its SNR [dB]")]
    head += [words for metric in SHOWN for words in (metric.key, f"{metric.key}: half its interval")]

    content = {
        "set-up": set_up,
        "sensors": sensors_table(entries, area),
        "summary": markdown_table(["by PSNR", "first", "second", "the paper's pixel"], summary),
        "white pixel": markdown_table(["lead in PSNR [dB]", *map(level_text, levels)], white_pixel),
    }
    return content, svg_text(_figure(entries, levels)), csv_text(head, rows)


def _entry(given: str, rows: Sequence[Row]) -> Entry:
    """Sensor of a file with Bayer, as it exists, or a preset with RGBW."""
    real, name = given.endswith(".toml"), plain_name(label(given))
    pictures: dict[tuple[str, str], list[Row]] = {}
    for row in sorted(rows, key=lambda row: row.seed):
        if plain_name(row.sensor) == name:
            pictures.setdefault((row.processor, row.level), []).append(row)
    return Entry(name, vary(preset(given), "bayer" if real else "rgbw"), BAYER if real else RGBW, pictures)


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
    return markdown_table([*head, "clip [e⁻/µm²]", "DSNU [e⁻]", "PRNU [%]"], rows)


def _efficiency(sensor: SensorConfig, figures: Mapping[str, float]) -> str:
    """Simulated quantum efficiency of W, in brackets without a report; the report's beside it where it differs."""
    at_nm, white = figures.get("lambda_nm", AT_NM), sensor.responses.curves["W"]
    value = 100 * sensor.pixel.fill_factor * float(np.interp(at_nm, white.wavelength_nm, white.values))
    if not figures:
        return f"({value:.1f} % at {at_nm:g} nm: the paper's W, fill factor {sensor.pixel.fill_factor:g})"
    alike = abs(value - figures["eta"]) < 0.05  # half of the last digit
    published = "" if alike else f"; published: {figures['eta']:g} %"
    return f"{value:.1f} % at {at_nm:g} nm{published}"


@rc_context(STYLE)
def _figure(entries: Sequence[Entry], levels: Sequence[str]) -> Figure:
    """Draw PSNR and median CIEDE2000 over light, a line a sensor."""
    figure = blank(2.6 * CHART[0], 1.2 * CHART[1])
    light = [entries[0].pictures[BAYER, level][0].luminance_cd_m2 for level in levels]
    for axes, metric in zip(figure.subplots(1, 2), (PSNR, DELTA_E), strict=True):
        means = {entry.words: [float(entry.figures(metric, level).mean()) for level in levels] for entry in entries}
        for values, (colour, line) in zip(means.values(), LINES.items(), strict=False):
            axes.semilogx(light, values, line, color=colour)
        axes.set(title=f"{metric.name} [{metric.unit}]" if metric.unit else metric.name)
        axes.set(xlabel="cd/m²", xlim=(light[0], light[-1]))
        plain_ticks(axes)
        name_at_ends(axes, [(name, of[-1], colour) for (name, of), colour in zip(means.items(), LINES, strict=False)])
    return figure


def write(folder: str) -> None:
    """Write the page of a sweep's folder, from where the sweep ran: the names of its sensors' files start there."""
    write_page(PAGE, *parts(last_run(Path(folder))))


if __name__ == "__main__":
    run(write, sys.argv[1:], len(sys.argv) == 2, "give the sweep's folder")
