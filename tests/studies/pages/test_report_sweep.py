"""The report of a sweep: every row in it, names as text, pictures within a limit, and what isn't made yet said so."""

import json
import re
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from html import unescape
from itertools import product
from math import isnan
from pathlib import Path

import numpy as np
import pytest
import report_sample as REPORTS
import sweep_sample as SAMPLE
from command_line import call, check_refusals
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refusal

from studies.commands.report import write_report, write_results
from studies.metrics.flip import seen
from studies.pages.report import group_views, render_report
from studies.pages.report_compare import Comparison
from studies.pages.report_data import ReportRender, ReportSensor
from studies.pages.report_pictures import busiest, flip_map, opened, view_order
from studies.pages.report_sweep import render_of, sensor_of, shown_part, sweep_report
from studies.study.study import SceneChoice
from studies.sweep.database import FILE
from studies.sweep.export import read_rows

NAME = "</script><b>study"
FILES = ("<b>bold.exr", "other.exr")


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of two scenes, two levels, two exposures, two processors and two seeds: 32 cells."""
    folder: Path = tmp_path_factory.mktemp("swept")
    for name, size in zip(FILES, ((16, 20), (24, 16)), strict=True):
        SAMPLE.picture(folder / name, size)
    scenes = tuple(SceneChoice(str(folder / name), "E") for name in FILES)
    study = SAMPLE.small_study(
        folder, scenes=scenes, exposures=("auto", "2ms"), processors=("interleaved", "bayer"), name=NAME
    )
    SAMPLE.swept(study, folder / "out")
    return folder / "out"


def copied(out: Path, place: Path) -> Path:
    """Ledger and pictures in a folder of their own, to be changed."""
    (place / "pictures").symlink_to(out / "pictures")
    with closing(sqlite3.connect(out / FILE)) as base, closing(sqlite3.connect(place / FILE)) as copy:
        base.backup(copy)
    return place


@pytest.mark.thorough
def test_every_row_stands_in_the_report(out: Path) -> None:
    report, pictures = sweep_report(out)
    rows = {(r.scene, r.level, r.exposure, r.processor, r.seed): r for r in read_rows(out)}
    assert len(rows) == 2 * len(report.cells) == 32
    for cell in report.cells:
        level = ("1cd/m2", "25cd/m2")[cell.level]
        assert cell.first is not None
        place = cell.first.scene, level, cell.first.exposure, cell.camera
        both = [rows[*place, seed] for seed in (0, 1)]
        assert cell.first == both[0]
        assert cell.luminance_cd_m2 == both[0].luminance_cd_m2
        assert cell.picture == both[0].picture
        for name in ("psnr_db", "flip_mean", "s_cielab_p95", "pu21_psnr_db", "mc_share"):
            assert cell.mean(name) == pytest.approx(sum(getattr(row, name) for row in both) / 2)
    assert len(pictures.files) == 16 + 2
    for name, content in pictures.files.items():
        assert np.array_equal(opened(content), opened((out / "pictures" / name).read_bytes())), "without a loss"
    assert [(scene.height, scene.width) for scene in report.scenes] == [(16, 20), (24, 16)]
    assert report.pictures_left_out == ""


@pytest.mark.thorough
def test_cells_come_by_scene_exposure_level_and_camera(out: Path) -> None:
    report, _ = sweep_report(out)
    places = [(cell.first.scene, cell.first.exposure, cell.level, cell.camera) for cell in report.cells if cell.first]
    assert places == list(product(FILES, ("auto", "2ms"), (0, 1), ("interleaved", "bayer")))
    titles = [f"{name}, {time}" for name in FILES for time in ("automatic", "2\N{NO-BREAK SPACE}ms")]
    assert [group.title for group in group_views(report)] == titles
    assert [group.truth for group in group_views(report)] == [0, 0, 1, 1]


LARGE = {
    "scenes": [{"source": "desk.exr"}],
    "spectra": ["own"],
    "sensors": ["low_noise", "table1_output"],
    "ways": [(time, 1, gain) for time in ("auto", "2ms", "4ms") for gain in ("1", "2", "4", "8")],
    "white_balances": ["gray_world"],
    "levels": [f"{light}cd/m2" for light in range(1, 101)],
    "processors": ["interleaved", "bayer"],
}


def test_a_page_of_a_large_study_thins_its_longest_axes_and_says_what_it_leaves_out() -> None:
    # 2 x 12 x 100 x 2 = 4800 pictures; 100 levels -> 50 -> 25 leave 1200, then levels are still the longest: 13, 624
    part, (note,) = shown_part(LARGE, {})
    assert part["levels"] == LARGE["levels"][::8]
    assert part | {"levels": LARGE["levels"]} == LARGE
    assert note.startswith("This page shows 624 of 4800 pictures: 13 of 100 levels.")
    # 2 x 3 x 100 x 2 = 1200 at one gain: every other level
    part, (note,) = shown_part(LARGE, {"gain": "4"})
    assert part["ways"] == [(time, 1, "4") for time in ("auto", "2ms", "4ms")]
    assert part["levels"] == LARGE["levels"][::2]
    assert note.startswith(
        "This page shows 600 of 4800 pictures: 3 of 12 exposures, frames and gains, 50 of 100 levels."
    )
    part, notes = shown_part(LARGE | {"levels": ["1cd/m2"]}, {})
    assert (part, notes) == (LARGE | {"levels": ["1cd/m2"]}, [])
    refusal(shown_part, LARGE, {"gain": "3"}, match="where: gain: '3' is unknown; allowed: 1, 2, 4, 8")
    refusal(shown_part, LARGE, {"seed": "3"}, match="'seed'")


@pytest.mark.thorough
def test_the_part_that_is_asked_for_is_all_that_the_page_shows(out: Path, tmp_path: Path) -> None:
    report, _ = sweep_report(out, where={"exposure": "2ms", "scene": FILES[1]})
    whole, _ = sweep_report(out)
    asked = [
        cell for cell in whole.cells if cell.first and (cell.first.exposure, cell.first.scene) == ("2ms", FILES[1])
    ]
    assert [cell.first for cell in report.cells] == [cell.first for cell in asked]
    assert len(report.cells) == 4
    assert report.notes[-1].startswith("This page shows 4 of 16 pictures: 1 of 2 scenes, 1 of 2 exposures")
    page = write_report(out, tmp_path / "part.html", where={"exposure": "2ms"}).read_text("utf-8")
    assert "This page shows 8 of 16 pictures" in page


@pytest.mark.thorough
def test_a_sweep_of_too_many_rows_for_json_says_how_to_export_them(
    out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    part = copied(out, tmp_path)
    write_results(part)
    assert len(json.loads((part / "results.json").read_text("utf-8"))["rows"]) == 32
    monkeypatch.setattr("studies.commands.report.MOST_ROWS", 31)
    write_results(part)
    assert not (part / "results.json").exists(), "one of fewer rows would say less than the sweep"
    assert f"32 rows are too many for results.json: rodcone export {part} -o rows.csv" in capsys.readouterr().err


@pytest.mark.thorough
def test_pictures_that_are_left_out_are_those_that_the_page_shows_last(out: Path) -> None:
    results, pictures = sweep_report(out, 6)
    shown = [cell.first for cell in results.cells if cell.picture]
    # The first scene at the first exposure, both levels and processors; then, as the next row, its second exposure.
    assert [(row.scene, row.exposure) for row in shown if row] == [(FILES[0], "auto")] * 4 + [(FILES[0], "2ms")] * 2
    assert len(pictures.files) == 6 + 2, "and each scene's truth"
    assert len(pictures.flip_maps) == 6
    assert results.pictures_left_out.startswith("To keep the page small, 10 of 16 pictures aren't in it")
    page = render_report(results, pictures)
    assert page.count('data-cell="') - page.count('[data-cell="') == 6
    assert unescape(page).count(results.pictures_left_out) == 2, "beside the viewer and above all pictures"
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert [bool(address) for address in data["flip"]] == [bool(cell.picture) for cell in results.cells]
    assert all((out / cell["file"]).is_file() for cell in data["cells"])


@pytest.mark.thorough
def test_pictures_fill_the_page_up_to_its_size(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, pictures = sweep_report(out)
    whole = sum(map(len, (*pictures.files.values(), *pictures.flip_maps.values())))
    monkeypatch.setattr("studies.pages.report_pictures.SHOWN_BYTES", whole // 2)
    results, pictures = sweep_report(out)
    assert 0 < sum(map(len, (*pictures.files.values(), *pictures.flip_maps.values()))) <= whole // 2
    assert results.pictures_left_out
    monkeypatch.setattr("studies.pages.report_pictures.SHOWN_BYTES", 0)
    assert len(sweep_report(out)[1].flip_maps) == 2, "those that are compared at first are in any page"


def test_levels_rise_in_the_report_in_whatever_order_the_study_has_them(tmp_path: Path) -> None:
    """Charts draw a line from one to the next, and the page's head gives the first and the last as their range."""
    SAMPLE.swept(SAMPLE.small_study(tmp_path, levels=("25cd/m2", "1cd/m2", "5cd/m2"), seeds=(0,)), tmp_path / "out")
    report, _ = sweep_report(tmp_path / "out")
    assert [level.name for level in report.levels] == [
        f"{value}\N{NO-BREAK SPACE}cd/m\N{SUPERSCRIPT TWO}" for value in (1, 5, 25)
    ]
    assert [(cell.level, cell.luminance_cd_m2) for cell in report.cells] == [(0, 1.0), (1, 5.0), (2, 25.0)]
    assert not any("not made yet" in note for note in report.notes)
    with closing(sqlite3.connect(tmp_path / "out" / FILE)) as base, base:
        base.execute("DELETE FROM cells WHERE level = '5cd/m2'")
    assert "1 of 3 cells are not made yet: rodcone sweep goes on with them." in sweep_report(tmp_path / "out")[0].notes


