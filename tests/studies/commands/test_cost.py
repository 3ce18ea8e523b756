"""What a command says that it will cost: closed forms of the estimate, and that nothing is computed before."""

import inspect
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sweep_sample as SAMPLE
from command_line import COST, call

from render.radiance_files.radiance_source import extent_of
from rodcone.memory import memory
from rodcone.progress import duration
from studies.commands import cli, expect
from studies.commands import render as render_command
from studies.pages.report_sweep import MOST_CELLS
from studies.photograph import shot
from studies.study import cost
from studies.study.cost import START_S, PictureCost, pace, render_seconds
from studies.study.model import LensTerms
from studies.study.study import BudgetShares, RenderLimits, SceneChoice, Study
from studies.study.study_file import read_study
from studies.sweep import cost as sweep_cost
from studies.sweep.cost import Estimate, _code_of, _memory, _Part, estimate_cost, estimated

PICTURE = PictureCost((200, 300), bands=20, groups=2, spp=64, after_s=1e-7)


@pytest.fixture(autouse=True)
def warm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cores of the machine that the numbers are of, with kernels on disk."""
    monkeypatch.setattr(cost, "kernels_kept", lambda: True)
    for module in (cost, sweep_cost, expect):
        monkeypatch.setattr(module, "pace", lambda: 1.0)
    monkeypatch.setattr(cost, "cores", lambda: 2)


def test_a_renders_time_is_by_samples_pixels_and_paths_and_that_of_its_bands() -> None:
    one = render_seconds(1000, 20, 1, 64)
    assert one == pytest.approx(1.1e-6 * 1000 * 64 / 2)
    assert render_seconds(2000, 20, 3, 32) == pytest.approx(3 * one)
    assert render_seconds(1000, 40, 1, 64) == pytest.approx(1.3 * one), "paths are 0.7 of it at 20 bands"
    assert render_seconds(1000, 20, 1, 128) == pytest.approx(2.5 * one), "a pilot of 32 samples goes before"


def test_a_pictures_time_is_the_sum_of_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    after = 1e-7 * 60_000 * 20
    assert PICTURE.seconds == pytest.approx(START_S + render_seconds(60_000, 20, 2, 64) + after)
    assert replace(PICTURE, spp=0).seconds == pytest.approx(START_S + after)
    assert replace(PICTURE, max_seconds=0.5).seconds == pytest.approx(START_S + 0.5 + after)
    assert PICTURE.memory == memory(60_000, 20, 2)
    warm = PICTURE.seconds
    monkeypatch.setattr(cost, "kernels_kept", lambda: False)
    assert PICTURE.seconds == pytest.approx(warm + 0.3 * 20)
    assert replace(PICTURE, spp=0).seconds == pytest.approx(START_S + after), "no render is compiled"


def test_a_slower_machine_takes_longer_but_for_a_renders_own_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, limited = PICTURE.seconds, replace(PICTURE, max_seconds=0.5).seconds
    monkeypatch.setattr(cost, "pace", lambda: 2.0)
    assert PICTURE.seconds == pytest.approx(2 * whole)
    assert replace(PICTURE, max_seconds=0.5).seconds == pytest.approx(2 * (limited - 0.5) + 0.5)


def test_the_pace_is_that_of_a_fixed_piece_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 0.03, 1.0, 1.0176, 2.0, 2.02])
    monkeypatch.setattr(cost, "process_time", lambda: next(clock))
    assert inspect.unwrap(pace)() == pytest.approx(2.0), "the least of three, as other programs only delay"


def test_its_line_says_time_memory_and_samples_and_half_of_it() -> None:
    half, small = replace(PICTURE, spp=32), replace(PICTURE, size=(100, 150))
    assert PICTURE.words() == (
        f"about {duration(PICTURE.seconds)}, {PICTURE.memory.total / 1e9:.1f} GB: 200 x 300 pixels, 64 samples per "
        f"pixel, 20 bands; with half the samples {duration(half.seconds)}, at half the size {duration(small.seconds)} "
        f"and {small.memory.total / 1e9:.1f} GB"
    )
    assert PICTURE.facts()["half_samples_seconds"] == half.seconds
    assert PICTURE.facts()["half_size_seconds"] == small.seconds
    assert "its light is there already; at half" in replace(PICTURE, spp=0).words()
    assert "for each 64 samples per pixel until the error is reached" in replace(PICTURE, spp=None).words()
    assert "0.06 million pixels" in replace(PICTURE, size=(1, 60_000)).words()
    assert [duration(seconds) for seconds in (99.0, 3600.0, 1e5, 2e5)] == ["99 s", "60 min", "27.8 h", "2 days"]


def test_a_dry_run_computes_nothing_and_says_what_would_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(render_command, "render_transport", lambda *_, **__: pytest.fail("rendered"))
    monkeypatch.setattr(shot, "render", lambda *_, **__: pytest.fail("rendered"))
    code, out, err = call(["render", "still_life", "--width", "4000", "--spp", "4096", "-o", "a.exr", "--dry-run"])
    assert (code, err, out.count("\n")) == (0, "", 1)
    assert "4000 x 4000 pixels, 4096 samples per pixel" in out
    facts = json.loads(call(["capture", "still_life", "--size", "64", "--spp", "8", "--dry-run", "--json"])[1])
    assert (facts["size"], facts["samples_per_pixel"]) == ([64, 64], 8)
    assert facts["half_samples_seconds"] < facts["seconds"]
    code, out, _ = call(["expect", "low_noise", "--mosaic", "bayer", "--mosaic", "rgbw", "--dry-run"])
    assert "2 cameras at 7 levels" in out
    SAMPLE.picture(tmp_path / "scene.exr")
    Path("study.toml").write_text('scenes = ["scene.exr"]\nlevels = ["1cd/m2"]\nprocessors = ["bayer"]\n', "utf-8")
    for command in (["sweep", "study.toml"], ["dataset", "study.toml"]):
        assert call([*command, "--dry-run"])[1].startswith(
            "1 cells, at most 0 kept from the last run; 0 to render; about"
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.exr", "study.toml"]


def test_the_line_comes_before_all_else_and_memory_is_refused_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        cli.main(["render", "still_life", "--width", "30000", "--spp", "4096", "-o", "a.exr"])
    first, second = capsys.readouterr().err.splitlines()
    assert COST.match(f"{first}\n")
    assert "30000 x 30000 pixels" in first
    assert "days" in first
    assert second.startswith("rodcone: memory: the run needs about")
    assert stopped.value.code == cli.BAD_INPUT
    assert "studies.commands.render" in sys.modules


def test_a_sweeps_time_counts_first_calls_of_each_process_metrics_and_the_report(tmp_path: Path) -> None:
    SAMPLE.picture(tmp_path / "scene.exr")
    text = 'scenes = ["{}"]\nlevels = ["1cd/m2"]\nprocessors = {}\nseeds = {}\n'

    def seconds(processors: str, seeds: int, **options: bool) -> float:
        path = tmp_path / "study.toml"
        path.write_text(text.format(tmp_path / "scene.exr", processors, seeds), "utf-8")
        return estimated(read_study(path), tmp_path / "out", 1, **options).seconds

    one, more = seconds('["bayer"]', 1), seconds('["bayer"]', 101)
    pixels = 16 * 20
    assert more - one == pytest.approx(100 * (0.03 + 0.05 + pixels * (5e-6 + 1e-6)), rel=0.3), (
        "a cell, and its place in the report"
    )
    assert one > START_S + 0.7 + 0.3 + 2.5
    assert seconds('["ple_bayer"]', 1) - one > 1.5, "its tables"
    assert seconds('["bayer"]', 1, planned=True) - one == pytest.approx(1.1), "a picture has nothing to render"
    assert seconds('["bayer"]', 1, frames=True) < one - 2.0, "neither developed nor reported"


def test_cells_whose_pictures_a_report_does_not_show_cost_it_next_to_nothing(tmp_path: Path) -> None:
    assert sweep_cost.SHOWN == MOST_CELLS
    study = SAMPLE.small_study(tmp_path, processors=("bayer",), seeds=tuple(range(1000)))
    first, second, third = (
        estimated(replace(study, seeds=tuple(range(count))), tmp_path / "out", 1) for count in (1000, 2000, 100_000)
    )
    pixels, _, _ = extent_of(tmp_path / "scene.exr")
    each_s = 0.03 + 1e-4 + pixels * (5e-6 + 1e-6)
    assert first.cells > sweep_cost.SHOWN
    for few, more in ((first, second), (second, third)):
        assert (more.seconds - few.seconds) / (more.cells - few.cells) == pytest.approx(each_s, rel=1e-6)


def test_half_of_a_sweep_is_that_of_half_its_seeds_or_of_a_quarter_of_its_pixels(tmp_path: Path) -> None:
    whole, half = (SAMPLE.small_study(tmp_path, seeds=tuple(range(count))) for count in (8, 4))
    told = estimated(whole, tmp_path / "out", 1)
    assert told.half_cells_seconds == pytest.approx(estimated(half, tmp_path / "out", 1).seconds)
    assert (told.cells, told.kept, told.renders, told.workers) == (2 * 8, 0, 0, 1)
    SAMPLE.picture(tmp_path / "scene.exr", (8, 10))
    assert told.half_size_seconds == pytest.approx(estimated(whole, tmp_path / "out", 1).seconds, rel=1e-3)


def test_each_mosaic_has_an_image_of_its_own(tmp_path: Path) -> None:
    """Two processors of one mosaic or of two, which cost the same: 7e-7 s a pixel and band is the difference."""
    one, two = (
        estimated(SAMPLE.small_study(tmp_path, processors=pair), tmp_path / "out", 1).seconds
        for pair in (("bayer", "bayer_bilinear"), ("bayer", "mono"))
    )
    pixels, bands, _ = extent_of(tmp_path / "scene.exr")
    assert two - one == pytest.approx(7e-7 * pixels * bands, rel=1e-6)


def test_a_lens_by_data_costs_its_images_of_points_however_small_the_picture(tmp_path: Path) -> None:
    """By hand: half a second a band, once for all mosaics of a sensor, and 2.5e-7 s a pixel and band of each image."""
    plain, behind = (shot.check(shot.Order("still_life", size=64, lens=lens)).cost for lens in (None, "double_gauss"))
    assert behind.seconds - plain.seconds == pytest.approx(plain.bands * (0.5 + 2.5e-7 * 64**2), rel=1e-9)
    study = SAMPLE.small_study(tmp_path, processors=("bayer", "mono"))
    pixels, bands, _ = extent_of(tmp_path / "scene.exr")
    one, two = (
        estimated(replace(study, lens=LensTerms(table=lens)), tmp_path / "out", 1).seconds
        for lens in (None, "double_gauss")
    )
    assert two - one == pytest.approx(bands * (0.5 + 2 * 2.5e-7 * pixels), rel=1e-6)


def test_a_sweeps_line_tells_each_size_in_its_place_and_unit() -> None:
    sizes = {"seconds": 90.0, "half_size_seconds": 30.0, "half_cells_seconds": 45.0, "bytes": 2.34e9}
    told = Estimate(cells=12, kept=3, renders=2, workers=4, largest_bytes=1e9, **sizes).words()
    assert told == (
        "12 cells, at most 3 kept from the last run; 2 to render; about 90 s with 4 workers, at most 2.3 GB of memory, "
        "what exists already counted too; at half the size 30 s, with half the cells 45 s"
    )


def test_a_sweep_of_renders_is_the_sum_of_its_parts() -> None:
    """By hand: two scenes, three cells each, two images that cells share; nothing is read of a picture file."""
    choices = [SceneChoice("still_life"), SceneChoice("night_street")]
    study = Study(
        tuple(choices), ("1cd/m2",), processors=("bayer", "interleaved", "ple_rgbw"), render=RenderLimits(size=40)
    )
    sizes, bands, groups, spp = [(30, 40), (20, 40)], [20, 30], [1, 3], [64, 256]
    scenes = {
        choice: SimpleNamespace(
            choice=choice,
            size=size,
            moving=(),
            scene=SimpleNamespace(groups=dict.fromkeys(range(count)), max_depth=8, rr_depth=5),
        )
        for choice, size, count in zip(choices, sizes, groups, strict=True)
    }
    models = {
        choice: SimpleNamespace(wavelength_nm=np.arange(n), width_nm=np.ones(n), spp=count, denoise=False)
        for choice, n, count in zip(choices, bands, spp, strict=True)
    }
    plan = SimpleNamespace(renders=models, samples_a_side=lambda choice: 1 + (choice is choices[1]))

    def told(workers: int, **options: bool) -> Estimate:
        return estimate_cost(study, plan, scenes, workers, 5, **options)  # type: ignore[arg-type]

    pixels = [1200, 4 * 800]  # the second takes four samples of light a pixel
    light = [
        render_seconds(1, n, count, of) * area for n, count, of, area in zip(bands, groups, spp, pixels, strict=True)
    ]
    shared = [2 * 7e-7 * area * n for area, n in zip(pixels, bands, strict=True)]
    first = 0.7 + 0.3 + 0.4 + 2.2  # a process's own, and that of three processors
    cell = [0.03 + area * (5e-6 + (1e-6 + 1.2e-6 + 5e-6) / 3) for area in pixels]
    whole = START_S + first + 2.5 + sum(light) + sum(shared) + 3 * sum(cell) + 6 * 0.05
    estimates = told(1)
    assert (estimates.cells, estimates.kept, estimates.renders) == (6, 5, 2)
    assert estimates.seconds == pytest.approx(whole, rel=1e-9)
    assert told(1, planned=True).seconds == pytest.approx(whole + 2 * 6.0, rel=1e-9)
    halved = START_S + first + 2.5 + sum(light) + sum(shared) + 3 * sum(cell) / 2 + 3 * 0.05
    assert estimates.half_cells_seconds == pytest.approx(halved, rel=1e-9)
    least = 6 * 0.03 + START_S + first + 2.5 + 6 * 0.05
    assert estimates.half_size_seconds == pytest.approx(least + (whole - least) / 4, rel=1e-9)
    # of two workers on two cores each cell takes half, and each imports for itself
    two = whole + START_S - 3 * sum(cell) / 2
    assert told(2).seconds == pytest.approx(two, rel=1e-9)
    limited = replace(study, render=replace(study.render, max_seconds=min(light) / 2))
    shorter = estimate_cost(limited, plan, scenes, 1, 0)  # type: ignore[arg-type]
    assert shorter.seconds == pytest.approx(whole - sum(light) + min(light), rel=1e-9)
    needs = [memory(area, n, count, 1, spp=of) for area, n, count, of in zip(pixels, bands, groups, spp, strict=True)]
    assert estimates.bytes == max(need.total for need in needs)
    assert estimates.largest_bytes == max(need.largest for need in needs)


def test_memory_counts_a_scene_rendered_beside_the_cells_of_another() -> None:
    fine, wide = _Part(64**2, 64**2, 200, 4, 512.0), _Part(1000**2, 1000**2, 3, 1, 4.0)
    (render, cells), (other, others) = (
        (memory(x.pixels, x.bands, x.groups, 0, spp=x.spp).total, 350e6 + 800 * x.pixels) for x in (fine, wide)
    )
    assert render > other
    assert others > cells
    assert _memory([fine, wide], 2, ahead=True).total == pytest.approx(render + 2 * others)
    assert _memory([fine, wide], 2, ahead=False).total == pytest.approx(max(render + 2 * cells, other + 2 * others))
    for one in (fine, wide):  # of one scene the same
        assert _memory([one], 2, ahead=True) == _memory([one], 2, ahead=False)


def test_a_row_whose_versions_cannot_be_read_counts_as_made_by_no_code() -> None:
    assert _code_of('{"rodcone": "1.2", "numpy": "2"}') == "1.2"
    for damaged in ("{", "{}", "[]", "null", "3", '"rodcone"', None, b"\xff"):
        assert _code_of(damaged) is None, damaged


def test_a_sweeps_cost_is_that_of_the_study_as_stated_unless_everything_is_modelled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the option or by the study's own budget; pilots, frames, workers and kept cells go on as they are asked."""
    told: list[tuple[Any, ...]] = []
    monkeypatch.setattr(sweep_cost, "plan_from_settings", lambda study: "as stated")
    monkeypatch.setattr(sweep_cost, "reference_plan", lambda study: "everything")
    monkeypatch.setattr(sweep_cost, "open_all", lambda study: "scenes")
    monkeypatch.setattr(sweep_cost, "estimate_cost", lambda *asks, **more: told.append((*asks, more)))
    study = SAMPLE.small_study(tmp_path)
    whole = replace(study, budget=BudgetShares(model="reference"))
    none = {"planned": False, "frames": False}
    for asked, options, plan, passed in (
        (study, {}, "as stated", none),
        (study, {"reference": True}, "everything", none),
        (whole, {}, "everything", none),
        (study, {"planned": True}, "as stated", none | {"planned": True}),
        (study, {"frames": True}, "as stated", none | {"frames": True}),
    ):
        estimated(asked, tmp_path / "out", 3, **options)
        assert told.pop() == (asked, plan, "scenes", 3, 0, passed)


@pytest.mark.parametrize(("asked", "there", "spp"), [(True, "light", 64), (True, None, 512), (False, "light", 512)])
def test_a_scene_with_reference_light_is_rendered_with_sixty_four_samples(
    asked: bool, there: Any, spp: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which tell whether its light is still this code's; without it, or where it isn't asked for, with all."""
    film = SimpleNamespace(size=(16, 20))
    monkeypatch.setattr(sweep_cost, "film_of", lambda opened, model, samples: film)
    monkeypatch.setattr(sweep_cost, "find_reference", lambda scene, of: there if of is film else None)
    study: Any = SimpleNamespace(render=SimpleNamespace(reference=asked), equal_area=None, sensors=())
    opened: Any = SimpleNamespace(
        choice="a", size=(8, 10), moving=(), scene=SimpleNamespace(groups={"sun": 1, "sky": 2})
    )
    model = SimpleNamespace(wavelength_nm=np.arange(7), spp=512, denoise=True)
    plan: Any = SimpleNamespace(renders={"a": model}, samples_a_side=lambda choice: 2)
    assert sweep_cost._part(study, plan, opened) == _Part(320, 320, 7, 2, spp, True)
