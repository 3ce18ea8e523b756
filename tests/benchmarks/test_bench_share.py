"""The share's benchmark: references by what they are, samples that take a time, and figures that aren't known."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from render.transport import Transport
from scenes.catalog import load

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

import bench_share  # noqa: E402
import references  # noqa: E402
from bench_share import THIS, Choice, figure_of, main, picture, samples_in, summed_up, told_figure  # noqa: E402
from references import SEEDS, Film, both, find, make  # noqa: E402
from refusal import refusal  # noqa: E402

FILM = Film(size=8, bands=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("references")
    make(made, load("cornell_box"), FILM, 24)
    return made


def rendered(seed: int, samples: int) -> Transport:
    scene = load("cornell_box")
    return references.render(scene, (8, 8), wavelength_nm=FILM.wavelength_nm, max_spp=samples, seed=seed)


def row(samples: int, seed: int, processor_s: float, mean: float, checkout: str = THIS) -> dict[str, object]:
    """Return what one picture measures; the references' own median is 0.1."""
    own = {"median": 0.1, "mean": 0.1, "p95": 0.1, "mean_of_kept": 0.1}
    figures = {"median": 0.5, "mean": mean, "p95": 1.0, "mean_of_kept": 0.5}
    asked = {"scene": "flat_field", "size": 8, "checkout": checkout, "bands": 4, "samples": samples, "drawn": samples}
    return {**asked, "seed": seed, "seconds": 1.0, "processor_s": processor_s, **figures, "own": own}


def test_references_are_read_as_they_were_rendered(folder: Path) -> None:
    one, other = both(folder, load("cornell_box"), FILM)
    assert (one.facts["seed"], other.facts["seed"]) == SEEDS
    assert one.facts["samples"] == 24
    assert one.radiance.shape == (8, 8)
    assert one.level_cd_m2 == pytest.approx(other.level_cd_m2, rel=0.2)
    assert one.lamps.any()
    made = rendered(SEEDS[0], 24)
    assert np.array_equal(one.radiance.values, made.relight().values)
    assert not np.array_equal(other.radiance.values, made.relight().values)
    variance = np.moveaxis(made.relight_variance(luminance_cd_m2=one.level_cd_m2), 0, -1)
    assert np.square(one.deviation.values) == pytest.approx(variance, rel=1e-5)


def test_more_samples_go_before_fewer_and_what_is_there_is_not_made_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load("cornell_box")
    before = find(folder, scene, FILM, SEEDS[0])
    make(folder, scene, FILM, 64)
    found = find(folder, scene, FILM, SEEDS[0])
    assert found is not None
    assert before is not None
    assert (before.exists(), "_64_" in found.name) == (True, True)
    monkeypatch.setattr(references, "render", None)
    make(folder, scene, FILM, 48)


def test_another_light_or_film_has_no_reference_and_a_later_engine_has(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load("cornell_box")
    name, group = next(iter(scene.groups.items()))
    brighter = replace(scene, groups={**scene.groups, name: replace(group, power=2 * group.power)})
    assert find(folder, brighter, FILM, SEEDS[0]) is None
    assert find(folder, scene, Film(8, 5), SEEDS[0]) is None
    assert find(folder, scene, FILM, 1) is None
    renamed = Path(shutil.copytree(folder, folder / "renamed"))
    for path in renamed.glob("*_24_*.npz"):
        path.rename(renamed / path.name.replace("_24_", "_9999_"))
    found = find(renamed, scene, FILM, SEEDS[0])
    assert found is None or "_9999_" not in found.name
    monkeypatch.setattr(references, "ENGINE_VERSION", 10**6)
    assert find(folder, scene, FILM, SEEDS[0]) is not None


def test_missing_references_are_refused_in_one_line_with_the_command(tmp_path: Path) -> None:
    told = refusal(both, tmp_path, load("flat_field"), FILM)
    command = f"references --scene flat_field --size 8 --reference-bands 4 --references {tmp_path} --samples 16384"
    assert told.endswith(f"make them: python benchmarks/bench_share.py {command}")


def test_a_references_seed_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["bench_share.py", "judge", "--seeds", "3", str(SEEDS[1])])
    with pytest.raises(SystemExit, match=f"seeds: {SEEDS[1]} is a reference's"):
        main()


def test_the_samples_of_a_time_lie_on_the_line_through_two() -> None:
    # 1 s and 10 ms a sample: 10 s are 900 samples; between 512 and 1024 a step is 64.
    assert samples_in(10.0, {128: 2.28, 512: 6.12}) == 896
    assert samples_in(6.12, {128: 2.28, 512: 6.12}) == 512
    assert samples_in(0.5, {128: 2.28, 512: 6.12}) == 16


def test_a_row_each_choice_with_its_spread_and_the_front() -> None:
    rows = [row(64, 0, 1.0, 3.0), row(64, 1, 3.0, 5.0), row(512, 0, 9.0, 1.0), row(512, 1, 9.0, 1.0)]
    rows += [row(32, seed, 2.0, 4.5, "other") for seed in range(2)]
    found = summed_up(rows)
    small, large, other = found.values()
    assert list(found) == [Choice(THIS, 4, 64), Choice(THIS, 4, 512), Choice("other", 4, 32)]
    assert small["mean"] == pytest.approx((4.0, np.sqrt(2.0)))
    assert small["processor_s"] == pytest.approx((2.0, np.sqrt(2.0)))
    assert [each["on_front"] for each in (small, large, other)] == [True, True, False]
    drawn = figure_of(rows)
    assert drawn.startswith("<svg")
    assert all(word in drawn for word in ("other, 4 bands", "the sensor's own noise", "512"))


def test_a_quantile_that_holds_the_references_noise_stands_in_brackets() -> None:
    (found,) = summed_up([row(64, seed, 1.0, 0.4) for seed in range(2)]).values()
    assert [told_figure(found, name) for name in ("median", "mean", "p95")] == ["(0.5 ± 0)", "0.4 ± 0", "1 ± 0"]
    (found,) = summed_up([row(64, 0, 1.0, 0.4)]).values()
    assert told_figure(found, "mean") == "0.4"


@pytest.mark.thorough
def test_a_picture_comes_from_a_process_of_its_own(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same bits as here; and the command judges it."""
    made = picture("cornell_box", 8, Choice(THIS, 4, 32), 5)
    assert np.array_equal(made.radiance.values, rendered(5, 32).relight().values)
    assert made.samples == 32
    assert made.processor_s > 0
    asked = ["--scene", "cornell_box", "--size", "8", "--reference-bands", "4", "--bands", "4", "--samples", "32"]
    rows = tmp_path / "rows.jsonl"
    command = ["bench_share.py", "judge", *asked, "--seeds", "5", "--references", str(folder), "--rows", str(rows)]
    monkeypatch.setattr(sys, "argv", command)
    main()
    (measured,) = [json.loads(line) for line in rows.read_text().splitlines()]
    assert measured["drawn"] == 32
    assert all(np.isfinite(measured[name]) for name in bench_share.FIGURES)
    assert "| *this checkout, 4 bands | 32 |" in capsys.readouterr().out