@pytest.mark.thorough
def test_the_mean_of_a_map_is_the_figure_of_its_picture(out: Path) -> None:
    """Figures are of pictures before 8 bits, whose steps move FLIP by some thousandths."""
    results, pictures = sweep_report(out)
    for cell in results.cells:
        assert cell.picture
        assert cell.first
        mean = float(opened(pictures.flip_maps[cell.picture]).mean()) / 255
        assert mean == pytest.approx(cell.first.flip_mean, abs=0.005)
    equal = np.full((8, 8, 3), 100, np.uint8)
    assert flip_map(equal, seen(equal / 255)).max() == 0


@settings(deadline=None)
@given(st.lists(st.integers(1, 4), min_size=6, max_size=6), st.permutations(range(6)), st.data())
def test_cells_come_in_the_order_in_which_the_page_shows_them(shape, axes, data):
    compared, along, rows = axes[:3]
    a, b = (data.draw(st.integers(0, shape[compared] - 1)) for _ in range(2))
    order = view_order(shape, Comparison(compared, along, rows, a, b))
    assert sorted(order) == list(range(int(np.prod(shape))))
    first = [[int(at) for at in np.unravel_index(cell, shape)] for cell in order[: len({a, b}) * shape[along]]]
    assert {place[compared] for place in first} == {a, b}
    assert all(place[axis] == 0 for place in first for axis in (rows, *axes[3:]))
    view = set(order[: shape[compared] * shape[along] * shape[rows]])
    assert all(np.unravel_index(cell, shape)[axis] == 0 for cell in view for axis in axes[3:])


