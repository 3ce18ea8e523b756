"""Runs: the same bits in any number of launches, and errors of some rows that are those of the whole picture."""

from dataclasses import replace

import numpy as np
import pytest

from render import runs
from render.engine import render
from render.error_estimates import Halves, group_errors, relative_error, shared_paths
from render.runs import Means, error_of, fields_of
from scenes.catalogue import load

BANDS = {"wavelength_nm": [450.0, 550.0, 650.0], "width_nm": 100.0}


def drawn_means(size: tuple[int, int], *, shared: bool = False) -> Means:
    """Means of noise in two groups of three bands, of which one has a lamp of its own colours."""
    rng = np.random.default_rng([*size, shared])

    def halves(*shape: int) -> Halves:
        light = rng.uniform(0.1, 1.0, (*shape, *size)).astype(np.float32)
        return Halves(light, (0.1 * rng.standard_normal(light.shape)).astype(np.float32))

    return Means(
        count=8,
        rates=rng.choice([1, 2, 4], size).astype(np.uint32),
        light=halves(2, 3),
        seen=[halves(1), halves(3)],
        coverage=halves(),
        shared=(0, 1) if shared else None,
    )


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("size", [(1, 1), (1, 5), (7, 6), (70, 40)])
@pytest.mark.parametrize("block", [1, 500, 1 << 16])
def test_errors_by_rows_are_those_of_the_whole_picture(
    size: tuple[int, int], block: int, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runs, "BLOCK", block)
    means, lights = drawn_means(size, shared=shared), np.array([[1.0, 2.0, 0.5], [3.0, 1.0, 0.2]])
    errors = group_errors(means.light, means.seen, means.coverage.mean, means.rates)
    variance = np.stack([error.covariance(error, means.rates) for error in errors])
    common = shared_paths((0, 1), errors, variance, means.rates) if shared else None
    fields = fields_of(lights, means)
    assert np.array_equal(fields["variance"], variance)
    assert fields["relative_mc_error"] == relative_error(lights, means.light.mean, variance, common)
    assert error_of(lights, means) == fields["relative_mc_error"]
    if common is not None:
        assert np.array_equal(fields["shared"].correlation, common.correlation)


@pytest.mark.parametrize(
    ("scene", "spp"),
    [
        ("cornell_box", 24),
        pytest.param("cornell_box", 72, marks=pytest.mark.thorough),
        pytest.param("night_street", 8, marks=pytest.mark.thorough),
    ],
)
def test_a_picture_has_the_same_bits_in_any_number_of_launches(
    scene: str, spp: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With and without a pilot, of one light group and of four; the last launch holds fewer pixels."""
    seen = []
    for most_floats in (runs.MOST_FLOATS, 1 << 13):
        monkeypatch.setattr(runs, "MOST_FLOATS", most_floats)
        made = render(replace(load(scene), reference_plane=None), (11, 13), spp=spp, **BANDS)
        lamps = [x for of_group in made.seen for x in vars(of_group).values()]
        planes = [*vars(made.light).values(), *vars(made.coverage).values(), made.variance, made.counts, *lamps]
        seen.append([np.asarray(x).tobytes() for x in planes])
    assert seen[0] == seen[1]
