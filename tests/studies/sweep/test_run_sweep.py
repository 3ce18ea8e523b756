"""Sweeps: the same ledger and pictures whatever ran them, in whatever order, and however often they were ended."""

import errno
import json
import os
import shutil
import struct
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sweep_sample as SAMPLE
from refusal import refusal

from render.denoised.relight import relight_denoised
from render.engine import render
from scenes.catalogue import load
from sensor.optics import form_image
from sensor.presets import preset, preset_file
from sensor.readings.resolve import chip_readings
from sensor.response import expected_electrons
from studies.study.render_noise import monte_carlo_bound, monte_carlo_share
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.sweep import run_cell as cell_run
from studies.sweep import run_sweep as sweep_run
from studies.sweep.cells import Cell
from studies.sweep.database import last_run
from studies.sweep.export import read_rows
from studies.sweep.row import Row
from studies.sweep.run_sweep import locked_folder
from studies.sweep.workers import run

content, half_pictures, here, parts_left, small_study, swept = (
    getattr(SAMPLE, name) for name in ("content", "half_pictures", "here", "parts_left", "small_study", "swept")
)


def test_every_cell_gets_a_row_in_the_studys_order_and_a_second_run_makes_none(tmp_path: Path) -> None:
    study = small_study(tmp_path)
    first = swept(study, tmp_path / "out")
    assert (first.cells, first.made) == (4, 4)
    found = [(row.level, row.seed, row.luminance_cd_m2) for row in read_rows(tmp_path / "out")]
    assert found == [("1cd/m2", 0, 1.0), ("1cd/m2", 1, 1.0), ("25cd/m2", 0, 25.0), ("25cd/m2", 1, 25.0)]
    before = content(tmp_path / "out")
    assert swept(study, tmp_path / "out").made == 0
    assert content(tmp_path / "out") == before


def test_order_and_executor_change_nothing(tmp_path: Path) -> None:
    study = small_study(tmp_path)
    swept(study, tmp_path / "one")
    swept(study, tmp_path / "turned", lambda cells: here(cells[::-1]))
    with ThreadPoolExecutor(2) as pool:
        swept(study, tmp_path / "threads", partial(run, executor=pool, at_once=3))
    assert content(tmp_path / "one") == content(tmp_path / "turned") == content(tmp_path / "threads")


