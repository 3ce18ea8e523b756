"""The page of the white pixel: means over named and drawn scenes apart, positive where RGBW is better."""

from dataclasses import replace
from pathlib import Path

import pytest
import white_pixel
from report_sample import SENSORS, sample_report
from white_pixel import PAGE, main, parts

from rodcone.errors import InputError
from studies.pages.report_data import ReportData, ReportScene
from studies.sweep.row import Row

# PSNR [dB] of RGBW over Bayer by scene; the seeds of both mosaics move in step.
LEADS_DB = {"still_life": 1.0, "night_street": 3.0, "generated-1": -2.5, "generated-2": -0.5}

SIZES = (128, 96), (64, 48), (64, 48), (64, 48)  # height, width


def swept(*cameras: str) -> ReportData:
    def change(row: Row) -> Row:
        lead_db = LEADS_DB[row.scene] if row.processor == "ple_rgbw" else 0.0
        return replace(row, psnr_db=20.0 + 0.3 * row.seed + lead_db)

    scenes = tuple(ReportScene(name, *size) for name, size in zip(LEADS_DB, SIZES, strict=True))
    report = sample_report(
        change, levels=2, scenes=scenes, sensors=SENSORS[:1], seeds=(0, 1), cameras=cameras,
        balances=("as-shot", "gray-world"),
    )  # fmt: skip
    return replace(report, environment={"rodcone": "0.2.0+abc"})


def test_leads_are_means_over_named_and_over_drawn_scenes_by_balance() -> None:
    content, figure, table = parts(swept("ple_bayer", "ple_rgbw"))
    for balance in ("balanced as shot", "balanced by Gray World"):
        assert f"| mean of 2 named scenes, {balance} | +2.0 ± 0.0 | +2.0 ± 0.0 |" in content["psnr_db"]
        assert f"| mean of 2 drawn scenes, {balance} | **−1.5 ± 0.0** | **−1.5 ± 0.0** |" in content["psnr_db"]
        assert f'PSNR [dB],"generated-1, {balance}",**−2.5 ± 0.0**' in table
        assert figure.count(f">{balance}</text>") == 2  # a line in each chart
    report = swept("ple_bayer", "ple_rgbw")
    turned = replace(report, scenes=tuple(ReportScene(x.name, x.width, x.height) for x in report.scenes))
    for one in (report, turned):
        assert "rodcone 0.2.0+abc: scenes of 128 pixels on the longer side, 2 seeds" in parts(one)[0]["set-up"]


def test_the_page_has_a_place_for_every_part() -> None:
    text = PAGE.read_text("utf-8")
    assert [name for name in parts(swept("ple_rgbw", "ple_bayer"))[0] if text.count(f"<!-- {name} -->") != 1] == []


def test_another_study_is_refused() -> None:
    with pytest.raises(InputError, match="ple_bayer"):
        parts(swept("ple_rgbw", "bayer"))
    for folders in ([], ["one", "other"]):
        with pytest.raises(SystemExit, match="give the sweep's folder"):
            main(folders)


def test_the_command_writes_page_figure_and_table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """All three hold what `parts` gives, in the places that the page has for it."""
    report = swept("ple_bayer", "ple_rgbw")
    monkeypatch.setattr(white_pixel, "sweep_report", lambda folder, pictures: {tmp_path: (report, pictures)}[folder])
    page = tmp_path / "white_pixel.md"
    page.write_text(PAGE.read_text("utf-8"), "utf-8")
    monkeypatch.setattr(white_pixel, "PAGE", page)
    monkeypatch.setattr(white_pixel, "RESULTS", tmp_path)
    main([str(tmp_path)])
    content, figure, table = parts(report)
    assert page.with_suffix(".svg").read_text("utf-8") == figure
    assert (tmp_path / "white_pixel.csv").read_text("utf-8") == table
    assert all(part in page.read_text("utf-8") for part in content.values())
