"""Published EMVA 1288 figures beside those of the simulated chip: `python docs/make/real_cameras.py`."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot, log10, sqrt

import numpy as np
from page_parts import RESULTS, Parts, csv_text, write_page

from sensor.cameras.emva_report import EmvaReport, numbers_of, read_report
from sensor.cameras.numbers import PixelNumbers, missing
from sensor.config import LensConfig, SensorConfig
from sensor.emva1288.characterise import characterise
from sensor.pixel import PixelConfig
from studies.pages.report_text import MISSING, markdown_table

PAGE = RESULTS.parent / "real_cameras.md"
REPORTS = PAGE.parents[1] / "sensor" / "cameras" / "reports"
SHAPE, EXPOSURE_S = (256, 320), 0.01
MOST_OFF = 0.035  # of a figure, 0.3 dB: what Basler states of its own calibration, as the guide quotes it
HEAD = ("figure", "unit", "published", "configured", "recovered", "off", "is it within 3.5 % or 0.3 dB?")
REASONS = {  # of what lies beyond, by file and symbol
    ("basler_aca1920_155um", "K"): "no: the black level isn't told, so that K follows from the saturation here",
    ("basler_aca1920_155um", "DR_dB"): "no: 12.2 bit is 32 k over 6.8 e⁻; the threshold also holds quantisation, "
    "2.3 e⁻, and half an electron",
    ("flir_bfs_u3_50s5m", "DR_dB"): "no: it is 10824 over 2.27 + 0.5 e⁻, without the quantisation that 12 bit add "
    "(0.8 e⁻); K isn't told",
    ("alvium_1800_c_507", "DR_dB"): "no, but it is printed to 1 dB",
    ("phantom_miro_c211", "DR_dB"): "no: it is 6972 over 9.08 e⁻, the half electron of the threshold left out",
}


@dataclass(frozen=True)
class PublishedFigure:
    """A figure of a camera: published and configured values are None where there is none."""

    symbol: str
    unit: str
    published: float | None
    configured: float | None
    recovered: float
    is_input: bool

    @property
    def off(self) -> float | None:
        """Recovered over published less 1; of decibels the difference."""
        if not self.published:
            return None
        return self.recovered - self.published if self.unit == "dB" else self.recovered / self.published - 1

    @property
    def within(self) -> bool:
        """Whether a published figure is met within `MOST_OFF`."""
        return self.off is None or abs(self.off) <= (20 * log10(1 + MOST_OFF) if self.unit == "dB" else MOST_OFF)


def camera_of(numbers: PixelNumbers, report: EmvaReport) -> SensorConfig:
    """Chip of a report for the bench; a pitch that isn't told plays no part there."""
    reported = {key: number.value for key, number in numbers.pixel.items()}
    lent = {"pitch_um": 5.0, "dsnu_e": 0.0, "prnu": 0.0}
    pixel = PixelConfig(**{**{key: lent[key] for key in missing(numbers)}, **reported})
    return SensorConfig(
        pixel, LensConfig(2.8), cfa=("W",), bits=report.bits or 12, black_level_dn=report.black_level_dn
    )


def rows_of(report: EmvaReport, seed: int = 0) -> list[PublishedFigure]:
    """Figures of a report: published, configured, and recovered from the frames of one simulated chip."""
    numbers = numbers_of(report)
    sensor = camera_of(numbers, report)
    chip = characterise(sensor, SHAPE, seed, EXPOSURE_S)
    figures, half = report.figures, chip.saturation_e / 2
    noise_e = hypot(chip.figure("dark noise").configured, sensor.gain_e_per_dn / sqrt(12))
    in_closed_form = 20 * log10(half / sqrt(half + noise_e**2))
    clip_told = "K" in figures and report.bits is not None and report.black_level_dn is not None
    inputs = {"sigma_d", "DSNU1288", "PRNU1288", "mu_I", "K" if clip_told else "mu_e_sat"}
    measured = (
        ("K", "DN/e⁻", "gain", 1.0),
        ("sigma_d", "e⁻", "dark noise", 1.0),
        ("DSNU1288", "e⁻", "DSNU", 1.0),
        ("PRNU1288", "%", "PRNU", 100.0),
        ("mu_I", "e⁻/s", "dark current", 1.0),
        ("mu_e_sat", "e⁻", "saturation", 1.0),
        ("mu_e_min", "e⁻", "threshold", 1.0),
        ("SNR_max_dB", "dB", "greatest SNR", 1.0),
        ("DR_dB", "dB", "dynamic range", 1.0),
    )
    rows = [
        PublishedFigure(
            symbol, unit, figures.get(symbol), figure.configured * factor, figure.measured * factor, symbol in inputs
        )
        for symbol, unit, name, factor in measured
        for figure in [chip.figure(name)]
        if symbol in figures or symbol not in ("DSNU1288", "PRNU1288", "mu_I")
    ]
    snr_db = 20 * log10(float(np.interp(half, chip.transfer.light_e, chip.snr)))
    return [*rows, PublishedFigure("SNR_50_dB", "dB", figures.get("SNR_50_dB"), in_closed_form, snr_db, False)]


def results(reports: Mapping[str, EmvaReport]) -> Parts:
    """Return the page's generated parts, no figure, and all numbers as CSV.

    Raises
    ------
    KeyError
        For a figure beyond the limit of which `REASONS` gives no reason.
    """
    rows = {name: rows_of(report) for name, report in reports.items()}
    cells = [[reports[name].camera, *_cells(name, row)] for name in reports for row in rows[name]]
    overview = [
        (
            report.camera,
            f"{sum(row.off is not None for row in rows[name])}",
            f"{sum(row.off is not None and not row.is_input for row in rows[name])}",
            f"{sum(not row.within for row in rows[name])}",
        )
        for name, report in reports.items()
    ]
    beyond = [[line[0], line[1], line[3], *line[5:]] for line in cells if line[-1].startswith("no")]
    parts = {
        "cameras": markdown_table(
            ("camera", "figures published", "of them no input", "beyond 3.5 % or 0.3 dB"), overview
        ),
        "beyond": markdown_table(("camera", "figure", "published", "recovered", "off", "within?"), beyond),
    }
    return parts, "", csv_text(("camera", *HEAD), cells)


def _cells(name: str, row: PublishedFigure) -> list[str]:
    digits = ".2f" if row.unit == "dB" else ".5g"
    published, configured = (MISSING if x is None else format(x, digits) for x in (row.published, row.configured))
    off = MISSING if row.off is None else f"{row.off:+.2f} dB" if row.unit == "dB" else f"{100 * row.off:+.1f} %"
    reason = MISSING if row.off is None else "yes" if row.within else REASONS[name, row.symbol]
    symbol = f"{row.symbol} (input)" if row.is_input and row.published is not None else row.symbol
    return [symbol, row.unit, published, configured, format(row.recovered, digits), off, reason]


def main() -> None:
    """Write the page's parts and the table."""
    write_page(PAGE, *results({path.stem: read_report(path) for path in sorted(REPORTS.glob("*.toml"))}))


if __name__ == "__main__":
    main()