def test_colours_are_fitted_for_cells_that_are_made_alone(tmp_path, monkeypatch):
    study = small_study(tmp_path)
    swept(study, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        swept(study, tmp_path / "out", partial(SAMPLE.ended_after, 2))
    swept(study, tmp_path / "out")
    assert content(tmp_path / "out") == content(tmp_path / "whole")
    monkeypatch.setattr("studies.sweep.prepare.colours_under", lambda *_: pytest.fail("nothing is to be made"))
    assert swept(study, tmp_path / "out").made == 0


@pytest.mark.thorough
def test_sensors_of_one_size_get_the_same_light_and_are_compared_at_the_coarsest_pixels(tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr", (48, 64))
    coarse_file = tmp_path / "coarse.toml"
    coarse_file.write_text(preset_file("low_noise").read_text("utf-8").replace("pitch_um = 2.2", "pitch_um = 4.4"))
    names = (str(coarse_file), "low_noise")
    study = small_study(tmp_path, sensors=names, sensor_side_um=140.8, seeds=(0,), exposures=("10ms",))
    swept(study, tmp_path / "out")
    made = read_rows(tmp_path / "out")
    coarse, fine = ([row for row in made if row.sensor == name] for name in ("coarse.toml", "low_noise"))
    assert len(coarse) == len(fine) == 2
    for one, other in zip(coarse, fine, strict=True):
        # four pixels for one; green's sites sample the picture a little differently
        light = [json.loads(row.mean_electrons)["G"] for row in (one, other)]
        assert light[0] / light[1] == pytest.approx(4.0, rel=0.01)
        assert one.truth == other.truth
        sizes = {png_size(tmp_path / "out" / "pictures" / name) for name in (one.picture, other.picture, one.truth)}
        assert sizes == {(32, 24)}
        assert min(one.psnr_db, other.psnr_db) > 13  # the whole scene: a quarter of it, cut out, gets 9 to 11 dB
    # expected electrons lie with each frame: pixels by pitch
    frames = [np.load(path).shape for path in sorted((tmp_path / "out" / "frames").rglob("*.npy"))]
    assert {shape for shape in frames if len(shape) == 2} == {(24, 32), (48, 64)}


def png_size(path: Path) -> tuple[int, int]:
    """Width and height, from the header of a PNG."""
    return struct.unpack(">II", path.read_bytes()[16:24])


@pytest.mark.sample(1)
@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_an_ended_run_is_gone_on_with_and_ends_as_one_never_ended(error: type[BaseException], tmp_path: Path) -> None:
    study = small_study(tmp_path)
    swept(study, tmp_path / "whole")
    with pytest.raises(error):
        swept(study, tmp_path / "out", partial(SAMPLE.ended_after, 3, error=error))
    assert swept(study, tmp_path / "out").made == 1
    assert content(tmp_path / "out") == content(tmp_path / "whole")


def test_ctrl_c_waits_for_what_runs_and_keeps_it(tmp_path: Path) -> None:
    study = small_study(tmp_path)

    def interrupted(cells: Sequence[Cell]) -> Iterator[Row]:
        with ThreadPoolExecutor(1) as pool:
            running = run(cells, pool, at_once=2)
            yield next(running)
            yield running.throw(KeyboardInterrupt)
            yield from running

    with pytest.raises(KeyboardInterrupt):
        swept(study, tmp_path / "out", interrupted)
    assert 1 <= 4 - swept(study, tmp_path / "out").made <= 3


def test_a_full_disk_leaves_nothing_half_done_and_the_next_run_goes_on(tmp_path, monkeypatch):
    study, pictures = small_study(tmp_path), 0
    write = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        nonlocal pictures
        pictures += "pictures" in path.parts
        if pictures > 4:  # two cells, each with its picture and the truth
            write(path, data[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return write(path, data)

    with monkeypatch.context() as patched:
        patched.setattr(cell_run.Path, "write_bytes", full)
        with pytest.raises(OSError, match="No space left"):
            swept(study, tmp_path / "out")
    assert len(content(tmp_path / "out")) == 2
    assert half_pictures(tmp_path / "out") == parts_left(tmp_path / "out") == []
    assert swept(study, tmp_path / "out").made == 2


def test_what_a_killed_run_left_is_cleared_and_nothing_else(tmp_path: Path) -> None:
    """A sweep at work in the same folder keeps what it is writing; files of others stay, whatever their names."""
    study, out = small_study(tmp_path), tmp_path / "out"
    swept(study, out)
    name = ".rodcone-0123456789abcdef"
    left = [out / "pictures" / "ab" / f"{name}.png", out / "frames" / name, out / "pilots" / f"{name}.npz"]
    kept = ["thesis.part/1.tex", "pictures/.part-x/a.png", "pictures/film.part", f"{name}.html", f"frames/{name}.d/a"]
    for path in [*left, *(out / place for place in kept)]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"half")
        os.utime(path, (0, 0))
    (out / "renders").mkdir(exist_ok=True)
    (out / "renders" / name).symlink_to(out / kept[0])
    shutil.move(out / "pilots", tmp_path / "shared")  # where others may be at work
    (out / "pilots").symlink_to(tmp_path / "shared")
    left.pop()
    before = content(out)
    with locked_folder(out):
        for path in left:
            path.write_bytes(b"half")
        assert swept(study, out).made == 0
        assert all(path.exists() for path in left)
    assert swept(study, out).made == 0
    assert not any(path.exists() for path in left)
    assert all((out / place).read_bytes() == b"half" for place in kept)
    assert (out / "renders" / name).is_symlink()
    assert (tmp_path / "shared" / f"{name}.npz").exists()
    assert content(out) == before


@pytest.mark.sample(1)
@pytest.mark.parametrize("year", [1970, 2106])
def test_a_clock_that_jumps_makes_no_cell_anew_and_the_last_run_stays_the_last(year, tmp_path, monkeypatch):
    study, out = small_study(tmp_path), tmp_path / "out"
    swept(study, out)
    before = content(out)
    clock = SimpleNamespace(now=lambda zone: datetime(year, 1, 2, tzinfo=zone))
    for module in (sweep_run, cell_run):
        monkeypatch.setattr(module, "datetime", clock)
    for path in out.rglob("*"):
        os.utime(path, (4e9, 4e9))
    assert swept(replace(study, seeds=(1,)), out).made == 0
    assert last_run(out).study["seeds"] == [1]
    assert swept(replace(study, seeds=(0, 1, 2)), out).made == 2
    assert len(last_run(out).rows) == 6
    assert last_run(out).stages.keys() >= {"captures", "metrics"}
    assert min(last_run(out).stages.values()) >= 0
    assert swept(study, out).made == 0
    assert [row for row in content(out) if row in before] == before


def test_a_folder_with_other_files_is_refused_and_left_as_it_was(tmp_path: Path) -> None:
    out = tmp_path / "Downloads"
    (out / "pictures").mkdir(parents=True)
    (out / "film.part").write_bytes(b"half")
    refusal(swept, small_study(tmp_path), out, match=r"Downloads holds other files, such as 'film.part'")
    assert sorted(path.name for path in out.rglob("*")) == ["film.part", "pictures"]
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / ".gitignore").write_text("*")
    assert swept(small_study(tmp_path), tmp_path / "new").made == 4


@pytest.mark.sample(1)
@pytest.mark.parametrize("damage", ["{", '{"light": 1, "auto_s": [], "white_cd_m2": "x"}'])
def test_shared_files_that_are_damaged_or_gone_are_made_again(damage: str, tmp_path: Path) -> None:
    study = small_study(tmp_path)
    swept(study, tmp_path / "out")
    before = content(tmp_path / "out")
    for path in [path for path in (tmp_path / "out" / "frames").rglob("*") if path.is_file()]:
        path.write_text(damage, "utf-8") if path.suffix == ".json" else damage == "{" and path.unlink()
    (tmp_path / "out" / "pictures" / read_rows(tmp_path / "out")[0].picture).unlink()
    assert swept(study, tmp_path / "out").made == 1
    assert content(tmp_path / "out") == before


@pytest.mark.thorough
def test_a_denoised_study_photographs_denoised_light_and_is_charged_its_measured_error(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba_oidn", reason="rodcone[denoise] is not installed")
    limits = RenderLimits(size=32, spp=32, band_nm=100.0)
    plain = Study((SceneChoice("cornell_box"),), ("1cd/m2",), processors=("bayer",), render=limits)
    study = replace(plain, render=replace(limits, denoise=True))
    assert [swept(each, tmp_path).made for each in (plain, study, plain)] == [1, 1, 0]  # both stay
    assert swept(study, tmp_path).made == 0
    row = read_rows(tmp_path)[0]
    model = SAMPLE.stated(study).renders[study.scenes[0]]
    bands = {"wavelength_nm": model.wavelength_nm, "width_nm": model.width_nm}
    transport = render(load("cornell_box"), (32, 32), **bands, spp=32, denoise=True)
    sensor = preset("low_noise", "bayer")
    whole, *folds = (
        expected_electrons(form_image(view, sensor), sensor, row.exposure_s)
        for view in relight_denoised(transport, luminance_cd_m2=1.0)
    )
    share = monte_carlo_bound(np.stack([whole - fold for fold in folds]), whole, chip_readings(sensor, row.exposure_s))
    assert row.mc_share == pytest.approx(share, rel=1e-3)  # single precision
    assert json.loads(row.render)["relative_mc_error"] > transport.relative_mc_error  # of all pixels, and their limit


@pytest.mark.thorough
def test_a_finer_request_goes_on_from_the_coarser_render_and_makes_its_cells_anew(tmp_path: Path) -> None:
    limits = RenderLimits(size=16, spp=16, band_nm=100.0)
    study = Study((SceneChoice("slanted_edge"),), ("1cd/m2",), processors=("bayer",), render=limits)
    finer = replace(study, render=replace(limits, spp=64))
    assert [swept(each, tmp_path / "out").made for each in (study, finer, study)] == [1, 1, 0]
    assert len(list((tmp_path / "out" / "renders").iterdir())) == 1
    assert [row.spp for row in read_rows(tmp_path / "out")] == [16]  # what the last run asked for
    coarse, fine = sorted(read_rows(tmp_path / "out", everything=True), key=lambda row: row.spp)
    assert (coarse.spp, fine.spp) == (16, 64)
    model = SAMPLE.stated(finer).renders[study.scenes[0]]
    bands = {"wavelength_nm": model.wavelength_nm, "width_nm": model.width_nm}
    # two samples of an edge's light along each side of a pixel
    transport = render(load("slanted_edge"), (32, 32), **bands, max_spp=64, cache=tmp_path / "out" / "renders")
    sensor = preset("low_noise", "bayer")
    whole = expected_electrons(form_image(transport.relight(luminance_cd_m2=1.0), sensor, 2), sensor, fine.exposure_s)
    halves = transport.relight_halves(luminance_cd_m2=1.0)
    even, odd = (expected_electrons(form_image(half, sensor, 2), sensor, fine.exposure_s) for half in halves)
    share = monte_carlo_share((even - odd) / 2, whole, sensor, fine.exposure_s)
    assert fine.mc_share == pytest.approx(share, rel=1e-4)  # float32 halves
    assert 0 < fine.mc_share < coarse.mc_share
