"""The share's benchmark: references by what they are, samples that take a time, and figures that aren't known."""

import sys
from pathlib import Path

import numpy as np
import pytest

from render.transport import Transport
from scenes.catalogue import load

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

import references  # noqa: E402
from bench_share import THIS, Choice, figure_of, samples_in, summed_up  # noqa: E402
from references import SEEDS, Film, both, make  # noqa: E402

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