def test_the_loupe_begins_where_the_edges_are() -> None:
    truth = np.full((64, 96, 3), 90, np.uint8)
    truth[30:40, 60:80:2] = 200
    column, row = busiest(truth)
    assert 60 <= column < 80
    assert 27 <= row <= 43
    assert busiest(np.zeros((1, 1, 3), np.uint8)) == (0, 0)


@pytest.mark.thorough
def test_cells_not_made_yet_are_dashes_and_the_page_says_how_many(out: Path, tmp_path: Path) -> None:
    part = copied(out, tmp_path)
    with closing(sqlite3.connect(part / FILE)) as base, base:
        base.execute("DELETE FROM cells WHERE scene = ?", (FILES[1],))
        base.execute("DELETE FROM cells WHERE seed = 1 AND level = '1cd/m2' AND processor = 'bayer'")
    results, pictures = sweep_report(part)
    assert results.notes == ("18 of 32 cells are not made yet: rodcone sweep goes on with them.",)
    places = product(FILES, ("auto", "2ms"), (0, 1), ("interleaved", "bayer"))
    found = dict(zip(places, results.cells, strict=True))
    assert isnan(found[FILES[0], "auto", 0, "bayer"].mean("psnr_db"))
    assert not isnan(found[FILES[0], "auto", 1, "bayer"].mean("psnr_db"))
    assert found[FILES[1], "auto", 1, "bayer"].picture is None
    page = render_report(results, pictures)
    assert results.notes[0] in page
    assert re.search(r"\b(nan|None)\b", unescape(re.sub(r"base64,[^\"]*", "", page))) is None


