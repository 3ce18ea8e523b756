"""Sensors of one size beside each other: presets made from the reports, places and leads by hand, studies refused."""

import csv
from pathlib import Path

import numpy as np
import pytest
import sweep_sample as SAMPLE
from five_cameras import Entry, parts, sensors_table
from page_parts import unstamped
from real_cameras import REPORTS

from sensor.cameras.emva_report import numbers_of, read_report
from sensor.cameras.numbers import borrowed_curves, completed, curves_csv, missing, preset_text
from sensor.presets import low_noise, preset
from studies.study.equal_area import EqualArea
from studies.study.study_file import read_study
from studies.sweep.database import LastRun
from studies.sweep.row import Row

CONFIGS = Path(__file__).parents[2] / "studies" / "configs"
PAGE = Path(__file__).parents[2] / "docs" / "five_cameras.md"
STUDY = read_study(CONFIGS / "real_cameras.toml")
FILES = [Path(name) for name in STUDY.sensors if name.endswith(".toml")]
REAL = FILES[0].stem
LIGHT = {"1cd/m2": 1.0, "10cd/m2": 10.0}
# Mean PSNR [dB] by sensor and processor; seeds differ by 0.2 dB, in step.
PSNR_DB = {
    (FILES[0].name, "ple_bayer"): 30.0,
    (FILES[0].name, "ple_rgbw"): 31.5,
    ("table1_output", "ple_bayer"): 20.0,
    ("table1_output", "ple_rgbw"): 24.0,
}


def run(**changes: object) -> LastRun:
    """Two sensors, two processors, two levels and two seeds."""
    made: list[Row] = [
        SAMPLE.row(processor, seed, sensor=sensor, level=level, luminance_cd_m2=light, exposure_s=0.01,
                   delta_e_median=5.0, psnr_db=mean + 0.2 * seed, ssim=0.5, delta_e_p95=9.0, s_cielab_median=4.0,
                   s_cielab_p95=8.0, flip_mean=0.1, pu21_psnr_db=40.0,
                   mean_electrons='{"R": 1.0, "G": 2.0, "B": 1.0, "W": 4.0}')
        for (sensor, processor), mean in PSNR_DB.items()
        for level, light in LIGHT.items()
        for seed in (0, 1)
    ]  # fmt: skip
    study = {
        "sensors": [str(FILES[0]), "table1_output"],
        "scenes": [{"source": "still_life"}],
        "sensor_side_um": 100.0,
        "longest_exposure_s": 0.066,
        **changes,
    }
    return LastRun(study, {}, len(made), made, "")


def plain(path: Path) -> str:
    """Text of a page with plain spaces and signs."""
    return plain_text(path.read_text("utf-8"))


def plain_text(text: str) -> str:
    return text.translate({0xA0: " ", 0x202F: " ", 0x2212: "-"})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_camera_of_the_study_is_what_its_report_makes(path: Path) -> None:
    numbers = numbers_of(read_report(REPORTS / path.name))
    assert not {"pitch_um", "full_well_e", "read_noise_e", "fill_factor"} & set(missing(numbers))  # never lent
    assert numbers.efficiency is not None
    whole = completed(numbers, low_noise(), "low_noise")
    curves = borrowed_curves(low_noise(), "low_noise", whole)
    name = f"{path.stem}_curves.csv"
    title = f"{whole.source.split(':')[0]}, as its sources tell it."
    assert path.read_text("utf-8") == preset_text(title, whole, curves, name)
    assert (path.parent / name).read_text("utf-8") == curves_csv(whole, curves)


def table_of(text: str) -> dict[tuple[str, str, str], dict[str, str]]:
    """Rows of the CSV by sensor, processor and level."""
    return {(row["sensor"], row["processor"], row["level"]): row for row in csv.DictReader(text.splitlines())}


@pytest.mark.thorough
def test_sensors_stand_beside_each_other_each_with_its_own_mosaic() -> None:
    content, figure, table = parts(run())
    text, cells = plain_text("\n".join(content.values())), table_of(table)
    assert figure.count(f">{REAL}, Bayer</text>") == 2
    # means over seeds: 30.1 and 24.1
    assert f"| 1 cd/m² | 1. {REAL}, Bayer: 30.1 dB | 2. table1_output, RGBW: 24.1 dB | 2. table1_output" in text
    # t of one degree of freedom is 12.706, the standard error 0.1
    cell = cells[REAL, "ple_bayer", "1cd/m2"]
    assert (cell["psnr_db"], cell["psnr_db: half its interval"]) == ("30.1", "1.3")
    # the same pixel with both mosaics; a lead in step has no scatter
    assert f"| {REAL} | +1.5 ± 0.0 | +1.5 ± 0.0 |" in text
    # 100 um at 6.9 and at 2.2 um
    assert f"`{REAL}`: {read_report(REPORTS / FILES[0].name).camera} | 6.9 | 14 |" in text
    assert "| `table1_output` | 2.2 | 45 | (76.2 % at 530 nm" in text
    # ten times the light gives ten times the electrons, until the well is full; Bayer has no W
    dim, bright = (float(cells["table1_output", "ple_rgbw", x]["W: electrons of an even field"]) for x in LIGHT)
    assert bright == pytest.approx(10 * dim, rel=1e-3)
    assert cell["W: electrons of an even field"] == cell["W: its SNR [dB]"] == ""


def test_the_quantum_efficiency_is_the_simulated_one_and_the_published_stands_beside_it_where_it_differs() -> None:
    entries = [Entry(path.stem, preset(str(CONFIGS / path), "bayer"), "ple_bayer", {}) for path in FILES]
    rows = plain_text(sensors_table(entries, EqualArea(883.2, 6.9))).splitlines()[2:]
    for entry, row in zip(entries, rows, strict=True):
        told = read_report(REPORTS / f"{entry.name}.toml").figures
        white = entry.sensor.responses.curves["W"]
        simulated = 100 * np.interp(told["lambda_nm"], white.wavelength_nm, white.values)
        cell = row.split(" | ")[3]
        assert cell.startswith(f"{simulated:.1f} % at {told['lambda_nm']:g} nm")
        assert ("published" in cell) == entry.name.startswith("framos")  # whose curve ends at 1 electron a photon
    assert "86.5 % at 536 nm; published: 91.25 %" in rows[-1]


def test_the_page_in_docs_is_of_the_committed_study() -> None:
    text = plain(PAGE)
    for path in FILES:
        assert f"| `{path.stem}`: {read_report(REPORTS / path.name).camera} |" in text
    assert len(table_of(unstamped((PAGE.parent / "results" / "five_cameras.csv").read_text("utf-8")))) == 7 * 2 * 6