@pytest.mark.thorough
def test_a_sensor_whose_file_is_gone_is_said_to_be() -> None:
    gone = sensor_of("gone.toml")
    assert gone == ReportSensor("gone.toml", None)
    report = REPORTS.sample_report(levels=1)
    pictures = REPORTS.sample_pictures(report)
    report = replace(report, sensors=(gone, *report.sensors[1:]))
    assert "<p>Its file is no longer there.</p>" in render_report(report, pictures)


@pytest.mark.thorough
def test_what_is_no_sweep_or_has_lost_a_picture_is_one_line(out: Path, tmp_path: Path) -> None:
    refusal(sweep_report, tmp_path, match=r"holds no ledger\.sqlite")
    part = copied(out, tmp_path)
    (part / "pictures").unlink()
    refusal(sweep_report, part, match=r"can't be read .*; run rodcone sweep again")
    with closing(sqlite3.connect(part / FILE)) as base, base:
        base.execute("DELETE FROM cells")
    refusal(sweep_report, part, match="has made no cell yet")


@pytest.mark.thorough
def test_the_command_writes_the_page_whole_and_prints_its_path(out: Path, tmp_path: Path) -> None:
    for arguments, place in ((["-o", tmp_path / "r.html"], tmp_path / "r.html"), ([], out / "report.html")):
        assert call(["report", out, *arguments])[:2] == (0, f"{place}\n")
        assert place.read_text("utf-8").lstrip().startswith("<!doctype html>")
    (out / "report.html").unlink()
    check_refusals(f"report {out}", [("--pictures 0", "pictures: 0")], out)
    check_refusals(f"report {out}", [(f"-o {tmp_path}/absent/r.html", "choose another place")], tmp_path, code=1)


@pytest.mark.thorough
def test_a_picture_that_is_a_link_out_of_the_folder_is_not_read(out: Path, tmp_path: Path) -> None:
    part = copied(out, tmp_path)
    (part / "pictures").unlink()
    shutil.copytree(out / "pictures", part / "pictures")
    (tmp_path / "secret").write_bytes(b"not for the report")
    picture = part / "pictures" / read_rows(out)[0].picture
    picture.unlink()
    picture.symlink_to(tmp_path / "secret")
    refusal(sweep_report, part, match="does not lie in")


@pytest.mark.thorough
def test_white_balances_stand_beside_each_other_and_the_rules_of_exposure_are_told(tmp_path: Path) -> None:
    study = SAMPLE.small_study(
        tmp_path, levels=("1cd/m2",), seeds=(0,), exposures=("auto", "auto:W"), white_balances=("gray-world", "as-shot")
    )
    SAMPLE.swept(study, tmp_path / "out")
    report, pictures = sweep_report(tmp_path / "out")
    assert [cell.first.white_balance for cell in report.cells if cell.first] == ["gray-world", "as-shot"] * 2
    page = unescape(render_report(report, pictures))
    assert "<summary>automatic for W, balanced as shot</summary>" in page
    assert "automatic: the 99th percentile of expected G at 80 % of the well; automatic for W: the 99th" in page


def test_a_renders_facts_are_those_of_its_rows() -> None:
    """Every number is another one, so that none is taken for its neighbour."""
    row = SAMPLE.row("bayer", 0, spp=64.0, bands=20, render_s=1.5, capture_s=2.5, develop_s=3.5, measure_s=4.5)
    other = replace(row, scene="table", spp=1.0, bands=2, render_s=3.0)
    assert render_of([other, row], "desk") == ReportRender("desk", 64.0, 20, 1.5, "file", "samples", 0.01)
    assert render_of([row], "street") == ReportRender("street")


def test_results_are_written_from_one_reading_of_the_database(tmp_path, monkeypatch):
    SAMPLE.swept(SAMPLE.small_study(tmp_path), tmp_path / "out")
    opened, connect = [], sqlite3.connect
    monkeypatch.setattr("sqlite3.connect", lambda *given, **named: opened.append(given) or connect(*given, **named))
    write_results(tmp_path / "out")
    assert len(opened) == 1
    assert len(json.loads((tmp_path / "out" / "results.json").read_bytes())["rows"]) == 4
